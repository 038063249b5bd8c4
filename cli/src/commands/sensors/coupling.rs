//! `palpate sensors`: what is known of a sensor beyond its geometry and response.

use clap::Args;
use palpate_client::schemas::{
    Coupling, CoveringEdge, CreateSensor, Drawing, Layout, NumberRange, Sensor, SensorKnowledge,
    SensorPreset, SensorRanges, SpreadKernel,
};
use palpate_core::sensor as core;

use crate::{knowledge, output, robot};

/// Options of `palpate sensors add`; each overrides the preset or the description.
#[derive(Debug, Args)]
pub(super) struct CouplingArgs {
    /// Trust in the description [default: data_sheet].
    #[arg(long, value_enum)]
    knowledge: Option<SensorKnowledge>,
    /// Shape of the lateral spread of a press.
    #[arg(long, value_enum)]
    kernel: Option<SpreadKernel>,
    /// Extent of the covering beyond the array, 0 to 100 mm: 0 if both end together.
    #[arg(long, value_name = "MM")]
    margin_mm: Option<f64>,
    /// What the outermost taxels read of an even press: as much, more, or less than the others.
    #[arg(long, value_enum)]
    edge: Option<CoveringEdge>,
    /// Share of a taxel's pressure that each neighbour reads in addition, 0 to 0.5.
    #[arg(long, value_name = "SHARE")]
    cross_talk: Option<f64>,
    /// Relative standard deviation of the taxels' gains, 0 to 0.5.
    #[arg(long, value_name = "SHARE")]
    gain_spread: Option<f64>,
    /// Largest relative deviation of a press through hysteresis, 0 to 0.5.
    #[arg(long, value_name = "SHARE")]
    hysteresis: Option<f64>,
}

impl CouplingArgs {
    /// The request with these options.
    pub(super) fn applied(&self, request: CreateSensor) -> CreateSensor {
        let known = match (&request.description, request.preset) {
            (Some(description), _) => description.coupling,
            (None, Some(preset)) => of_preset(preset),
            (None, None) => Coupling::default(),
        };
        let coupling = Coupling {
            kernel: self.kernel.unwrap_or(known.kernel),
            margin: self.margin_mm.map(|mm| mm / 1e3).or(known.margin),
            edge: self.edge.unwrap_or(known.edge),
            cross_talk: self.cross_talk.unwrap_or(known.cross_talk),
            gain_spread: self.gain_spread.unwrap_or(known.gain_spread),
            hysteresis: self.hysteresis.unwrap_or(known.hysteresis),
        };
        let is_changed = coupling != known;
        CreateSensor {
            coupling: is_changed.then_some(coupling),
            sensor_knowledge: self.knowledge,
            ..request
        }
    }
}

fn of_preset(preset: SensorPreset) -> Coupling {
    let known = robot::described(preset).parameters().coupling;
    Coupling {
        kernel: match known.kernel {
            core::SpreadKernel::Gaussian => SpreadKernel::Gaussian,
            core::SpreadKernel::Exponential => SpreadKernel::Exponential,
        },
        margin: known.margin,
        edge: match known.edge {
            core::CoveringEdge::Continues => CoveringEdge::Continues,
            core::CoveringEdge::ConservesForce => CoveringEdge::ConservesForce,
            core::CoveringEdge::LosesForce => CoveringEdge::LosesForce,
        },
        cross_talk: known.cross_talk,
        gain_spread: known.gain_spread,
        hysteresis: known.hysteresis,
    }
}

/// Layout, coupling, knowledge and ranges of a sensor, a line each.
pub(super) fn words(sensor: &Sensor) -> String {
    let Coupling { kernel, margin, edge, cross_talk, gain_spread, hysteresis } =
        sensor.description.coupling;
    let margin = margin.map_or("far".to_owned(), output::mm);
    let level = sensor.sensor_knowledge;
    let mut lines: Vec<String> = sensor.layout.iter().map(|it| layout_words(it, sensor)).collect();
    lines.extend([
        format!(
            "coupling: {} spread of {}, covering {margin} beyond the array ({}), cross-talk {}, \
             gains ± {}, hysteresis {}",
            output::word(&kernel),
            output::mm(sensor.description.point_spread),
            output::word(&edge),
            percent(cross_talk),
            percent(gain_spread),
            percent(hysteresis),
        ),
        format!("knowledge: {} ({})", level.name(), knowledge::meaning(level)),
    ]);
    lines.extend(sensor.description.ranges.as_ref().map(range_words));
    lines.join("\n")
}

/// How a list of taxels becomes an image.
fn layout_words(layout: &Layout, sensor: &Sensor) -> String {
    let grid = &sensor.description.grid;
    let drawn = match layout.drawing {
        Drawing::AsIs => "as sent".to_owned(),
        Drawing::OnPlane => format!("drawn as {} × {} on their plane", grid.rows, grid.cols),
        Drawing::AtContact => {
            format!("drawn as {} × {} on the plane that touches the skin", grid.rows, grid.cols)
        }
    };
    format!("images: {drawn}; of a small contact {} are lost", percent(layout.drawing_loss))
}

fn range_words(ranges: &SensorRanges) -> String {
    let factor = |range: NumberRange| format!("× {:.2} to {:.2}", range.low, range.high);
    let share = |range: NumberRange| format!("{} to {}", percent(range.low), percent(range.high));
    let margin =
        |range: NumberRange| format!("{} to {}", output::mm(range.low), output::mm(range.high));
    let list = |words: Vec<String>| words.join(", ");
    let named = [
        ("spread", ranges.spread_factor.map(factor)),
        (
            "kernels",
            ranges.kernels.as_ref().map(|all| list(all.iter().map(output::word).collect())),
        ),
        ("covering beyond the array", ranges.margin.map(margin)),
        ("edges", ranges.edges.as_ref().map(|all| list(all.iter().map(output::word).collect()))),
        ("cross-talk", ranges.cross_talk.map(share)),
        ("stiffness", ranges.stiffness.map(factor)),
        ("stiffening", ranges.stiffening.map(|r| format!("{:.2} to {:.2}", r.low, r.high))),
    ];
    let said = named.into_iter().filter_map(|(name, words)| Some(format!("{name} {}", words?)));
    format!("trainings draw: {}", said.collect::<Vec<_>>().join("; "))
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}
