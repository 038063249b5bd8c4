//! Which role may call which operation: the one table that says so.
//!
//! Operations are named by their ids in the API's description. One that is not in the table
//! may be called by nobody where keys are asked for, and a test fails. The description is made
//! from this table (`x-palpate-roles`, 401, 403), so it cannot say anything else.

use std::collections::BTreeMap;

use axum::http::Method;
use palpate_schemas::Role::{self, Admin, Robot, Trainer, Viewer};

/// Who may call an operation, and what it does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    /// The operation's id.
    pub(crate) operation: &'static str,
    /// Who may call it.
    pub(crate) who: Who,
    /// What it does to what is stored.
    pub(crate) effect: Effect,
}

/// Who may call an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Who {
    /// Everybody, also without a key.
    Anybody,
    /// Who has a key with one of these roles.
    Holders(&'static [Role]),
}

/// What an operation does to what is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// Nothing.
    Reads,
    /// It adds readings of sessions, whose journal says who sent what.
    Touches,
    /// It changes something, and goes into the audit log.
    Changes,
}

const ANYBODY: Who = Who::Anybody;
const ALL: Who = Who::Holders(&[Robot, Trainer, Viewer, Admin]);
const LOOKING: Who = Who::Holders(&[Trainer, Viewer, Admin]);
const TEACHING: Who = Who::Holders(&[Trainer, Admin]);
const TOUCHING: Who = Who::Holders(&[Robot, Admin]);
pub(crate) const RULING: Who = Who::Holders(&[Admin]);

use Effect::{Changes, Reads, Touches};

/// A new operation gets its line here.
pub(crate) const TABLE: &[(&str, Who, Effect)] = &[
    ("livez", ANYBODY, Reads),
    ("readyz", ANYBODY, Reads),
    ("version", ANYBODY, Reads),
    ("metrics", LOOKING, Reads),
    ("whoami", ALL, Reads),
    ("list_sensors", ALL, Reads),
    ("get_sensor", ALL, Reads),
    ("check_reading", ALL, Reads),
    ("get_calibration", ALL, Reads),
    ("create_sensor", TEACHING, Changes),
    ("calibrate_sensor", TEACHING, Changes),
    ("delete_sensor", TEACHING, Changes),
    ("analyse_coverings", LOOKING, Reads),
    ("list_objects", LOOKING, Reads),
    ("get_object", LOOKING, Reads),
    ("get_mesh", LOOKING, Reads),
    ("list_object_readings", LOOKING, Reads),
    ("create_object", TEACHING, Changes),
    ("update_object", TEACHING, Changes),
    ("delete_object", TEACHING, Changes),
    ("put_mesh", TEACHING, Changes),
    ("add_object_readings", TEACHING, Changes),
    ("list_catalogues", ALL, Reads),
    ("get_catalogue", ALL, Reads),
    ("list_versions", ALL, Reads),
    ("get_version", ALL, Reads),
    ("get_report", ALL, Reads),
    ("get_appearance_report", ALL, Reads),
    ("get_object_map", ALL, Reads),
    ("get_occupancy", ALL, Reads),
    ("get_occupancy_png", ALL, Reads),
    ("get_occupancy_ply", ALL, Reads),
    ("get_current", ALL, Reads),
    ("start_training", TEACHING, Changes),
    ("merge_maps", TEACHING, Changes),
    ("set_current", TEACHING, Changes),
    ("delete_catalogue", TEACHING, Changes),
    ("delete_version", TEACHING, Changes),
    ("list_jobs", LOOKING, Reads),
    ("get_job", LOOKING, Reads),
    ("job_events", LOOKING, Reads),
    ("cancel_job", TEACHING, Changes),
    ("list_sessions", ALL, Reads),
    ("get_session", ALL, Reads),
    ("get_fleet", LOOKING, Reads),
    ("get_belief", ALL, Reads),
    ("get_marginals", ALL, Reads),
    ("ask_next_touches", ALL, Reads),
    ("session_events", ALL, Reads),
    ("events", ALL, Reads),
    ("create_session", TOUCHING, Changes),
    ("close_session", TOUCHING, Changes),
    ("extend_session", TOUCHING, Changes),
    ("delete_session", TOUCHING, Changes),
    ("add_readings", TOUCHING, Touches),
    ("list_session_readings", ALL, Reads),
    ("retract_reading", TOUCHING, Changes),
    ("retract_robot_reading", TOUCHING, Changes),
    ("replay_session", ALL, Reads),
    ("explain_session", ALL, Reads),
    ("list_keys", RULING, Reads),
    ("get_key", RULING, Reads),
    ("create_key", RULING, Changes),
    ("revoke_key", RULING, Changes),
    ("rotate_key", RULING, Changes),
    ("list_robots", LOOKING, Reads),
    ("bind_robot", RULING, Changes),
    ("release_robot", RULING, Changes),
    ("list_audit", RULING, Reads),
    ("get_storage", LOOKING, Reads),
    ("take_snapshot", RULING, Changes),
    ("compact", RULING, Changes),
];

/// What a request asks for, as far as the table knows.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Asked {
    /// An operation of the table.
    Operation(Rule),
    /// A path of the description, with a method that it does not have there.
    OtherMethod,
    /// Something that the description or the table does not know.
    Unlisted,
}

/// The line of an operation.
pub(crate) fn rule(operation: &str) -> Option<Rule> {
    let line = TABLE.iter().find(|(named, _, _)| *named == operation);
    line.map(|(operation, who, effect)| Rule { operation, who: *who, effect: *effect })
}

/// The operations of the API by path and method, as its description names them.
#[derive(Debug, Default)]
pub(crate) struct Operations(BTreeMap<String, BTreeMap<&'static str, String>>);

impl Operations {
    /// From the path, method and id of every operation.
    pub(crate) fn new(ids: impl IntoIterator<Item = (String, &'static str, String)>) -> Self {
        let mut paths: BTreeMap<_, BTreeMap<_, _>> = BTreeMap::new();
        for (path, method, operation) in ids {
            paths.entry(path).or_default().insert(method, operation);
        }
        Self(paths)
    }

    /// What is asked for with `method` at a path as routes write it, `/v1/objects/{object}`.
    pub(crate) fn asked(&self, method: &Method, path: &str) -> Asked {
        let Some(methods) = self.0.get(path) else { return Asked::Unlisted };
        // What can be got can be asked for its headers alone.
        let method = if method == Method::HEAD { &Method::GET } else { method };
        match methods.get(method.as_str()) {
            Some(operation) => rule(operation).map_or(Asked::Unlisted, Asked::Operation),
            None => Asked::OtherMethod,
        }
    }

    /// The methods of a path as the header `Allow` lists them.
    pub(crate) fn methods(&self, path: &str) -> String {
        let methods: Vec<_> =
            self.0.get(path).into_iter().flat_map(BTreeMap::keys).copied().collect();
        let head = if methods.contains(&"GET") { ["HEAD"].as_slice() } else { &[] };
        [&methods, head].concat().join(",")
    }
}

/// Roles as a sentence lists them.
pub(crate) fn listed(roles: &[Role]) -> String {
    roles.iter().map(|role| name(*role)).collect::<Vec<_>>().join(", ")
}

/// A role as the API writes it.
pub(crate) fn name(role: Role) -> &'static str {
    match role {
        Robot => "robot",
        Trainer => "trainer",
        Viewer => "viewer",
        Admin => "admin",
    }
}
