//! Single taxels: dead ones, ones with an offset, and how loosely touches are placed.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::units::MM;

use crate::images::{Images, N, response};

/// Largest value of a dead taxel over all touches, as a share of the median taxel's. Chosen: half
/// of the least gain that a data sheet's sensor has.
const DEAD: f64 = 0.1;

/// Offsets above this many deviations of the sensor's noise are drift.
const DRIFT: f64 = 4.0;

/// State of a taxel that is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TaxelFault {
    /// It never responds.
    Dead,
    /// It reads this much (Pa) without a press.
    Offset(f64),
}

/// Taxels (indices in the order of the given images) that never respond.
pub(crate) fn dead(images: &[Vec<Option<f64>>]) -> Vec<usize> {
    let n_taxels = images.first().map_or(0, Vec::len);
    let most: Vec<f64> = (0..n_taxels)
        .map(|taxel| images.iter().filter_map(|image| image[taxel]).fold(0.0, f64::max))
        .collect();
    let mut sorted = most.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(n_taxels / 2).copied().unwrap_or(0.0);
    let is_missing = |taxel: usize| images.iter().all(|image| image[taxel].is_none());
    (0..n_taxels).filter(|taxel| most[*taxel] < DEAD * usual && !is_missing(*taxel)).collect()
}

/// Taxels with an offset: the median of measured less modelled where the model has no pressure.
pub(crate) fn offsets(images: &Images<'_>, values: &[f64; N]) -> Vec<(usize, f64)> {
    let parameters = images.simulator.sensor().parameters();
    let least = DRIFT * (parameters.noise.powi(2) + parameters.quantisation.powi(2) / 12.0).sqrt();
    let modelled = images.modelled(values);
    let quiet = 0.01 * parameters.saturation;
    let mut found = Vec::new();
    for taxel in 0..parameters.grid.n_taxels() {
        let mut rest: Vec<f64> = images
            .measured
            .iter()
            .zip(&modelled)
            .filter(|(_, modelled)| modelled[taxel] < quiet)
            .filter_map(|(measured, modelled)| Some(measured[taxel]? - modelled[taxel]))
            .collect();
        rest.sort_by(f64::total_cmp);
        if rest.len() >= 4 && rest[rest.len() / 2] > least + quiet {
            found.push((taxel, rest[rest.len() / 2]));
        }
    }
    found
}

/// Deviation of single touches from their place: root mean square of the shifts across and along
/// the sensor's axis that fit each image best, without a twentieth that is farthest off. Metres.
///
/// One linear step a touch from the fit, with a prior deviation of [`SHIFT`].
pub(crate) fn looseness(images: &Images<'_>, values: &[f64; N]) -> f64 {
    let pressed = images.pressed(values);
    let group = images.simulator.sensor().grid().n_taxels();
    let residuals = images.residuals(values);
    let largest = |image: &[Option<f64>]| image.iter().flatten().copied().fold(0.0, f64::max);
    let mut shifts = Vec::new();
    for (touch, pose) in images.object_from_sensors(values).into_iter().enumerate() {
        let scale = largest(&images.measured[touch]).max(1.0) * MODEL;
        let there = |shift: DVec3| {
            response(&pressed, pose * Pose::from_parts(DQuat::IDENTITY, shift), values)
        };
        let mut squared = 0.0;
        for axis in DVec3::AXES {
            let (ahead, behind) = (there(axis * STEP), there(-axis * STEP));
            let slope = |taxel: usize| (ahead[taxel] - behind[taxel]) / (2.0 * STEP * scale);
            let (mut pull, mut stiffness) = (0.0, SHIFT.powi(-2));
            for taxel in 0..group {
                let slope = slope(taxel);
                pull += slope * residuals[touch * group + taxel];
                stiffness += slope * slope;
            }
            squared += (pull / stiffness).powi(2) / 3.0;
        }
        shifts.push(squared);
    }
    shifts.sort_by(f64::total_cmp);
    shifts.truncate((shifts.len() * 19).div_ceil(20));
    (shifts.iter().sum::<f64>() / shifts.len().max(1) as f64).sqrt()
}

/// Step of a derivative, metres.
const STEP: f64 = 0.2 * MM;

/// Prior deviation of a touch's shift, metres. Chosen: poses that are looser than this make a
/// robot useless for touch.
const SHIFT: f64 = 3.0 * MM;

/// Relative deviation of a pressure, as in the fit.
const MODEL: f64 = 0.08;
