//! The operations of the routes, one by one.

use std::collections::BTreeSet;

use utoipa::openapi::RefOr;
use utoipa::openapi::path::{Operation, ParameterIn, PathItem};

use crate::routes;

/// Every operation as path, method and id.
pub(crate) fn operation_ids() -> Vec<(String, &'static str, String)> {
    let mut ids = Vec::new();
    for (path, item) in &mut routes::api().into_openapi().paths.paths {
        for (method, operation) in operations(item) {
            ids.push((path.clone(), method, operation.operation_id.clone().unwrap_or_default()));
        }
    }
    ids
}

/// The operations without parameters in their query, as path and method.
pub(crate) fn operations_without_query() -> BTreeSet<(String, &'static str)> {
    let mut found = BTreeSet::new();
    for (path, item) in &mut routes::api().into_openapi().paths.paths {
        for (method, operation) in operations(item) {
            let parameters = operation.parameters.iter().flatten();
            let mut places = parameters.map(|parameter| match parameter {
                RefOr::T(parameter) => Some(&parameter.parameter_in),
                RefOr::Ref(_) => None,
            });
            if !places.any(|place| place == Some(&ParameterIn::Query)) {
                found.insert((path.clone(), method));
            }
        }
    }
    found
}

/// The operations of a path, with their methods.
pub(super) fn operations(
    item: &mut PathItem,
) -> impl Iterator<Item = (&'static str, &mut Operation)> {
    [
        ("GET", &mut item.get),
        ("PUT", &mut item.put),
        ("POST", &mut item.post),
        ("PATCH", &mut item.patch),
        ("DELETE", &mut item.delete),
    ]
    .into_iter()
    .filter_map(|(method, operation)| Some((method, operation.as_mut()?)))
}
