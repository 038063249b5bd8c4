//! Conversion of sessions.

mod check;

use std::time::Duration;

use palpate_core::reading::{Base, Looseness};
use palpate_recogniser::options::SurfaceOptions;
use palpate_schemas as wire;
use palpate_schemas::{Method, SessionEnd, SessionState};
use palpate_store::entity::{Method as StoredMethod, Session};
use palpate_store::model_codec::ModelPart;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::model::Model;
use crate::wire::Invalid;
use crate::wire::life::{EndReason, Status};
use crate::wire::reading::frame_name;
use crate::wire::{INTEGER_MAX, count, time};
use check::{checked_options, prior};

/// Maximum lifetime, in seconds.
pub(super) const TTL_MAX: u64 = 31_536_000;

/// Default number of bins of an object along x, y and the turn: Table 3.1.
const BINS: [u32; 3] = [25, 25, 16];
/// Default number of particles.
const PARTICLES: u32 = 10_000;
/// The options of a session without their own fields in the store.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct Options {
    pub(crate) method: Method,
    #[serde(default)]
    pub(crate) pose_prior: Option<wire::PosePrior>,
    #[serde(default)]
    pub(crate) bins: Option<[u32; 3]>,
    #[serde(default)]
    pub(crate) particles: Option<u32>,
    #[serde(default)]
    pub(crate) robots: Option<Vec<wire::RobotBase>>,
    #[serde(default)]
    pub(crate) object_moves: Option<wire::Looseness>,
    #[serde(default)]
    pub(crate) risk: Option<f64>,
    /// Missing in surface sessions older than the option: the recogniser's default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) unknown_prior: Option<f64>,
    /// Whether the client stated it.
    #[serde(default)]
    pub(crate) is_unknown_prior_told: bool,
    /// End of the lease that keeps the session open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) leased_until_ms: Option<u64>,
    /// When the lease was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) leased_at_ms: Option<u64>,
    /// The key that opened the session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) opened_by: Option<Uuid>,
    /// The key that requested the lease.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) leased_by: Option<Uuid>,
    /// When the session's alarms were last acknowledged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) acknowledged_at_ms: Option<u64>,
    /// Until when its alarms need no attention.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) muted_until_ms: Option<u64>,
    /// The true object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) truth: Option<wire::Truth>,
    #[serde(default, skip_serializing_if = "wire::Labels::is_empty")]
    pub(crate) labels: wire::Labels,
    /// Of an ended session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) outcome: Option<Outcome>,
    /// Name of the cell that forwards the session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) cell: Option<String>,
    /// Set when all of an ended session is at the central service.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) forwarded: Option<ForwardMark>,
}

/// Mark in an ended session's record: all that it has is at a central service.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq)]
pub(crate) struct ForwardMark {
    /// Address of the central service.
    pub(crate) to: String,
    /// Hash of the labels and the truth that were forwarded.
    pub(crate) print: String,
}

/// What a session came to, in short.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct Outcome {
    /// The newest belief.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) latest: Option<wire::TracePoint>,
    /// The robots of its newest readings.
    #[serde(default)]
    pub(crate) touched_by: Vec<String>,
}

/// Defaults and limits of the server.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    pub(crate) time_to_live: Duration,
    pub(crate) now_ms: u64,
    /// The key that opens it.
    pub(crate) opened_by: Option<Uuid>,
}

/// A session in its wire form.
pub(crate) fn session(
    session: &Session,
    catalogue: &str,
    status: Status,
    outcome: Outcome,
    writer: impl Fn(Uuid) -> wire::Writer,
) -> wire::Session {
    let is_open = status.end.is_none();
    let options = options(session);
    let is_surface = matches!(options.method, Method::Surface);
    let unknown_prior = is_surface.then(|| surface_options(&options).unknown);
    wire::Session {
        id: session.id,
        catalogue: catalogue.to_owned(),
        version: session.version,
        method: options.method,
        seed: options.method.is_geometric().then_some(session.seed),
        pose_prior: options.pose_prior,
        bins: options.bins,
        particles: options.particles,
        robots: options.robots,
        object_moves: options.object_moves,
        risk: options.risk,
        unknown_prior,
        frame_id: frame_id(session).map(str::to_owned),
        state: if is_open { SessionState::Open } else { SessionState::Closed },
        n_readings: count(status.n_readings),
        n_retracted: count(status.n_retracted),
        revision: count(status.length),
        ttl_s: (session.time_to_live_ms > 0).then(|| count(session.time_to_live_ms / 1000)),
        expires_at: status.expires_at_ms.filter(|_| is_open).map(time),
        leased_until: status.leased_until_ms.map(time),
        leased_by: options.leased_by.map(writer),
        created_at: time(session.created_at_ms),
        closed_at: status.end.map(|end| time(end.at_ms)),
        ended: status.end.map(|end| match end.reason {
            EndReason::Closed => SessionEnd::Closed,
            EndReason::Expired => SessionEnd::Expired,
        }),
        truth: options.truth,
        latest: outcome.latest,
        touched_by: outcome.touched_by,
        labels: options.labels,
        cell: options.cell,
    }
}

/// Replaces a session's labels.
pub(crate) fn set_labels(session: &mut Session, labels: &wire::Labels) {
    let labels = labels.clone();
    session.options = written(&Options { labels, ..options(session) });
}

/// Records what an ended session came to.
pub(crate) fn set_outcome(session: &mut Session, outcome: &Outcome) {
    let outcome = Some(outcome.clone());
    session.options = written(&Options { outcome, ..options(session) });
}

pub(crate) fn written(options: &Options) -> String {
    serde_json::to_string(options).expect("numbers and names can be written")
}

/// The options of a stored session.
pub(crate) fn options(session: &Session) -> Options {
    serde_json::from_str(&session.options).unwrap_or_default()
}

/// A method in its stored form.
fn stored_method(method: Method) -> StoredMethod {
    match method {
        Method::Surface => StoredMethod::Surface,
        Method::Sva | Method::SvaLiteral => StoredMethod::Sva,
        Method::Appearance | Method::AppearanceLiteral => StoredMethod::Appearance,
        Method::Geometric | Method::GeometricHistogram | Method::GeometricParticles => {
            StoredMethod::Geometric
        }
    }
}

/// The frame of a stored session, if stated.
pub(crate) fn frame_id(session: &Session) -> Option<&str> {
    (!session.frame_id.is_empty()).then_some(session.frame_id.as_str())
}

/// A new session, checked against the model of its version.
pub(crate) fn new_session(
    request: &wire::CreateSession,
    method: Method,
    model: &Model,
    id: Uuid,
    limits: Limits,
) -> Result<Session, Invalid> {
    let frame_id = request.frame_id.as_deref().and_then(frame_name).unwrap_or_default().to_owned();
    super::text("/frame_id", &frame_id, 256)?;
    let time_to_live = match request.ttl_s {
        Some(ttl) => Duration::from_secs(super::within("/ttl_s", u64::from(ttl), 1, TTL_MAX)?),
        None => limits.time_to_live,
    };
    let opened_by = limits.opened_by;
    super::labels::checked(&request.labels)?;
    let labels = request.labels.clone();
    let options = Options { opened_by, labels, ..checked_options(request, method, model)? };
    let (method, is_geometric) = (options.method, options.method.is_geometric());
    let seed = super::within("/seed", request.seed.unwrap_or(1), 0, INTEGER_MAX)?;
    Ok(Session {
        id,
        catalogue: model.catalogue,
        version: model.version,
        method: stored_method(method),
        sensors: Vec::new(),
        frame_id,
        prior: prior(request.prior.as_deref().unwrap_or_default(), model)?,
        seed: if is_geometric { seed } else { 0 },
        time_to_live_ms: time_to_live.as_millis() as u64,
        options: written(&options),
        created_at_ms: limits.now_ms,
        closed_at_ms: None,
    })
}

/// The method of a new session: the requested one, or surfaces if there are any.
pub(crate) fn method(request: &wire::CreateSession, has_surfaces: bool) -> Method {
    let usual = if has_surfaces { Method::Surface } else { Method::Sva };
    request.method.unwrap_or(usual)
}

/// The model part of a method.
pub(crate) fn part(method: Method) -> ModelPart {
    match method {
        Method::Surface => ModelPart::Surface,
        Method::Sva | Method::SvaLiteral => ModelPart::Sva,
        Method::Appearance | Method::AppearanceLiteral => ModelPart::Appearance,
        Method::Geometric | Method::GeometricHistogram | Method::GeometricParticles => {
            ModelPart::Geometric
        }
    }
}

/// The options with the default number of bins and particles.
pub(crate) fn with_usual_size(chosen: &Options) -> Options {
    let mut changed = chosen.clone();
    changed.bins = changed.bins.map(|_| BINS);
    changed.particles = changed.particles.map(|_| PARTICLES);
    changed
}

/// The recogniser's default probability of "none of these" if the client stated none; in
/// sessions that do not record that, a value that differs was stated.
pub(crate) fn untold_unknown_prior(options: &Options) -> Option<f64> {
    let usual = SurfaceOptions::default().unknown;
    let is_usual = options.unknown_prior.is_none_or(|prior| prior.total_cmp(&usual).is_eq());
    (is_usual && !options.is_unknown_prior_told).then_some(usual)
}

/// The surface recogniser's options for a session.
pub(crate) fn surface_options(options: &Options) -> SurfaceOptions {
    let usual = SurfaceOptions::default();
    let unknown = options.unknown_prior.unwrap_or(usual.unknown);
    let motion = options.object_moves.map(|wire::Looseness { position_m, angle_rad }| Looseness {
        position: position_m,
        angle: angle_rad,
    });
    SurfaceOptions { unknown, motion, ..usual }
}

/// The base of the robot of a reading, if it is uncertain.
pub(crate) fn base(options: &Options, robot: Option<&str>) -> Option<Base> {
    let robots = options.robots.as_deref()?;
    let place = robots.iter().position(|known| Some(known.robot.as_str()) == robot)?;
    let wire::Looseness { position_m: position, angle_rad: angle } = robots[place].base;
    Some(Base { robot: place as u32 + 1, looseness: Looseness { position, angle } })
}

/// The sessions in `?sessions=`.
pub(crate) fn session_ids(query: &wire::EventsQuery) -> Result<Vec<Uuid>, Invalid> {
    let mut ids: Vec<Uuid> = Vec::new();
    for part in query.sessions.split(',').filter(|part| !part.is_empty()) {
        let id = Uuid::parse_str(part.trim()).map_err(|_| {
            Invalid::field("?sessions", format!("came {part:?}, expected a session's id"))
        })?;
        if !ids.contains(&id) {
            ids.push(id);
        }
    }
    match ids.len() {
        1..=100 => Ok(ids),
        n => Err(Invalid::field("?sessions", format!("{n} ids came, expected 1 to 100"))),
    }
}
