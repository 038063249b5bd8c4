//! Sensors as they are stored.

use std::sync::Arc;

use bincode::{Decode, Encode};
use glam::DVec3;
use palpate_core::sensor::{
    Coupling, CoveringEdge, ForceCurve, ImageOrder, Layout, SensorDescription, SensorError,
    SensorKnowledge, SensorParameters, SpreadKernel, StatedRanges, Taxel, TaxelGrid,
};
use uuid::Uuid;

use crate::entity::{Labels, Sensor};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

#[derive(Encode, Decode)]
struct SensorRecordV1 {
    id: IdV1,
    name: String,
    preset: Option<String>,
    rows: u32,
    cols: u32,
    pitch: f64,
    taxel_width: f64,
    covering_thickness: f64,
    point_spread: f64,
    force_curve: Vec<(f64, f64)>,
    saturation: f64,
    noise: f64,
    quantisation: f64,
    /// Transposed, rows reversed, columns reversed.
    image_order: [bool; 3],
    used: bool,
    created_at_ms: u64,
}

/// Coupling and knowledge follow the fields of [`SensorRecordV1`].
#[derive(Encode, Decode)]
struct SensorRecordV2 {
    known: SensorRecordV1,
    coupling: CouplingV1,
    /// Index in [`KNOWLEDGE`].
    knowledge: u8,
    ranges: RangesV1,
}

/// The layout follows the fields of [`SensorRecordV2`].
#[derive(Encode, Decode)]
struct SensorRecordV3 {
    known: SensorRecordV2,
    layout: Option<LayoutV1>,
}

/// The labels follow the fields of [`SensorRecordV3`].
#[derive(Encode, Decode)]
struct SensorRecordV4 {
    known: SensorRecordV3,
    labels: Labels,
}

/// Taxels: position and normal, x, y and z each, and width.
#[derive(Encode, Decode)]
struct LayoutV1 {
    is_near_grid: bool,
    taxels: Vec<([f32; 3], [f32; 3], f32)>,
}

impl LayoutV1 {
    fn of(layout: &Layout) -> Self {
        let taxel = |taxel: &Taxel| {
            let (position, normal) = (taxel.position.as_vec3(), taxel.normal.as_vec3());
            (position.to_array(), normal.to_array(), taxel.width as f32)
        };
        let taxels = layout.taxels().iter().map(taxel).collect();
        Self { is_near_grid: layout.is_near_grid(), taxels }
    }

    fn value(self, grid: TaxelGrid) -> Result<Layout, RecordError> {
        let taxel = |(position, normal, width): ([f32; 3], [f32; 3], f32)| Taxel {
            position: DVec3::from_array(position.map(f64::from)),
            normal: DVec3::from_array(normal.map(f64::from)),
            width: f64::from(width),
        };
        let taxels = self.taxels.into_iter().map(taxel).collect();
        let layout = match self.is_near_grid {
            true => Layout::near_grid(taxels, grid),
            false => Layout::list(taxels),
        };
        Ok(layout.map_err(SensorError::Layout)?)
    }
}

#[derive(Encode, Decode)]
struct CouplingV1 {
    /// Index in [`KERNELS`].
    kernel: u8,
    margin: Option<f64>,
    /// Index in [`EDGES`].
    edge: u8,
    cross_talk: f64,
    gain_spread: f64,
    hysteresis: f64,
}

/// Stated ranges, (low, high) each; kernels and edges are indices.
#[derive(Encode, Decode)]
struct RangesV1 {
    spread_factor: Option<(f64, f64)>,
    kernels: Option<Vec<u8>>,
    margin: Option<(f64, f64)>,
    edges: Option<Vec<u8>>,
    cross_talk: Option<(f64, f64)>,
    stiffness: Option<(f64, f64)>,
    stiffening: Option<(f64, f64)>,
}

const KERNELS: [SpreadKernel; 2] = [SpreadKernel::Gaussian, SpreadKernel::Exponential];
const EDGES: [CoveringEdge; 3] =
    [CoveringEdge::Continues, CoveringEdge::ConservesForce, CoveringEdge::LosesForce];
const KNOWLEDGE: [SensorKnowledge; 3] =
    [SensorKnowledge::Measured, SensorKnowledge::DataSheet, SensorKnowledge::Unknown];

impl CouplingV1 {
    fn of(coupling: &Coupling) -> Self {
        let Coupling { kernel, margin, edge, cross_talk, gain_spread, hysteresis } = *coupling;
        let (kernel, edge) = (code(&KERNELS, &kernel), code(&EDGES, &edge));
        Self { kernel, margin, edge, cross_talk, gain_spread, hysteresis }
    }

    fn value(&self) -> Result<Coupling, RecordError> {
        Ok(Coupling {
            kernel: coded(&KERNELS, "kernel", self.kernel)?,
            margin: self.margin,
            edge: coded(&EDGES, "edge", self.edge)?,
            cross_talk: self.cross_talk,
            gain_spread: self.gain_spread,
            hysteresis: self.hysteresis,
        })
    }
}

impl RangesV1 {
    fn of(stated: &StatedRanges) -> Self {
        let codes = |edges: &Vec<CoveringEdge>| edges.iter().map(|e| code(&EDGES, e)).collect();
        let kernels = |all: &Vec<SpreadKernel>| all.iter().map(|k| code(&KERNELS, k)).collect();
        Self {
            spread_factor: stated.spread_factor,
            kernels: stated.kernels.as_ref().map(kernels),
            margin: stated.margin,
            edges: stated.edges.as_ref().map(codes),
            cross_talk: stated.cross_talk,
            stiffness: stated.stiffness,
            stiffening: stated.stiffening,
        }
    }

    fn value(&self) -> Result<StatedRanges, RecordError> {
        let kernels = |codes: &Vec<u8>| -> Result<Vec<SpreadKernel>, RecordError> {
            codes.iter().map(|found| coded(&KERNELS, "kernels", *found)).collect()
        };
        let edges = |codes: &Vec<u8>| -> Result<Vec<CoveringEdge>, RecordError> {
            codes.iter().map(|found| coded(&EDGES, "edges", *found)).collect()
        };
        let ranges = StatedRanges {
            spread_factor: self.spread_factor,
            kernels: self.kernels.as_ref().map(kernels).transpose()?,
            margin: self.margin,
            edges: self.edges.as_ref().map(edges).transpose()?,
            cross_talk: self.cross_talk,
            stiffness: self.stiffness,
            stiffening: self.stiffening,
        };
        ranges.check()?;
        Ok(ranges)
    }
}

impl Record for Sensor {
    const KIND: Kind = Kind::Sensor;
    const SCHEMA: u16 = 5;

    fn to_payload(&self) -> Vec<u8> {
        let coupling = CouplingV1::of(&self.description.parameters().coupling);
        let (knowledge, ranges) = (code(&KNOWLEDGE, &self.knowledge), RangesV1::of(&self.ranges));
        let layout = self.description.layout().map(LayoutV1::of);
        let known = SensorRecordV2 { known: SensorRecordV1::of(self), coupling, knowledge, ranges };
        let (known, labels) = (SensorRecordV3 { known, layout }, self.labels.clone());
        write(&SensorRecordV4 { known, labels })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let SensorRecordV4 { known, labels } = read(payload)?;
        Ok(Self { labels, ..known.sensor()? })
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        let sensor = match schema {
            1 => {
                let (known, knowledge): (SensorRecordV1, _) = (read(payload)?, Default::default());
                known.sensor(Coupling::default(), knowledge, StatedRanges::default(), None)?
            }
            2 => read::<SensorRecordV2>(payload)?.sensor(None)?,
            3 => read::<SensorRecordV3>(payload)?.sensor()?,
            4 => {
                let SensorRecordV4 { known, labels } = read(payload)?;
                Self { labels, ..known.sensor()? }
            }
            found => return Err(RecordError::Schema { found, known: Self::SCHEMA }),
        };
        Ok(as_data_sheet(sensor))
    }
}

/// A sensor of schemas 1 to 4. Presets of simulated sensors then were `measured` unless their
/// owner said otherwise, and the record does not say who said it.
fn as_data_sheet(sensor: Sensor) -> Sensor {
    const SIMULATED: [&str; 6] = [
        "digitacts-6x6",
        "digitacts-6x6-thin",
        "digitacts-6x8",
        "fingertip-14x14",
        "tekscan-26x26",
        "fingertip-curved-24",
    ];
    let by_default = sensor.preset.as_ref().is_some_and(|name| SIMULATED.contains(&name.as_str()));
    let knowledge = if by_default && sensor.knowledge == SensorKnowledge::Measured {
        SensorKnowledge::DataSheet
    } else {
        sensor.knowledge
    };
    Sensor { knowledge, ..sensor }
}

impl SensorRecordV3 {
    fn sensor(self) -> Result<Sensor, RecordError> {
        self.known.sensor(self.layout)
    }
}

impl SensorRecordV2 {
    fn sensor(self, layout: Option<LayoutV1>) -> Result<Sensor, RecordError> {
        let Self { known, coupling, knowledge, ranges } = self;
        let knowledge = coded(&KNOWLEDGE, "knowledge", knowledge)?;
        known.sensor(coupling.value()?, knowledge, ranges.value()?, layout)
    }
}

impl SensorRecordV1 {
    fn of(sensor: &Sensor) -> Self {
        let parameters = sensor.description.parameters();
        let order = parameters.image_order;
        Self {
            id: sensor.id.into_bytes(),
            name: sensor.name.clone(),
            preset: sensor.preset.clone(),
            // A description has at most 128 of each.
            rows: parameters.grid.rows as u32,
            cols: parameters.grid.cols as u32,
            pitch: parameters.grid.pitch,
            taxel_width: parameters.grid.taxel_width,
            covering_thickness: parameters.covering_thickness,
            point_spread: parameters.point_spread,
            force_curve: parameters.force_curve.knots().to_vec(),
            saturation: parameters.saturation,
            noise: parameters.noise,
            quantisation: parameters.quantisation,
            image_order: [order.transposed, order.rows_reversed, order.cols_reversed],
            used: sensor.used,
            created_at_ms: sensor.created_at_ms,
        }
    }

    fn sensor(
        self,
        coupling: Coupling,
        knowledge: SensorKnowledge,
        ranges: StatedRanges,
        layout: Option<LayoutV1>,
    ) -> Result<Sensor, RecordError> {
        let [transposed, rows_reversed, cols_reversed] = self.image_order;
        let grid = TaxelGrid {
            rows: self.rows as usize,
            cols: self.cols as usize,
            pitch: self.pitch,
            taxel_width: self.taxel_width,
        };
        let description = SensorDescription::new(SensorParameters {
            grid,
            layout: layout.map(|layout| layout.value(grid)).transpose()?.map(Arc::new),
            covering_thickness: self.covering_thickness,
            point_spread: self.point_spread,
            force_curve: ForceCurve::new(self.force_curve)?,
            saturation: self.saturation,
            noise: self.noise,
            quantisation: self.quantisation,
            image_order: ImageOrder { transposed, rows_reversed, cols_reversed },
            coupling,
        })?;
        Ok(Sensor {
            id: Uuid::from_bytes(self.id),
            name: self.name,
            preset: self.preset,
            description,
            knowledge,
            ranges,
            labels: Labels::new(),
            used: self.used,
            created_at_ms: self.created_at_ms,
        })
    }
}
