//! Authentication and authorisation of requests.
//!
//! With keys, a request needs one whose role is listed for the operation in the table of
//! `roles`; an operation outside the table is refused. Without keys, the server is for its
//! own machine, and requests from pages of other sites in that machine's browser are refused:
//! they would otherwise have full access.

use std::net::IpAddr;

use axum::extract::{ConnectInfo, MatchedPath, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use palpate_store::access::AccessKey;

use crate::app::App;
use crate::client::Client;
use crate::dashboard;
use crate::door::Peer;
use crate::middleware::caller::Caller;
use crate::middleware::once::Host;
use crate::middleware::telemetry::REQUEST_ID;
use crate::refusal::{AccessError, Refusal};
use crate::roles::{Asked, Effect, Rule, Who};
use crate::secret::redacted;
use crate::services::audit::Attempt;
use crate::wire;

/// Admits or refuses a request.
pub(crate) async fn guard(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let asked = asked(&app, &request);
    let checked = check(&app, &request, asked);
    match checked {
        Ok(caller) => {
            if let Asked::Operation(Rule { operation, effect: Effect::Changes, .. }) = asked {
                let attempt = attempt(&request, operation, caller.key.as_ref());
                request.extensions_mut().insert(attempt);
            }
            let touched = match asked {
                Asked::Operation(Rule { operation, effect: Effect::Touches, .. }) => {
                    caller.key.as_ref().map(|key| attempt(&request, operation, Some(key)))
                }
                _ => None,
            };
            keep_connection(&app, &request, &caller);
            request.extensions_mut().insert(caller);
            let response = next.run(request).await;
            if let Some(attempt) = touched.filter(|_| response.status() == StatusCode::FORBIDDEN) {
                app.audit.denied(attempt, StatusCode::FORBIDDEN.as_u16()).await;
            }
            response
        }
        Err(error) => {
            let operation = match asked {
                Asked::Operation(rule) => rule.operation,
                Asked::OtherMethod | Asked::Unlisted => "(none)",
            };
            let key = match &error {
                AccessError::Unauthenticated(fault) => fault.key().cloned(),
                AccessError::Forbidden { key, .. } => Some((**key).clone()),
                _ => None,
            };
            let attempt = attempt(&request, operation, key.as_ref());
            let response = Refusal::from(error).into_response();
            if matches!(response.status(), StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN) {
                app.audit.denied(attempt, response.status().as_u16()).await;
            }
            response
        }
    }
}

/// Keeps the connection of a client that showed a key, or that needs none here.
fn keep_connection(app: &App, request: &Request, caller: &Caller) {
    let Some(ConnectInfo(peer)) = request.extensions().get::<ConnectInfo<Peer>>() else { return };
    match &caller.key {
        Some(key) => peer.place.admit(Client::Key(key.id)),
        None if !app.keys.required() => peer.place.admit(Client::at(peer.address.ip())),
        None => {}
    }
}

fn asked(app: &App, request: &Request) -> Asked {
    let route = request.extensions().get::<MatchedPath>();
    route.map_or(Asked::Unlisted, |route| app.operations.asked(request.method(), route.as_str()))
}

fn check(app: &App, request: &Request, asked: Asked) -> Result<Caller, AccessError> {
    let nobody = Caller { key: None };
    if !app.keys.required() {
        at_home(app, request)?;
        return Ok(nobody);
    }
    let who = match asked {
        Asked::Unlisted if is_page(request.uri().path()) => Who::Anybody,
        Asked::Operation(Rule { operation: "metrics", .. }) if app.config.open_metrics => {
            Who::Anybody
        }
        Asked::Operation(rule) => rule.who,
        // The description is open, so this reveals nothing.
        Asked::OtherMethod => {
            let route = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
            return Err(AccessError::OtherMethod { allow: app.operations.methods(route) });
        }
        Asked::Unlisted => Who::Holders(&[]),
    };
    let Who::Holders(roles) = who else { return Ok(nobody) };
    let header = request.headers().get(header::AUTHORIZATION);
    let key = app.keys.verify(header.map(|value| value.as_bytes()))?;
    match asked {
        // Without a route the answer is 404, and reveals nothing.
        Asked::Unlisted if request.extensions().get::<MatchedPath>().is_none() => {}
        _ if roles.contains(&wire::access::role(key.role)) => {}
        _ => return Err(AccessError::Forbidden { key: Box::new(key), roles }),
    }
    Ok(Caller { key: Some(key) })
}

/// Pages for people and the API's description, which contain no stored data.
fn is_page(path: &str) -> bool {
    matches!(path, "/openapi.json" | "/docs") || path.starts_with("/docs/") || dashboard::has(path)
}

/// Refuses a request from another site's page in a browser of this machine: its origin is not
/// ours, or the host is not one of this machine's names (a name that was made to point here).
fn at_home(app: &App, request: &Request) -> Result<(), AccessError> {
    let config = &app.config;
    let headers = request.headers();
    let host = request.extensions().get::<Host>().map_or("", |Host(host)| host.as_str());
    let is_own = is_loopback(host)
        || !config.listen.ip().is_loopback() && is_in_network(host, &config.host_names);
    if !host.is_empty() && !is_own {
        return Err(AccessError::ForeignHost { host: host.to_owned() });
    }
    let Some(origin) = headers.get(header::ORIGIN) else { return Ok(()) };
    let origin = String::from_utf8_lossy(origin.as_bytes());
    let scheme = if config.tls.is_some() { "https" } else { "http" };
    let is_own = !host.is_empty() && origin.eq_ignore_ascii_case(&format!("{scheme}://{host}"));
    if is_own || config.cors_origins.iter().any(|allowed| *allowed == origin) {
        return Ok(());
    }
    Err(AccessError::ForeignOrigin { origin: origin.into_owned() })
}

/// Whether a `Host` header names this machine.
fn is_loopback(host: &str) -> bool {
    let name = without_port(host);
    literal(name).is_some_and(|address| address.is_loopback())
        || name.eq_ignore_ascii_case("localhost")
        || name.to_ascii_lowercase().ends_with(".localhost")
}

/// Whether a `Host` header is an address, to which no other site's name leads, or a name that
/// the operator listed.
fn is_in_network(host: &str, listed: &[String]) -> bool {
    let name = without_port(host);
    literal(name).is_some() || listed.iter().any(|listed| name.eq_ignore_ascii_case(listed))
}

/// A `Host` header without its port.
fn without_port(host: &str) -> &str {
    // An IPv6 address contains colons.
    if host.starts_with('[') {
        return host.rsplit_once("]:").map_or(host, |(name, _)| name);
    }
    host.rsplit_once(':').map_or(host, |(name, port)| {
        if port.bytes().all(|byte| byte.is_ascii_digit()) { name } else { host }
    })
}

fn literal(name: &str) -> Option<IpAddr> {
    name.trim_matches(['[', ']']).parse().ok()
}

fn attempt(request: &Request, operation: &'static str, key: Option<&AccessKey>) -> Attempt {
    let peer = request.extensions().get::<ConnectInfo<Peer>>();
    let id = request.headers().get(REQUEST_ID).and_then(|id| id.to_str().ok());
    let address = peer.map(|ConnectInfo(peer)| peer.address.ip());
    Attempt {
        operation,
        client: key.map(|key| Client::Key(key.id)).or(address.map(Client::at)),
        key: key.map(|key| (key.id, key.name.clone(), key.role)),
        address: address.map_or_else(String::new, |address| address.to_string()),
        path: redacted(request.uri().path()).into_owned(),
        request_id: id.unwrap_or_default().to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_this_machine_are_recognised() {
        for host in [
            "localhost",
            "LOCALHOST:7411",
            "127.0.0.1",
            "127.0.0.1:80",
            "[::1]:7411",
            "[::1]",
            "palpate.localhost:1",
        ] {
            assert!(is_loopback(host), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example:7411", "10.0.0.1", "[2001:db8::1]:1"] {
            assert!(!is_loopback(host), "{host}");
        }
    }

    #[test]
    fn in_a_network_addresses_and_listed_names_are_accepted() {
        let listed = ["palpate.lab".to_owned()];
        for host in ["10.0.0.1:7411", "[2001:db8::1]:7411", "[2001:db8::1]", "Palpate.Lab:7411"] {
            assert!(is_in_network(host, &listed), "{host}");
        }
        for host in
            ["evil.example", "palpate.lab.evil.example:7411", "lab", "10.0.0.1.evil.example"]
        {
            assert!(!is_in_network(host, &listed), "{host}");
        }
    }

    #[test]
    fn only_pages_are_pages() {
        assert!(is_page("/docs/swagger-ui.css") && is_page("/"));
        assert!(!is_page("/v1/objects") && !is_page("/docsx") && !is_page("/metrics"));
    }
}
