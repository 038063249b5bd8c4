//! Tests of presses at a place that was pressed before.

use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, touches};

/// The same reading from `off` metres beside, along an axis of the session.
fn beside(reading: &Value, axis: usize, off: f64) -> Value {
    let mut moved = reading.clone();
    let place = &mut moved["pose"]["position"][axis];
    *place = json!(place.as_f64().unwrap() + off);
    moved
}

async fn unknown(it: &Harness, readings: &[Value]) -> f64 {
    let path = format!("/v1/sessions/{}/readings", it.session(json!({})).await);
    let answer = it.post(&path, &json!({"readings": readings})).await.expect(200);
    answer["belief"]["unknown"].as_f64().unwrap()
}

#[tokio::test]
async fn a_place_pressed_again_leaves_unknown_as_it_was() {
    let it = Harness::trained().await;
    for first in touches(BAR, 3, 5, Pose::IDENTITY) {
        let one = unknown(&it, std::slice::from_ref(&first)).await;
        for off in [0.0, 0.000_05, 0.000_3, 0.001, 0.002] {
            let again = |n: usize| beside(&first, n % 3, off);
            for n in 1..=3 {
                let several: Vec<Value> =
                    std::iter::once(first.clone()).chain((0..n).map(again)).collect();
                let found = unknown(&it, &several).await;
                assert!((found - one).abs() < 0.03, "{n} more at {off} m: {found}, one: {one}");
            }
        }
    }
}
