//! Conversion between trained geometry and blocks: one shared by all objects, one for each object.
//!
//! The shared block holds the properties of the classifier and the sensors; an object's block
//! does not contain its position in the catalogue. A version without the shared block has no
//! geometry. Metres, pascals, object frames; drawn in `docs/formats.md`.

use std::sync::Arc;

use palpate_core::reading::SensorId;
use palpate_dissertation::geometric::model::{
    ClassTable, GeometricMap, GeometricModel, SensorGains,
};
use palpate_dissertation::mosaic::ForceMosaic;
use palpate_dissertation::occupancy::grid::CELLS_MAX;
use palpate_dissertation::occupancy::{GridShape, OccupancyGrid};
use uuid::Uuid;

use super::reader::Reader;
use super::writer::{put_counts, put_floats, put_singles};
use super::{CodecError, FORM, count};

/// Name of the block with the class table and the sensors' gains.
pub const GEOMETRY_BLOCK: &str = "geometry";
/// Maximum rows of a class table.
const ROWS_MAX: u32 = 4096;
/// Maximum number of sensors with gains.
const SENSORS_MAX: u32 = 4096;
/// Maximum number of taxels of a sensor.
const TAXELS_MAX: u32 = 1 << 14;

/// Name of the block with an object's maps of contact and force.
#[must_use]
pub fn geometry_block_name(object: Uuid) -> String {
    format!("{GEOMETRY_BLOCK}/{object}")
}

/// The blocks of a catalogue's geometry. `objects` are the ids of its objects, in its order.
pub(super) fn to_blocks(model: &GeometricModel, objects: &[Uuid]) -> Vec<(String, Vec<u8>)> {
    let shared = (GEOMETRY_BLOCK.to_owned(), shared_to_block(model));
    let maps = objects
        .iter()
        .zip(&model.maps)
        .map(|(object, map)| (geometry_block_name(*object), map_to_block(map)));
    std::iter::once(shared).chain(maps).collect()
}

/// The geometry of a shared block and the objects' blocks, in the catalogue's order.
pub(super) fn from_blocks<'block>(
    shared: &[u8],
    maps: impl Iterator<Item = Result<&'block [u8], CodecError>>,
) -> Result<GeometricModel, CodecError> {
    let (table, gains) = shared_from_block(shared)?;
    let maps = maps.map(|block| map_from_block(block?).map(Arc::new));
    let maps = maps.collect::<Result<_, _>>()?;
    Ok(GeometricModel { table, gains, maps })
}

fn shared_to_block(model: &GeometricModel) -> Vec<u8> {
    let rows = model.table.rows();
    let mut block = Vec::new();
    put_counts(&mut block, &[FORM, count(rows.len()), count(model.gains.len())]);
    put_floats(&mut block, rows.as_flattened());
    for SensorGains { sensor, gains } in &model.gains {
        block.extend_from_slice(&sensor.0.to_le_bytes());
        put_counts(&mut block, &[count(gains.len())]);
        put_floats(&mut block, gains);
    }
    block
}

fn shared_from_block(block: &[u8]) -> Result<(ClassTable, Vec<SensorGains>), CodecError> {
    let mut reader = Reader::new(block)?;
    let n_rows = reader.count("rows of the class table", 1, ROWS_MAX)?;
    let n_sensors = reader.count("sensors", 0, SENSORS_MAX)?;
    let rows = reader.floats("class table", 3 * n_rows)?.as_chunks::<3>().0.to_vec();
    let table = ClassTable::new(rows)?;
    let gains = (0..n_sensors).map(|_| sensor_gains(&mut reader)).collect::<Result<_, _>>()?;
    reader.end()?;
    Ok((table, gains))
}

fn sensor_gains(reader: &mut Reader<'_>) -> Result<SensorGains, CodecError> {
    let id = reader.take(1, 16)?.as_chunks::<16>().0[0];
    let n_taxels = reader.count("taxels", 1, TAXELS_MAX)?;
    let gains = reader.floats("gains", n_taxels)?;
    match gains.iter().find(|gain| **gain <= 0.0) {
        Some(found) => Err(CodecError::Gain { found: *found }),
        None => Ok(SensorGains { sensor: SensorId(u128::from_le_bytes(id)), gains }),
    }
}

/// The block of an object's maps.
fn map_to_block(map: &GeometricMap) -> Vec<u8> {
    let GeometricMap { occupancy, mosaic } = map;
    let n_cells = |mosaic: &ForceMosaic| mosaic.shape().n_cells();
    let n_force = 2 * mosaic.as_ref().map_or(0, n_cells);
    let mut block = Vec::with_capacity(96 + 4 * (occupancy.shape().n_cells() + n_force));
    let [x, y, z] = occupancy.shape().n();
    let [mosaic_x, mosaic_y, _] = mosaic.as_ref().map_or([0; 3], |mosaic| mosaic.shape().n());
    let counts = [x, y, z, mosaic_x, mosaic_y].map(count);
    put_counts(&mut block, &[FORM]);
    put_counts(&mut block, &counts);
    put_place(&mut block, occupancy.shape());
    put_floats(&mut block, &[occupancy.prior()]);
    put_singles(&mut block, occupancy.log_odds());
    if let Some(mosaic) = mosaic {
        put_place(&mut block, mosaic.shape());
        put_singles(&mut block, mosaic.pressure());
        put_singles(&mut block, mosaic.deviation());
    }
    block
}

/// The maps of an object's block.
fn map_from_block(block: &[u8]) -> Result<GeometricMap, CodecError> {
    const CELLS: u32 = CELLS_MAX as u32;
    let mut reader = Reader::new(block)?;
    let mut counts = |low| reader.count("cells along an axis", low, CELLS);
    let n = [counts(1)?, counts(1)?, counts(1)?];
    let n_mosaic = [counts(0)?, counts(0)?, 1];
    let shape = shape(&mut reader, n)?;
    let prior = reader.floats("prior", 1)?[0];
    let occupancy = OccupancyGrid::from_parts(shape, prior, reader.singles(shape.n_cells())?)?;
    let mosaic = if n_mosaic == [0, 0, 1] { None } else { Some(mosaic(&mut reader, n_mosaic)?) };
    reader.end()?;
    Ok(GeometricMap { occupancy, mosaic })
}

fn mosaic(reader: &mut Reader<'_>, n: [usize; 3]) -> Result<ForceMosaic, CodecError> {
    let shape = shape(reader, n)?;
    let pressure = reader.singles(shape.n_cells())?;
    let deviation = reader.singles(shape.n_cells())?;
    Ok(ForceMosaic::from_parts(shape, pressure, deviation)?)
}

fn put_place(block: &mut Vec<u8>, shape: &GridShape) {
    put_floats(block, &shape.min().to_array());
    put_floats(block, &[shape.cell()]);
}

fn shape(reader: &mut Reader<'_>, n: [usize; 3]) -> Result<GridShape, CodecError> {
    let min = reader.floats("place of the cells", 3)?;
    let cell = reader.floats("side of a cell", 1)?[0];
    Ok(GridShape::new([min[0], min[1], min[2]].into(), cell, n)?)
}

#[cfg(test)]
pub(super) mod tests {
    use palpate_dissertation::geometric::model::ClassTableError;
    use palpate_dissertation::occupancy::GridError;

    use super::*;
    use crate::model_codec::tests::check_damage;

    pub(in crate::model_codec) fn model() -> GeometricModel {
        let plane = GridShape::new([-0.01, -0.02, 0.003].into(), 0.001, [3, 2, 1]).unwrap();
        let solid = GridShape::new([0.0, 0.0, -0.5].into(), 0.25, [1, 2, 3]).unwrap();
        let log_odds = vec![-1.5, 0.0, 0.25, 3.0, -0.125, 8.0];
        let deviation = vec![f32::INFINITY, 10.0, 20.0, 30.0, 40.0, 50.0];
        let mosaic = ForceMosaic::from_parts(plane, vec![100.0; 6], deviation).unwrap();
        let map = |shape, mosaic| {
            let occupancy = OccupancyGrid::from_parts(shape, 0.25, log_odds.clone()).unwrap();
            Arc::new(GeometricMap { occupancy, mosaic })
        };
        GeometricModel {
            table: ClassTable::new(vec![[0.25, 0.5, 0.25], [0.75, 0.125, 0.125]]).unwrap(),
            gains: vec![SensorGains { sensor: SensorId(0x0102), gains: vec![0.5, 1.5] }],
            maps: vec![map(plane, Some(mosaic)), map(solid, None)],
        }
    }

    fn decoded(blocks: &[(String, Vec<u8>)]) -> Result<GeometricModel, CodecError> {
        let maps = blocks[1..].iter().map(|(_, block)| Ok(block.as_slice()));
        from_blocks(&blocks[0].1, maps)
    }

    fn blocks() -> Vec<(String, Vec<u8>)> {
        to_blocks(&model(), &[Uuid::from_u128(1), Uuid::from_u128(2)])
    }

    #[test]
    fn geometry_is_restored_bit_by_bit() {
        let blocks = blocks();
        let names: Vec<&str> = blocks.iter().map(|(name, _)| name.as_str()).collect();
        let object = "geometry/00000000-0000-0000-0000-000000000001";
        assert_eq!(names[..2], [GEOMETRY_BLOCK, object]);
        assert_eq!(decoded(&blocks), Ok(model()));
    }

    #[test]
    fn block_lengths_follow_the_format() {
        let hash = |block: &[u8]| blake3::hash(block).to_hex()[..16].to_owned();
        let found: Vec<(usize, String)> =
            blocks().iter().map(|(_, block)| (block.len(), hash(block))).collect();
        // Shared: 3 counts, 2 × 3 and 2 numbers, id and count of a sensor. Maps: 6 counts,
        // 5 numbers, 6 cells; a mosaic 4 numbers and 2 × 6 cells more.
        let expected = [
            (12 + 64 + 20, "fc7e00b9a544048c"),
            (24 + 40 + 24 + 80, "0bc005ca9421f2a4"),
            (24 + 40 + 24, "9d7e402eabf04ad0"),
        ];
        assert_eq!(found, expected.map(|(length, hash)| (length, hash.to_owned())));
    }

    #[test]
    fn cut_longer_and_changed_blocks_never_panic() {
        check_damage(&blocks(), decoded, |model| model.maps.len() == 2);
    }

    #[test]
    fn invalid_blocks_are_refused_by_fault() {
        let with = |place: usize, at: usize, bytes: &[u8]| {
            let mut all = blocks();
            all[place].1[at..at + bytes.len()].copy_from_slice(bytes);
            decoded(&all).unwrap_err()
        };
        assert_eq!(with(0, 0, &7u32.to_le_bytes()), CodecError::Form { found: 7, newest: 1 });
        let row = ClassTableError::Row { row: 0 };
        assert_eq!(with(0, 12, &0.5f64.to_le_bytes()), CodecError::ClassTable(row));
        assert_eq!(with(0, 80, &0f64.to_le_bytes()), CodecError::Gain { found: 0.0 });
        // A number of cells beyond the block's length is refused before anything is allocated.
        let long = with(1, 4, &CELLS_MAX.to_le_bytes()[..4]);
        assert!(matches!(long, CodecError::Grid(GridError::Count { .. })), "{long}");
        let long = with(2, 4, &(1u32 << 23).to_le_bytes());
        assert!(matches!(long, CodecError::Length { found: 88, .. }), "{long}");
        // The prior, then the first log-odds.
        let values = CodecError::Grid(GridError::Values { expected: 6, found: 6 });
        assert_eq!(with(1, 56, &1f64.to_le_bytes()), values);
        assert_eq!(with(1, 64, &f32::NAN.to_le_bytes()), values);
        // The last deviation.
        assert_eq!(with(1, 164, &0f32.to_le_bytes()), values);
    }
}
