//! Figure 2.5: the fitted point spread against the covering's thickness.

use palpate_core::sensor::line::Line as Fit;
use palpate_core::sensor::point_spread::{ELEMENT_WIDTH, point_spread_of_covering};
use palpate_core::sensor::response::fit_response;
use palpate_core::sensor::spread_fit::{SpreadPress, fit_spread};
use palpate_core::sensor::{SensorDescription, SensorParameters, TaxelState};
use palpate_sim::elastic::PointResponse;
use palpate_sim::elastic::covering::{ElasticCovering, disc};
use palpate_sim::indent::{INDENTER, IndentationRun, indentation_run, indentation_run_of};
use serde_json::json;

use super::{COVERINGS, key_of};
use crate::plot::{Line, Panel};
use crate::report::Report;

/// The 6 × 8 sensor under a covering, with the spread of equation 2.5.
pub(super) fn sensor_under(covering_thickness: f64, point_spread: f64) -> SensorDescription {
    let parameters = SensorDescription::digitacts_6x8().parameters().clone();
    SensorDescription::new(SensorParameters { covering_thickness, point_spread, ..parameters })
        .expect("the dissertation's coverings are within the bounds")
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
        let (mut cosine_min, mut n_faults_found) = (1.0f64, 0);
        for thickness in COVERINGS {
            let sensor = sensor_under(thickness, point_spread_of_covering(thickness));
            let run = match source {
                "simulator" => indentation_run(&sensor, seed),
                _ => {
                    let width = sensor.grid().taxel_width;
                    let covering = ElasticCovering::new(slab, thickness, width);
                    let image =
                        |at| covering.image(sensor.grid(), &disc(at, INDENTER.diameter, 1.0));
                    indentation_run_of(&sensor, seed, &image)
                }
            };
            let fits = fits(&sensor, &run)?;
            n_faults_found += fits.n_faults_found;
            for (depth, fit) in fits.by_depth {
                cosine_min = cosine_min.min(fit.cosine);
                points.push((thickness / ELEMENT_WIDTH, fit.sigma / ELEMENT_WIDTH));
                report.row(vec![
                    ("figure", json!("2.5")),
                    ("source", json!(source)),
                    ("covering", json!(key_of(thickness))),
                    ("depth_share", json!(depth / thickness)),
                    ("sigma", json!(fit.sigma / ELEMENT_WIDTH)),
                    ("cosine", json!(fit.cosine)),
                    ("pearson", json!(fit.pearson)),
                ]);
            }
        }
        let line = Fit::fit(&points).ok_or_else(|| anyhow::anyhow!("no line through spreads"))?;
        report.summarise(&format!("{source}_spread_slope"), line.slope);
        report.summarise(&format!("{source}_spread_offset"), line.offset);
        report.summarise(&format!("{source}_spread_cosine_min"), cosine_min);
        report.summarise(&format!("{source}_faults_found"), f64::from(n_faults_found));
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

struct Fits {
    by_depth: Vec<(f64, palpate_core::sensor::spread_fit::SpreadFit)>,
    /// How many of the run's two faulty taxels were named rightly.
    n_faults_found: u32,
}

fn fits(sensor: &SensorDescription, run: &IndentationRun) -> anyhow::Result<Fits> {
    let grid = sensor.grid();
    let response = fit_response(&run.response, grid, sensor.parameters().saturation)?;
    let calibration = &response.calibration;
    let (wrong, answers) = run.cross_wired;
    let state = |taxel: usize| calibration.taxels()[taxel].state;
    let n_faults_found = u32::from(state(run.dead) == TaxelState::Dead)
        + u32::from(state(wrong) == TaxelState::CrossWired { answers });
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
                let offset = calibration.target().offset;
                pressures.iter_mut().flatten().for_each(|pressure| *pressure -= offset);
                SpreadPress { at: press.at, pressures }
            })
            .collect();
        by_depth.push((depth, fit_spread(grid, INDENTER, &presses)?));
    }
    Ok(Fits { by_depth, n_faults_found })
}
