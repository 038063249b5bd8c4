//! Tests of sensors' health: from presses without contact, and from recognised sessions.

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::sensor::SensorDescription;
use reqwest::Method;
use serde_json::{Value, json};

use crate::calibration::{indentations, run};
use crate::harness::{BAR, Harness, pose_of, quiet_reading, touches};

/// Adds sensors like the one that the server was trained with.
async fn add_sensors(it: &Harness, names: &[&str]) {
    for name in names {
        let sensor = json!({"name": name, "preset": "digitacts-6x6"});
        it.post("/v1/sensors", &sensor).await.expect(201);
    }
}

/// Presses of a sensor that meet nothing, with noise of a tenth of the contact floor, and a taxel
/// with an offset in floors.
fn quiet(sensor: &str, n: usize, taxel: usize, offset: f64) -> Vec<Value> {
    let floor = SensorDescription::digitacts_6x6().contact_floor();
    let press = |press: usize| {
        let noise = |taxel: usize| 0.1 * floor * (((7 * press + 3 * taxel) % 5) as f64 / 2.0 - 1.0);
        let mut image: Vec<f64> = (0..36).map(noise).collect();
        image[taxel] += offset * floor;
        let mut reading = quiet_reading();
        (reading["sensor"], reading["image"]) = (json!(sensor), json!(image));
        reading["pose"]["position"] = json!([0.01 * press as f64, 0.0, 0.1]);
        reading
    };
    (0..n).map(press).collect()
}

/// A session with these readings, which is closed with `truth`.
async fn ended(it: &Harness, readings: &[Value], truth: &Value) -> Value {
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let readings = json!({"readings": readings});
    let added = it.post(&format!("{path}/readings"), &readings).await.expect(200);
    it.post(&format!("{path}/close"), truth).await.expect(200);
    added
}

/// The health of a sensor after all sessions that have ended.
async fn health(it: &Harness, sensor: &str) -> Value {
    loop {
        let health = it.get(&format!("/v1/sensors/{sensor}/health")).await.expect(200);
        if health["n_waiting"] == 0 {
            return health;
        }
    }
}

fn reasons(health: &Value) -> Vec<(String, Value)> {
    let reason = |it: &Value| (it["code"].as_str().unwrap().to_owned(), it["taxel"].clone());
    health["reasons"].as_array().unwrap().iter().map(reason).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_taxel_with_an_offset_asks_for_commissioning() {
    let it = Harness::trained().await;
    add_sensors(&it, &["left", "right", "drifting"]).await;
    let unknown = health(&it, "left").await;
    assert_eq!((&unknown["state"], &unknown["n_days"]), (&json!("unknown"), &json!(0)));
    assert_eq!((&unknown["rest"], &unknown["tool_center"]), (&Value::Null, &Value::Null));

    ended(&it, &quiet("left", 24, 14, 1.5), &json!({})).await;
    ended(&it, &quiet("right", 24, 14, 0.0), &json!({})).await;
    let left = health(&it, "left").await;
    assert_eq!(left["state"], "commission", "{left}");
    assert_eq!(reasons(&left), [("offset".to_owned(), json!(14))]);
    let detail = left["reasons"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("taxel 14 (row 2, column 2)") && detail.contains('+'), "{detail}");
    assert!(left["summary"].as_str().unwrap().contains("commission the sensor again"), "{left}");
    let floor = left["rest"]["contact_floor"].as_f64().unwrap();
    let value = left["rest"]["pressures"][14].as_f64().unwrap();
    assert!((value / floor - 1.5).abs() < 0.05, "{left}");
    let noise = left["rest"]["noise"][14].as_f64().unwrap();
    assert!(noise < 0.2 * floor, "{left}");
    assert_eq!((&left["n_presses"], &left["n_quiet"]), (&json!(24), &json!(24)));
    assert_eq!((&left["n_sessions"], &left["n_days"]), (&json!(1), &json!(1)));
    let mut drifting = quiet("drifting", 30, 7, 0.0);
    for (press, reading) in drifting.iter_mut().enumerate() {
        let value = reading["image"][7].as_f64().unwrap() + 2.0 * floor * press as f64 / 30.0;
        reading["image"][7] = json!(value);
    }
    ended(&it, &drifting, &json!({})).await;
    let drifted = health(&it, "drifting").await;
    assert_eq!(drifted["state"], "commission", "{drifted}");
    assert_eq!(reasons(&drifted), [("offset".to_owned(), json!(7))]);
    let both = [quiet("right", 2, 0, 0.0), quiet("left", 2, 0, 0.0)].concat();
    let warned = ended(&it, &both, &json!({})).await["warnings"].clone();
    assert_eq!(
        (warned.as_array().unwrap().len(), &warned[0]["code"]),
        (1, &json!("sensor_changed"))
    );
    assert_eq!(warned[0]["pointer"], "/readings/2/sensor");
    assert!(warned[0]["detail"].as_str().unwrap().contains("taxel 14"), "{warned}");
    let left = health(&it, "left").await;
    let right = health(&it, "right").await;
    assert_eq!((&right["state"], &right["reasons"]), (&json!("good"), &json!([])), "{right}");
    assert_eq!(health(&it, "digitacts-6x6").await["state"], "unknown", "the preset itself");
    let metrics = it.get("/metrics").await.text;
    for line in ["palpate_sensors{health=\"good\"}", "palpate_sensors{health=\"commission\"}"] {
        assert!(metrics.contains(line), "{metrics}");
    }

    // Stored, and counted once: the start looks at sessions that ended lately again.
    let it = it.restart().await;
    let again = health(&it, "left").await;
    assert_eq!(again, left);
    assert_eq!(health(&it, "right").await, right);

    // A calibration starts anew.
    let run = indentations(&run());
    it.post("/v1/sensors/left/calibration", &run).await.expect(201);
    let anew = health(&it, "left").await;
    assert_eq!((&anew["state"], &anew["calibration"]), (&json!("unknown"), &json!(1)), "{anew}");
    assert_eq!((&anew["n_sessions"], &anew["first_day"]), (&json!(0), &Value::Null));
    let answer = ended(&it, &quiet("left", 2, 0, 0.0), &json!({})).await;
    assert_eq!(answer["warnings"], json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_tool_centre_is_told_with_its_sign() {
    let it = Harness::trained().await;
    add_sensors(&it, &["long", "short", "right"]).await;
    for (sensor, off) in [("long", -0.003), ("short", 0.003), ("right", 0.0)] {
        for seed in 41..45 {
            let mut readings = touches(BAR, 12, seed, Pose::IDENTITY);
            for reading in &mut readings {
                // The sensor is `off` metres further out than the robot states.
                let pose = pose_of(&reading["pose"]);
                let stated = pose.translation - pose.turn(DVec3::Z) * off;
                reading["pose"]["position"] = json!(stated.to_array());
                reading["sensor"] = json!(sensor);
            }
            // Told by the client, so that a session counts that is sure by less than 0.99.
            ended(&it, &readings, &json!({"object": "bar"})).await;
        }
        let found = health(&it, sensor).await;
        let center = &found["tool_center"];
        let z = center["shift_m"][2].as_f64().unwrap();
        assert!((z - off).abs() < 0.0012, "{sensor}: {found}");
        assert!(center["n_sessions"].as_u64().unwrap() >= 3, "{found}");
        if off == 0.0 {
            assert_eq!(found["state"], "good", "{found}");
        } else {
            assert_eq!(found["state"], "commission", "{found}");
            let reason = &found["reasons"][0];
            assert_eq!((&reason["code"], &reason["axis"]), (&json!("tool_center"), &json!("z")));
            let sign = if off > 0.0 { "+" } else { "-" };
            assert!(reason["detail"].as_str().unwrap().contains(sign), "{found}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dead_taxel_is_found_by_its_neighbours() {
    let it = Harness::trained().await;
    add_sensors(&it, &["finger"]).await;
    for seed in 0..5 {
        let mut readings = touches(BAR, 20, seed, Pose::IDENTITY);
        for reading in &mut readings {
            reading["sensor"] = json!("finger");
            reading["image"][15] = json!(0.0);
        }
        ended(&it, &readings, &json!({})).await;
    }
    let found = health(&it, "finger").await;
    assert_eq!((&found["dead"], &found["stuck"]), (&json!([15]), &json!([])), "{found}");
    assert_eq!(reasons(&found), [("dead".to_owned(), json!(15))]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_removed_sensor_and_a_deleted_session_leave_nothing() {
    let it = Harness::trained().await;
    add_sensors(&it, &["finger"]).await;
    let added = ended(&it, &quiet("finger", 12, 3, 2.0), &json!({})).await;
    assert_eq!(health(&it, "finger").await["state"], "commission");
    let session = added["session"].as_str().unwrap();
    it.send(Method::DELETE, &format!("/v1/sessions/{session}"), None).await.expect(204);
    assert_eq!(health(&it, "finger").await["state"], "commission", "what it said stays");
    it.send(Method::DELETE, "/v1/sensors/finger", None).await.expect(204);
    it.get("/v1/sensors/finger/health").await.problem(404, "not-found", None);
    add_sensors(&it, &["finger"]).await;
    assert_eq!(health(&it, "finger").await["state"], "unknown", "another one of the name");
}
