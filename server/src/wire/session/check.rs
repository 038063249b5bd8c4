//! Checks of a new session's options and prior, with every default filled in.

use palpate_core::units::Beyond;
use palpate_recogniser::options::SurfaceOptions;
use palpate_schemas as wire;
use palpate_schemas::Method;
use palpate_store::journal::ROBOT_BYTES_MAX;
use uuid::Uuid;

use super::{BINS, Options, PARTICLES};
use crate::model::Model;
use crate::wire::Invalid;
use crate::wire::reading::looseness;
use crate::wire::{camera, count, geometry, outside, range, text, within};

/// Tolerance of the sum of probabilities about 1.
const SUM_TOLERANCE: f64 = 1e-6;
/// Maximum number of bins of an object, and of particles.
const HYPOTHESES_MAX: u64 = 100_000;

/// Maximum number of robots with uncertain bases.
const ROBOTS_MAX: usize = 100;
/// Permitted risks.
const RISKS: std::ops::RangeInclusive<f64> = 0.000_1..=0.5;

/// The options of a new session with every default filled in. Options of other methods are
/// refused.
pub(super) fn checked_options(
    request: &wire::CreateSession,
    method: Method,
    model: &Model,
) -> Result<Options, Invalid> {
    let only = |field: &str, methods: &str| {
        let detail = format!("came with the method `{}`, expected with {methods}", method.name());
        Invalid::field(field, detail)
    };
    if !method.is_geometric() && request.seed.is_some() {
        return Err(only("/seed", "geometric methods only"));
    }
    if !method.is_geometric() && method != Method::Surface && request.pose_prior.is_some() {
        return Err(only("/pose_prior", "`surface` or geometric methods only"));
    }
    if request.bins.is_some() && method != Method::GeometricHistogram {
        return Err(only("/bins", "`geometric_histogram` only"));
    }
    if request.particles.is_some() && method != Method::GeometricParticles {
        return Err(only("/particles", "`geometric_particles` only"));
    }
    let surface_only = [
        ("/robots", request.robots.is_some()),
        ("/object_moves", request.object_moves.is_some()),
        ("/risk", request.risk.is_some()),
        ("/unknown_prior", request.unknown_prior.is_some()),
    ];
    if let Some((field, _)) = surface_only.iter().find(|(_, came)| *came)
        && method != Method::Surface
    {
        return Err(only(field, "`surface` only"));
    }
    let robots = request.robots.as_deref().map(robots).transpose()?;
    let risk = request.risk.map(risk).transpose()?;
    let unknown_prior = request.unknown_prior.map(unknown_prior).transpose()?;
    let object_moves = request.object_moves;
    object_moves.map(|moves| looseness("/object_moves", moves)).transpose()?;
    let mut options = Options { method, robots, object_moves, risk, ..Options::default() };
    match method {
        Method::Surface => {
            options.is_unknown_prior_told = unknown_prior.is_some();
            options.unknown_prior =
                Some(unknown_prior.unwrap_or(SurfaceOptions::default().unknown));
            if let Some(given) = &request.pose_prior {
                let of_objects = prior(request.prior.as_deref().unwrap_or_default(), model)?;
                let of_objects: Vec<f64> = of_objects.iter().map(|(_, p)| *p).collect();
                options.pose_prior = Some(camera::checked(given, model, &of_objects)?);
            }
            return Ok(options);
        }
        Method::Sva | Method::SvaLiteral => return Ok(options),
        Method::Appearance | Method::AppearanceLiteral => {
            return Ok(options);
        }
        Method::Geometric => {}
        Method::GeometricHistogram => options.bins = Some(bins(request.bins.unwrap_or(BINS))?),
        Method::GeometricParticles => {
            let n = u64::from(request.particles.unwrap_or(PARTICLES));
            options.particles = Some(count(within("/particles", n, 100, HYPOTHESES_MAX)?));
        }
    }
    let Some(maps) = &model.core.geometric else {
        let detail =
            format!("came `{}`, expected a method that the version was trained for", method.name());
        return Err(Invalid::field("/method", detail));
    };
    let kind = geometry::kind(maps);
    options.pose_prior = Some(geometry::pose_prior(request.pose_prior.as_ref(), kind)?);
    Ok(options)
}

/// The prior over all objects of the model; empty when the request has none.
pub(super) fn prior(
    entries: &[wire::PriorEntry],
    model: &Model,
) -> Result<Vec<(Uuid, f64)>, Invalid> {
    if entries.is_empty() {
        return Ok(Vec::new());
    }
    let mut given: Vec<Option<f64>> = vec![None; model.objects.len()];
    for (index, entry) in entries.iter().enumerate() {
        let object = model.find(&entry.object).ok_or_else(|| {
            let (name, version) = (&model.name, model.version);
            let detail = format!(
                "version {version} of catalogue {name:?} does not know the object {:?}",
                entry.object
            );
            Invalid::field(format!("/prior/{index}/object"), detail)
        })?;
        let probability = entry.probability;
        if !(0.0..=1.0).contains(&probability) {
            let at = format!("/prior/{index}/probability");
            return Err(outside(at, probability, [0.0, 1.0], "0 to 1"));
        }
        if given[object].replace(probability).is_some() {
            let detail = format!("the object {:?} is named twice", entry.object);
            return Err(Invalid::field(format!("/prior/{index}/object"), detail));
        }
    }
    let sum: f64 = given.iter().flatten().sum();
    let n_others = given.iter().filter(|probability| probability.is_none()).count();
    if sum > 1.0 + SUM_TOLERANCE || (n_others == 0 && sum < 1.0 - SUM_TOLERANCE) {
        let expected = if n_others == 0 { "exactly 1" } else { "at most 1" };
        let sum = Beyond(sum, [1.0]);
        let detail = format!("the probabilities sum to {sum}, expected {expected}");
        return Err(Invalid::field("/prior", detail));
    }
    let share = (1.0 - sum).max(0.0) / n_others.max(1) as f64;
    let all = given.iter().zip(&model.objects);
    Ok(all.map(|(probability, object)| (object.id, probability.unwrap_or(share))).collect())
}

/// Robots with uncertain bases, checked.
fn robots(given: &[wire::RobotBase]) -> Result<Vec<wire::RobotBase>, Invalid> {
    if given.len() > ROBOTS_MAX {
        let detail = format!("{} robots came, expected at most {ROBOTS_MAX}", given.len());
        return Err(Invalid::field("/robots", detail));
    }
    for (index, robot) in given.iter().enumerate() {
        let pointer = format!("/robots/{index}");
        text(&format!("{pointer}/robot"), &robot.robot, ROBOT_BYTES_MAX)?;
        if robot.robot.is_empty() || given[..index].iter().any(|o| o.robot == robot.robot) {
            let detail = format!("came {:?}, expected a name that comes once", robot.robot);
            return Err(Invalid::field(format!("{pointer}/robot"), detail));
        }
        looseness(&format!("{pointer}/base"), robot.base)?;
    }
    Ok(given.to_vec())
}

/// A stated risk, checked.
fn risk(given: f64) -> Result<f64, Invalid> {
    if RISKS.contains(&given) {
        return Ok(given);
    }
    let (low, high) = (RISKS.start(), RISKS.end());
    Err(outside("/risk", given, [*low, *high], &range(*low, *high)))
}

/// The probability of "none of these" before the first touch, checked.
fn unknown_prior(given: f64) -> Result<f64, Invalid> {
    if given > 0.0 && given < 1.0 {
        return Ok(given);
    }
    Err(outside("/unknown_prior", given, [0.0, 1.0], "more than 0 and less than 1"))
}

/// Bins of the histogram filter, checked.
fn bins(n: [u32; 3]) -> Result<[u32; 3], Invalid> {
    for (axis, n) in n.into_iter().enumerate() {
        within(&format!("/bins/{axis}"), u64::from(n), 2, 200)?;
    }
    let found = n.into_iter().map(u64::from).product();
    within("/bins", found, 8, HYPOTHESES_MAX)?;
    Ok(n)
}
