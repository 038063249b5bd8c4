//! Tests of coupling and knowledge of sensors: stored, returned, with defaults, and checked.

use serde_json::{Value, json};

use crate::harness::Harness;

fn described() -> Value {
    json!({"grid": {"rows": 4, "cols": 4, "pitch": 0.004, "taxel_width": 0.003},
        "covering_thickness": 0.003, "saturation": 50_000.0, "quantisation": 0.0})
}

#[tokio::test(flavor = "multi_thread")]
async fn presets_and_descriptions_are_data_sheets_by_default() {
    let it = Harness::start().await;
    let new = json!({"name": "palm", "description": described()});
    let made = it.post("/v1/sensors", &new).await.expect(201);
    assert_eq!(made["sensor_knowledge"], "data_sheet");
    let coupling = json!({"kernel": "gaussian", "margin": null, "edge": "continues",
        "cross_talk": 0.0, "gain_spread": 0.0, "hysteresis": 0.0});
    assert_eq!(made["description"]["coupling"], coupling);
    // Four pitches of 4 mm.
    let ranges = &made["description"]["ranges"];
    assert_eq!(ranges["margin"], json!({"low": 0.0, "high": 0.016}));
    assert_eq!(ranges["edges"], json!(["continues", "conserves_force", "loses_force"]));
    // What the answer describes can be sent again.
    let copy = json!({"name": "copy", "description": made["description"]});
    let copy = it.post("/v1/sensors", &copy).await.expect(201);
    assert_eq!(copy["description"], made["description"]);
    // Those of the start, and a new one of each.
    for preset in palpate_core::sensor::Preset::NAMES {
        let new = json!({"name": format!("my-{preset}"), "preset": preset});
        let new = it.post("/v1/sensors", &new).await.expect(201);
        let found = it.get(&format!("/v1/sensors/{preset}")).await.expect(200);
        for sensor in [new, found] {
            assert_eq!(sensor["sensor_knowledge"], "data_sheet", "{preset}");
            assert!(sensor["description"]["ranges"].is_object(), "{preset}");
        }
    }
    let simulated =
        json!({"name": "exact", "preset": "digitacts-6x6", "sensor_knowledge": "measured"});
    let simulated = it.post("/v1/sensors", &simulated).await.expect(201);
    assert_eq!(simulated["sensor_knowledge"], "measured");
    assert_eq!(simulated["description"]["ranges"], Value::Null);
}

#[tokio::test(flavor = "multi_thread")]
async fn stated_coupling_and_ranges_survive_a_restart() {
    let it = Harness::start().await;
    let mut description = described();
    description["coupling"] = json!({"margin": 0.001, "edge": "loses_force", "cross_talk": 0.1});
    description["ranges"] = json!({"stiffness": {"low": 0.8, "high": 1.25},
        "cross_talk": {"low": 0.05, "high": 0.2}});
    let new = json!({"name": "palm", "description": description});
    it.post("/v1/sensors", &new).await.expect(201);
    let thumb = json!({"name": "thumb", "preset": "digitacts-6x6",
        "sensor_knowledge": "data_sheet", "coupling": {"margin": 0.0}});
    let thumb = it.post("/v1/sensors", &thumb).await.expect(201);
    let it = it.restart().await;
    let palm = it.get("/v1/sensors/palm").await.expect(200)["description"].clone();
    assert_eq!(palm["coupling"]["edge"], "loses_force");
    let ranges = &palm["ranges"];
    assert_eq!(ranges["margin"], json!({"low": 0.001, "high": 0.001}));
    assert_eq!(ranges["edges"], json!(["loses_force"]));
    assert_eq!(ranges["stiffness"], json!({"low": 0.8, "high": 1.25}));
    assert_eq!(ranges["cross_talk"], json!({"low": 0.05, "high": 0.2}));
    assert_eq!(it.get("/v1/sensors/thumb").await.expect(200), thumb);
    assert_eq!(thumb["description"]["coupling"]["margin"], 0.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_coupling_and_ranges_are_refused_by_field() {
    let it = Harness::start().await;
    let check = async |part: &str, value: Value, pointer: &str| {
        let mut description = described();
        description[part] = value;
        let new = json!({"name": "palm", "description": description});
        it.post("/v1/sensors", &new).await.problem(422, "invalid-value", Some(pointer));
    };
    check("coupling", json!({"margin": 1.0}), "/description/coupling/margin").await;
    check("coupling", json!({"cross_talk": -0.1}), "/description/coupling/cross_talk").await;
    let turned = json!({"stiffness": {"low": 2.0, "high": 0.5}});
    check("ranges", turned, "/description/ranges/stiffness").await;
    check("ranges", json!({"edges": []}), "/description/ranges/edges").await;
    let far = json!({"margin": {"low": 0.0, "high": 0.5}});
    check("ranges", far, "/description/ranges/margin").await;
    check("coupling", json!({"edge": "frays"}), "/description/coupling/edge").await;
    let wide = json!({"name": "palm", "preset": "digitacts-6x6", "coupling": {"hysteresis": 2.0}});
    it.post("/v1/sensors", &wide).await.problem(422, "invalid-value", Some("/coupling/hysteresis"));
    let mut description = described();
    description["ranges"] = json!({"stiffness": {"low": 0.5, "high": 2.0}});
    let sure = json!({"name": "palm", "description": description, "sensor_knowledge": "measured"});
    it.post("/v1/sensors", &sure).await.problem(422, "invalid-value", Some("/description/ranges"));
}
