//! Conversion of a camera's word: the pose prior of kind `camera`, for the method `surface`.
//!
//! A session keeps it with ids for names and every default filled in.

use std::f64::consts::PI;

use glam::DVec3;
use palpate_core::object::ObjectIdx;
use palpate_core::units::Beyond;
use palpate_recogniser::pose_prior::{
    Covariance, HYPOTHESES_MAX, PoseHypothesis, PosePrior, WRONG, Workspace,
};
use palpate_schemas as wire;

use crate::model::Model;
use crate::wire::reading::{looseness, pose};
use crate::wire::{Invalid, number, outside, range};

/// Maximum number of weights of objects.
const CLASSES_MAX: usize = 1_000;
/// Permitted weights above 0. Chosen: products of weights with a prior stay normal numbers.
const WEIGHT: [f64; 2] = [1e-9, 1e6];
/// Permitted deviations of a covariance along each axis, in metres.
const POSITION_DEVIATION: [f64; 2] = [1e-5, 1.0];
/// Permitted deviations of a covariance about each axis, in radians.
const ANGLE_DEVIATION: [f64; 2] = [1e-4, PI + 1e-6];
/// Permitted shares of wrong statements.
const WRONG_SHARE: [f64; 2] = [1e-3, 0.9];
/// Largest coordinate of a workspace, and its permitted edges, in metres.
const COORDINATE_MAX: f64 = 1e6;
const EDGE: [f64; 2] = [1e-3, 100.0];

/// A stated prior with every default filled in, checked against the model of its session. `prior`
/// is that of the objects; empty if even.
pub(super) fn checked(
    given: &wire::PosePrior,
    model: &Model,
    prior: &[f64],
) -> Result<wire::PosePrior, Invalid> {
    let wire::PosePrior::Camera { hypotheses, class_weights, workspace, wrong } = given else {
        return Err(Invalid::field(
            "/pose_prior/kind",
            "came with the method `surface`, expected the kind `camera`",
        ));
    };
    if hypotheses.is_empty() && class_weights.is_empty() && workspace.is_none() {
        let detail = "states nothing, expected `hypotheses`, `class_weights` or `workspace`";
        return Err(Invalid::field("/pose_prior", detail));
    }
    at_most("/pose_prior/hypotheses", hypotheses.len(), HYPOTHESES_MAX)?;
    at_most("/pose_prior/class_weights", class_weights.len(), CLASSES_MAX)?;
    let [low, high] = WRONG_SHARE;
    let wrong = number("/pose_prior/wrong", wrong.unwrap_or(WRONG), low, high)?;
    let checked = hypotheses.iter().enumerate().map(|(n, one)| hypothesis(n, one, model));
    let hypotheses: Vec<wire::StatedPose> = checked.collect::<Result<_, _>>()?;
    let weights: Vec<f64> = hypotheses.iter().filter_map(|one| one.weight).collect();
    some("/pose_prior/hypotheses", &weights)?;
    let class_weights = classes(class_weights, model, prior)?;
    workspace.as_ref().map(check_box).transpose()?;
    let wrong = Some(wrong);
    Ok(wire::PosePrior::Camera { hypotheses, class_weights, workspace: *workspace, wrong })
}

fn hypothesis(
    index: usize,
    given: &wire::StatedPose,
    model: &Model,
) -> Result<wire::StatedPose, Invalid> {
    let pointer = format!("/pose_prior/hypotheses/{index}");
    let found =
        given.object.as_deref().map(|object| find(&format!("{pointer}/object"), object, model));
    let object = found.transpose()?.map(|object| model.objects[object].id.to_string());
    pose(&format!("{pointer}/pose"), &given.pose)?;
    let weight = weight(&format!("{pointer}/weight"), given.weight.unwrap_or(1.0))?;
    match (given.deviation, &given.covariance) {
        (Some(deviation), None) => {
            let at = format!("{pointer}/deviation");
            let loose = looseness(&at, deviation)?;
            // It becomes a covariance, and has the bounds of one.
            let [low, high] = POSITION_DEVIATION;
            number(&format!("{at}/position_m"), loose.position, low, high)?;
            let [low, high] = ANGLE_DEVIATION;
            number(&format!("{at}/angle_rad"), loose.angle, low, high)?;
        }
        (None, Some(covariance)) => {
            matrix(&format!("{pointer}/covariance"), covariance)?;
        }
        (both, _) => {
            let came = if both.is_some() { "both" } else { "neither" };
            let detail = format!("{came} came, expected either `deviation` or `covariance`");
            return Err(Invalid::field(pointer, detail));
        }
    }
    Ok(wire::StatedPose { object, weight: Some(weight), ..given.clone() })
}

fn classes(
    given: &[wire::ClassWeight],
    model: &Model,
    prior: &[f64],
) -> Result<Vec<wire::ClassWeight>, Invalid> {
    let (mut checked, mut possible) = (Vec::with_capacity(given.len()), Vec::new());
    let mut is_known = vec![false; model.objects.len()];
    for (index, class) in given.iter().enumerate() {
        let pointer = format!("/pose_prior/class_weights/{index}");
        let place = format!("{pointer}/object");
        let object = find(&place, &class.object, model)?;
        if std::mem::replace(&mut is_known[object], true) {
            let detail = format!("the object {:?} is named twice", class.object);
            return Err(Invalid::field(place, detail));
        }
        let weight = weight(&format!("{pointer}/weight"), class.weight)?;
        possible.push(weight * prior.get(object).copied().unwrap_or(1.0));
        checked.push(wire::ClassWeight { object: model.objects[object].id.to_string(), weight });
    }
    some("/pose_prior/class_weights", &possible)?;
    Ok(checked)
}

/// Refuses weights that are all 0.
fn some(pointer: &str, weights: &[f64]) -> Result<(), Invalid> {
    if weights.is_empty() || weights.iter().any(|weight| *weight > 0.0) {
        return Ok(());
    }
    let detail = "all weights of possible objects are 0, expected one above 0";
    Err(Invalid::field(pointer, detail))
}

fn weight(pointer: &str, found: f64) -> Result<f64, Invalid> {
    let [min, max] = WEIGHT;
    if found > 0.0 && found < min {
        let expected = format!("0, or {min:e} to {max}");
        return Err(outside(pointer, found, [0.0, min], &expected));
    }
    number(pointer, found, 0.0, max)
}

fn at_most(pointer: &str, found: usize, max: usize) -> Result<(), Invalid> {
    let detail = || format!("{found} came, expected at most {max}");
    (found <= max).then_some(()).ok_or_else(|| Invalid::field(pointer, detail()))
}

fn find(pointer: &str, object: &str, model: &Model) -> Result<usize, Invalid> {
    model.find(object).ok_or_else(|| {
        let (name, version) = (&model.name, model.version);
        let detail =
            format!("version {version} of catalogue {name:?} does not know the object {object:?}");
        Invalid::field(pointer, detail)
    })
}

/// A covariance, checked.
fn matrix(pointer: &str, given: &[f64]) -> Result<Covariance, Invalid> {
    if given.len() != 36 {
        let detail = format!("{} numbers came, expected 36", given.len());
        return Err(Invalid::field(pointer, detail));
    }
    for axis in 0..6 {
        let [low, high] = if axis < 3 { POSITION_DEVIATION } else { ANGLE_DEVIATION };
        let (at, found) = (7 * axis, given[7 * axis]);
        if !(low.powi(2)..=high.powi(2)).contains(&found) {
            let limits @ [low, high] = [low.powi(2), high.powi(2)];
            let expected = format!("a variance of {}", range(low, high));
            return Err(outside(format!("{pointer}/{at}"), found, limits, &expected));
        }
    }
    let detail = "is no covariance, expected a symmetric and positive definite matrix";
    PoseHypothesis::full(given).ok_or_else(|| Invalid::field(pointer, detail))
}

fn check_box(given: &wire::WorkspaceBox) -> Result<(), Invalid> {
    for axis in 0..3 {
        let low = format!("/pose_prior/workspace/low/{axis}");
        let high = format!("/pose_prior/workspace/high/{axis}");
        number(&low, given.low[axis], -COORDINATE_MAX, COORDINATE_MAX)?;
        number(&high, given.high[axis], -COORDINATE_MAX, COORDINATE_MAX)?;
        let edge = given.high[axis] - given.low[axis];
        let [least, most] = EDGE;
        if !(least..=most).contains(&edge) {
            let edge = Beyond(edge, EDGE);
            let detail = format!("is {edge} m above `low`, expected {}", range(least, most));
            return Err(Invalid::field(high, detail));
        }
    }
    Ok(())
}

/// The recogniser's form of a stored prior, for a model that may lack some of its objects; `None`
/// if nothing is left, or it is of another kind.
///
/// # Errors
/// [`Invalid`] if the stored prior is no longer valid.
pub(crate) fn stated(
    stored: &wire::PosePrior,
    model: &Model,
) -> Result<Option<PosePrior>, Invalid> {
    let wire::PosePrior::Camera { hypotheses, class_weights, workspace, wrong } = stored else {
        return Ok(None);
    };
    let index = |object: &str| model.find(object).map(|object| ObjectIdx(object as u32));
    let mut found = PosePrior { wrong: wrong.unwrap_or(WRONG), ..PosePrior::default() };
    for one in hypotheses {
        let object = one.object.as_deref().map(index);
        if object == Some(None) {
            continue;
        }
        let covariance = match (one.deviation, &one.covariance) {
            (Some(wire::Looseness { position_m, angle_rad }), _) => {
                // Earlier versions took any deviation above 0.
                let (position, angle) = (POSITION_DEVIATION[0], ANGLE_DEVIATION[0]);
                PoseHypothesis::diagonal(position_m.max(position), angle_rad.max(angle))
            }
            (None, Some(covariance)) => matrix("/pose_prior", covariance)?,
            (None, None) => continue,
        };
        found.hypotheses.push(PoseHypothesis {
            object: object.flatten(),
            session_from_object: pose("/pose_prior", &one.pose)?,
            covariance,
            weight: one.weight.unwrap_or(1.0),
        });
    }
    let known = class_weights.iter().filter_map(|one| Some((index(&one.object)?, one.weight)));
    found.class_weights = known.collect();
    found.workspace = workspace
        .map(|it| Workspace { low: DVec3::from_array(it.low), high: DVec3::from_array(it.high) });
    // What is left after objects that the model lacks may weigh nothing.
    if found.hypotheses.iter().all(|one| one.weight <= 0.0) {
        found.hypotheses.clear();
    }
    if found.class_weights.iter().all(|(_, weight)| *weight <= 0.0) {
        found.class_weights.clear();
    }
    Ok((!found.is_empty()).then_some(found))
}
