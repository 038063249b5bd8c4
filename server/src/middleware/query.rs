//! Refuses the query of an operation without query parameters. Operations that have some refuse
//! unknown ones where they read them (`extract::Params`).

use std::collections::BTreeSet;
use std::sync::Arc;

use axum::extract::{MatchedPath, Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::cause::Cause;
use crate::refusal::Refusal;

/// Operations without parameters in their query, as path and method.
pub(crate) type Without = Arc<BTreeSet<(String, &'static str)>>;

/// Passes a request on unless its query would be ignored.
pub(crate) async fn heed(State(without): State<Without>, request: Request, next: Next) -> Response {
    match ignored(&without, &request) {
        Some(name) => {
            let detail = "is not a parameter of this operation, which has none";
            Refusal::from(Cause::field(format!("?{name}"), detail)).into_response()
        }
        None => next.run(request).await,
    }
}

/// The first parameter of a query that the operation would ignore.
fn ignored(without: &Without, request: &Request) -> Option<String> {
    let query = request.uri().query().filter(|query| !query.is_empty())?;
    let path = request.extensions().get::<MatchedPath>()?.as_str().to_owned();
    let method = if request.method() == Method::HEAD { "GET" } else { request.method().as_str() };
    let name: String = query.chars().take_while(|c| !"=&".contains(*c)).take(64).collect();
    let without: &BTreeSet<(String, &str)> = without;
    without.contains(&(path, method)).then_some(name)
}
