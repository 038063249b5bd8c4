//! Tests of readings in MessagePack: equal to the same readings in JSON, refused as clearly.

use palpate_core::pose::Pose;
use palpate_schemas::AddReadings;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, BAR, Harness, quiet_reading, touches};

const MSGPACK: &str = "application/msgpack";

async fn post(it: &Harness, path: &str, body: Vec<u8>) -> Answer {
    it.send(Method::POST, path, Some((MSGPACK, body))).await
}

fn packed(value: &Value) -> Vec<u8> {
    rmp_serde::to_vec_named(value).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn readings_are_equal_in_messagepack_and_json() {
    let it = Harness::trained().await;
    let mut readings = touches(BAR, 6, 31, Pose::IDENTITY);
    for (seq, reading) in readings.iter_mut().enumerate() {
        reading["robot"] = json!("arm-3");
        reading["seq"] = json!(seq);
        reading["image"][5] = Value::Null;
    }
    let readings = json!({"readings": readings});
    let [one, other] = [it.session(json!({})).await, it.session(json!({})).await];
    let path = |session: &str| format!("/v1/sessions/{session}/readings");
    let as_msgpack = post(&it, &path(&one), packed(&readings)).await.expect(200);
    let as_json = it.post(&path(&other), &readings).await.expect(200);
    assert_eq!(as_msgpack["n_new"], 6);
    for field in ["objects", "poses", "entropy_bits", "n_readings"] {
        assert_eq!(as_msgpack["belief"][field], as_json["belief"][field], "{field}");
    }
    let again = it.post(&path(&one), &readings).await.expect(200);
    assert_eq!((&again["n_new"], &again["n_repeated"]), (&json!(0), &json!(6)));
    let training = post(&it, "/v1/objects/bar/readings", packed(&readings)).await;
    assert_eq!(training.expect(200)["n_readings"], 6);
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_messagepack_is_refused() {
    let it = Harness::trained_with(|config| config.json_bytes_max = 100_000).await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let good = packed(&json!({"readings": [quiet_reading()]}));
    let with_rest = [good.clone(), vec![0]].concat();
    let deep = [&b"\x81\xa8readings"[..], &[0x91; 5000]].concat();
    // A list that claims 2^32 - 1 readings; 0xc1 is no marker; a name that is not UTF-8.
    let lying = b"\x81\xa8readings\xdd\xff\xff\xff\xff".to_vec();
    let broken = [
        Vec::new(),
        good[..good.len() - 1].to_vec(),
        with_rest,
        lying,
        vec![0xc1],
        b"\x81\xa2\xff\xfe".to_vec(),
    ];
    for body in broken {
        let refused = post(&it, &path, body.clone()).await;
        assert_eq!(refused.status, 400, "{body:02x?}: {refused:?}");
        refused.problem(400, "malformed-request", None);
    }
    assert!(post(&it, &path, deep).await.status.is_client_error());
    let check = async |readings: Value, pointer: &str| {
        let refused = post(&it, &path, packed(&json!({"readings": readings}))).await;
        refused.problem(422, "invalid-value", Some(pointer));
    };
    let changed = |at: &str, value: Value| {
        let mut reading = quiet_reading();
        *reading.pointer_mut(at).unwrap() = value;
        json!([reading])
    };
    check(changed("/pose/orientation", json!([0, 0, 0, 0])), "/readings/0/pose/orientation").await;
    check(changed("/image/3", json!("soft")), "/readings/0/image/3").await;
    check(changed("/sensor", json!(7)), "/readings/0/sensor").await;
    check(json!([{"sensor": "digitacts-6x6"}]), "/readings/0/image").await;
    check(json!([]), "/readings").await;
    let mut typo = quiet_reading();
    typo["positon"] = json!(1);
    check(json!([typo]), "/readings/0/positon").await;
    let mut readings: AddReadings =
        serde_json::from_value(json!({"readings": [quiet_reading()]})).unwrap();
    readings.readings[0].image[3] = Some(f64::NAN);
    let not_finite = post(&it, &path, rmp_serde::to_vec_named(&readings).unwrap()).await;
    not_finite.problem(422, "invalid-value", Some("/readings/0/image/3"));
    readings.readings[0].image[3] = None;
    readings.readings[0].pose.as_mut().unwrap().position[1] = f64::INFINITY;
    let infinite = post(&it, &path, rmp_serde::to_vec_named(&readings).unwrap()).await;
    infinite.problem(422, "invalid-value", Some("/readings/0/pose/position/1"));
    let large = post(&it, &path, vec![0xc0; 200_000]).await;
    large.problem(413, "body-too-large", None);
    let cbor = it.send(Method::POST, &path, Some(("application/cbor", good.clone()))).await;
    cbor.problem(415, "unsupported-media-type", Some("header:content-type"));
    let elsewhere = post(&it, "/v1/objects", packed(&json!({"name": "cup"}))).await;
    elsewhere.problem(415, "unsupported-media-type", None);
    let session = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
    assert_eq!(session["n_readings"], 0);
}
