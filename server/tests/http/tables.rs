//! Tests of the memory of geometric sessions: counted, shared, and refused before allocation.

use palpate_core::reading::SensorId;
use palpate_sim::letters::Font;
use palpate_sim::rig::{Rig, RigNoise, rig_sensor};
use serde_json::{Value, json};

use crate::geometry::{add_letters, train};
use crate::harness::Harness;
use crate::limits::belief_bytes;

/// Two letters with planar maps, on a server with this much memory for beliefs.
async fn letters(belief_bytes_max: usize) -> Harness {
    let it = Harness::start_with(|config| config.belief_memory_bytes_max = belief_bytes_max).await;
    add_letters(&it, &['I', 'O']).await;
    train(&it, &json!({"n_classes": 4, "geometric": {"kind": "planar"}})).await;
    it
}

fn histogram(half_extent: f64, bins: [u32; 3]) -> Value {
    let prior = json!({"kind": "planar", "half_extent": half_extent});
    json!({"method": "geometric_histogram", "bins": bins, "pose_prior": prior})
}

/// A press of an I at the origin.
fn reading() -> Value {
    let rig = Rig::new(SensorId(0), &rig_sensor(), RigNoise::physical(), 1);
    let field = rig.field(Font::built_in().letter('I').unwrap());
    crate::geometry::wire(&rig.session(&field, 0)[90])
}

#[tokio::test(flavor = "multi_thread")]
async fn too_large_tables_are_refused_at_their_field() {
    let it = letters(40_000_000).await;
    // The smallest box took 10 GB per object when samples followed the bins.
    for (request, pointer) in [
        (histogram(0.0001, [25, 25, 16]), "/pose_prior/half_extent"),
        (histogram(0.0002, [90, 90, 12]), "/pose_prior/half_extent"),
        (histogram(0.01, [2, 2, 200]), "/bins"),
    ] {
        let refused = it.post("/v1/sessions", &request).await;
        let problem = refused.problem(422, "invalid-value", Some(pointer));
        let detail = problem["errors"][0]["detail"].as_str().unwrap();
        assert!(detail.contains("20.000 MB") && detail.contains("--belief-memory-mb"), "{detail}");
        assert_eq!(belief_bytes(&it).await, 0, "nothing was made");
    }
    let wide = json!({"method": "geometric", "pose_prior": {"kind": "planar", "half_extent": 0.2}});
    let refused = it.post("/v1/sessions", &wide).await;
    refused.problem(422, "invalid-value", Some("/pose_prior/half_extent"));
    it.session(histogram(0.01, [25, 25, 16])).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tables_are_shared_counted_and_evicted() {
    let it = letters(40_000_000).await;
    let body = json!({"readings": [reading()]});
    let mut beliefs = Vec::new();
    let mut bytes = Vec::new();
    for bins in [[25, 25, 16], [25, 25, 16], [25, 25, 32], [20, 20, 24], [20, 20, 20]] {
        let session = it.session(histogram(0.01, bins)).await;
        let path = format!("/v1/sessions/{session}/readings");
        let belief = it.post(&path, &body).await.expect(200)["belief"].clone();
        beliefs.push((session, belief));
        bytes.push(belief_bytes(&it).await);
        assert!(bytes[bytes.len() - 1] <= 40_000_000, "{bytes:?}");
    }
    // 4 MB per object: the second session of these bins adds its own memory alone.
    assert!(bytes[0] > 5_000_000 && bytes[1] < bytes[0] + 1_000_000, "{bytes:?}");
    assert!(bytes[2] > bytes[1] + 10_000_000, "{bytes:?}");
    for (session, belief) in beliefs {
        let again = it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200);
        assert_eq!(again, belief, "also where it was folded anew");
    }
}
