//! The table of roles, checked against the operations of the API's description.

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use axum::http::Method;
    use palpate_schemas::Role::{self, Admin, Robot, Trainer, Viewer};

    use crate::openapi::operation_ids;
    use crate::roles::Effect::{Changes, Reads};
    use crate::roles::{Asked, Operations, RULING, TABLE, Who, rule};

    fn may(operation: &str, role: Role) -> bool {
        matches!(rule(operation).unwrap().who, Who::Holders(roles) if roles.contains(&role))
    }

    #[test]
    fn operations_and_lines_of_the_table_match() {
        let described: BTreeSet<String> =
            operation_ids().into_iter().map(|(_, _, operation)| operation).collect();
        let listed: BTreeSet<String> =
            TABLE.iter().map(|(operation, _, _)| (*operation).to_owned()).collect();
        assert_eq!(described, listed, "a new operation needs a line in the table of roles");
        assert_eq!(TABLE.len(), listed.len(), "two lines for one operation");
    }

    #[test]
    fn every_operation_keeps_the_promises_of_roles() {
        for (_, method, operation) in operation_ids() {
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
                let of_readings =
                    ["add_readings", "forward_entries", "retract_reading", "retract_robot_reading"];
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
    fn unlisted_operations_are_not_found_in_the_table() {
        let operations = Operations::new(operation_ids());
        let asked = |method: &Method, path: &str| operations.asked(method, path);
        assert!(matches!(asked(&Method::GET, "/v1/objects"), Asked::Operation(_)));
        assert!(matches!(asked(&Method::HEAD, "/v1/objects"), Asked::Operation(_)));
        assert!(matches!(asked(&Method::DELETE, "/v1/objects"), Asked::OtherMethod));
        assert!(matches!(asked(&Method::GET, "/v1/secret-door"), Asked::Unlisted));
        assert!(rule("no_such_operation").is_none());
    }
}
