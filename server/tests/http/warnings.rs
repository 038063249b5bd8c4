//! Tests of warnings about probable mistakes: units, poses, sizes, objects left out.

use glam::DVec3;
use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, off_box, pose_of, quiet_reading, touches};

/// The reading of the HTTP guide.
fn press(pascals: f64, position: [f64; 3]) -> Value {
    let mut image = [0.0; 36];
    for (taxel, pressure) in [
        (7, 900.0),
        (8, 2500.0),
        (13, 1800.0),
        (14, 4100.0),
        (15, 900.0),
        (19, 900.0),
        (20, 2500.0),
    ] {
        image[taxel] = pressure * pascals;
    }
    json!({
        "sensor": "digitacts-6x6",
        "pose": {"position": position, "orientation": [0.0, 0.0, 0.0, 1.0]},
        "image": image.as_slice(),
    })
}

const NEAR: [f64; 3] = [0.4, -0.1, 0.25];

/// The code and the pointer of each warning.
fn codes(answer: &Value) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let warnings = answer["warnings"].as_array().unwrap();
    warnings.iter().map(|warning| (text(&warning["code"]), text(&warning["pointer"]))).collect()
}

fn one(code: &str, pointer: &str) -> Vec<(String, String)> {
    vec![(code.to_owned(), pointer.to_owned())]
}

#[tokio::test(flavor = "multi_thread")]
async fn check_names_the_probable_unit() {
    let it = Harness::start().await;
    let check = async |reading: &Value| {
        it.post("/v1/sensors/digitacts-6x6/check", reading).await.expect(200)
    };
    let right = check(&press(1.0, NEAR)).await;
    assert_eq!((&right["warnings"], &right["hints"]), (&json!([]), &json!([])));
    let empty = check(&quiet_reading()).await;
    assert_eq!(empty["warnings"], json!([]));
    assert!(empty["hints"][0].as_str().unwrap().contains("free space"), "{empty}");
    for (pascals, unit) in [(1e-3, "kPa"), (3.24e-6, "N for each taxel"), (1e-5, "bar")] {
        let answer = check(&press(pascals, NEAR)).await;
        assert_eq!(codes(&answer), one("pressure_unit", "/image"), "{unit}");
        let hints = answer["hints"].as_array().unwrap();
        assert_eq!(hints.len(), 1, "it is no empty press: {answer}");
        assert!(hints[0].as_str().unwrap().contains(&format!("probably in {unit}")), "{answer}");
    }
    let millimetres = check(&press(1.0, [400.0, -100.0, 250.0])).await;
    assert_eq!(codes(&millimetres), one("position_unit", "/pose/position"));
    let far = check(&press(1.0, [40e3, 0.0, 0.0])).await;
    assert_eq!(codes(&far), one("position_far", "/pose/position"));
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_to_readings_warn_of_probable_mistakes() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings?belief=none");
    let post =
        async |readings: &[Value]| it.post(&path, &json!({"readings": readings})).await.expect(200);
    assert_eq!(post(&[press(1.0, NEAR)]).await["warnings"], json!([]));
    let kilopascals = post(&[press(1.0, NEAR), press(1e-3, NEAR), press(1e-3, NEAR)]).await;
    assert_eq!(codes(&kilopascals), one("pressure_unit", "/readings/1/image"));
    let detail = kilopascals["warnings"][0]["detail"].as_str().unwrap();
    assert!(detail.ends_with("(2 of 3 readings)"), "{detail}");
    // The session's first reading was near the base.
    let far = post(&[press(1.0, [500.0, 0.0, 0.0])]).await;
    let place = |code: &str| one(code, "/readings/0/pose/position").remove(0);
    assert_eq!(codes(&far), [place("position_unit"), place("positions_apart")]);
    let apart = post(&[press(1.0, [3.0, 0.0, 0.0])]).await;
    assert_eq!(codes(&apart), [place("positions_apart")]);

    it.post("/v1/objects", &json!({"name": "plate"})).await.expect(201);
    let readings = json!({"readings": [press(1e-3, NEAR), press(1.0, [500.0, 0.0, 0.0])]});
    let added = it.post("/v1/objects/plate/readings", &readings).await.expect(200);
    let found: Vec<String> = codes(&added).into_iter().map(|(code, _)| code).collect();
    assert_eq!(found, ["pressure_unit", "position_unit", "positions_apart"]);
}

/// Touches of a box with pressures and positions in other units.
fn in_units(n: usize, pressure: f64, position: f64) -> Value {
    let mut readings = touches(BAR, n, 5, Pose::IDENTITY);
    for reading in &mut readings {
        for value in reading["image"].as_array_mut().unwrap() {
            *value = json!(value.as_f64().unwrap() * pressure);
        }
        for value in reading["pose"]["position"].as_array_mut().unwrap() {
            *value = json!(value.as_f64().unwrap() * position);
        }
    }
    json!({ "readings": readings })
}

async fn train(it: &Harness, training: &Value) -> Value {
    let job = it.post("/v1/catalogues/default/trainings", training).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bad_object_is_left_out_unless_training_is_strict() {
    let it = Harness::start().await;
    for name in ["cube", "speck", "newtons", "wide"] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
    }
    it.put_mesh("cube", &off_box(CUBE)).await.expect(200);
    it.put_mesh("speck", &off_box([0.01, 0.01, 0.01])).await.expect(200);
    let newtons = in_units(40, 3.24e-6, 1.0);
    it.post("/v1/objects/newtons/readings", &newtons).await.expect(200);
    let mut image = vec![0.0; 196];
    image[90] = 8e3;
    let mut wide = quiet_reading();
    wide["sensor"] = json!("fingertip-14x14");
    wide["image"] = json!(image);
    it.post("/v1/objects/wide/readings", &json!({"readings": [wide]})).await.expect(200);

    let settings = json!({"readings_per_object": 60, "n_classes": 4});
    let job = train(&it, &settings).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    let names = |list: &Value| -> Vec<String> {
        let name = |item: &Value| item["name"].as_str().unwrap().to_owned();
        list.as_array().unwrap().iter().map(name).collect()
    };
    assert_eq!(names(&report["objects"]), ["cube"]);
    assert_eq!(names(&report["skipped"]), ["speck", "newtons", "wide"]);
    let reason = |n: usize| report["skipped"][n]["reason"].as_str().unwrap();
    let said = [
        (0, ["speck", "0.01 mm"]),
        (1, ["digitacts-6x6", "N for each taxel"]),
        (2, ["14×14", "--sensor"]),
    ];
    for (n, words) in said {
        assert!(words.iter().all(|word| reason(n).contains(word)), "{}", reason(n));
    }
    assert_eq!(codes(&report), one("objects_skipped", "/skipped"));

    let strict = json!({"readings_per_object": 60, "n_classes": 4, "strict": true});
    let job = train(&it, &strict).await;
    assert_eq!(job["state"], "failed", "{job}");
    let only = json!({"objects": ["newtons", "wide"], "readings_per_object": 60, "n_classes": 4});
    let job = train(&it, &json!({"objects": ["newtons"]})).await;
    let reason = job["reason"].as_str().unwrap();
    let all = ["newtons", "digitacts-6x6", "N for each taxel"];
    assert!(all.iter().all(|word| reason.contains(word)), "{reason}");
    // The object with the wide array is the only one touched, and one touch is no map.
    let job = train(&it, &only).await;
    assert_eq!(job["state"], "failed", "{job}");
    assert!(job["reason"].as_str().unwrap().contains("2 objects"), "{job}");
}

#[tokio::test(flavor = "multi_thread")]
async fn implausible_sizes_give_training_warnings() {
    let it = Harness::start().await;
    for name in ["hall", "cube", "bar"] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
    }
    it.put_mesh("cube", &off_box(CUBE)).await.expect(200);
    let body = || Some(("model/off", off_box(CUBE).into_bytes()));
    it.send(Method::PUT, "/v1/objects/hall/mesh?unit=m", body()).await.expect(200);
    it.post("/v1/objects/bar/readings", &in_units(60, 1.0, 1e3)).await.expect(200);
    let job = train(&it, &json!({
        "readings_per_object": 60, "sva": false, "surface": true, "objects": ["hall", "cube", "bar"],
    }))
    .await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    let of = |n: usize| -> Vec<String> {
        codes(&report["objects"][n]).into_iter().map(|(code, _)| code).collect()
    };
    assert!(of(0).contains(&"object_large".to_owned()), "{report}");
    assert!(!of(1).contains(&"object_large".to_owned()), "{report}");
    assert!(of(2).contains(&"object_large".to_owned()), "{report}");
    assert_eq!(codes(&report), one("sizes_differ", "/objects"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_with_a_wrong_tool_centre_says_so() {
    let it = Harness::trained().await;
    let warned = async |off: f64| {
        let session = it.session(json!({})).await;
        let mut readings = touches(BAR, 12, 41, Pose::IDENTITY);
        for reading in &mut readings {
            // The sensor is `off` metres further out than the robot states.
            let pose = pose_of(&reading["pose"]);
            let stated = pose.translation - pose.turn(DVec3::Z) * off;
            reading["pose"]["position"] = json!(stated.to_array());
        }
        let path = format!("/v1/sessions/{session}/readings");
        let added = it.post(&path, &json!({"readings": readings})).await.expect(200);
        assert_eq!(added["belief"]["objects"][0]["name"], "bar");
        added["belief"].clone()
    };
    assert_eq!(codes(&warned(0.0).await), []);
    for off in [0.003, -0.003] {
        let belief = warned(off).await;
        assert_eq!(codes(&belief), one("sensor_shifted", ""), "{belief}");
        let detail = belief["warnings"][0]["detail"].as_str().unwrap();
        let sign = if off > 0.0 { "+" } else { "-" };
        assert!(detail.contains("tool centre") && detail.contains(sign), "{detail}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_with_mirrored_images_says_so() {
    let it = Harness::trained().await;
    let warned = async |is_mirrored: bool| {
        let session = it.session(json!({})).await;
        let mut readings = touches(BAR, 20, 43, Pose::IDENTITY);
        for reading in readings.iter_mut().filter(|_| is_mirrored) {
            let image = reading["image"].as_array_mut().unwrap();
            image.chunks_exact_mut(6).for_each(<[Value]>::reverse);
        }
        let path = format!("/v1/sessions/{session}/readings");
        let added = it.post(&path, &json!({"readings": readings})).await.expect(200);
        added["belief"].clone()
    };
    assert_eq!(codes(&warned(false).await), []);
    let belief = warned(true).await;
    assert!(codes(&belief).contains(&("image_order".to_owned(), String::new())), "{belief}");
}
