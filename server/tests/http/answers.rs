//! No answer grows without bound with what is stored: a table of everything that is read.

use std::collections::BTreeMap;

use palpate_server::openapi::document;
use reqwest::Method;
use serde_json::{Value, json};

use crate::calibration::{indentations, run};
use crate::harness::{Harness, quiet_reading};

/// What bounds the answer to a reading request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bound {
    /// `limit` and `cursor`, and bytes where items are large.
    Pages,
    /// A fixed number of things, as stated.
    Constant(&'static str),
    /// One thing, which a limit bounds when it comes in.
    One,
    /// Events, one after another.
    Stream,
}

use Bound::{Constant, One, Pages, Stream};

/// Every `GET` of the API. A new one needs a line here.
const ANSWERS: &[(&str, Bound)] = &[
    ("livez", Constant("a word")),
    ("readyz", Constant("the checks")),
    ("metrics", Constant("labels of closed sets, 100 keys, 10 things")),
    ("version", Constant("one")),
    ("whoami", Constant("one")),
    ("list_audit", Pages),
    ("list_catalogues", Pages),
    ("get_catalogue", Constant("its last switches and aliases")),
    ("get_current", Constant("one")),
    ("list_versions", Pages),
    ("get_version", One),
    ("get_block", One),
    ("get_interest", One),
    ("get_object_map", Pages),
    ("get_occupancy", One),
    ("get_occupancy_ply", One),
    ("get_occupancy_png", One),
    ("get_package", One),
    ("get_report", One),
    ("get_appearance_report", One),
    ("events", Stream),
    ("get_fleet", Pages),
    ("get_forwarding", Constant("100 refused sessions and 100 sensors")),
    ("list_jobs", Pages),
    ("get_job", One),
    ("job_events", Stream),
    ("list_keys", Pages),
    ("get_key", Constant("one")),
    ("list_objects", Pages),
    ("get_object", One),
    ("get_mesh", One),
    ("list_object_readings", Pages),
    ("get_thumbnail", Constant("256 by 256 pixels")),
    ("list_reference_bodies", Constant("four")),
    ("get_reference_mesh", Constant("one of four")),
    ("list_robots", Pages),
    ("list_sensors", Pages),
    ("get_sensor", One),
    ("get_calibration", One),
    ("get_sensor_health", Constant("the days of the ring")),
    ("get_sensor_package", Pages),
    ("get_passport", One),
    ("list_sessions", Pages),
    ("get_session", One),
    ("get_belief", One),
    ("session_events", Stream),
    ("explain_session", Constant("200 readings")),
    ("get_marginals", Constant("bins")),
    ("list_session_readings", Pages),
    ("replay_session", Constant("`limit` steps after `after`")),
    ("get_storage", Constant("10,000 keys and 11 things")),
    ("list_webhooks", Pages),
    ("get_webhook", Constant("one")),
    ("list_webhook_deliveries", Pages),
    ("get_webhook_delivery", One),
];

#[test]
fn every_answer_has_a_bound_or_pages() {
    let document: Value = serde_json::to_value(document()).unwrap();
    let bounds: BTreeMap<&str, Bound> = ANSWERS.iter().copied().collect();
    for (path, item) in document["paths"].as_object().unwrap() {
        let Some(get) = item.get("get") else { continue };
        let operation = get["operationId"].as_str().unwrap();
        let bound = bounds.get(operation).unwrap_or_else(|| panic!("{path}: what bounds it?"));
        let parameters = get["parameters"].as_array().cloned().unwrap_or_default();
        let has = |name: &str| parameters.iter().any(|it| it["name"] == name);
        assert_eq!(*bound == Pages, has("limit") && has("cursor"), "{operation}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_package_of_a_sensor_has_pages() {
    let it = Harness::start().await;
    let sensor = json!({"name": "probe", "preset": "digitacts-6x6"});
    it.post("/v1/sensors", &sensor).await.expect(201);
    let body = json!({"response": indentations(&run())["response"]});
    for _ in 0..5 {
        it.post("/v1/sensors/probe/calibration", &body).await.expect(201);
    }
    let (mut path, mut calibrations, mut n_pages) =
        ("/v1/sensors/probe/package?limit=2".to_owned(), Vec::new(), 0);
    loop {
        let page = it.get(&path).await.expect(200);
        assert_eq!(page["first"], json!(calibrations.len()), "{page}");
        calibrations.extend(page["calibrations"].as_array().unwrap().clone());
        n_pages += 1;
        let Some(cursor) = page["next_cursor"].as_str() else { break };
        path = format!("/v1/sensors/probe/package?limit=2&cursor={cursor}");
    }
    assert_eq!((calibrations.len(), n_pages), (5, 3));
    let wrong = it.send(Method::GET, "/v1/sensors/probe/package?limit=0", None).await;
    wrong.problem(422, "invalid-value", Some("?limit"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_that_takes_too_much_memory_is_refused() {
    let it = Harness::trained_with(|config| config.training_memory_bytes_max = 30_000_000).await;
    let path = "/v1/catalogues/default/trainings";
    let large = |field: &str, n: u64| {
        let mut asked = json!({"readings_per_object": 60, "n_classes": 8});
        asked[field] = json!(n);
        asked
    };
    for field in ["readings_per_object", "surface_readings_per_object"] {
        let refused = it.post(path, &large(field, 20_000)).await;
        let pointer = format!("/{field}");
        let problem = refused.problem(422, "invalid-value", Some(&pointer));
        let detail = problem["errors"][0]["detail"].as_str().unwrap();
        assert!(detail.contains("--training-memory-mb"), "{detail}");
    }
    let both = json!({
        "readings_per_object": 20_000, "surface_readings_per_object": 20_000, "surface": false,
    });
    it.post(path, &both).await.problem(422, "invalid-value", Some("/readings_per_object"));
    it.post(path, &large("seed", 4)).await.expect(202);
    assert_eq!(it.get("/v1/jobs").await.expect(200)["items"].as_array().unwrap().len(), 2);
    let it = it.restart_with(|config| config.training_memory_bytes_max = 1_000_000).await;
    it.post(path, &json!({})).await.problem(422, "invalid-value", Some("/objects"));
    // Three readings of 36 taxels and features of 4,096 values: 3 × (300 + 110 × 4,132) bytes.
    it.post("/v1/objects", &json!({"name": "felt"})).await.expect(201);
    let mut reading = quiet_reading();
    for feature in [vec![0; 4096], vec![1; 4096], vec![2; 4096]] {
        reading["feature"] = json!(feature);
        let readings = json!({"readings": [reading]});
        it.post("/v1/objects/felt/readings", &readings).await.expect(200);
    }
    let felt = it.post(path, &json!({"objects": ["felt"]})).await;
    felt.problem(422, "invalid-value", Some("/objects"));
}
