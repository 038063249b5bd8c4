//! Tests of bad input: a problem names the field, nothing is stored, the server continues.

use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{CUBE, Harness, off_box, quiet_reading};

const HUGE: &str = "OFF\n3 1 0\n0 0 0\n1e9 0 0\n0 1e9 0\n3 0 1 2\n";
const FLAT: &str = "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n";
const NOT_FINITE: &str = "OFF\n3 1 0\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n";
const INFINITE: &str = "OFF\n3 1 0\n0 0 1e999\n1 0 0\n0 1 0\n3 0 1 2\n";
const NO_FACES: &str = "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n";
const OUT_OF_RANGE: &str = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n";
const LYING_COUNT: &str = "OFF\n4000000000 1 0\n0 0 0\n";

#[tokio::test(flavor = "multi_thread")]
async fn invalid_meshes_are_refused() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    for mesh in ["", "OFF", HUGE, FLAT, NOT_FINITE, INFINITE, NO_FACES, OUT_OF_RANGE, LYING_COUNT] {
        it.put_mesh("mug", mesh).await.problem(422, "invalid-value", Some(""));
    }
    let off = || Some(("model/off", off_box(CUBE).into_bytes()));
    let path = "/v1/objects/mug/mesh";
    let put = async |query: &str, body| it.send(Method::PUT, &format!("{path}{query}"), body).await;
    put("", off()).await.problem(422, "invalid-value", Some("?unit"));
    put("?unit=inch", off()).await.problem(422, "invalid-value", Some("?unit"));
    let plain = || Some(("application/octet-stream", off_box(CUBE).into_bytes()));
    put("?unit=m", plain()).await.problem(422, "invalid-value", Some("?format"));
    put("?unit=m&format=stl", off()).await.problem(422, "invalid-value", Some("?format"));
    let picture = Some(("image/png", vec![1, 2, 3]));
    put("?unit=m", picture).await.problem(415, "unsupported-media-type", None);
    let unknown = it.put_mesh("cup", &off_box(CUBE)).await;
    unknown.problem(404, "not-found", None);
    assert_eq!(it.get("/v1/objects/mug").await.expect(200)["mesh"], Value::Null);
    it.put_mesh("mug", &off_box(CUBE)).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn too_large_and_malformed_bodies_are_refused() {
    let it = Harness::start_with(|config| {
        config.json_bytes_max = 10_000;
        config.mesh_bytes_max = 20_000;
    })
    .await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    let readings = json!({"readings": vec![quiet_reading(); 200]});
    let large = it.post("/v1/objects/mug/readings", &readings).await;
    large.problem(413, "body-too-large", None);
    let large = it.put_mesh("mug", &" ".repeat(1_000_000)).await;
    large.problem(413, "body-too-large", None);
    let broken: [&[u8]; 6] =
        [b"", b"{\"name\": \"cup\"", b"{\"name\": NaN}", b"\xff\xfe", b"[[[[", b"{} {}"];
    for body in broken {
        let body = Some(("application/json", body.to_vec()));
        let refused = it.send(Method::POST, "/v1/objects", body).await;
        assert!([400, 422].contains(&refused.status.as_u16()), "{refused:?}");
        refused.problem(
            refused.status.as_u16(),
            if refused.status == 400 { "malformed-request" } else { "invalid-value" },
            None,
        );
    }
    let deep = Some(("application/json", vec![b'['; 9_000]));
    let deep = it.send(Method::POST, "/v1/objects", deep).await;
    assert!(deep.status.is_client_error(), "{deep:?}");
    let typo = it.post("/v1/objects", &json!({"name": "cup", "colour": "red"})).await;
    typo.problem(422, "invalid-value", Some("/colour"));
    it.post("/v1/objects", &json!({})).await.problem(422, "invalid-value", Some("/name"));
    it.post("/v1/objects", &json!({"name": 7})).await.problem(422, "invalid-value", Some("/name"));
    let objects = it.get("/v1/objects").await.expect(200);
    assert_eq!(objects["items"].as_array().unwrap().len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_array_is_not_accepted_for_an_object() {
    let it = Harness::start().await;
    for path in ["/v1/objects", "/v1/sessions", "/v1/catalogues/default/trainings"] {
        for body in [json!(["mug"]), json!([null, null])] {
            it.post(path, &body).await.problem(422, "invalid-value", Some(""));
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_readings_are_refused() {
    let it = Harness::trained().await;
    let session = it.session(json!({"frame_id": "base_link"})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let check = async |at: &str, value: Value, pointer: &str| {
        let mut reading = quiet_reading();
        *reading.pointer_mut(at).unwrap() = value;
        let body = json!({"readings": [quiet_reading(), reading]});
        let pointer = format!("/readings/1{pointer}");
        it.post(&path, &body).await.problem(422, "invalid-value", Some(&pointer))
    };
    check("/image", json!(vec![0.0; 35]), "/image").await;
    check("/image", json!([]), "/image").await;
    check("/image/3", json!(1e39), "/image/3").await;
    check("/image/3", json!("soft"), "/image/3").await;
    let zeros = check("/pose/orientation", json!([0, 0, 0, 0]), "/pose/orientation").await;
    assert!(zeros["detail"].as_str().unwrap().contains("nobody has set"), "{zeros}");
    check("/pose/orientation", json!([0, 0, 0, 2]), "/pose/orientation").await;
    check("/pose/orientation", json!([0, 0, 1]), "/pose/orientation").await;
    check("/pose/position/1", Value::Null, "/pose/position/1").await;
    check("/pose/position/1", json!(1e300), "/pose/position/1").await;
    check("/sensor", json!("left-hand"), "/sensor").await;
    check("/sensor", json!("fingertip-14x14"), "/image").await;

    let mut reading = quiet_reading();
    reading["frame_id"] = json!("tool0");
    let other = it.post(&path, &json!({"readings": [reading]})).await;
    let other = other.problem(422, "invalid-value", Some("/readings/0/frame_id"));
    assert!(other["detail"].as_str().unwrap().contains("transform the pose"), "{other}");
    let mut reading = quiet_reading();
    reading["robot"] = json!("arm");
    let half = it.post(&path, &json!({"readings": [reading]})).await;
    half.problem(422, "invalid-value", Some("/readings/0/seq"));
    let mut reading = quiet_reading();
    reading["positon"] = json!(1);
    let typo = it.post(&path, &json!({"readings": [reading]})).await;
    typo.problem(422, "invalid-value", Some("/readings/0/positon"));

    let raw = async |text: &str| {
        let body =
            format!("{{\"readings\": [{}]}}", quiet_reading().to_string().replacen("0.0", text, 1));
        it.send(Method::POST, &path, Some(("application/json", body.into_bytes()))).await
    };
    raw("NaN").await.problem(400, "malformed-request", None);
    raw("1e999").await.problem(422, "invalid-value", None);
    it.post(&path, &json!({"readings": []})).await.problem(422, "invalid-value", Some("/readings"));
    let many = json!({"readings": vec![quiet_reading(); 1001]});
    it.post(&path, &many).await.problem(422, "invalid-value", Some("/readings"));
    let one = json!({"readings": [quiet_reading()]});
    let detail = it.post(&format!("{path}?belief=all"), &one).await;
    detail.problem(422, "invalid-value", Some("?belief"));
    it.post("/v1/sessions/mine/readings", &one).await.problem(404, "not-found", None);

    let wide = json!({"name": "wide", "preset": "fingertip-14x14"});
    it.post("/v1/sensors", &wide).await.expect(201);
    let mut reading = quiet_reading();
    reading["sensor"] = json!("wide");
    reading["image"] = json!(vec![0.0; 196]);
    // Method `surface` accepts any sensor; the dissertation's does not.
    let printed = it.session(json!({"method": "sva"})).await;
    let path = format!("/v1/sessions/{printed}/readings");
    let other_shape = it.post(&path, &json!({"readings": [reading]})).await;
    other_shape.problem(422, "invalid-value", Some("/readings/0/sensor"));
    let session = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
    assert_eq!(session["n_readings"], 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn trainings_and_sessions_without_data_are_refused() {
    let it = Harness::start().await;
    let path = "/v1/catalogues/default/trainings";
    let post = async |body: Value| it.post(path, &body).await;
    post(json!({})).await.problem(422, "invalid-value", Some("/objects"));
    it.post("/v1/objects", &json!({"name": "ghost"})).await.expect(201);
    let ghost = post(json!({"objects": ["ghost"]})).await;
    let ghost = ghost.problem(422, "invalid-value", Some("/objects/0"));
    assert!(ghost["detail"].as_str().unwrap().contains("no data"), "{ghost}");
    post(json!({"objects": ["nobody"]})).await.problem(422, "invalid-value", Some("/objects/0"));
    post(json!({"objects": []})).await.problem(422, "invalid-value", Some("/objects"));
    post(json!({"sensor": "nothing"})).await.problem(422, "invalid-value", Some("/sensor"));
    for n_classes in [1, 256] {
        let refused = post(json!({"n_classes": n_classes})).await;
        refused.problem(422, "invalid-value", Some("/n_classes"));
    }
    post(json!({"seed": 1_u64 << 53})).await.problem(422, "invalid-value", Some("/seed"));
    let few = json!({"readings_per_object": 1});
    post(few).await.problem(422, "invalid-value", Some("/readings_per_object"));
    let fewer = json!({"readings_per_object": 100, "surface_readings_per_object": 99});
    post(fewer).await.problem(422, "invalid-value", Some("/surface_readings_per_object"));
    let range = json!({"distance_range": {"min": 0.2, "max": 0.1}});
    post(range).await.problem(422, "invalid-value", Some("/distance_range"));
    it.put_mesh("ghost", &off_box(CUBE)).await.expect(200);
    let name = it.post("/v1/catalogues/two%20words/trainings", &json!({})).await;
    name.problem(422, "invalid-value", Some("/name"));
    let untrained = it.post("/v1/sessions", &json!({})).await;
    untrained.problem(409, "wrong-state", None);
    let unknown = it.post("/v1/sessions", &json!({"catalogue": "none"})).await;
    unknown.problem(422, "invalid-value", Some("/catalogue"));
    it.get("/v1/catalogues/none").await.problem(404, "not-found", None);
    it.get("/v1/jobs/7").await.problem(404, "not-found", None);
    let jobs = it.get("/v1/jobs").await.expect(200);
    assert_eq!(jobs["items"], json!([]), "nothing was stored");
    let catalogues = it.get("/v1/catalogues").await.expect(200);
    assert_eq!(catalogues["items"], json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_sessions_are_refused() {
    let it = Harness::trained().await;
    let check = async |body: Value, pointer: &str| {
        it.post("/v1/sessions", &body).await.problem(422, "invalid-value", Some(pointer));
    };
    check(json!({"version": 9}), "/version").await;
    check(json!({"method": "smell"}), "/method").await;
    check(json!({"ttl_s": 0}), "/ttl_s").await;
    let prior =
        |object: &str, probability: f64| json!({"object": object, "probability": probability});
    check(json!({"prior": [prior("mug", 0.5)]}), "/prior/0/object").await;
    check(json!({"prior": [prior("bar", 1.5)]}), "/prior/0/probability").await;
    check(json!({"prior": [prior("bar", 0.5), prior("bar", 0.5)]}), "/prior/1/object").await;
    check(json!({"prior": [prior("bar", 0.2), prior("cube", 0.2)]}), "/prior").await;
    let sessions = it.get("/v1/sessions").await.expect(200);
    assert_eq!(sessions["items"], json!([]));
    it.session(json!({"prior": [prior("bar", 1.0), prior("cube", 0.0)]})).await;
    it.session(json!({"method": "sva_literal", "version": 1})).await;
}
