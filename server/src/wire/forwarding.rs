//! Conversion of forwarding: a cell's sessions and journal entries as requests to the central
//! service, and back.

use palpate_core::pose::Pose;
use palpate_schemas as wire;
use palpate_store::entity::{Session, StoredReading};
use palpate_store::journal::{Entry, Event};
use uuid::Uuid;

use crate::wire::Invalid;
use crate::wire::reading::{self, Given, Incoming};
use crate::wire::session::{ForwardMark, options, written};
use crate::wire::{count, felt, sensor};

/// Time by which the id of a forwarded session may be ahead of this server's clock. Chosen: a clock
/// that shows the local time for the universal one is off by at most 14 hours.
const AHEAD_MAX_MS: u64 = 86_400_000;
/// Time by which it may be behind. Chosen: longer than a cell is without its central service.
const BEHIND_MAX_MS: u64 = 366 * 86_400_000;
/// Maximum length of a cell's name, in characters.
pub(crate) const CELL_MAX: usize = 64;

/// A checked entry of a request.
#[derive(Clone, Debug)]
pub(crate) enum Forwarded {
    Reading(Box<Incoming>),
    Retraction(u64),
}

/// The id of a forwarded session.
pub(crate) fn session_id(id: &str) -> Result<Uuid, Invalid> {
    let parsed = Uuid::parse_str(id).ok().filter(|id| id.get_version_num() == 7);
    parsed.ok_or_else(|| {
        Invalid::field("path:session", format!("came {id:?}, expected the UUIDv7 of the session"))
    })
}

/// Refuses the id of a new session that states no believable time.
pub(crate) fn check_time(id: Uuid, now_ms: u64) -> Result<(), Invalid> {
    let believed = now_ms.saturating_sub(BEHIND_MAX_MS)..=now_ms.saturating_add(AHEAD_MAX_MS);
    let stated = created_at_ms(id);
    if believed.contains(&stated) {
        return Ok(());
    }
    let [stated, from, to] = [stated, *believed.start(), *believed.end()].map(super::time);
    let detail = format!(
        "came {id}, which states the time {stated}, expected one from {from} to {to}: set the clock \
         of the cell"
    );
    Err(Invalid::field("path:session", detail))
}

/// The time of a forwarded session's creation, ms since 1970: its id begins with it.
pub(crate) fn created_at_ms(id: Uuid) -> u64 {
    (id.as_u128() >> 80) as u64
}

/// The catalogue and version of a forwarded session, and its settings for this server.
pub(crate) fn settings(
    request: &wire::ForwardSession,
) -> Result<(&str, u32, wire::CreateSession), Invalid> {
    super::text("/cell", &request.cell, CELL_MAX)?;
    if request.cell.is_empty() {
        return Err(Invalid::field("/cell", "came empty, expected the name of the cell"));
    }
    let asked = &request.session;
    let missing = |field: &str| {
        Invalid::field(format!("/session/{field}"), "is missing, expected that of the session")
    };
    let catalogue = asked.catalogue.as_deref().ok_or_else(|| missing("catalogue"))?;
    let version = asked.version.ok_or_else(|| missing("version"))?;
    if asked.alias.is_some() {
        return Err(Invalid::field(
            "/session/alias",
            "came with `version`, expected one of the two",
        ));
    }
    Ok((catalogue, version, wire::CreateSession { ttl_s: None, ..asked.clone() }))
}

/// A new session as one that a cell forwards. It does not expire: the cell tells its end.
pub(crate) fn of_cell(session: Session, cell: &str) -> Session {
    let mut options = options(&session);
    options.cell = Some(cell.to_owned());
    Session { time_to_live_ms: 0, options: written(&options), ..session }
}

/// The readings of a request, each entry of which must be one thing.
pub(crate) fn readings(request: &wire::ForwardEntries) -> Result<Vec<Given<'_>>, Invalid> {
    let mut given = Vec::with_capacity(request.entries.len());
    for (index, entry) in request.entries.iter().enumerate() {
        match (&entry.reading, entry.retracts) {
            (Some(reading), None) => given.push((format!("/entries/{index}/reading"), reading)),
            (None, Some(_)) => {}
            (Some(_), Some(_)) | (None, None) => {
                let detail = "expected exactly one of `reading` and `retracts`";
                return Err(Invalid::field(format!("/entries/{index}"), detail));
            }
        }
    }
    Ok(given)
}

/// The entries of a request, of whose readings these are the checked ones in order.
pub(crate) fn entries(
    request: &wire::ForwardEntries,
    readings: Vec<Incoming>,
) -> Result<Vec<Forwarded>, Invalid> {
    let mut readings = readings.into_iter();
    let one = |entry: &wire::ForwardedEntry| {
        let Some(given) = &entry.reading else {
            return Ok(Forwarded::Retraction(u64::from(entry.retracts.unwrap_or_default())));
        };
        let incoming = readings.next().expect("every reading of the request was checked");
        Ok(Forwarded::Reading(Box::new(as_stored(incoming, given)?)))
    };
    request.entries.iter().map(one).collect()
}

/// Points warnings about the readings of a request, which count these alone, to its entries.
pub(crate) fn point_to_entries(warnings: &mut [wire::Warning], given: &[Given<'_>]) {
    for warning in warnings {
        let place = warning.pointer.strip_prefix("/readings/").unwrap_or_default();
        let (index, field) = place.split_once('/').unwrap_or((place, ""));
        let entry = index.parse::<usize>().ok().and_then(|index| given.get(index));
        if let Some((pointer, _)) = entry {
            warning.pointer = format!("{pointer}/{field}");
        }
    }
}

/// A reading with the bits of the cell's pose. The cell normalised its quaternion, and to do that
/// again could change its last bit.
fn as_stored(incoming: Incoming, given: &wire::Reading) -> Result<Incoming, Invalid> {
    let pose = given.pose.as_ref().map(|pose| Pose::stored(pose.position, pose.orientation));
    let pose = pose.transpose();
    let session_from_sensor =
        pose.map_err(|error| Invalid::field(format!("{}/pose", incoming.pointer), error))?;
    let stored = StoredReading { session_from_sensor, ..incoming.stored };
    Ok(Incoming { stored, ..incoming })
}

/// A stored entry as a request for the central service, whose sensors have the same names; `None`
/// for the end of the session.
pub(crate) fn entry(
    entry: &Entry,
    sensor: impl Fn(Uuid) -> String,
) -> Option<wire::ForwardedEntry> {
    match &entry.event {
        Event::Closed => None,
        Event::Retraction { seq } => {
            Some(wire::ForwardedEntry { reading: None, retracts: Some(count(*seq)) })
        }
        Event::Reading(stored) => {
            let id = entry.reading_id.as_ref();
            let moved = stored.object_moved.map(|moved| wire::Looseness {
                position_m: moved.position,
                angle_rad: moved.angle,
            });
            let reading = wire::Reading {
                robot: id.map(|id| id.robot.clone()),
                seq: id.map(|id| id.seq),
                sensor: sensor(stored.sensor),
                frame_id: None,
                stamp: stored.stamp_ns.map(reading::stamp),
                pose: stored.session_from_sensor.as_ref().map(sensor::pose),
                image: stored.pressures.clone(),
                contact: stored.contact.map(felt::shown),
                shear: stored.shear.clone(),
                feature: stored.feature.clone(),
                approach_m: (stored.approach > 0.0).then_some(stored.approach),
                object_moved: moved,
            };
            Some(wire::ForwardedEntry { reading: Some(reading), retracts: None })
        }
    }
}

/// A session of this cell as a request for the central service.
pub(crate) fn request(
    session: &Session,
    catalogue: String,
    (cell, version_hash): (&str, String),
) -> wire::ForwardSession {
    let options = options(session);
    let is_geometric = options.method.is_geometric();
    let prior = session.prior.iter().map(|(object, probability)| wire::PriorEntry {
        object: object.to_string(),
        probability: *probability,
    });
    let prior: Vec<wire::PriorEntry> = prior.collect();
    let told = options.unknown_prior.filter(|_| options.is_unknown_prior_told);
    wire::ForwardSession {
        cell: cell.to_owned(),
        version_hash,
        session: wire::CreateSession {
            catalogue: Some(catalogue),
            version: Some(session.version),
            alias: None,
            method: Some(options.method),
            frame_id: super::session::frame_id(session).map(str::to_owned),
            prior: (!prior.is_empty()).then_some(prior),
            unknown_prior: told,
            pose_prior: options.pose_prior,
            bins: options.bins,
            particles: options.particles,
            seed: is_geometric.then_some(session.seed),
            robots: options.robots,
            object_moves: options.object_moves,
            risk: options.risk,
            ttl_s: None,
            labels: options.labels,
        },
    }
}

/// The closing of an ended session, with its truth if it is known.
pub(crate) fn closing(session: &Session) -> wire::CloseSession {
    let truth = options(session).truth;
    wire::CloseSession {
        object: truth.as_ref().and_then(|truth| truth.object).map(|object| object.to_string()),
        none_of_these: truth.as_ref().filter(|truth| truth.object.is_none()).map(|_| true),
        pose: truth.and_then(|truth| truth.pose),
    }
}

/// The mark of a session whose labels and truth are at a central service.
pub(crate) fn mark(session: &Session, to: &str) -> ForwardMark {
    let told = (closing(session), options(session).labels);
    let told = serde_json::to_vec(&told).expect("numbers and names can be written");
    ForwardMark { to: to.to_owned(), print: blake3::hash(&told).to_hex()[..16].to_owned() }
}

/// Records that all of a session is at a central service.
pub(crate) fn set_mark(session: &mut Session, mark: &ForwardMark) {
    let mut options = options(session);
    options.forwarded = Some(mark.clone());
    session.options = written(&options);
}
