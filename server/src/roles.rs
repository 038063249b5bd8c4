//! Which role may call which operation: the one table that says so.
//!
//! Operations are named by their ids in the API's description. One that is not in the table
//! may be called by nobody where keys are asked for, and a test fails. The description is made
//! from this table (`x-palpate-roles`, 401, 403), so it cannot say anything else.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use axum::http::Method;
use palpate_schemas::Role::{self, Admin, Robot, Trainer, Viewer};

use crate::openapi;

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
const RULING: Who = Who::Holders(&[Admin]);

use Effect::{Changes, Reads, Touches};

/// A new operation gets its line here.
const TABLE: &[(&str, Who, Effect)] = &[
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

/// What is asked for with `method` at a path as routes write it, `/v1/objects/{object}`.
pub(crate) fn asked(method: &Method, path: &str) -> Asked {
    let Some(methods) = paths().get(path) else { return Asked::Unlisted };
    // What can be got can be asked for its headers alone.
    let method = if method == Method::HEAD { &Method::GET } else { method };
    match methods.get(method.as_str()) {
        Some(operation) => rule(operation).map_or(Asked::Unlisted, Asked::Operation),
        None => Asked::OtherMethod,
    }
}

/// The methods of a path as the header `Allow` lists them.
pub(crate) fn methods(path: &str) -> String {
    let methods: Vec<_> = paths().get(path).into_iter().flat_map(BTreeMap::keys).copied().collect();
    let head = if methods.contains(&"GET") { ["HEAD"].as_slice() } else { &[] };
    [&methods, head].concat().join(",")
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

/// Ids of operations by path and method.
fn paths() -> &'static BTreeMap<String, BTreeMap<&'static str, String>> {
    static PATHS: OnceLock<BTreeMap<String, BTreeMap<&'static str, String>>> = OnceLock::new();
    PATHS.get_or_init(|| {
        let mut paths: BTreeMap<_, BTreeMap<_, _>> = BTreeMap::new();
        for (path, method, operation) in openapi::operation_ids() {
            paths.entry(path).or_default().insert(method, operation);
        }
        paths
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn may(operation: &str, role: Role) -> bool {
        matches!(rule(operation).unwrap().who, Who::Holders(roles) if roles.contains(&role))
    }

    #[test]
    fn every_operation_has_one_line_and_every_line_an_operation() {
        let described: BTreeSet<String> =
            openapi::operation_ids().into_iter().map(|(_, _, operation)| operation).collect();
        let listed: BTreeSet<String> =
            TABLE.iter().map(|(operation, _, _)| (*operation).to_owned()).collect();
        assert_eq!(described, listed, "a new operation needs a line in the table of roles");
        assert_eq!(TABLE.len(), listed.len(), "two lines for one operation");
    }

    #[test]
    fn what_roles_promise_holds_for_every_operation() {
        for (_, method, operation) in openapi::operation_ids() {
            let rule = rule(&operation).unwrap();
            let Who::Holders(_) = rule.who else {
                assert_eq!(method, "GET", "{operation} changes things without a key");
                continue;
            };
            assert!(may(&operation, Admin), "admin: {operation}");
            if may(&operation, Viewer) {
                assert_eq!(rule.effect, Reads, "viewer: {operation}");
                assert!(may(&operation, Trainer), "trainer sees less than viewer: {operation}");
            }
            if may(&operation, Robot) && rule.effect != Reads {
                let of_readings = ["add_readings", "retract_reading", "retract_robot_reading"];
                let of_sessions =
                    operation.contains("session") || of_readings.contains(&operation.as_str());
                assert!(of_sessions, "robot: {operation}");
            }
            if operation.contains("key") || operation.contains("audit") {
                assert_eq!(rule.who, RULING, "{operation}");
            }
            if matches!(method, "PUT" | "PATCH" | "DELETE") {
                assert_eq!(rule.effect, Changes, "{operation}");
            }
            if method == "GET" {
                assert_eq!(rule.effect, Reads, "{operation}");
            }
        }
    }

    #[test]
    fn what_is_not_listed_is_not_found_in_the_table() {
        assert!(matches!(asked(&Method::GET, "/v1/objects"), Asked::Operation(_)));
        assert!(matches!(asked(&Method::HEAD, "/v1/objects"), Asked::Operation(_)));
        assert!(matches!(asked(&Method::DELETE, "/v1/objects"), Asked::OtherMethod));
        assert!(matches!(asked(&Method::GET, "/v1/secret-door"), Asked::Unlisted));
        assert!(rule("no_such_operation").is_none());
    }
}
