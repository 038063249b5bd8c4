//! Tests of trainings: jobs, versions, the current one, and resumption after a restart.

use std::path::PathBuf;
use std::time::Duration;

use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, off_box, touches};
use palpate_core::pose::Pose;

#[tokio::test(flavor = "multi_thread")]
async fn a_training_creates_a_version_with_report_and_history() {
    let it = Harness::start().await;
    let job = it.train().await;
    assert_eq!(job["version"], 1);
    let version = it.get("/v1/catalogues/default/versions/1").await.expect(200);
    assert_eq!(version["is_current"], true);
    assert_eq!(version["job"], job["id"]);
    assert_eq!(version["training"]["descriptor"], "mnti");
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    assert_eq!(report, version["report"]);
    assert_eq!(report["seed"], 3);
    assert_eq!(report["n_classes"], 8);
    assert_eq!(report["objects"].as_array().unwrap().len(), 2);
    assert!(report["index_bytes"].as_u64().unwrap() > 0);
    assert!(report["objects"][0]["n_patches"].as_u64().unwrap() > 10);

    // The bar again, from a robot's readings, without making it current.
    let readings = touches(BAR, 40, 9, Pose::IDENTITY);
    let added = it.post("/v1/objects/bar/readings", &json!({"readings": readings})).await;
    added.expect(200);
    let training = json!({"objects": ["bar"], "n_classes": 4, "activate": false});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!((&job["state"], &job["version"]), (&json!("succeeded"), &json!(2)), "{job}");
    let current = it.get("/v1/catalogues/default/current").await;
    assert_eq!(current.expect(200)["version"], 1);

    let switch = |etag: Option<&str>, version: u32| {
        let request = it.client.put(it.url("/v1/catalogues/default/current"));
        let request = request.json(&json!({"version": version}));
        let request = etag
            .map(|etag| request.try_clone().unwrap().header("if-match", etag))
            .unwrap_or(request);
        async move { request.send().await.unwrap() }
    };
    let etag = current.headers["etag"].to_str().unwrap();
    assert_eq!(switch(None, 2).await.status(), 428);
    assert_eq!(switch(Some("\"77\""), 2).await.status(), 412);
    assert_eq!(switch(Some("yesterday"), 2).await.status(), 422);
    assert_eq!(switch(Some(etag), 3).await.status(), 422);
    assert_eq!(switch(Some(etag), 2).await.status(), 200);
    assert_eq!(switch(Some(etag), 1).await.status(), 412);
    let catalogue = it.get("/v1/catalogues/default").await.expect(200);
    let history: Vec<&Value> =
        catalogue["history"].as_array().unwrap().iter().map(|entry| &entry["version"]).collect();
    assert_eq!(history, [2, 1]);
    let versions = it.get("/v1/catalogues/default/versions?limit=1").await.expect(200);
    assert_eq!(versions["next_cursor"], "1");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_objects_map_lies_on_its_surface_and_is_paged() {
    let it = Harness::trained().await;
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    let known = report["objects"].as_array().unwrap().iter().find(|o| o["name"] == "bar").unwrap();
    let path = "/v1/catalogues/default/versions/1/objects/bar/map";
    let (mut patches, mut cursor) = (Vec::new(), String::from("0"));
    loop {
        let page = it.get(&format!("{path}?limit=20&cursor={cursor}")).await.expect(200);
        for field in ["id", "name", "n_patches", "index_bytes", "origin_in_mesh"] {
            assert_eq!(page[field], known[field], "{field}");
        }
        patches.extend(page["patches"].as_array().unwrap().clone());
        let Some(next) = page["next_cursor"].as_str() else { break };
        assert_eq!(patches.len() % 20, 0);
        next.clone_into(&mut cursor);
    }
    assert_eq!(patches.len() as u64, known["n_patches"].as_u64().unwrap());
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    for patch in &patches {
        // The covering is soft: a touch goes a little into the surface.
        let position = numbers(&patch["position"]);
        let inside = position.iter().zip(BAR).map(|(x, edge)| x.abs() - edge * 0.5e-3);
        let depth = inside.fold(f64::NEG_INFINITY, f64::max);
        assert!(depth.abs() < 5e-3, "{depth} m from the surface: {patch}");
        let norm = numbers(&patch["normal"]).iter().map(|n| n * n).sum::<f64>().sqrt();
        assert!((norm - 1.0).abs() < 1e-5, "{patch}");
        assert!(patch["class"].as_u64().unwrap() < 25, "{patch}");
    }
    let classes: std::collections::BTreeSet<u64> =
        patches.iter().filter_map(|patch| patch["class"].as_u64()).collect();
    assert!(classes.len() > 1, "{classes:?}");
    let id = known["id"].as_str().unwrap();
    let by_id = format!("/v1/catalogues/default/versions/1/objects/{id}/map?limit=1000");
    let whole = it.get(&by_id).await.expect(200);
    assert_eq!((&whole["patches"], &whole["next_cursor"]), (&json!(patches), &Value::Null));
    assert_eq!(whole["distances"]["min"], 0.008);
    assert_eq!(whole["distances"]["n_bins"], 40);
    assert!(whole["n_postings"].as_u64().unwrap() > 0);
    let behind = it.get(&format!("{path}?cursor=99999999")).await.expect(200);
    assert_eq!((&behind["patches"], &behind["next_cursor"]), (&json!([]), &Value::Null));
    for wrong in ["versions/9/objects/bar", "versions/1/objects/mug", "versions/x/objects/bar"] {
        let wrong = it.get(&format!("/v1/catalogues/default/{wrong}/map")).await;
        wrong.problem(404, "not-found", None);
    }
    let many = it.get(&format!("{path}?limit=1001")).await;
    many.problem(422, "invalid-value", Some("?limit"));
}

#[tokio::test(flavor = "multi_thread")]
async fn versions_train_with_any_single_feature_descriptor() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "bar"})).await.expect(201);
    it.put_mesh("bar", &off_box(BAR)).await.expect(200);
    let path = "/v1/catalogues/default/trainings";
    for (version, descriptor) in [(1, "polar_fourier_signed"), (2, "sift")] {
        let training = json!({
            "descriptor": descriptor, "readings_per_object": 40, "n_classes": 4,
        });
        let job = it.post(path, &training).await.expect(202);
        let job = it.finished(job["id"].as_str().unwrap()).await;
        assert_eq!(job["version"], version, "{job}");
        assert_eq!(job["training"]["descriptor"], descriptor);
    }
    let several = it.post(path, &json!({"descriptor": "mr8"})).await;
    several.problem(422, "invalid-value", Some("/descriptor"));
    let unknown = it.post(path, &json!({"descriptor": "fourier"})).await;
    assert_eq!(unknown.status.as_u16() / 100, 4);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_that_takes_too_long_fails_and_says_so() {
    let it = Harness::start_with(|config| {
        config.training_time_max = std::time::Duration::from_millis(20);
    })
    .await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    it.put_mesh("cube", &off_box([60.0, 50.0, 40.0])).await.expect(200);
    let training = json!({"readings_per_object": 5000, "n_classes": 8, "seed": 3});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "failed", "{job}");
    assert!(job["reason"].as_str().unwrap().contains("--training-max-s"), "{job}");
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_can_be_cancelled_until_they_are_finished() {
    let it = Harness::start().await;
    for name in ["cube", "other"] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.put_mesh(name, &off_box([60.0, 50.0, 40.0])).await.expect(200);
    }
    let path = "/v1/catalogues/default/trainings";
    let long = json!({"objects": ["cube"], "readings_per_object": 20_000});
    let running = it.post(path, &long).await.expect(202);
    let queued = it.post(path, &json!({"objects": ["other"]})).await.expect(202);
    let delete = it.send(Method::DELETE, "/v1/objects/other", None).await;
    delete.problem(409, "wrong-state", None);
    let cancel = |job: &Value| format!("/v1/jobs/{}/cancel", job["id"].as_str().unwrap());
    let one = |job: &Value| format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    for job in [&queued, &running] {
        let delete = it.send(Method::DELETE, &one(job), None).await;
        delete.problem(409, "wrong-state", None);
        let cancelled = it.post(&cancel(job), &json!({})).await.expect(200);
        assert_eq!(cancelled["state"], "cancelled", "{cancelled}");
        assert!(cancelled["reason"].as_str().is_some());
        it.post(&cancel(job), &json!({})).await.problem(409, "wrong-state", None);
    }
    it.send(Method::DELETE, "/v1/objects/other", None).await.expect(204);
    let jobs = it.get("/v1/jobs").await.expect(200);
    assert_eq!(jobs["items"].as_array().unwrap().len(), 2);
    it.send(Method::DELETE, &one(&queued), None).await.expect(204);
    it.get(&one(&queued)).await.problem(404, "not-found", None);
    it.send(Method::DELETE, &one(&queued), None).await.problem(404, "not-found", None);
    it.get("/v1/catalogues/default/current").await.problem(409, "wrong-state", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn trainings_beyond_the_queue_are_refused() {
    let it = Harness::start_with(|config| config.training_queue_max = 1).await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    it.put_mesh("cube", &off_box([60.0, 50.0, 40.0])).await.expect(200);
    let path = "/v1/catalogues/default/trainings";
    let long = json!({"readings_per_object": 20_000});
    it.post(path, &long).await.expect(202);
    let refused = it.post(path, &long).await;
    refused.problem(503, "overloaded", None);
    assert_eq!(refused.headers["retry-after"], "1");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_interrupted_training_is_done_after_the_restart() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    it.put_mesh("cube", &off_box([60.0, 50.0, 40.0])).await.expect(200);
    let training = json!({"readings_per_object": 300, "n_classes": 4});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let it = it.restart().await;
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!((&job["state"], &job["version"]), (&json!("succeeded"), &json!(1)), "{job}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_impossible_training_fails_with_a_reason() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "speck"})).await.expect(201);
    it.put_mesh("speck", &off_box([0.01, 0.01, 0.01])).await.expect(200);
    let training =
        json!({"objects": ["speck"], "readings_per_object": 20, "sensor": "tekscan-26x26"});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "failed", "{job}");
    assert!(job["reason"].as_str().unwrap().contains("speck"), "{job}");
}

/// Three boxes to train from their meshes, in a new job.
async fn three_boxes(it: &Harness) -> Value {
    for (name, sides) in [("a", [60.0, 50.0, 40.0]), ("b", [70.0, 30.0, 20.0]), ("c", [50.0; 3])] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.put_mesh(name, &off_box(sides)).await.expect(200);
    }
    let training = json!({"readings_per_object": 1_000, "seed": 5, "sensor_knowledge": "measured"});
    it.post("/v1/catalogues/default/trainings", &training).await.expect(202)
}

/// Files of kept touches of a job.
fn kept(it: &Harness, job: &Value) -> Vec<PathBuf> {
    let folder = it.folder().join("touches").join(job["id"].as_str().unwrap());
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.filter(|path| path.extension().is_some_and(|kind| kind == "touches")).collect()
}

/// Waits until the touches of `n` objects are kept.
async fn touched(it: &Harness, job: &Value, n: usize) {
    for _ in 0..6_000 {
        if kept(it, job).len() >= n {
            return;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("no {n} objects were touched in a minute");
}

/// What a training made of its objects: their first patches.
async fn patches(it: &Harness, job: &Value) -> Vec<Value> {
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!((&job["state"], &job["version"]), (&json!("succeeded"), &json!(1)), "{job}");
    let mut patches = Vec::new();
    for name in ["a", "b", "c"] {
        let path = format!("/v1/catalogues/default/versions/1/objects/{name}/map");
        patches.push(it.get(&path).await.expect(200)["patches"].take());
    }
    patches
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_goes_on_with_the_touches_of_before_its_stops() {
    let undisturbed = Harness::start_with(|config| config.training_threads = 1).await;
    let job = three_boxes(&undisturbed).await;
    let expected = patches(&undisturbed, &job).await;
    assert!(!undisturbed.folder().join("touches").join(job["id"].as_str().unwrap()).exists());

    let it = Harness::start_with(|config| config.training_threads = 1).await;
    let job = three_boxes(&it).await;
    touched(&it, &job, 1).await;
    let it = it.restart_with(|config| config.training_threads = 1).await;
    touched(&it, &job, 2).await;
    // A second orderly stop does not end the job either.
    let it = it.restart_with(|config| config.training_threads = 1).await;
    assert_eq!(patches(&it, &job).await, expected);
    assert!(kept(&it, &job).is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn kept_touches_are_not_taken_again() {
    let it = Harness::start_with(|config| config.training_threads = 1).await;
    let job = three_boxes(&it).await;
    touched(&it, &job, 2).await;
    let files = kept(&it, &job);
    let it = it
        .restart_after(|_| {
            // Each gets the touches of the other.
            let [one, two] = [0, 1].map(|at| std::fs::read(&files[at]).unwrap());
            std::fs::write(&files[0], two).unwrap();
            std::fs::write(&files[1], one).unwrap();
        })
        .await;
    let undisturbed = Harness::start().await;
    let other = three_boxes(&undisturbed).await;
    let (found, expected) = (patches(&it, &job).await, patches(&undisturbed, &other).await);
    // Classes are learnt from all objects together.
    let first = |patches: &Value| patches[0]["position"].clone();
    let equal = found.iter().zip(&expected).map(|(a, b)| first(a) == first(b));
    let equal: Vec<bool> = equal.collect();
    assert_eq!(equal.iter().filter(|equal| **equal).count(), 1, "{equal:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_surface_is_made_of_further_touches_of_the_mesh() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "bar"})).await.expect(201);
    it.put_mesh("bar", &off_box(BAR)).await.expect(200);
    let path = "/v1/catalogues/default/trainings";
    let trained = async |training: Value| {
        let job = it.post(path, &training).await.expect(202);
        let job = it.finished(job["id"].as_str().unwrap()).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let version = format!("/v1/catalogues/default/versions/{}", job["version"]);
        it.get(&version).await.expect(200)
    };
    let usual = json!({"readings_per_object": 60, "n_classes": 4, "seed": 3});
    let usual = trained(usual).await;
    assert_eq!(usual["training"]["surface_readings_per_object"], 60);
    let more = json!({"readings_per_object": 60, "surface_readings_per_object": 150,
        "n_classes": 4, "seed": 3});
    let more = trained(more).await;
    let [usual, more] = [&usual, &more].map(|version| &version["report"]["objects"][0]);
    assert_eq!((&usual["n_readings"], &more["n_readings"]), (&json!(60), &json!(150)));
    // Pair maps are made of the first sixty, which are the same.
    for field in ["n_patches", "index_bytes"] {
        assert_eq!(more[field], usual[field], "{field}");
    }
    let n = |object: &Value| object["surface"]["n_patches"].as_u64().unwrap();
    assert_eq!((n(usual), n(more)), (60, 150));
}
