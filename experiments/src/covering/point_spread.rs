//! Figure 2.5: the fitted point spread against the covering's thickness.

use palpate_core::sensor::line::Line as Fit;
use palpate_core::sensor::point_spread::{ELEMENT_WIDTH, point_spread_of_covering};
use palpate_core::sensor::response::{ResponseForm, fit_response};
use palpate_core::sensor::spread_fit::{SpreadFit, SpreadPress, fit_spread};
use palpate_core::sensor::{Calibration, SensorDescription, SensorParameters, TaxelState};
use palpate_sim::elastic::PointResponse;
use palpate_sim::elastic::covering::{ElasticCovering, disc};
use palpate_sim::indent::{INDENTER, IndentationRun, indentation_run, indentation_run_of};
use palpate_sim::plot::{Line, Panel};
use serde::Serialize;

use super::{COVERINGS, key_of};
use crate::report::Report;

/// The 6 × 8 sensor under a covering, with the spread of equation 2.5.
pub(super) fn sensor_under(covering_thickness: f64, point_spread: f64) -> SensorDescription {
    let parameters = SensorDescription::digitacts_6x8().parameters().clone();
    SensorDescription::new(SensorParameters { covering_thickness, point_spread, ..parameters })
        .expect("the dissertation's coverings are within the bounds")
}

#[derive(Serialize)]
struct Spread {
    depth_share: f64,
    sigma: f64,
    cosine: f64,
    pearson: f64,
}

/// Indents every covering in the simulator and in the elastic reference, and fits.
pub(super) fn figure_2_5(
    seed: u64,
    slabs: &[PointResponse],
    report: &mut Report,
) -> anyhow::Result<Panel> {
    let slab = slabs.last().ok_or_else(|| anyhow::anyhow!("no elastic slab"))?;
    let mut lines = Vec::new();
    for source in ["simulator", "elastic"] {
        let mut points = Vec::new();
        let mut cosine_min = 1.0f64;
        let runs = COVERINGS.map(|thickness| indent(source, thickness, slab, seed));
        // Section 2.2: the responses are measured under the thinnest covering.
        let calibration = calibration(&runs[0])?;
        let n_faults = n_faults_found(&calibration, &runs[0].1);
        for (thickness, run) in COVERINGS.into_iter().zip(&runs) {
            for (depth, fit) in fits(run, &calibration)? {
                cosine_min = cosine_min.min(fit.cosine);
                points.push((thickness / ELEMENT_WIDTH, fit.sigma / ELEMENT_WIDTH));
                report.labelled(
                    &[("figure", "2.5"), ("source", source), ("covering", &key_of(thickness))],
                    Spread {
                        depth_share: depth / thickness,
                        sigma: fit.sigma / ELEMENT_WIDTH,
                        cosine: fit.cosine,
                        pearson: fit.pearson,
                    },
                );
            }
        }
        let line = Fit::fit(&points).ok_or_else(|| anyhow::anyhow!("no line through spreads"))?;
        report.summarise(&format!("{source}_spread_slope"), line.slope);
        report.summarise(&format!("{source}_spread_offset"), line.offset);
        report.summarise(&format!("{source}_spread_cosine_min"), cosine_min);
        report.summarise(&format!("{source}_faults_found"), f64::from(n_faults));
        let ends = [0.0, 2.6].map(|t| (t, line.at(t)));
        lines.push(Line { name: format!("{source}, fitted line"), points: ends.to_vec() });
        lines.push(Line { name: format!("{source}, fits"), points });
    }
    let published = [0.0, 2.6].map(|t| (t, 1.11 + 0.497 * t));
    lines.push(Line { name: "equation 2.5".to_owned(), points: published.to_vec() });
    Ok(Panel {
        title: "2.5: point spread of a covering".to_owned(),
        x: "thickness (element widths of 2 mm)".to_owned(),
        y: "σ (element widths)".to_owned(),
        lines,
    })
}

/// A sensor under a covering and the run on it.
type Run = (SensorDescription, IndentationRun);

fn indent(source: &str, thickness: f64, slab: &PointResponse, seed: u64) -> Run {
    let sensor = sensor_under(thickness, point_spread_of_covering(thickness));
    let run = match source {
        "simulator" => indentation_run(&sensor, seed),
        _ => {
            let covering = ElasticCovering::new(slab, thickness, sensor.grid().taxel_width);
            let image = |at| covering.image(sensor.grid(), &disc(at, INDENTER.diameter, 1.0));
            indentation_run_of(&sensor, seed, &image)
        }
    };
    (sensor, run)
}

fn calibration((sensor, run): &Run) -> anyhow::Result<Calibration> {
    let saturation = sensor.parameters().saturation;
    Ok(fit_response(&run.response, sensor.grid(), saturation, ResponseForm::Lines)?.calibration)
}

/// Number of a run's two faulty taxels that the calibration identifies correctly.
fn n_faults_found(calibration: &Calibration, run: &IndentationRun) -> u32 {
    let state = |taxel: usize| calibration.taxels()[taxel].state;
    let is_crossed = |(wrong, answers)| state(wrong) == TaxelState::CrossWired { answers };
    u32::from(run.dead.is_some_and(|dead| state(dead) == TaxelState::Dead))
        + u32::from(run.cross_wired.is_some_and(is_crossed))
}

/// The fitted spread at each depth of a run.
fn fits((sensor, run): &Run, calibration: &Calibration) -> anyhow::Result<Vec<(f64, SpreadFit)>> {
    let mut depths: Vec<f64> = run.spread.iter().map(|press| press.depth).collect();
    depths.sort_by(f64::total_cmp);
    depths.dedup();
    let mut by_depth = Vec::new();
    for depth in depths {
        let same = run.spread.iter().filter(|press| (press.depth - depth).abs() < 1e-12);
        let presses: Vec<SpreadPress> = same
            .map(|press| {
                let mut pressures: Vec<Option<f64>> =
                    press.pressures.iter().copied().map(Some).collect();
                calibration.correct(&mut pressures);
                pressures.iter_mut().flatten().for_each(|p| *p = calibration.straightened(*p));
                SpreadPress { at: press.at, pressures }
            })
            .collect();
        by_depth.push((depth, fit_spread(sensor.grid(), INDENTER, &presses)?));
    }
    Ok(by_depth)
}
