//! Tests of interest points: where on an object a touch tells most about which object it is.

use serde_json::{Value, json};

use crate::harness::Harness;

const BAR: &str = "/v1/catalogues/default/versions/1/objects/bar/interest";

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn places_of_one_of_two_objects_tell_at_most_a_bit() {
    let it = Harness::trained().await;
    let found = it.get(BAR).await.expect(200);
    assert_eq!((&found["name"], &found["rivals"][0]["name"]), (&json!("bar"), &json!("cube")));
    assert_eq!(found["rivals"].as_array().unwrap().len(), 1);
    // Two objects: one bit.
    assert!((found["bits_max"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    let likeness = found["rivals"][0]["likeness"].as_f64().unwrap();
    assert!((0.01..1.0).contains(&likeness), "{likeness}");
    let places = found["places"].as_array().unwrap();
    assert!((20..=500).contains(&places.len()), "{}", places.len());
    for place in places {
        let bits = place["bits"].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&bits), "{place}");
        // The bar is 80 × 20 × 20 mm about its origin; a touch goes a little into it.
        let (at, normal) = (numbers(&place["position"]), numbers(&place["normal"]));
        assert!(at[0].abs() < 0.045 && at[1].abs() < 0.015 && at[2].abs() < 0.015, "{place}");
        assert!((normal.iter().map(|part| part * part).sum::<f64>() - 1.0).abs() < 1e-4);
    }
    // By id, and by another request: the same.
    let id = found["id"].as_str().unwrap();
    let again = it.get(&BAR.replace("bar/", &format!("{id}/"))).await.expect(200);
    assert_eq!(again, found);
    let it = it.restart().await;
    assert_eq!(it.get(BAR).await.expect(200), found, "computed again, the same");
}

#[tokio::test(flavor = "multi_thread")]
async fn interest_needs_a_version_with_surfaces_and_the_object() {
    let it = Harness::trained().await;
    for (from, to) in [("bar", "none"), ("versions/1", "versions/7"), ("default", "other")] {
        it.get(&BAR.replace(from, to)).await.expect(404);
    }
    let training = json!({"objects": ["bar", "cube"], "readings_per_object": 60, "n_classes": 4,
        "surface": false, "activate": false});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["version"], 2, "{job}");
    it.get(&BAR.replace("versions/1", "versions/2")).await.expect(409);
}
