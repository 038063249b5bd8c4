//! Conversion of beliefs.

use glam::DQuat;
use palpate_core::belief::answer::{Answer, PoseMode};
use palpate_core::pose::Pose;
use palpate_schemas as wire;
use palpate_schemas::Method;
use palpate_store::entity::Session;

use crate::hints::{of_images, of_session};
use crate::model::Model;
use crate::wire::session::{options, untold_unknown_prior};
use crate::wire::{count, evidence, sensor, symmetry};

/// A belief in its wire form, with every object and pose.
pub(crate) fn belief(
    session: &Session,
    revision: u64,
    answer: &Answer,
    model: &Model,
) -> wire::Belief {
    let method = options(session).method;
    let basis = model.core.surface.as_ref().map(|surfaces| surfaces.calibration.basis);
    let uncalibrated_reason = evidence::reason_of(method, basis);
    let mut objects: Vec<wire::ObjectProbability> = answer
        .probabilities
        .iter()
        .zip(&model.objects)
        .map(|(&probability, object)| wire::ObjectProbability {
            object: object.id,
            name: object.name.clone(),
            probability,
        })
        .collect();
    objects.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let poses = answer.modes.iter().map(|mode| hypothesis(mode, method, model)).collect();
    wire::Belief {
        session: session.id,
        revision: count(revision),
        n_readings: count(answer.n_readings),
        objects,
        unknown: answer.unknown,
        stop: stop(session, answer, model),
        calibrated: uncalibrated_reason.is_none(),
        uncalibrated_reason,
        entropy_bits: answer.entropy_bits,
        poses,
        warnings: warnings(answer),
    }
}

/// What all touches of a session have in common that is probably a mistake.
fn warnings(answer: &Answer) -> Vec<wire::Warning> {
    let shift = answer.sensor_shift.as_ref().and_then(of_session);
    let order = answer.image_doubt.as_ref().and_then(of_images);
    shift.into_iter().chain(order).collect()
}

/// The stop advice of a session with a stated risk.
fn stop(session: &Session, answer: &Answer, model: &Model) -> Option<wire::StopAdvice> {
    let options = options(session);
    let risk = options.risk?;
    let rule = model.core.surface.as_ref().map(|surfaces| surfaces.calibration.stop);
    let found = answer.risk(untold_unknown_prior(&options), rule.unwrap_or_default());
    Some(wire::StopAdvice { risk, found, reached: found <= risk })
}

/// Whether a method reports poses modulo the objects' symmetries.
pub(crate) fn knows_symmetry(method: Method) -> bool {
    match method {
        Method::Surface | Method::Sva => true,
        Method::SvaLiteral
        | Method::Geometric
        | Method::GeometricHistogram
        | Method::GeometricParticles
        | Method::Appearance
        | Method::AppearanceLiteral => false,
    }
}

/// The belief with its likeliest object and pose only.
pub(crate) fn top(mut belief: wire::Belief) -> wire::Belief {
    belief.objects.truncate(1);
    belief.poses.truncate(1);
    belief
}

fn hypothesis(mode: &PoseMode, method: Method, model: &Model) -> wire::PoseHypothesis {
    let object = &model.objects[mode.object.0 as usize];
    let known = model.symmetries.get(mode.object.0 as usize);
    let symmetry = known.filter(|_| knows_symmetry(method));
    let covariance = mode.covariance;
    let origin_in_model = model.origins_in_model[mode.object.0 as usize];
    let object_from_model = Pose::from_parts(DQuat::IDENTITY, -origin_in_model);
    wire::PoseHypothesis {
        object: object.id,
        name: object.name.clone(),
        weight: mode.weight,
        pose: sensor::pose(&mode.session_from_object),
        session_from_model: sensor::pose(&(mode.session_from_object * object_from_model)),
        covariance: (0..36).map(|index| covariance[(index / 6, index % 6)]).collect(),
        symmetry: symmetry
            .map_or_else(Vec::new, |known| symmetry::axes(known, &mode.session_from_object)),
    }
}
