//! Tests of contacts without an image and of shear: recognition, mixtures, keeping, refusals.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, off_box, quiet_reading, touches};

/// Edges in millimetres.
const PLATE: [f64; 3] = [70.0, 60.0, 12.0];
/// Standard deviations of the contacts: metres, rad.
const DEVIATIONS: (f64, f64) = (0.001, 0.1);

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

/// Contacts at places of a box anywhere on its faces, with the errors that they state.
fn contacts(size: [f64; 3], n: usize, seed: u64, pose: Pose) -> Vec<Value> {
    let mut stream = Stream::new(seed, Purpose::Sampling, 0);
    let half = 0.5e-3 * DVec3::from_array(size);
    let areas = [half.y * half.z, half.x * half.z, half.x * half.y];
    let mut contact = || {
        let mut left = stream.uniform(0.0, areas.iter().sum());
        let axis = areas.iter().position(|area| {
            left -= area;
            left <= 0.0
        });
        let axis = axis.unwrap_or(2);
        let side = if stream.uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let mut place = DVec3::from_array([(); 3].map(|()| stream.uniform(-1.0, 1.0))) * half;
        let mut normal = DVec3::ZERO;
        (place[axis], normal[axis]) = (side * half[axis], side);
        let mut off = |deviation: f64| {
            deviation * DVec3::new(stream.normal(), stream.normal(), stream.normal())
        };
        let position = pose * place + off(DEVIATIONS.0);
        let felt = (pose.turn(normal) + off(DEVIATIONS.1)).normalize();
        json!({"sensor": "digitacts-6x6", "contact": {
            "position": position.to_array(), "position_deviation_m": DEVIATIONS.0,
            "normal": felt.to_array(), "normal_deviation_rad": DEVIATIONS.1, "force_n": 2.0}})
    };
    (0..n).map(|_| contact()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn ten_contacts_name_one_of_three_objects() {
    let it = Harness::start().await;
    let boxes = [("cube", CUBE), ("bar", BAR), ("plate", PLATE)];
    for (name, size) in boxes {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.put_mesh(name, &off_box(size)).await.expect(200);
    }
    let training = json!({"readings_per_object": 150, "n_classes": 8, "seed": 3});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let mut right = 0;
    for seed in [31, 32] {
        for (name, size) in boxes {
            let session = it.session(json!({})).await;
            let readings = contacts(size, 10, seed, resting_pose());
            let path = format!("/v1/sessions/{session}/readings");
            let added = it.post(&path, &json!({"readings": readings})).await.expect(200);
            let belief = &added["belief"];
            assert_eq!(belief["n_readings"], 10);
            assert_eq!(added["warnings"], json!([]), "surface uses them");
            right += usize::from(belief["objects"][0]["name"] == name);
        }
    }
    // By chance 2 of 6.
    assert!(right >= 5, "{right} of 6");
}

#[tokio::test(flavor = "multi_thread")]
async fn presses_and_contacts_mix_and_are_kept() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let pose = resting_pose();
    let mut readings = touches(BAR, 4, 77, pose);
    readings.extend(contacts(BAR, 6, 5, pose));
    let miss = json!({"sensor": "digitacts-6x6", "approach_m": 0.05, "contact": {"touched": false,
        "position": [0.3, 0.0, 0.05], "position_deviation_m": 0.001,
        "normal": [0.0, 0.0, 1.0], "normal_deviation_rad": 0.1}});
    readings.push(miss.clone());
    let added = it.post(&format!("{path}/readings"), &json!({"readings": readings})).await;
    let belief = added.expect(200)["belief"].clone();
    assert_eq!((&belief["objects"][0]["name"], &belief["n_readings"]), (&json!("bar"), &json!(11)));

    let listed = it.get(&format!("{path}/readings")).await.expect(200);
    let items = listed["items"].as_array().unwrap();
    for (item, sent) in items.iter().zip(&readings) {
        let sent_contact = sent.get("contact").cloned().unwrap_or(Value::Null);
        if sent_contact["touched"] != false {
            let mut found = item["contact"].clone();
            found.as_object_mut().map(|contact| contact.remove("touched"));
            assert_eq!(found, sent_contact, "returned as sent");
        }
        assert_eq!(item["image"].as_array().unwrap().is_empty(), !sent_contact.is_null());
    }
    assert_eq!(
        (&items[10]["contact"]["touched"], &items[10]["approach_m"]),
        (&json!(false), &json!(0.05))
    );

    // Withdrawing a contact gives the belief without it, before and after a restart.
    let url = format!("{path}/readings/7");
    let without = it.send(reqwest::Method::DELETE, &url, None).await.expect(200);
    assert_eq!(without["belief"]["n_readings"], 10);
    assert_ne!(without["belief"]["objects"], belief["objects"]);
    let it = it.restart().await;
    let after = it.get(&format!("{path}/belief")).await.expect(200);
    assert_eq!(after["objects"], without["belief"]["objects"]);
    let then = it.get(&format!("{path}/belief?at=11")).await.expect(200);
    assert_eq!(then["objects"], belief["objects"], "the belief at a revision");
    let replayed = it.get(&format!("{path}/replay")).await.expect(200);
    assert!(replayed.to_string().contains("\"reading\""), "{replayed}");
    it.get(&format!("{path}/explain")).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_contact_is_refused_at_its_field() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let right = contacts(CUBE, 1, 4, resting_pose()).remove(0);
    let cases: &[(&str, Value, &str)] = &[
        ("/contact/position_deviation_m", json!(0.0), "/contact/position_deviation_m"),
        ("/contact/position_deviation_m", json!(0.2), "/contact/position_deviation_m"),
        ("/contact/normal_deviation_rad", json!(-0.1), "/contact/normal_deviation_rad"),
        ("/contact/normal_deviation_rad", Value::Null, "/contact/normal_deviation_rad"),
        ("/contact/normal", json!([0.0, 0.0, 0.5]), "/contact/normal"),
        ("/contact/normal", Value::Null, "/contact/normal_deviation_rad"),
        ("/contact/position", json!([0.0, 1e9, 0.0]), "/contact/position"),
        ("/contact/force_n", json!(-1.0), "/contact/force_n"),
        ("/image", json!(vec![1.0; 36]), "/contact"),
        ("/pose", quiet_reading()["pose"].clone(), "/pose"),
        ("/shear", json!(vec![[0.0, 0.0]; 36]), "/shear"),
        ("/contact", Value::Null, "/image"),
        ("/sensor", json!("nobody"), "/sensor"),
    ];
    for (field, value, named) in cases {
        let mut wrong = right.clone();
        match field.strip_prefix("/contact/") {
            Some(inner) => wrong["contact"][inner] = value.clone(),
            None => wrong[&field[1..]] = value.clone(),
        }
        let answer = it.post(&path, &json!({"readings": [wrong]})).await;
        answer.problem(422, "invalid-value", Some(&format!("/readings/0{named}")));
    }
    let blind = json!({"sensor": "digitacts-6x6", "approach_m": 0.1, "contact": {
        "position": [0.0, 0.0, 0.0], "position_deviation_m": 0.01}});
    let answer = it.post(&path, &json!({"readings": [blind]})).await;
    answer.problem(422, "invalid-value", Some("/readings/0/approach_m"));
    let unknown =
        json!({"sensor": "digitacts-6x6", "contact": {"position": [0.0, 0.0, 0.0], "radius": 1}});
    assert_eq!(it.post(&path, &json!({"readings": [unknown]})).await.status, 422);
    it.post(&path, &json!({"readings": [right]})).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_and_checks_need_an_image() {
    let it = Harness::trained().await;
    let contact = contacts(CUBE, 1, 4, resting_pose()).remove(0);
    let answer = it.post("/v1/objects/cube/readings", &json!({"readings": [contact]})).await;
    answer.problem(422, "invalid-value", Some("/readings/0/contact"));
    let answer = it.post("/v1/sensors/digitacts-6x6/check", &contact).await;
    answer.problem(422, "invalid-value", Some("/contact"));
}

#[tokio::test(flavor = "multi_thread")]
async fn methods_that_need_images_say_that_they_ignore_contacts() {
    let it = Harness::trained().await;
    for method in ["sva"] {
        let session = it.session(json!({"method": method})).await;
        let path = format!("/v1/sessions/{session}");
        let press = json!({"readings": touches(BAR, 2, 3, resting_pose())});
        let before = it.post(&format!("{path}/readings"), &press).await.expect(200);
        let contacts = json!({"readings": contacts(BAR, 3, 4, resting_pose())});
        let after = it.post(&format!("{path}/readings"), &contacts).await.expect(200);
        assert_eq!(after["belief"]["objects"], before["belief"]["objects"], "{method}");
        assert_eq!(after["n_readings"], 5, "stored all the same");
        let warnings = after["warnings"].as_array().unwrap();
        let codes: Vec<&str> = warnings.iter().map(|w| w["code"].as_str().unwrap()).collect();
        assert_eq!(codes, ["contact_ignored"], "{method}");
        assert_eq!(warnings[0]["pointer"], "/readings/0/contact");
        let it_again = it.get(&format!("{path}/belief")).await.expect(200);
        assert_eq!(it_again["objects"], before["belief"]["objects"]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_contact_that_is_held_counts_once() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let contact = contacts(CUBE, 1, 4, resting_pose()).remove(0);
    let frame = |n: u32| {
        let mut frame = contact.clone();
        frame["robot"] = json!("arm");
        frame["seq"] = json!(n);
        frame["stamp"] = json!({"sec": 5, "nanosec": n * 10_000_000});
        frame
    };
    let readings: Vec<Value> = (0..8).map(frame).collect();
    let path = format!("/v1/sessions/{session}/readings");
    let added = it.post(&path, &json!({"readings": readings})).await.expect(200);
    assert_eq!((&added["n_readings"], &added["n_presses"]), (&json!(8), &json!(1)));
}

#[tokio::test(flavor = "multi_thread")]
async fn shear_is_kept_with_its_reading_and_never_dropped() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let mut shear: Vec<Value> = (0..36).map(|taxel| json!([taxel, -0.5])).collect();
    shear[7] = Value::Null;
    let mut reading = touches(CUBE, 1, 9, resting_pose()).remove(0);
    reading["shear"] = json!(shear);
    let added = it.post(&path, &json!({"readings": [reading]})).await.expect(200);
    let warnings = added["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|w| w["code"] == "shear_ignored"), "{warnings:?}");
    let it = it.restart().await;
    let listed = it.get(&path).await.expect(200);
    let kept: Vec<Value> = listed["items"][0]["shear"].as_array().unwrap().clone();
    assert_eq!((kept[7].clone(), kept[3].clone()), (Value::Null, json!([3.0, -0.5])));
    assert_eq!(kept.len(), 36);

    it.post("/v1/objects", &json!({"name": "thing"})).await.expect(201);
    let trained = it.post("/v1/objects/thing/readings", &json!({"readings": [reading]})).await;
    assert!(trained.expect(200)["warnings"].to_string().contains("shear_ignored"));
    let stored = it.get("/v1/objects/thing/readings").await.expect(200);
    assert_eq!(stored["items"][0]["shear"][3], json!([3.0, -0.5]));

    reading["shear"] = json!(vec![[0.0, 0.0]; 35]);
    let short = it.post(&path, &json!({"readings": [reading]})).await;
    short.problem(422, "invalid-value", Some("/readings/0/shear"));
    reading["shear"] = json!(vec![[0.0, 2e8]; 36]);
    let large = it.post(&path, &json!({"readings": [reading]})).await;
    large.problem(422, "invalid-value", Some("/readings/0/shear/0"));
}
