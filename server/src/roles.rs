//! The table of roles and the operations that they may call.
//!
//! Operations are named by their ids in the API's description. With keys, an operation
//! outside the table is refused, and a test fails. The description is made from this table
//! (`x-palpate-roles`, 401, 403), so the two always agree.

use std::collections::BTreeMap;

use axum::http::Method;
use palpate_schemas::Role::{self, Admin, Robot, Trainer, Viewer};

/// The permitted callers of an operation, and its effect.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    /// Id of the operation.
    pub(crate) operation: &'static str,
    /// Permitted callers.
    pub(crate) who: Who,
    /// Effect on stored data.
    pub(crate) effect: Effect,
}

/// Permitted callers of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Who {
    /// Every caller, also without a key.
    Anybody,
    /// Holders of a key with one of these roles.
    Holders(&'static [Role]),
}

/// Effect of an operation on stored data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// None.
    Reads,
    /// Adds readings of sessions, whose journal records the senders.
    Touches,
    /// Changes something, and is recorded in the audit log.
    Changes,
}

const ANYBODY: Who = Who::Anybody;
const ALL: Who = Who::Holders(&[Robot, Trainer, Viewer, Admin]);
const LOOKING: Who = Who::Holders(&[Trainer, Viewer, Admin]);
const TEACHING: Who = Who::Holders(&[Trainer, Admin]);
const TOUCHING: Who = Who::Holders(&[Robot, Admin]);
pub(crate) const RULING: Who = Who::Holders(&[Admin]);

use Effect::{Changes, Reads, Touches};

/// A new operation needs a line here.
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
    ("get_sensor_health", ALL, Reads),
    ("get_sensor_package", ALL, Reads),
    ("create_sensor", TEACHING, Changes),
    ("calibrate_sensor", TEACHING, Changes),
    ("commission_sensor", TEACHING, Changes),
    ("get_passport", ALL, Reads),
    ("list_reference_bodies", ALL, Reads),
    ("get_reference_mesh", ALL, Reads),
    ("delete_sensor", TEACHING, Changes),
    ("analyse_coverings", LOOKING, Reads),
    ("list_objects", LOOKING, Reads),
    ("get_object", LOOKING, Reads),
    ("get_mesh", LOOKING, Reads),
    ("get_thumbnail", LOOKING, Reads),
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
    ("get_interest", ALL, Reads),
    ("get_occupancy", ALL, Reads),
    ("get_occupancy_png", ALL, Reads),
    ("get_occupancy_ply", ALL, Reads),
    ("get_package", ALL, Reads),
    ("get_block", ALL, Reads),
    ("get_current", ALL, Reads),
    ("start_training", TEACHING, Changes),
    ("recalibrate_catalogue", TEACHING, Changes),
    ("shadow_version", TEACHING, Changes),
    ("merge_maps", TEACHING, Changes),
    ("set_current", TEACHING, Changes),
    ("delete_catalogue", TEACHING, Changes),
    ("delete_version", TEACHING, Changes),
    ("list_jobs", LOOKING, Reads),
    ("get_job", LOOKING, Reads),
    ("job_events", LOOKING, Reads),
    ("cancel_job", TEACHING, Changes),
    ("delete_job", TEACHING, Changes),
    ("list_sessions", ALL, Reads),
    ("get_session", ALL, Reads),
    ("get_fleet", LOOKING, Reads),
    ("get_forwarding", LOOKING, Reads),
    ("get_belief", ALL, Reads),
    ("get_marginals", ALL, Reads),
    ("ask_next_touches", ALL, Reads),
    ("session_events", ALL, Reads),
    ("events", ALL, Reads),
    ("create_session", TOUCHING, Changes),
    ("forward_session", TOUCHING, Changes),
    ("forward_entries", TOUCHING, Touches),
    ("set_session_labels", TOUCHING, Changes),
    ("set_object_labels", TEACHING, Changes),
    ("set_sensor_labels", TEACHING, Changes),
    ("set_catalogue_labels", TEACHING, Changes),
    ("set_alias", TEACHING, Changes),
    ("remove_alias", TEACHING, Changes),
    ("close_session", TOUCHING, Changes),
    ("close_sessions", TOUCHING, Changes),
    ("acknowledge_sessions", TEACHING, Changes),
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
    ("list_webhooks", RULING, Reads),
    ("get_webhook", RULING, Reads),
    ("list_webhook_deliveries", RULING, Reads),
    ("get_webhook_delivery", RULING, Reads),
    ("create_webhook", RULING, Changes),
    ("update_webhook", RULING, Changes),
    ("delete_webhook", RULING, Changes),
    ("rotate_webhook_secret", RULING, Changes),
    ("test_webhook", RULING, Changes),
    ("redeliver_webhook", RULING, Changes),
    ("list_audit", RULING, Reads),
    ("get_storage", LOOKING, Reads),
    ("take_snapshot", RULING, Changes),
    ("compact", RULING, Changes),
];

/// The operation of a request, according to the table.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Asked {
    /// An operation of the table.
    Operation(Rule),
    /// A path of the description, with a method that it does not have.
    OtherMethod,
    /// A path or operation that the description or the table does not have.
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

    /// The operation of `method` at a route's path, `/v1/objects/{object}`.
    pub(crate) fn asked(&self, method: &Method, path: &str) -> Asked {
        let Some(methods) = self.0.get(path) else { return Asked::Unlisted };
        // Every GET also answers HEAD.
        let method = if method == Method::HEAD { &Method::GET } else { method };
        match methods.get(method.as_str()) {
            Some(operation) => rule(operation).map_or(Asked::Unlisted, Asked::Operation),
            None => Asked::OtherMethod,
        }
    }

    /// The methods of a path, as in the header `Allow`.
    pub(crate) fn methods(&self, path: &str) -> String {
        let methods: Vec<_> =
            self.0.get(path).into_iter().flat_map(BTreeMap::keys).copied().collect();
        let head = if methods.contains(&"GET") { ["HEAD"].as_slice() } else { &[] };
        [&methods, head].concat().join(",")
    }
}

/// Roles as a list in a sentence.
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
