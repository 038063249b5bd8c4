//! `palpate sensors calibrate`, `calibration` and `indent`: the response of a sensor's taxels.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context as _;
use glam::DVec3;
use palpate_client::Client;
use palpate_client::schemas::{
    self as wire, CalibrateSensor, ResponsePress, Sensor, SensorCalibration, SpreadPress,
    SpreadPresses, TaxelState,
};
use palpate_core::sensor::{
    Coupling, ForceCurve, ImageOrder, Layout, SensorDescription, SensorParameters, Taxel, TaxelGrid,
};
use palpate_sim::indent::{INDENTER, indentation_run};

use crate::output;

/// Simulates indentations of a sensor of the server and writes them as a request.
pub(crate) async fn indent(
    client: &Client,
    sensor: &str,
    out: &Path,
    seed: u64,
) -> anyhow::Result<String> {
    let sensor = client.sensor(sensor).await?;
    let description = description(&sensor)?;
    anyhow::ensure!(
        description.listed().is_none(),
        "{} is a list of taxels, expected a sensor with rows and columns",
        sensor.name
    );
    let run = indentation_run(&description, seed);
    let grid = *description.grid();
    let order = description.parameters().image_order;
    let driver = |pressures: &[Option<f64>]| order.of_driver(pressures, grid.rows, grid.cols);
    let response = run.response.iter().map(|press| ResponsePress {
        row: (press.taxel / grid.cols) as u32,
        col: (press.taxel % grid.cols) as u32,
        depth: press.depth,
        pressures: driver(&press.pressures),
    });
    let presses = run.spread.iter().map(|press| {
        let pressures: Vec<Option<f64>> = press.pressures.iter().copied().map(Some).collect();
        let (x, y) = press.at;
        SpreadPress { x, y, depth: press.depth, pressures: driver(&pressures) }
    });
    let spread = SpreadPresses {
        indenter_diameter: INDENTER.diameter,
        covering_thickness: Some(description.parameters().covering_thickness),
        presses: presses.collect(),
    };
    let indentations =
        CalibrateSensor { response: response.collect(), spread: Some(spread), form: None };
    let text = serde_json::to_string(&indentations)?;
    std::fs::write(out, text).with_context(|| format!("cannot write {}", out.display()))?;
    let place = |taxel: usize| format!("row {}, column {}", taxel / grid.cols, taxel % grid.cols);
    let dead = run.dead.map_or_else(|| "none".to_owned(), place);
    let crossed = run.cross_wired.map_or_else(
        || "none".to_owned(),
        |(wrong, answers)| format!("{}, which answers {}", place(wrong), place(answers)),
    );
    Ok(format!(
        "wrote {} presses of taxels and {} of a fine grid to {}\n\
         dead: {dead}; cross-wired: {crossed}\n\
         next: palpate sensors calibrate {} --file {}",
        indentations.response.len(),
        run.spread.len(),
        out.display(),
        sensor.name,
        out.display()
    ))
}

/// The sensor's description in core's form.
pub(super) fn description(sensor: &Sensor) -> anyhow::Result<SensorDescription> {
    let given = &sensor.description;
    let knots = given.force_curve.iter().map(|knot| (knot.displacement, knot.pressure)).collect();
    let grid = TaxelGrid {
        rows: given.grid.rows as usize,
        cols: given.grid.cols as usize,
        pitch: given.grid.pitch,
        taxel_width: given.grid.taxel_width,
    };
    Ok(SensorDescription::new(SensorParameters {
        grid,
        covering_thickness: given.covering_thickness,
        point_spread: given.point_spread,
        force_curve: ForceCurve::new(knots)?,
        saturation: given.saturation,
        noise: given.noise,
        quantisation: given.quantisation,
        image_order: ImageOrder {
            transposed: given.image_order.transposed,
            rows_reversed: given.image_order.rows_reversed,
            cols_reversed: given.image_order.cols_reversed,
        },
        coupling: Coupling::default(),
        layout: layout(sensor, grid)?.map(Arc::new),
    })?)
}

/// A sensor's layout in core's form; `None` for taxels on the grid.
fn layout(sensor: &Sensor, grid: TaxelGrid) -> anyhow::Result<Option<Layout>> {
    let (Some(layout), Some(taxels)) = (&sensor.layout, &sensor.description.taxels) else {
        return Ok(None);
    };
    let vector = |point: wire::Point| DVec3::new(point.x, point.y, point.z);
    let taxel = |taxel: &wire::Taxel| Taxel {
        position: vector(taxel.position),
        normal: vector(taxel.normal),
        width: taxel.width,
    };
    let taxels = taxels.iter().map(taxel).collect();
    Ok(Some(match layout.drawing {
        wire::Drawing::AsIs => Layout::near_grid(taxels, grid)?,
        wire::Drawing::OnPlane | wire::Drawing::AtContact => Layout::list(taxels)?,
    }))
}

/// A calibration as a table of gains over the taxels, with advice.
pub(crate) fn text(calibration: &SensorCalibration) -> String {
    let cols = calibration.taxels.iter().map(|taxel| taxel.col + 1).max().unwrap_or(1);
    let mut lines = vec![format!(
        "calibration {} of {}, made {}; slopes over the target's, row by row:",
        calibration.number, calibration.sensor, calibration.created_at
    )];
    for row in calibration.taxels.chunks(cols as usize) {
        let cells: Vec<String> = row
            .iter()
            .map(|taxel| match taxel.state {
                TaxelState::Ok => format!("{:6.2}", taxel.slope / calibration.target.slope),
                TaxelState::Dead => format!("{:>6}", "dead"),
                TaxelState::CrossWired => format!("{:>6}", "wired"),
            })
            .collect();
        lines.push(cells.join(" "));
    }
    for taxel in &calibration.taxels {
        if let Some(answers) = taxel.answers {
            lines.push(format!(
                "row {}, column {} answers presses of row {}, column {}",
                taxel.row, taxel.col, answers.row, answers.col
            ));
        }
    }
    let (before, after) = (calibration.before, calibration.after);
    let target = match &calibration.curve {
        Some(curve) => {
            let knots = curve.iter().map(|knot| (knot.depth, knot.pressure));
            format!("target (mm, kPa): {}", knots_text(knots))
        }
        None => format!(
            "target {:.2} kPa/mm · depth {:+.2} kPa",
            calibration.target.slope / 1e6,
            calibration.target.offset / 1e3
        ),
    };
    lines.push(format!(
        "{target}; residual {:.0} Pa as measured (R² {:.3}), {:.0} Pa corrected (R² {:.3})",
        before.residual, before.r_squared, after.residual, after.r_squared
    ));
    if let Some(curve) = &calibration.force_curve {
        let knots = curve.iter().map(|knot| (knot.displacement, knot.pressure));
        lines.push(format!("force curve for the description (mm, kPa): {}", knots_text(knots)));
    }
    if let Some(spread) = calibration.spread {
        lines.push(format!(
            "point spread {} ({:.3} element widths; described {}, equation 2.5 {}), cosine {:.4}, \
             Pearson {:.4}",
            output::mm(spread.sigma),
            spread.sigma_in_widths,
            output::mm(spread.described),
            output::mm(spread.published),
            spread.cosine,
            spread.pearson
        ));
    }
    lines.join("\n")
}

/// Knots in millimetres and kilopascal.
fn knots_text(knots: impl Iterator<Item = (f64, f64)>) -> String {
    let knot =
        |(length, pressure): (f64, f64)| format!("{:.2} {:.2}", length * 1e3, pressure / 1e3);
    knots.map(knot).collect::<Vec<_>>().join(", ")
}
