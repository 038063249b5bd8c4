//! Tests of API keys: created, used, rotated, revoked; and of servers without keys.

use palpate_server::{Access, Config, Server, StartError};
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Harness, config, quiet_reading};

const UNAUTHENTICATED: &str = "unauthenticated";

fn get() -> Method {
    Method::GET
}

#[tokio::test(flavor = "multi_thread")]
async fn without_keys_local_callers_have_full_access() {
    let it = Harness::start().await;
    let whoami = it.get("/v1/whoami").await.expect(200);
    assert_eq!(
        whoami,
        json!({"keys_required": false, "role": "admin", "key": null, "quota_bytes": null})
    );
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
}

#[tokio::test(flavor = "multi_thread")]
async fn with_keys_every_request_needs_one() {
    let it = Harness::guarded().await;
    let whoami = it.get("/v1/whoami").await.expect(200);
    assert_eq!((&whoami["role"], &whoami["key"]["name"]), (&json!("admin"), &json!("admin")));
    let admin = it.key.clone().unwrap();
    for (sent, expected) in [
        (None, "Bearer realm=\"palpate\""),
        (Some("palpate_x"), "Bearer realm=\"palpate\", error=\"invalid_token\""),
        (Some(&admin[..104]), "Bearer realm=\"palpate\", error=\"invalid_token\""),
    ] {
        let refused = it.send_as(sent, get(), "/v1/objects").await;
        refused.problem(401, UNAUTHENTICATED, None);
        assert_eq!(refused.headers["www-authenticate"], expected);
    }
    // The valid key's id with another secret of the same length.
    let forged = format!("{}{}", &admin[..41], "0".repeat(64));
    it.send_as(Some(&forged), get(), "/v1/objects").await.problem(401, UNAUTHENTICATED, None);
    for open in ["/livez", "/readyz", "/version", "/openapi.json", "/docs/", "/", "/assets/app.css"]
    {
        assert_eq!(it.send_as(None, get(), open).await.status, 200, "{open}");
    }
    it.send_as(None, get(), "/metrics").await.problem(401, UNAUTHENTICATED, None);
    it.send_as(None, get(), "/v1/no-such-thing").await.problem(401, UNAUTHENTICATED, None);
    it.get("/v1/no-such-thing").await.problem(404, "not-found", None);
    let wrong = it.send_as(None, Method::DELETE, "/v1/sensors").await;
    wrong.problem(405, "method-not-allowed", None);
    assert_eq!(wrong.headers["allow"], "GET,POST,HEAD");
    let basic = it.client.get(it.url("/v1/objects")).basic_auth("a", Some("b")).send().await;
    assert_eq!(basic.unwrap().status(), 401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_is_valid_until_revoked_across_restarts() {
    let it = Harness::guarded().await;
    let wanted = json!({"name": "arm-3", "role": "robot", "expires_in_s": 3600});
    let created = it.post("/v1/keys", &wanted).await;
    let location = created.headers["location"].to_str().unwrap().to_owned();
    let created = created.expect(201);
    let robot = created["secret"].as_str().unwrap().to_owned();
    assert_eq!(created["key"]["role"], "robot");
    assert_eq!(created["key"]["last_used_at"], Value::Null);
    let taken = it.post("/v1/keys", &wanted).await;
    taken.problem(409, "conflict", Some("/name"));

    let whoami = it.send_as(Some(&robot), get(), "/v1/whoami").await.expect(200);
    assert_eq!((&whoami["role"], &whoami["key"]["name"]), (&json!("robot"), &json!("arm-3")));
    let shown = it.get(&location).await.expect(200);
    assert_ne!(shown["last_used_at"], Value::Null);
    let listed = it.get("/v1/keys").await;
    assert!(!listed.text.contains("secret") && !listed.text.contains("hash"), "{}", listed.text);
    assert_eq!(listed.expect(200)["items"].as_array().unwrap().len(), 2);

    let refused = it.send_as(Some(&robot), Method::DELETE, "/v1/objects/mug").await;
    let refused = refused.problem(403, "forbidden", None);
    let detail = refused["detail"].as_str().unwrap();
    assert!(detail.contains("robot") && detail.contains("trainer, admin"), "{detail}");

    let it = it.restart().await;
    it.send_as(Some(&robot), get(), "/v1/sessions").await.expect(200);
    it.send_as(None, get(), "/v1/sessions").await.problem(401, UNAUTHENTICATED, None);
    it.send(Method::DELETE, "/v1/keys/arm-3", None).await.expect(204);
    it.send(Method::DELETE, "/v1/keys/arm-3", None).await.expect(204);
    let gone = it.send_as(Some(&robot), get(), "/v1/sessions").await;
    let gone = gone.problem(401, UNAUTHENTICATED, None);
    assert!(gone["detail"].as_str().unwrap().contains("revoked"), "{gone}");
    let revoked = it.get("/v1/keys/arm-3").await.expect(200);
    assert_eq!(revoked["active"], false);
    // The name is free again, and belongs to the new key.
    it.new_key("arm-3", "viewer").await;
    assert_eq!(it.get("/v1/keys/arm-3").await.expect(200)["role"], "viewer");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_previous_secret_is_valid_for_its_grace_period() {
    let it = Harness::guarded().await;
    let first = it.new_key("arm-3", "robot").await;
    let rotate = async |body: Value| it.post("/v1/keys/arm-3/rotate", &body).await;
    let second = rotate(json!({"grace_s": 600})).await.expect(200);
    assert_ne!(second["key"]["rotating_until"], Value::Null);
    let second = second["secret"].as_str().unwrap();
    for secret in [&first, second] {
        it.send_as(Some(secret), get(), "/v1/whoami").await.expect(200);
    }
    let third = rotate(json!({})).await.expect(200);
    let third = third["secret"].as_str().unwrap();
    it.send_as(Some(third), get(), "/v1/whoami").await.expect(200);
    for secret in [&first, second] {
        it.send_as(Some(secret), get(), "/v1/whoami").await.problem(401, UNAUTHENTICATED, None);
    }
    let long = rotate(json!({"grace_s": 2_592_001})).await;
    long.problem(422, "invalid-value", Some("/grace_s"));
    it.send(Method::DELETE, "/v1/keys/arm-3", None).await.expect(204);
    rotate(json!({})).await.problem(409, "wrong-state", None);
    it.post("/v1/keys/nobody/rotate", &json!({})).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_end_with_the_key_that_opened_them() {
    let it = Harness::guarded_and_trained().await;
    let session = it.session(json!({})).await;
    let created = it.post("/v1/keys", &json!({"name": "screen", "role": "viewer"})).await;
    let other = it.post("/v1/keys", &json!({"name": "wall", "role": "viewer"})).await;
    let open = async |key: &Value| {
        let path = it.url(&format!("/v1/sessions/{session}/events"));
        let stream = it.client.get(path).bearer_auth(key["secret"].as_str().unwrap());
        stream.send().await.unwrap()
    };
    let (screen, rotated) = (created.expect(201), other.expect(201));
    let (screen, mut wall) = (open(&screen).await, open(&rotated).await);
    assert!(wall.chunk().await.unwrap().is_some(), "the belief as it is");
    it.send(Method::DELETE, "/v1/keys/screen", None).await.expect(204);
    let text = screen.text().await.unwrap();
    assert!(text.contains("event: belief") && !text.contains("closed"), "{text}");

    // The other stream continues until its secret is replaced.
    it.post(&format!("/v1/sessions/{session}/readings"), &json!({"readings": [quiet_reading()]}))
        .await
        .expect(200);
    assert!(wall.chunk().await.unwrap().is_some(), "the next belief");
    it.post("/v1/keys/wall/rotate", &json!({})).await.expect(200);
    while wall.chunk().await.unwrap().is_some() {}
}

#[tokio::test(flavor = "multi_thread")]
async fn the_last_admin_key_cannot_be_removed() {
    let it = Harness::guarded().await;
    let last = it.send(Method::DELETE, "/v1/keys/admin", None).await;
    let last = last.problem(409, "wrong-state", None);
    assert!(last["detail"].as_str().unwrap().contains("last valid admin key"), "{last}");
    let other = it.new_key("other", "admin").await;
    it.send(Method::DELETE, "/v1/keys/admin", None).await.expect(204);
    it.get("/v1/keys").await.problem(401, UNAUTHENTICATED, None);
    let last = it.send_as(Some(&other), Method::DELETE, "/v1/keys/other").await;
    last.problem(409, "wrong-state", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_keys_are_refused() {
    let it = Harness::guarded().await;
    for (body, pointer) in [
        (json!({"name": "a b", "role": "robot"}), "/name"),
        (json!({"name": "a", "role": "boss"}), "/role"),
        (json!({"name": "a"}), "/role"),
        (json!({"name": "a", "role": "robot", "expires_in_s": 59}), "/expires_in_s"),
        (json!({"name": "a", "role": "robot", "expires": 60}), "/expires"),
    ] {
        it.post("/v1/keys", &body).await.problem(422, "invalid-value", Some(pointer));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_required_from_the_start_after_the_first() {
    let it = Harness::start().await;
    let robot = it.new_key("arm-3", "robot").await;
    it.get("/v1/objects").await.expect(200);
    let mut it = it.restart().await;
    it.get("/v1/objects").await.problem(401, UNAUTHENTICATED, None);
    it.send_as(Some(&robot), get(), "/v1/sessions").await.expect(200);
    // No admin key was usable, so one was created; the next start creates none.
    it.key = it.server.take_admin_key();
    it.get("/v1/keys/admin").await.expect(200);
    assert_eq!(it.server.take_admin_key(), None);
    let mut it = it.restart().await;
    assert_eq!(it.server.take_admin_key(), None);
    it.get("/v1/keys").await.expect(200);
    // An administrator who has lost the key creates another one.
    let mut it = it.restart_with(|config| config.new_admin_key = true).await;
    it.key = it.server.take_admin_key();
    assert_eq!(it.get("/v1/whoami").await.expect(200)["key"]["name"], "admin-2");
    let it = it.restart_with(|config| config.access = Access::Open).await;
    it.send_as(None, get(), "/v1/keys").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn other_machines_need_keys() {
    let folder = tempfile::TempDir::new().unwrap();
    let mut open = config(folder.path());
    open.listen = "0.0.0.0:0".parse().unwrap();
    for access in [Access::Auto, Access::Open] {
        open.access = access;
        let error = Server::start(open.clone()).await.unwrap_err();
        assert!(matches!(error, StartError::InsecureBind { .. }), "{error}");
        assert!(error.to_string().contains("--access keys"), "{error}");
    }
    let insecure = Config { insecure_bind: true, ..open.clone() };
    Server::start(insecure).await.unwrap().shutdown().await;
    open.access = Access::Keys;
    let mut server = Server::start(open.clone()).await.unwrap();
    assert!(server.take_admin_key().is_some());
    server.shutdown().await;
    // A key is stored by now.
    open.access = Access::Auto;
    Server::start(open).await.unwrap().shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn open_metrics_need_no_key() {
    let it = Harness::start_with(|config| {
        (config.access, config.open_metrics) = (Access::Keys, true);
    })
    .await;
    assert_eq!(it.send_as(None, get(), "/metrics").await.status, 200);
    it.send_as(None, get(), "/v1/objects").await.problem(401, UNAUTHENTICATED, None);
}
