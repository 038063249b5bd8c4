//! Conversion between the symmetry of one object and its block.
//!
//! Metres, object frame; drawn in `docs/formats.md`. Versions stored before symmetries were
//! discovered have no such block, and are read as if no object had one.

use glam::DVec3;
use palpate_core::symmetry::{AxisOrder, ORDER_MAX, Symmetry};
use uuid::Uuid;

use super::reader::Reader;
use super::writer::{put_counts, put_floats};
use super::{CodecError, FORM, count};

/// More axes than any group of rotations has: an icosahedron has 31.
const AXES_MAX: u32 = 64;
/// The order of a continuous axis.
const CONTINUOUS: u32 = 0;
/// Tolerance of a direction's norm about 1.
const NORM_TOLERANCE: f64 = 1e-6;

/// Name of the block with an object's symmetry.
#[must_use]
pub fn symmetry_block_name(object: Uuid) -> String {
    format!("symmetry/{object}")
}

/// The block of an object's symmetry.
#[must_use]
pub fn symmetry_to_block(symmetry: &Symmetry) -> Vec<u8> {
    let mut block = Vec::new();
    put_counts(&mut block, &[FORM, count(symmetry.axes.len())]);
    put_floats(&mut block, &symmetry.center.to_array());
    for axis in &symmetry.axes {
        put_counts(
            &mut block,
            &[match axis.order {
                AxisOrder::Finite(order) => u32::from(order),
                AxisOrder::Continuous => CONTINUOUS,
            }],
        );
        put_floats(&mut block, &axis.direction.to_array());
    }
    block
}

/// The symmetry of a block.
///
/// # Errors
/// [`CodecError`] names the invalid number.
pub fn symmetry_from_block(block: &[u8]) -> Result<Symmetry, CodecError> {
    let mut reader = Reader::new(block)?;
    let n_axes = reader.count("axes", 0, AXES_MAX)?;
    let center = vector(&mut reader, "centre")?;
    let axes: Vec<(DVec3, AxisOrder)> =
        (0..n_axes).map(|_| axis(&mut reader)).collect::<Result<_, _>>()?;
    reader.end()?;
    Ok(Symmetry::through(center, &axes))
}

fn axis(reader: &mut Reader<'_>) -> Result<(DVec3, AxisOrder), CodecError> {
    let order = match reader.count("order of an axis", 0, u32::from(ORDER_MAX))? {
        0 => AxisOrder::Continuous,
        1 => return Err(CodecError::Symmetry),
        order => AxisOrder::Finite(order as u8),
    };
    let direction = vector(reader, "direction of an axis")?;
    if (direction.length() - 1.0).abs() > NORM_TOLERANCE {
        return Err(CodecError::Symmetry);
    }
    Ok((direction, order))
}

fn vector(reader: &mut Reader<'_>, field: &'static str) -> Result<DVec3, CodecError> {
    Ok(DVec3::from_slice(&reader.floats(field, 3)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_codec::tests::check_length;

    /// A wheel of five teeth with one half turn across.
    fn wheel() -> Symmetry {
        let axes = [(DVec3::Z, AxisOrder::Finite(5)), (DVec3::X, AxisOrder::Finite(2))];
        Symmetry::through(DVec3::new(0.01, -0.02, 0.03), &axes)
    }

    #[test]
    fn symmetries_are_restored_bit_by_bit() {
        let spindle = Symmetry::through(DVec3::ZERO, &[(DVec3::Y, AxisOrder::Continuous)]);
        for symmetry in [Symmetry::NONE, wheel(), spindle] {
            assert_eq!(symmetry_from_block(&symmetry_to_block(&symmetry)), Ok(symmetry));
        }
        // Two counts, the centre, and two axes of a count and a direction.
        assert_eq!(symmetry_to_block(&wheel()).len(), 2 * 4 + 3 * 8 + 2 * (4 + 3 * 8));
    }

    #[test]
    fn a_cut_or_longer_block_is_refused() {
        check_length(&symmetry_to_block(&wheel()), symmetry_from_block);
    }

    #[test]
    fn invalid_axes_are_refused() {
        let with = |at: usize, bytes: &[u8]| {
            let mut block = symmetry_to_block(&wheel());
            block[at..at + bytes.len()].copy_from_slice(bytes);
            symmetry_from_block(&block).unwrap_err()
        };
        // After two counts and the centre: the first axis's order, then its direction.
        assert_eq!(with(32, &1u32.to_le_bytes()), CodecError::Symmetry);
        assert!(matches!(with(32, &31u32.to_le_bytes()), CodecError::Count { found: 31, .. }));
        assert_eq!(with(36, &0.5f64.to_le_bytes()), CodecError::Symmetry);
        let nan = with(8, &f64::NAN.to_le_bytes());
        assert!(matches!(nan, CodecError::Finite { field: "centre", .. }));
    }
}
