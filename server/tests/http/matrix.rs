//! Tests of every endpoint with every role, without a key, with a revoked and with a
//! malformed one.
//!
//! Generated from the API's description: an operation that does not state its callers fails
//! here, and so does one that accepts or refuses other callers than stated.

use reqwest::Method;
use serde_json::{Map, Value};

use crate::harness::{Answer, Harness};

const ROLES: [&str; 4] = ["robot", "trainer", "viewer", "admin"];
/// Operations without a key. A new operation is not among them by oversight.
const OPEN: [&str; 3] = ["livez", "readyz", "version"];

/// An endpoint of the description.
struct Endpoint {
    id: String,
    method: Method,
    path: String,
    /// `None` when it needs no key.
    roles: Option<Vec<String>>,
}

fn endpoints() -> Vec<Endpoint> {
    let document: Value = serde_json::from_str(palpate_server::openapi::text()).unwrap();
    let paths = document["paths"].as_object().unwrap();
    let of_path = |(path, item): (&String, &Value)| {
        let item = item.as_object().unwrap();
        item.iter().map(|(method, operation)| endpoint(method, path, operation)).collect::<Vec<_>>()
    };
    paths.iter().flat_map(of_path).collect()
}

fn endpoint(method: &str, path: &str, operation: &Value) -> Endpoint {
    let id = operation["operationId"].as_str().unwrap().to_owned();
    let named = operation["x-palpate-roles"].as_array();
    let roles = named.map(|roles| roles.iter().map(|r| r.as_str().unwrap().to_owned()).collect());
    assert_eq!(roles.is_none(), OPEN.contains(&id.as_str()), "{id} does not say who may call it");
    let responses = operation["responses"].as_object().unwrap();
    for status in ["401", "403"] {
        assert_eq!(responses.contains_key(status), roles.is_some(), "{id}: {status}");
    }
    let security = match roles {
        Some(_) => serde_json::json!([{"key": []}, {}]),
        None => serde_json::json!([]),
    };
    assert_eq!(operation["security"], security, "{id}: security");
    let method = method.to_uppercase().parse().unwrap();
    Endpoint { id, method, path: filled(path), roles }
}

/// The path with parameters that do not exist.
fn filled(path: &str) -> String {
    let segment = |segment: &str| match segment {
        "{version}" => "1".to_owned(),
        "{session}" | "{job}" => "01890000-0000-7000-8000-000000000000".to_owned(),
        other if other.starts_with('{') => "nothing".to_owned(),
        other => other.to_owned(),
    };
    path.split('/').map(segment).collect::<Vec<_>>().join("/")
}

async fn ask(it: &Harness, endpoint: &Endpoint, key: Option<&str>) -> Answer {
    it.send_as(key, endpoint.method.clone(), &endpoint.path).await
}

fn check(endpoint: &Endpoint, role: &str, answer: &Answer, responses: &Map<String, Value>) {
    let Endpoint { id, roles, .. } = endpoint;
    let status = answer.status.as_u16();
    assert!(responses.contains_key(&status.to_string()), "{id} as {role}: {status} is undeclared");
    let may = roles.as_ref().is_none_or(|roles| roles.iter().any(|named| named == role));
    if may {
        assert!(!matches!(status, 401 | 403), "{id} keeps {role} out: {answer:?}");
        assert!(status < 500, "{id} as {role}: {answer:?}");
        return;
    }
    let problem = answer.problem(403, "forbidden", None);
    let detail = problem["detail"].as_str().unwrap();
    for named in roles.iter().flatten() {
        assert!(detail.contains(named.as_str()), "{id}: {detail} does not name {named}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_endpoint_accepts_exactly_its_stated_roles() {
    let it = Harness::guarded().await;
    let document: Value = serde_json::from_str(palpate_server::openapi::text()).unwrap();
    let mut holders = Vec::new();
    for role in ROLES {
        holders.push((role, it.new_key(&format!("a-{role}"), role).await));
    }
    let revoked = it.new_key("revoked", "admin").await;
    it.send(Method::DELETE, "/v1/keys/revoked", None).await.expect(204);
    let garbage = format!("palpate_{}_{}", "0".repeat(32), "f".repeat(64));

    let endpoints = endpoints();
    assert!(endpoints.len() > 50, "{}", endpoints.len());
    for endpoint in &endpoints {
        let item = document["paths"].as_object().unwrap().values().find_map(|item| {
            item.as_object().unwrap().values().find(|o| o["operationId"] == endpoint.id.as_str())
        });
        let responses = item.unwrap()["responses"].as_object().unwrap();
        for (role, key) in &holders {
            check(endpoint, role, &ask(&it, endpoint, Some(key)).await, responses);
        }
        for stranger in [None, Some(revoked.as_str()), Some(&garbage), Some("Bearer"), Some("é")] {
            let answer = ask(&it, endpoint, stranger).await;
            if endpoint.roles.is_none() {
                answer.expect(200);
                continue;
            }
            answer.problem(401, "unauthenticated", None);
            assert!(answer.headers.contains_key("www-authenticate"), "{}", endpoint.id);
        }
    }
    // None of these requests changed more than it was permitted to.
    assert_eq!(it.get("/v1/objects").await.expect(200)["items"], serde_json::json!([]));
    assert_eq!(it.get("/v1/keys").await.expect(200)["items"].as_array().unwrap().len(), 6);
}
