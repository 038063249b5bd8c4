//! Tests of checkpoints of beliefs: a restart resumes from them, and no result depends on them.

use std::path::{Path, PathBuf};

use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, touches};

/// Readings of a robot with increasing numbers.
fn numbered(box_size: [f64; 3], n: usize, first: usize) -> Vec<Value> {
    let name = |(index, mut reading): (usize, Value)| {
        reading["robot"] = json!("arm");
        reading["seq"] = json!(first + index);
        reading["stamp"] = json!({"sec": 10 * (first + index), "nanosec": 0});
        reading
    };
    touches(box_size, n, 41, Pose::IDENTITY).into_iter().enumerate().map(name).collect()
}

async fn post(it: &Harness, session: &str, readings: &[Value]) -> Value {
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200)["belief"].clone()
}

async fn belief(it: &Harness, session: &str) -> Value {
    it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200)
}

async fn n_resumed(it: &Harness) -> u64 {
    let figures = it.get("/metrics").await.text;
    let line = figures.lines().find_map(|line| line.strip_prefix("palpate_beliefs_resumed_total "));
    line.map_or(0, |n| n.parse().unwrap())
}

fn file(folder: &Path, session: &str) -> PathBuf {
    folder.join("checkpoints").join(session.replace('-', ""))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_resumes_from_checkpoints_with_equal_beliefs() {
    let it = Harness::trained().await;
    let (bar, cube) = (it.session(json!({})).await, it.session(json!({})).await);
    let (first, rest) = (numbered(BAR, 17, 0), numbered(BAR, 20, 100));
    for reading in &first {
        post(&it, &bar, std::slice::from_ref(reading)).await;
    }
    assert!(file(it.folder(), &bar).exists(), "one is stored every 16 readings");
    post(&it, &cube, &numbered(CUBE, 3, 0)).await;
    let before = [belief(&it, &bar).await, belief(&it, &cube).await];
    let it = it.restart().await;
    assert!(file(it.folder(), &cube).exists(), "and all are when the server stops");
    let n_before = n_resumed(&it).await;
    assert_eq!([belief(&it, &bar).await, belief(&it, &cube).await], before);
    assert!(n_resumed(&it).await >= n_before + 2);

    // Later beliefs equal those without a restart, late readings included.
    let went_on = post(&it, &bar, &rest).await;
    let mut late = numbered(BAR, 1, 500);
    late[0]["stamp"] = json!({"sec": 5, "nanosec": 0});
    let with_late = post(&it, &bar, &late).await;
    let it =
        it.restart_after(|folder| std::fs::remove_dir_all(folder.join("checkpoints")).unwrap());
    let it = it.await;
    assert_eq!(belief(&it, &bar).await, with_late);
    let at = it.get(&format!("/v1/sessions/{bar}/belief?at=37")).await.expect(200);
    assert_eq!(at, went_on);
}

#[tokio::test(flavor = "multi_thread")]
async fn damaged_checkpoints_are_ignored_and_end_with_the_session() {
    let it = Harness::trained().await;
    let sessions = [it.session(json!({})).await, it.session(json!({})).await];
    for session in &sessions {
        post(&it, session, &numbered(BAR, 20, 0)).await;
    }
    let before = belief(&it, &sessions[0]).await;
    let (torn, copied) = (sessions[0].clone(), sessions.clone());
    let it = it
        .restart_after(|folder| {
            let path = file(folder, &torn);
            let mut bytes = std::fs::read(&path).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 0x10;
            std::fs::write(&path, bytes).unwrap();
            std::fs::write(folder.join("checkpoints/notes.txt"), "not ours").unwrap();
            std::fs::copy(file(folder, &copied[1]), file(folder, &"0".repeat(32))).unwrap();
        })
        .await;
    assert_eq!(belief(&it, &sessions[0]).await, before);
    let left = || std::fs::read_dir(it.folder().join("checkpoints")).unwrap().count();
    assert_eq!(left(), 2, "what belongs to no open session is gone");
    it.post(&format!("/v1/sessions/{}/close", sessions[0]), &json!({})).await.expect(200);
    assert_eq!(left(), 1);
    it.send(Method::DELETE, &format!("/v1/sessions/{}", sessions[1]), None).await.expect(204);
    assert_eq!(left(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_that_has_ended_gets_no_checkpoint() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let told = post(&it, &session, &numbered(BAR, 20, 0)).await;
    it.post(&format!("/v1/sessions/{session}/close"), &json!({})).await.expect(200);
    let it = it.restart().await;
    assert_eq!(belief(&it, &session).await["objects"], told["objects"]);
    assert!(!file(it.folder(), &session).exists(), "nothing would ever remove it");
}
