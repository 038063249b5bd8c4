//! Figure 2.3: the finite-element response to a point load against a Gaussian.
//!
//! Lengths in elements, as in the dissertation's σ = 0.5 t + 0.9 with t the number of layers.

use palpate_core::sensor::line::Line as Fit;
use palpate_sim::elastic::{POISSON_RATIO, PointResponse, Slab, point_response};
use palpate_sim::plot::{Line, Panel};
use serde::Serialize;

use crate::report::{Progress, Report};

/// The numbers of layers of figure 2.3.
const LAYERS: std::ops::RangeInclusive<usize> = 5..=10;
/// Half width of the plot about the centre, elements.
const DRAWN: i64 = 12;

#[derive(Serialize)]
struct Layers {
    layers: usize,
    sigma: f64,
    cosine: f64,
    pearson: f64,
    dissertation_sigma: f64,
    peak_force: f64,
    iterations: usize,
}

/// The responses of 5 to 10 layers, and the figure's two panels.
pub(super) fn figure_2_3(
    half_width: usize,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<(Vec<PointResponse>, Vec<Panel>)> {
    let mut responses = Vec::new();
    let (mut forces, mut gaussians, mut fitted) = (Vec::new(), Vec::new(), Vec::new());
    let (mut cosine_min, mut iterations_max) = (1.0f64, 0);
    for (done, n_layers) in LAYERS.enumerate() {
        progress("loading elastic slabs", done, 9);
        let slab = Slab { half_width, n_layers, poisson_ratio: POISSON_RATIO };
        let response = point_response(&slab)?;
        let fit = response.gaussian();
        fitted.push((n_layers as f64, fit.sigma));
        cosine_min = cosine_min.min(fit.cosine);
        iterations_max = iterations_max.max(response.n_iterations());
        report.labelled(
            &[("figure", "2.3")],
            Layers {
                layers: n_layers,
                sigma: fit.sigma,
                cosine: fit.cosine,
                pearson: fit.pearson,
                dissertation_sigma: 0.5 * n_layers as f64 + 0.9,
                peak_force: response.force(0, 0),
                iterations: response.n_iterations(),
            },
        );
        let name = format!("{n_layers} layers");
        let profile =
            |value: &dyn Fn(i64) -> f64| (0..=DRAWN).map(|x| (x as f64, value(x))).collect();
        let points = profile(&|x| response.force(x, 0));
        forces.push(Line { name: name.clone(), points });
        let peak = 1.0 / (std::f64::consts::TAU * fit.sigma * fit.sigma);
        let points = profile(&|x| peak * (-0.5 * (x as f64 / fit.sigma).powi(2)).exp());
        gaussians.push(Line { name, points });
        responses.push(response);
    }
    let line = Fit::fit(&fitted).ok_or_else(|| anyhow::anyhow!("no line through the spreads"))?;
    report.summarise("elastic_sigma_slope_per_layer", line.slope);
    report.summarise("elastic_sigma_offset_elements", line.offset);
    report.summarise("elastic_gaussian_cosine_min", cosine_min);
    report.summarise("elastic_iterations_max", iterations_max as f64);
    let panel = |title: &str, lines| Panel {
        title: title.to_owned(),
        x: "distance from the load (elements)".to_owned(),
        y: "force (part of the load)".to_owned(),
        lines,
    };
    let panels = vec![
        panel("2.3a: finite elements", forces),
        panel("2.3b: Gaussians fitted to them", gaussians),
    ];
    Ok((responses, panels))
}
