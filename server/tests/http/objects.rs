//! Tests of sensors and objects: stored values are returned, names are unique.

use reqwest::Method;
use serde_json::json;

use crate::harness::{BAR, CUBE, Harness, off_box, quiet_reading};

#[tokio::test(flavor = "multi_thread")]
async fn presets_exist_and_sensors_can_be_added() {
    let it = Harness::start().await;
    let page = it.get("/v1/sensors").await.expect(200);
    assert_eq!(page["items"].as_array().unwrap().len(), 13);
    let known = it.get("/v1/sensors/digitacts-6x6").await.expect(200);
    assert_eq!(known["description"]["grid"]["rows"], 6);
    let example = include_str!("../../../schemas/examples/create_sensor.json");
    let given: serde_json::Value = serde_json::from_str(example).unwrap();
    let made = it.post("/v1/sensors", &given).await.expect(201);
    let mut described = made["description"].clone();
    for open in ["ranges", "taxels"] {
        described.as_object_mut().unwrap().remove(open);
    }
    assert_eq!(described, given["description"]);
    let id = made["id"].as_str().unwrap();
    assert_eq!(it.get(&format!("/v1/sensors/{id}")).await.expect(200), made);
    let again = it.post("/v1/sensors", &given).await;
    again.problem(409, "conflict", Some("/name"));
    let mut wrong = given;
    wrong["name"] = json!("other");
    wrong["description"]["grid"]["pitch"] = json!(2.0);
    let refused = it.post("/v1/sensors", &wrong).await;
    refused.problem(422, "invalid-value", Some("/description/grid/pitch"));
    let both = json!({"name": "other", "preset": "digitacts-6x6",
        "description": wrong["description"]});
    it.post("/v1/sensors", &both).await.problem(422, "invalid-value", Some("/preset"));
    let odd = json!({"name": "other", "preset": "digitacts-7x7"});
    it.post("/v1/sensors", &odd).await.problem(422, "invalid-value", Some("/preset"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reading_can_be_checked_without_storing_it() {
    let it = Harness::start().await;
    let sensor = json!({"name": "turned", "preset": "digitacts-6x6",
        "image_order": {"rows_reversed": true}});
    it.post("/v1/sensors", &sensor).await.expect(201);
    let mut reading = quiet_reading();
    reading["sensor"] = json!("turned");
    // Row 0, column 5 of the driver's image is row 5, column 5 of the sensor frame, with its
    // centre at 5 mm along x and y; the sensor is 100 mm above the session's origin.
    reading["image"][5] = json!(8000.0);
    reading["image"][0] = serde_json::Value::Null;
    let check = it.post("/v1/sensors/turned/check", &reading).await.expect(200);
    assert_eq!(check["contact"], json!([35]));
    assert_eq!(check["missing"], json!([30]));
    assert_eq!(check["saturated"], json!([]));
    let close = |value: &serde_json::Value, expected: f64| {
        assert!((value.as_f64().unwrap() - expected).abs() < 1e-9, "{check}");
    };
    close(&check["centroid_in_sensor"]["x"], 0.005);
    close(&check["centroid_in_sensor"]["y"], 0.005);
    close(&check["centroid_in_session"]["z"], 0.1);
    close(&check["sensor_z_in_session"]["z"], 1.0);
    let quiet = it.post("/v1/sensors/digitacts-6x6/check", &quiet_reading()).await.expect(200);
    assert!(quiet["hints"][0].as_str().unwrap().contains("free space"), "{quiet}");
    let other = it.post("/v1/sensors/turned/check", &quiet_reading()).await;
    other.problem(422, "invalid-value", Some("/sensor"));
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_are_created_changed_listed_and_deleted() {
    let it = Harness::start().await;
    for name in ["mug", "tyre", "glass"] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
    }
    it.post("/v1/objects", &json!({"name": "mug"})).await.problem(409, "conflict", Some("/name"));
    for name in ["", "two words", "-x", "0192f0a0-0000-7000-8000-000000000000"] {
        let refused = it.post("/v1/objects", &json!({"name": name})).await;
        refused.problem(422, "invalid-value", Some("/name"));
    }
    let first = it.get("/v1/objects?limit=2").await.expect(200);
    let cursor = first["next_cursor"].as_str().unwrap();
    let rest = it.get(&format!("/v1/objects?limit=2&cursor={cursor}")).await.expect(200);
    assert_eq!(rest["items"][0]["name"], "glass");
    assert_eq!(rest["next_cursor"], json!(null));
    let rename = json!({"name": "cup", "description": "blue"}).to_string().into_bytes();
    let body = || Some(("application/json", rename.clone()));
    let renamed = it.send(Method::PATCH, "/v1/objects/mug", body()).await.expect(200);
    assert_eq!((&renamed["name"], &renamed["description"]), (&json!("cup"), &json!("blue")));
    it.get("/v1/objects/mug").await.problem(404, "not-found", None);
    let taken = it.send(Method::PATCH, "/v1/objects/tyre", body()).await;
    taken.problem(409, "conflict", Some("/name"));
    it.send(Method::DELETE, "/v1/objects/cup", None).await.expect(204);
    it.send(Method::DELETE, "/v1/objects/cup", None).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_are_returned_unchanged() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "bar"})).await.expect(201);
    it.get("/v1/objects/bar/mesh").await.problem(404, "not-found", None);
    let report = it.put_mesh("bar", &off_box(BAR)).await.expect(200);
    assert_eq!(report["n_triangles"], 12);
    assert_eq!(report["warnings"], json!([]));
    assert!((report["size"][0].as_f64().unwrap() - 0.08).abs() < 1e-9, "{report}");
    let file = it.get("/v1/objects/bar/mesh").await;
    assert_eq!(
        (file.text.as_str(), &file.headers["content-type"]),
        (off_box(BAR).as_str(), &"model/off".parse().unwrap())
    );
    let path = "/v1/objects/bar/mesh?unit=m&format=off";
    let plain = Some(("application/octet-stream", off_box(CUBE).into_bytes()));
    let report = it.send(Method::PUT, path, plain).await.expect(200);
    assert!(report["warnings"][0].as_str().unwrap().contains("in mm ("), "{report}");
    let tiny = off_box([0.04, 0.04, 0.04]);
    let report = it.put_mesh("bar", &tiny).await.expect(200);
    assert!(report["warnings"][0].as_str().unwrap().contains("in m ("), "{report}");
}

#[tokio::test(flavor = "multi_thread")]
async fn training_readings_are_stored_once_and_listed() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    let mut readings = vec![quiet_reading(); 3];
    for (seq, reading) in readings.iter_mut().enumerate() {
        reading["robot"] = json!("arm");
        reading["seq"] = json!(seq);
        reading["stamp"] = json!({"sec": 0, "nanosec": 5});
    }
    let path = "/v1/objects/mug/readings";
    let added = it.post(path, &json!({"readings": readings})).await.expect(200);
    let counts = |n_new: u32, n_repeated: u32| json!({"n_new": n_new, "n_repeated": n_repeated, "n_readings": 3, "warnings": []});
    assert_eq!(added, counts(3, 0));
    let added = it.post(path, &json!({"readings": readings})).await.expect(200);
    assert_eq!(added, counts(0, 3));
    readings[1]["image"][0] = json!(5.0);
    let other = it.post(path, &json!({"readings": readings})).await;
    other.problem(409, "conflict", Some("/readings/1"));
    let page = it.get(&format!("{path}?limit=2")).await.expect(200);
    assert_eq!(page["items"][0]["stamp"], json!({"sec": 0, "nanosec": 5}));
    let cursor = page["next_cursor"].as_str().unwrap();
    let rest = it.get(&format!("{path}?cursor={cursor}")).await.expect(200);
    assert_eq!((&rest["items"][0]["index"], &rest["next_cursor"]), (&json!(2), &json!(null)));
    let mut wide = quiet_reading();
    wide["sensor"] = json!("fingertip-14x14");
    wide["image"] = json!(vec![0.0; 196]);
    let other_sensor = it.post(path, &json!({"readings": [wide]})).await;
    other_sensor.problem(422, "invalid-value", Some("/readings/0/sensor"));
    readings[0]["frame_id"] = json!("table");
    let mixed = it.post(path, &json!({"readings": readings})).await;
    mixed.problem(422, "invalid-value", Some("/readings/1/frame_id"));
    readings[1]["frame_id"] = json!("");
    let unnamed = it.post(path, &json!({"readings": readings})).await;
    let problem = unnamed.problem(422, "invalid-value", Some("/readings/1/frame_id"));
    let detail = problem["errors"][0]["detail"].as_str().unwrap();
    assert!(detail.starts_with("came null, expected \"table\""), "{detail}");
    assert_eq!(it.get("/v1/objects/mug").await.expect(200)["n_readings"], 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_small_picture_follows_its_mesh() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    let path = "/v1/objects/mug/thumbnail.png";
    it.get(path).await.problem(404, "not-found", None);
    it.put_mesh("mug", &off_box(CUBE)).await.expect(200);
    let picture = async |it: &Harness| {
        let answer = it.client.get(it.url(path)).send().await.unwrap();
        assert_eq!(answer.status(), 200);
        assert_eq!(answer.headers()["content-type"], "image/png");
        let tag = answer.headers()["etag"].to_str().unwrap().to_owned();
        (tag, answer.bytes().await.unwrap())
    };
    let (tag, cube) = picture(&it).await;
    assert!(cube.starts_with(b"\x89PNG") && cube.len() < 20_000, "{} bytes", cube.len());
    let again = it.client.get(it.url(path)).header("if-none-match", &tag).send().await.unwrap();
    assert_eq!(again.status(), 304);

    // Made at the upload, made again if it is missing, and gone with its mesh.
    let folder = it.folder().join("thumbnails");
    let files = || std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path());
    assert_eq!(files().count(), 1);
    std::fs::write(files().next().unwrap(), &cube[..100]).unwrap();
    assert_eq!(picture(&it).await, (tag.clone(), cube.clone()));
    it.put_mesh("mug", &off_box(BAR)).await.expect(200);
    let (other_tag, bar) = picture(&it).await;
    assert!(other_tag != tag && bar != cube);
    assert_eq!(files().count(), 1);
    std::fs::write(folder.join("00000000000000000000000000000001"), b"of no mesh").unwrap();
    let it = it.restart().await;
    assert_eq!(files().count(), 1);
    assert_eq!(picture(&it).await, (other_tag, bar));
    it.send(Method::DELETE, "/v1/objects/mug", None).await.expect(204);
    assert_eq!(files().count(), 0);
}

const GLB: &[u8] = include_bytes!("../../../fuzz/corpus/mesh_packed/seed-glb");
const THREE_MF: &[u8] = include_bytes!("../../../fuzz/corpus/mesh_packed/seed-3mf");

#[tokio::test(flavor = "multi_thread")]
async fn a_unit_is_asked_only_of_files_that_record_none() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "part"})).await.expect(201);
    let put = async |query: &str, kind, bytes: &[u8]| {
        let path = format!("/v1/objects/part/mesh{query}");
        it.send(Method::PUT, &path, Some((kind, bytes.to_vec()))).await
    };
    let (glb, three_mf) = ("model/gltf-binary", "model/3mf");
    // A tetrahedron of nine units, twice as large by its node; and in inches.
    for (query, kind, bytes, unit, size) in [
        ("", glb, GLB, "m", 18.0),
        ("?unit=m", glb, GLB, "m", 18.0),
        ("?format=glb", "application/octet-stream", GLB, "m", 18.0),
        ("", three_mf, THREE_MF, "in", 0.2286),
        ("?format=3mf", "application/octet-stream", THREE_MF, "in", 0.2286),
    ] {
        let report = put(query, kind, bytes).await.expect(200);
        assert_eq!((&report["mesh"]["unit"], &report["n_triangles"]), (&json!(unit), &json!(4)));
        assert!((report["size"][0].as_f64().unwrap() - size).abs() < 1e-9, "{report}");
        let stored = it.get("/v1/objects/part").await.expect(200);
        assert_eq!(stored["mesh"]["unit"], unit);
        it.get("/v1/objects/part/thumbnail.png").await;
    }
    let file = it.get("/v1/objects/part/mesh").await;
    assert_eq!(file.headers["content-type"], three_mf);
    for (query, kind, bytes) in [
        ("?unit=mm", glb, GLB),
        ("?unit=mm", three_mf, THREE_MF),
        ("", "model/off", off_box(CUBE).as_bytes()),
    ] {
        put(query, kind, bytes).await.problem(422, "invalid-value", Some("?unit"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn refusals_of_meshes_say_what_the_file_is_and_what_to_do() {
    let it = Harness::start_with(|config| config.mesh_bytes_max = 2_500_000).await;
    it.post("/v1/objects", &json!({"name": "part"})).await.expect(201);
    let refused = async |kind, bytes: Vec<u8>| {
        let path = "/v1/objects/part/mesh?unit=mm";
        let answer = it.send(Method::PUT, path, Some((kind, bytes))).await;
        assert!([413, 422].contains(&answer.status.as_u16()), "{answer:?}");
        answer.text
    };
    let zip = [b"PK\x03\x04", &[0; 80][..], b"mug.stl"].concat();
    let step = b"ISO-10303-21;\nHEADER;\n".repeat(9);
    let tiny = off_box([4e-24; 3]).into_bytes();
    let huge = off_box([4e31; 3]).into_bytes();
    for (kind, bytes, expected) in [
        ("model/stl", zip, "ZIP archive"),
        ("model/stl", step, "export STL or 3MF"),
        ("model/stl", off_box(CUBE).repeat(9).into_bytes(), "begins as OFF does"),
        ("model/stl", vec![0; 3_000_000], "longer than 2.50 MB: decimate"),
        ("model/off", tiny, "extent 4e-27 m"),
        ("model/off", huge, "extent of 4e28 m"),
    ] {
        let text = refused(kind, bytes).await;
        assert!(text.contains(expected), "{expected}: {text}");
    }
}
