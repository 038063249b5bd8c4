//! Tests of stored data: a full disk, a damaged version, a snapshot, a second server.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_core::pose::Pose;
use palpate_server::{Access, FreeSpace, Server};
use palpate_store::database::Database;
use palpate_store::engine::{Commit, Engine};
use palpate_store::sled::{SledEngine, SledOptions};
use palpate_store::snapshot::{KeysFrom, restore, verify};
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{CUBE, Harness, config, quiet_reading, touches};

fn readings(n: usize) -> Value {
    let mut readings = touches(CUBE, n, 9, Pose::IDENTITY);
    for (seq, reading) in readings.iter_mut().enumerate() {
        (reading["robot"], reading["seq"]) = (json!("arm"), json!(seq));
    }
    json!({ "readings": readings })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_refuses_writes_with_507_and_allows_reads() {
    let free = Arc::new(AtomicU64::new(u64::MAX));
    let seen = Arc::clone(&free);
    let it = Harness::trained_with(|config| {
        config.free_space = FreeSpace::from_probe(move |_| Ok(seen.load(Ordering::Relaxed)));
    })
    .await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &readings(6)).await.expect(200);
    let belief_path = format!("/v1/sessions/{session}/belief");
    let belief = it.get(&belief_path).await.expect(200);

    free.store(1 << 20, Ordering::Relaxed);
    let one = json!({"readings": [quiet_reading()]});
    let problem = it.post(&path, &one).await.problem(507, "storage-full", None);
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("1.05 MB are free and 67.1 MB must stay free"), "{detail}");
    it.post("/v1/objects", &json!({"name": "mug"})).await.problem(507, "storage-full", None);
    assert_eq!(it.get(&belief_path).await.expect(200), belief);
    let again = it.post(&path, &readings(6)).await.expect(200);
    assert_eq!(again["n_repeated"], 6, "nothing is written for a repetition");
    let ready = it.get("/readyz").await.expect(200);
    let checks = ready["checks"].as_array().unwrap();
    let room = checks.iter().find(|check| check["name"] == "room").unwrap();
    assert_eq!((&ready["ready"], &room["passed"]), (&json!(true), &json!(false)), "{room}");

    free.store(u64::MAX, Ordering::Relaxed);
    let added = it.post(&path, &one).await.expect(200);
    assert_eq!(added["n_readings"], 7);
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unstorable_training_fails_and_is_recorded_later() {
    let free = Arc::new(AtomicU64::new(u64::MAX));
    let seen = Arc::clone(&free);
    let it = Harness::trained_with(|config| {
        config.free_space = FreeSpace::from_probe(move |_| Ok(seen.load(Ordering::Relaxed)));
    })
    .await;
    let training = json!({"readings_per_object": 150, "n_classes": 4, "seed": 5});
    let path = "/v1/catalogues/default/trainings";
    let job = it.post(path, &training).await.expect(202);
    free.store(0, Ordering::Relaxed);
    let id = job["id"].as_str().unwrap();
    let job = it.finished(id).await;
    assert_eq!(job["state"], "failed", "{job}");
    assert!(job["reason"].as_str().unwrap().contains("the disk is full"), "{job}");
    assert_eq!(it.get(&format!("/v1/jobs/{id}")).await.expect(200)["state"], "failed");
    it.post(path, &training).await.problem(507, "storage-full", None);

    free.store(u64::MAX, Ordering::Relaxed);
    // The worker is free, and the pending write does not come again.
    let job = it.post(path, &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_version_is_unusable_and_the_rest_serves() {
    let mut it = Harness::trained().await;
    let old = it.session(json!({})).await;
    let second = json!({"readings_per_object": 70, "n_classes": 8, "seed": 4});
    let job = it.post("/v1/catalogues/default/trainings", &second).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await;
    it = it
        .restart_after(|folder| {
            // A piece of a block that only the second version has.
            let engine = SledEngine::open(folder, &SledOptions::default()).unwrap();
            let engine: Arc<dyn Engine> = Arc::new(engine);
            let catalogues = Database::with_engine(Arc::clone(&engine)).unwrap().catalogues();
            let catalogue = catalogues.find_by_name("default").unwrap().unwrap();
            let first = catalogues.manifest(catalogue.id, 1).unwrap();
            let second = catalogues.manifest(catalogue.id, 2).unwrap();
            let is_new = |hash| first.blocks.iter().all(|known| known.hash != hash);
            let own = second
                .blocks
                .iter()
                .find(|block| block.name.starts_with("surface/") && is_new(block.hash));
            let key = [&b"b"[..], &own.unwrap().hash].concat();
            engine.commit(Commit::new().remove(key)).wait().unwrap();
        })
        .await;
    let problem = it.post("/v1/sessions", &json!({})).await.problem(500, "damaged", None);
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("version 2 of catalogue \"default\" is damaged"), "{detail}");
    let version = it.get("/v1/catalogues/default/versions/2").await.expect(200);
    assert!(!version["damage"].as_str().unwrap().is_empty(), "{version}");
    let version = it.get("/v1/catalogues/default/versions/1").await.expect(200);
    assert_eq!(version["damage"], Value::Null);
    let metrics = it.get("/metrics").await.text;
    assert!(metrics.contains("palpate_versions_damaged"), "{metrics}");
    let path = format!("/v1/sessions/{old}/readings");
    it.post(&path, &readings(4)).await.expect(200);
    it.post("/v1/sessions", &json!({"version": 1})).await.expect(201);
    let ready = it.get("/readyz").await.expect(200);
    let checks = ready["checks"].as_array().unwrap();
    let integrity = checks.iter().find(|check| check["name"] == "integrity").unwrap();
    assert_eq!(integrity["passed"], false, "{ready}");
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_allows_revoking_keys_and_removing_data() {
    let free = Arc::new(AtomicU64::new(u64::MAX));
    let seen = Arc::clone(&free);
    let it = Harness::trained_with(|config| {
        config.access = Access::Keys;
        config.free_space = FreeSpace::from_probe(move |_| Ok(seen.load(Ordering::Relaxed)));
    })
    .await;
    let (closed, deleted) = (it.session(json!({})).await, it.session(json!({})).await);
    for session in [&closed, &deleted] {
        let path = format!("/v1/sessions/{session}/readings");
        it.post(&path, &readings(6)).await.expect(200);
    }
    it.post("/v1/objects", &json!({"name": "spare"})).await.expect(201);
    let leaked = it.new_key("leaked", "robot").await;
    let turned = it.new_key("turned", "robot").await;

    // Less than half of the reserve: even plain removals would be refused.
    free.store(30 << 20, Ordering::Relaxed);
    it.post("/v1/objects", &json!({"name": "mug"})).await.problem(507, "storage-full", None);
    it.send(Method::DELETE, "/v1/keys/leaked", None).await.expect(204);
    assert_eq!(it.send_as(Some(&leaked), Method::GET, "/v1/whoami").await.status, 401);
    it.post("/v1/keys/turned/rotate", &json!({})).await.expect(200);
    assert_eq!(it.send_as(Some(&turned), Method::GET, "/v1/whoami").await.status, 401);
    it.post(&format!("/v1/sessions/{closed}/close"), &json!({})).await.expect(200);
    it.send(Method::DELETE, &format!("/v1/sessions/{deleted}"), None).await.expect(204);
    it.send(Method::DELETE, "/v1/objects/spare", None).await.expect(204);
    let audit = it.get("/v1/audit?limit=20").await.expect(200);
    let told: Vec<(&str, u64)> = audit["items"]
        .as_array()
        .unwrap()
        .iter()
        .map(|entry| (entry["operation"].as_str().unwrap(), entry["status"].as_u64().unwrap()))
        .collect();
    for entry in [("revoke_key", 204), ("rotate_key", 200), ("delete_object", 204)] {
        assert!(told.contains(&entry), "{entry:?} in {told:?}");
    }
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_snapshot_restores_to_the_same_beliefs() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &readings(8)).await.expect(200);
    let belief_path = format!("/v1/sessions/{session}/belief?poses=20");
    let belief = it.get(&belief_path).await.expect(200);
    let taken = it.client.post(it.url("/v1/snapshots")).send().await.unwrap();
    assert_eq!(taken.status(), 200);
    let bytes = taken.bytes().await.unwrap();
    // Later changes are not in the snapshot.
    it.post("/v1/objects", &json!({"name": "later"})).await.expect(201);
    it.server.shutdown().await;
    let (_, report) = verify(&bytes[..]).unwrap();
    assert_eq!((report.n_damaged, report.records["session"]), (0, 1));

    let folder = tempfile::tempdir().unwrap();
    {
        let engine = SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
        restore(&bytes[..], &engine, KeysFrom::Snapshot).unwrap();
    }
    let server = Server::start(config(folder.path())).await.unwrap();
    let url = |path: &str| format!("http://{}{path}", server.local_addr());
    let again = it.client.get(url(&belief_path)).send().await.unwrap().text().await.unwrap();
    assert_eq!(serde_json::from_str::<Value>(&again).unwrap(), belief);
    let later = it.client.get(url("/v1/objects/later")).send().await.unwrap();
    assert_eq!(later.status(), 404);
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_server_on_a_folder_is_refused_by_name() {
    let it = Harness::start().await;
    let error = Server::start(config(it.folder())).await.err().unwrap().to_string();
    assert!(error.contains("is in use by another process"), "{error}");
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_compaction_frees_space_and_is_shown_and_audited() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &readings(8)).await.expect(200);
    let done = it.post("/v1/compactions", &json!({})).await.expect(200);
    let bytes = |name: &str| done[name].as_u64().unwrap();
    assert!(bytes("live_bytes") > 0 && bytes("after_bytes") < bytes("before_bytes"), "{done}");
    let again = it.post(&path, &readings(8)).await.expect(200);
    assert_eq!(again["n_repeated"], 8);
    let metrics = it.get("/metrics").await.text;
    assert!(metrics.contains("palpate_store_compactions_total 1"), "{metrics}");
    assert!(metrics.contains("palpate_store_live_bytes "), "{metrics}");
    let log = it.get("/v1/audit?operation=compact").await.expect(200);
    assert_eq!(log["items"].as_array().unwrap().len(), 1, "{log}");
    it.server.shutdown().await;
}
