//! Tests of sensor calibrations: fitted from indentations, applied to later readings, kept
//! for ever.

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::sensor::{ForceCurve, SensorDescription};
use palpate_sim::indent::{IndentationRun, indentation_run};
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, touches};

pub(crate) fn run() -> IndentationRun {
    indentation_run(&SensorDescription::digitacts_6x6(), 3)
}

pub(crate) fn indentations(run: &IndentationRun) -> Value {
    let response = run.response.iter().map(|press| {
        json!({"row": press.taxel / 6, "col": press.taxel % 6, "depth": press.depth,
            "pressures": press.pressures})
    });
    let presses = run.spread.iter().filter(|press| press.depth < 1e-3).map(|press| {
        let (x, y) = press.at;
        json!({"x": x, "y": y, "depth": press.depth, "pressures": press.pressures})
    });
    json!({"response": response.collect::<Vec<_>>(),
        "spread": {"indenter_diameter": 0.001, "presses": presses.collect::<Vec<_>>()}})
}

async fn finger(it: &Harness) {
    let finger = json!({"name": "finger", "preset": "digitacts-6x6"});
    it.post("/v1/sensors", &finger).await.expect(201);
}

fn touch() -> Value {
    let mut reading = touches(BAR, 1, 5, Pose::from_parts(glam::DQuat::IDENTITY, DVec3::ZERO));
    reading[0]["sensor"] = json!("finger");
    reading.remove(0)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_calibration_returns_its_fit_and_check_shows_its_effect() {
    let it = Harness::start().await;
    finger(&it).await;
    let path = "/v1/sensors/finger/calibration";
    it.get(path).await.problem(404, "not-found", None);
    assert_eq!(it.get("/v1/sensors/finger").await.expect(200)["calibration"], Value::Null);
    let run = run();
    let fit = it.post(path, &indentations(&run)).await.expect(201);
    assert_eq!((&fit["number"], &fit["n_unusable"]), (&json!(1), &json!(2)));
    assert_eq!(it.get("/v1/sensors/finger").await.expect(200)["calibration"], 1);
    let sensors = it.get("/v1/sensors").await.expect(200);
    let of = |name: &str| {
        let mut sensors = sensors["items"].as_array().unwrap().iter();
        sensors.find(|sensor| sensor["name"] == name).unwrap()["calibration"].clone()
    };
    assert_eq!((of("finger"), of("digitacts-6x6")), (json!(1), Value::Null));
    assert_eq!((&fit["n_presses"], &fit["spread"]["n_presses"]), (&json!(180), &json!(225)));
    let (dead, (wrong, answers)) = (run.dead.unwrap(), run.cross_wired.unwrap());
    assert_eq!(fit["taxels"][dead]["state"], "dead");
    assert_eq!(fit["taxels"][wrong]["state"], "cross_wired");
    let place = json!({"row": answers / 6, "col": answers % 6});
    assert_eq!(fit["taxels"][wrong]["answers"], place);
    let number = |at: &str| fit.pointer(at).unwrap().as_f64().unwrap();
    assert!(number("/after/residual") < 0.3 * number("/before/residual"), "{fit}");
    assert!((number("/spread/sigma") / number("/spread/described") - 1.0).abs() < 0.05);
    assert!(number("/spread/cosine") > 0.98 && number("/spread/pearson") > 0.9);

    let reading = touch();
    let check = it.post("/v1/sensors/finger/check", &reading).await.expect(200);
    let mut unusable = [dead, wrong];
    unusable.sort_unstable();
    assert_eq!((&check["calibration"], &check["unusable"]), (&json!(1), &json!(unusable)));
    assert_eq!(check["missing"], json!(unusable));
    // Equation 2.1 by hand for one taxel.
    let taxel = (0..36).find(|taxel| !unusable.contains(taxel)).unwrap();
    let own = |key: &str| number(&format!("/taxels/{taxel}/{key}"));
    let raw = reading["image"][taxel].as_f64().unwrap();
    let expected =
        number("/target/offset") + number("/target/slope") * (raw - own("offset")) / own("slope");
    let found = check["image"][taxel].as_f64().unwrap();
    assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found}, {expected}");
    let mut ideal = reading;
    ideal["sensor"] = json!("digitacts-6x6");
    let check = it.post("/v1/sensors/digitacts-6x6/check", &ideal).await.expect(200);
    assert_eq!((&check["calibration"], &check["unusable"]), (&Value::Null, &json!([])));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_calibration_applies_to_later_readings_only() {
    let it = Harness::trained().await;
    finger(&it).await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    let one = |seq: u32| {
        let mut reading = touch();
        (reading["robot"], reading["seq"]) = (json!("arm"), json!(seq));
        json!({"readings": [reading]})
    };
    // One touch gives no identity: a second one, of another sensor, is added.
    let pair = || {
        let mut readings = one(1);
        let mut second = touches(BAR, 2, 5, Pose::from_parts(glam::DQuat::IDENTITY, DVec3::ZERO));
        let mut second = second.remove(1);
        (second["robot"], second["seq"]) = (json!("arm"), json!(2));
        readings["readings"].as_array_mut().unwrap().push(second);
        readings
    };
    let (before, after) = (it.session(json!({})).await, it.session(json!({})).await);
    let readings = |session: &str| format!("/v1/sessions/{session}/readings");
    let plain = it.post(&readings(&before), &pair()).await.expect(200)["belief"].clone();
    it.post("/v1/objects/mug/readings", &one(1)).await.expect(200);
    let path = "/v1/sensors/finger/calibration";
    let first = it.post(path, &indentations(&run())).await.expect(201);
    let corrected = it.post(&readings(&after), &pair()).await.expect(200)["belief"].clone();
    it.post("/v1/objects/mug/readings", &one(2)).await.expect(200);
    assert_ne!(plain["objects"], corrected["objects"], "the same reading, corrected");
    // The repeated reading is a repetition, not a conflict, although it would be corrected now.
    let again = it.post(&readings(&before), &pair()).await.expect(200);
    assert_eq!((&again["n_repeated"], &again["n_readings"]), (&json!(2), &json!(2)));

    let it = it.restart().await;
    let belief =
        async |session: &str| it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200);
    assert_eq!(belief(&before).await, plain);
    assert_eq!(belief(&after).await, corrected);
    let stored = it.get("/v1/objects/mug/readings").await.expect(200);
    let numbers: Vec<&Value> = (0..2).map(|index| &stored["items"][index]["calibration"]).collect();
    assert_eq!(numbers, [&Value::Null, &json!(1)]);
    assert_eq!(stored["items"][0]["image"], stored["items"][1]["image"], "stored as they came");
    assert_eq!(it.get(path).await.expect(200), first);
    assert_eq!(it.post(path, &indentations(&run())).await.expect(201)["number"], 2);
    assert_eq!(it.get(&format!("{path}?number=1")).await.expect(200), first);
    it.get(&format!("{path}?number=3")).await.problem(404, "not-found", None);
    assert_eq!(belief(&after).await, corrected, "still with calibration 1");
}

#[tokio::test(flavor = "multi_thread")]
async fn curves_fit_a_stiffening_sensor_and_show_its_force_curve() {
    let it = Harness::start().await;
    let mut parameters = SensorDescription::digitacts_6x6().parameters().clone();
    // Half as stiff up to a tenth of the range as beyond it.
    let saturation = parameters.saturation;
    let knots = vec![(0.0, 0.0), (1e-3, 0.1 * saturation), (5.5e-3, saturation)];
    parameters.force_curve = ForceCurve::new(knots.clone()).unwrap();
    let stiff = SensorDescription::new(parameters).unwrap();
    let digitacts = it.get("/v1/sensors/digitacts-6x6").await.expect(200);
    let knot = |(displacement, pressure): &(f64, f64)| json!({"displacement": displacement, "pressure": pressure});
    let mut description = digitacts["description"].clone();
    description["force_curve"] = knots.iter().map(knot).collect();
    let sensor = json!({"name": "stiff", "description": description});
    it.post("/v1/sensors", &sensor).await.expect(201);
    let path = "/v1/sensors/stiff/calibration";
    let mut body = indentations(&indentation_run(&stiff, 4));
    let lines = it.post(path, &body).await.expect(201);
    assert_eq!((&lines["form"], &lines["curve"]), (&json!("lines"), &Value::Null));
    assert_eq!(lines["force_curve"], Value::Null);
    body["form"] = json!("curves");
    let curves = it.post(path, &body).await.expect(201);
    assert_eq!(curves["form"], "curves");
    assert!(curves["after"]["residual"].as_f64() < curves["before"]["residual"].as_f64());
    assert_eq!(curves["curve"].as_array().unwrap().len(), 5, "one knot a depth");
    let unused = |taxel: &&Value| taxel["curve"].is_null();
    let n_unused = curves["taxels"].as_array().unwrap().iter().filter(unused).count();
    assert_eq!(json!(n_unused), curves["n_unusable"]);
    // The force curve stiffens as the sensor does, by a factor of 2.
    let found = curves["force_curve"].as_array().unwrap();
    let slope = |pair: &[Value]| {
        let of = |knot: &Value, key: &str| knot[key].as_f64().unwrap();
        (of(&pair[1], "pressure") - of(&pair[0], "pressure"))
            / (of(&pair[1], "displacement") - of(&pair[0], "displacement"))
    };
    let slopes: Vec<f64> = found.windows(2).map(slope).collect();
    let ratio = slopes.last().unwrap() / slopes[1];
    assert!((1.6..2.4).contains(&ratio), "{slopes:?}");
    assert_eq!(it.get(path).await.expect(200), curves, "read back from the store");
    body["form"] = json!("splines");
    it.post(path, &body).await.problem(422, "invalid-value", Some("/form"));
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_indentations_are_refused() {
    let it = Harness::start().await;
    finger(&it).await;
    let path = "/v1/sensors/finger/calibration";
    let good = indentations(&run());
    let check = async |at: &str, value: Value, pointer: &str| {
        let mut body = good.clone();
        *body.pointer_mut(at).unwrap() = value;
        it.post(path, &body).await.problem(422, "invalid-value", Some(pointer));
    };
    check("/response", json!([]), "/response").await;
    check("/response/4/depth", json!(-1e-4), "/response/4/depth").await;
    check("/response/4/depth", json!(0.4), "/response/4/depth").await;
    check("/response/4/row", json!(6), "/response/4/row").await;
    check("/response/4/pressures", json!([1.0]), "/response/4/pressures").await;
    check("/response/4/pressures/2", json!(1e300), "/response/4/pressures/2").await;
    check("/spread/presses", json!([]), "/spread/presses").await;
    check("/spread/presses/3/x", json!(1.2), "/spread/presses/3/x").await;
    check("/spread/indenter_diameter", json!(-1.0), "/spread/indenter_diameter").await;
    let nothing = json!(vec![Value::Null; 36]);
    check("/spread/presses/3/pressures", nothing, "/spread/presses/3/pressures").await;
    let mut body = good.clone();
    body["response"].as_array_mut().unwrap().retain(|press| press["row"] != 2);
    let refused = it.post(path, &body).await.problem(422, "invalid-value", Some("/response"));
    assert!(refused["detail"].as_str().unwrap().contains("row 2, column 0"), "{refused}");
    it.post("/v1/sensors/nobody/calibration", &good).await.problem(404, "not-found", None);
    it.get(path).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_sharpest_covering_without_aliasing_is_recommended() {
    let it = Harness::start().await;
    let path = "/v1/analyses/covering";
    let body = json!({"element_width": 0.002, "spreads": [0.0006, 0.0034, 0.0028],
        "force_resolutions": [0.1]});
    let answer = it.post(path, &body).await.expect(200);
    // The bound is 3/π element widths: 1.9099 mm.
    assert!((answer["aliasing_spread"].as_f64().unwrap() - 1.9099e-3).abs() < 1e-7);
    assert_eq!(answer["recommended"], 2);
    let coverings = answer["coverings"].as_array().unwrap();
    let avoids: Vec<&Value> = coverings.iter().map(|one| &one["avoids_aliasing"]).collect();
    assert_eq!(avoids, [false, true, true]);
    assert_eq!(coverings[0]["thickness"], Value::Null, "no covering is so sharp");
    // (1.4 − 1.11) / 0.497 · 2 mm.
    assert!((coverings[2]["thickness"].as_f64().unwrap() - 1.16700e-3).abs() < 1e-8);
    let distinct = |index: usize| coverings[index]["acuity"][0]["representations"].as_u64();
    assert!(distinct(0) > distinct(1), "0.3 element widths tell more places apart than 1.7");

    let four = it.post(path, &json!({"element_width": 0.002})).await.expect(200);
    assert_eq!(four["coverings"].as_array().unwrap().len(), 4);
    assert_eq!(four["coverings"][0]["acuity"].as_array().unwrap().len(), 25);
    assert_eq!(four["recommended"], 0);
    for (body, pointer) in [
        (json!({"element_width": 0.0}), "/element_width"),
        (json!({}), "/element_width"),
        (json!({"element_width": 0.002, "thicknesses": []}), "/thicknesses"),
        (json!({"element_width": 0.002, "thicknesses": [0.001, 1.0]}), "/thicknesses/1"),
        (json!({"element_width": 0.002, "thicknesses": [0.001], "spreads": [0.001]}), "/spreads"),
        (json!({"element_width": 0.002, "force_resolutions": [0]}), "/force_resolutions/0"),
    ] {
        it.post(path, &body).await.problem(422, "invalid-value", Some(pointer));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn missing_sensor_properties_get_defaults() {
    let it = Harness::start().await;
    let known = it.get("/v1/sensors/digitacts-6x6").await.expect(200)["description"].clone();
    let mut sheet = known.clone();
    for field in ["point_spread", "force_curve", "noise"] {
        sheet.as_object_mut().unwrap().remove(field);
    }
    let post = async |name: &str, description: &Value| {
        it.post("/v1/sensors", &json!({"name": name, "description": description})).await
    };
    // The presets use the defaults, and are data sheets as well.
    let derived = post("sheet", &sheet).await.expect(201)["description"].clone();
    assert!(derived["ranges"].is_object());
    assert_eq!(derived, known);
    sheet["quantisation"] = json!(500.0);
    let coarse = post("coarse", &sheet).await.expect(201);
    assert_eq!(coarse["description"]["noise"], 500.0, "a step is more than half a percent");
    sheet["noise"] = json!(30.0);
    assert_eq!(post("stated", &sheet).await.expect(201)["description"]["noise"], 30.0);
    // The given invalid field is named, not one derived from it.
    for (field, value) in [("covering_thickness", 0.0), ("saturation", -1.0)] {
        let mut wrong = sheet.clone();
        wrong[field] = json!(value);
        let pointer = format!("/description/{field}");
        post("wrong", &wrong).await.problem(422, "invalid-value", Some(&pointer));
    }
}
