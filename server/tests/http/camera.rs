//! Tests of a camera's word: a pose prior of kind `camera` for the method `surface`.

use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, content, touches};

/// A pose near that of the objects, which rest in the session frame.
fn near() -> Value {
    json!({"position": [0.004, -0.003, 0.002], "orientation": [0.0, 0.0, 0.0, 1.0]})
}

fn seen(object: Option<&str>) -> Value {
    let mut hypothesis =
        json!({"pose": near(), "deviation": {"position_m": 0.01, "angle_rad": 0.17}});
    if let Some(object) = object {
        hypothesis["object"] = json!(object);
    }
    json!({"kind": "camera", "hypotheses": [hypothesis]})
}

async fn touched(it: &Harness, session: &str, box_size: [f64; 3], n: usize) -> Value {
    let readings = touches(box_size, n, 5, Pose::IDENTITY);
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200)["belief"].clone()
}

fn probability(belief: &Value, name: &str) -> f64 {
    let objects = belief["objects"].as_array().unwrap();
    let object = objects.iter().find(|object| object["name"] == name).unwrap();
    object["probability"].as_f64().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_named_object_is_likelier_before_any_touch_and_shown() {
    let it = Harness::trained().await;
    let objects = it.get("/v1/objects").await.expect(200);
    let objects = objects["items"].as_array().unwrap();
    let names: Vec<&str> = objects.iter().map(|it| it["name"].as_str().unwrap()).collect();
    let first = names[0];
    let shown =
        it.post("/v1/sessions", &json!({"pose_prior": seen(Some(first))})).await.expect(201);
    let prior = &shown["pose_prior"];
    assert_eq!(prior["kind"], "camera");
    assert_eq!(prior["hypotheses"][0]["object"], objects[0]["id"], "ids survive new names");
    assert_eq!((&prior["wrong"], &prior["hypotheses"][0]["weight"]), (&json!(0.1), &json!(1.0)));
    let session = shown["id"].as_str().unwrap();
    let unsaid = it.session(json!({})).await;
    let belief = |session: String| {
        let path = format!("/v1/sessions/{session}/belief");
        let it = &it;
        async move { it.get(&path).await.expect(200) }
    };
    let (said, unsaid) = (belief(session.to_owned()).await, belief(unsaid).await);
    assert!(probability(&said, first) > probability(&unsaid, first) + 0.2, "{said}");
    assert_eq!(said["unknown"], unsaid["unknown"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn one_touch_gives_a_pose_and_a_restart_the_same_belief() {
    let it = Harness::trained().await;
    let unsaid = it.session(json!({})).await;
    assert_eq!(touched(&it, &unsaid, BAR, 1).await["poses"], json!([]), "one touch fixes no pose");
    let session = it.session(json!({"pose_prior": seen(None)})).await;
    let one = touched(&it, &session, BAR, 1).await;
    assert!(!one["poses"].as_array().unwrap().is_empty(), "{one}");
    let path = format!("/v1/sessions/{session}/belief");
    let before = it.get(&path).await.expect(200);
    // Without the checkpoint the readings are folded again.
    let it =
        it.restart_after(|folder| std::fs::remove_dir_all(folder.join("checkpoints")).unwrap());
    let it = it.await;
    assert_eq!(content(&it.get(&path).await.expect(200)), content(&before));
    let many = touched(&it, &session, BAR, 8).await;
    let it = it.restart().await;
    assert_eq!(content(&it.get(&path).await.expect(200)), content(&many));
}

#[tokio::test(flavor = "multi_thread")]
async fn touches_overrule_a_camera_that_names_another_object() {
    let it = Harness::trained().await;
    let unsaid = it.session(json!({})).await;
    let truth = touched(&it, &unsaid, CUBE, 10).await["objects"][0]["name"].clone();
    let lied = if truth == "bar" { "cube" } else { "bar" };
    let session = it.session(json!({"pose_prior": seen(Some(lied))})).await;
    let belief = touched(&it, &session, CUBE, 10).await;
    assert_eq!(belief["objects"][0]["name"], truth, "{belief}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_no_camera_can_say_is_refused_at_its_field() {
    let it = Harness::trained().await;
    let with = |pointer: &str, value: Value| {
        let mut prior = seen(Some("bar"));
        match pointer.rsplit_once('/') {
            Some((parent, field)) => prior.pointer_mut(parent).unwrap()[field] = value,
            None => unreachable!("a pointer begins with a slash"),
        }
        prior
    };
    let hypothesis = "/hypotheses/0";
    let at = |field: &str, value: Value| with(&format!("{hypothesis}/{field}"), value);
    let mut flat = vec![0.0; 36];
    (0..6).for_each(|axis| flat[7 * axis] = 0.01);
    let skewed = |at: usize| {
        let mut covariance = flat.clone();
        covariance[at] = 0.02;
        let mut prior = seen(None);
        prior["hypotheses"][0] = json!({"pose": near(), "covariance": covariance});
        prior
    };
    let many = vec![seen(None)["hypotheses"][0].clone(); 65];
    let boxed = |high: [f64; 3]| json!({"kind": "camera", "workspace": {"low": [0.0, 0.0, 0.0], "high": high}});
    let classes = |weights: Value| json!({"kind": "camera", "class_weights": weights});
    for (prior, pointer) in [
        (json!({"kind": "camera"}), "/pose_prior"),
        (json!({"kind": "planar"}), "/pose_prior/kind"),
        (with("/wrong", json!(0.0)), "/pose_prior/wrong"),
        (with("/wrong", json!(1.0)), "/pose_prior/wrong"),
        (at("object", json!("never trained")), "/pose_prior/hypotheses/0/object"),
        (at("weight", json!(-1.0)), "/pose_prior/hypotheses/0/weight"),
        (at("weight", json!(0.0)), "/pose_prior/hypotheses"),
        (
            at("pose/orientation", json!([0.0, 0.0, 0.0, 2.0])),
            "/pose_prior/hypotheses/0/pose/orientation",
        ),
        (at("pose/position", json!([0.0, 1e9, 0.0])), "/pose_prior/hypotheses/0/pose/position/1"),
        (at("deviation/angle_rad", json!(0.0)), "/pose_prior/hypotheses/0/deviation/angle_rad"),
        (at("covariance", json!(flat)), "/pose_prior/hypotheses/0"),
        (at("deviation", Value::Null), "/pose_prior/hypotheses/0"),
        (skewed(1), "/pose_prior/hypotheses/0/covariance"),
        (with("/hypotheses", json!(many)), "/pose_prior/hypotheses"),
        (boxed([1.0, 0.0, 1.0]), "/pose_prior/workspace/high/1"),
        (classes(json!([{"object": "bar", "weight": 0.0}])), "/pose_prior/class_weights"),
        (
            classes(json!([{"object": "bar", "weight": 1.0}, {"object": "bar", "weight": 1.0}])),
            "/pose_prior/class_weights/1/object",
        ),
    ] {
        let refused = it.post("/v1/sessions", &json!({"pose_prior": prior})).await;
        refused.problem(422, "invalid-value", Some(pointer));
    }
    let other = json!({"method": "sva", "pose_prior": seen(None)});
    it.post("/v1/sessions", &other).await.problem(422, "invalid-value", Some("/pose_prior"));
}
