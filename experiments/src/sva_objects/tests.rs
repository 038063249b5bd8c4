//! Small runs of `sva-objects`.

use palpate_sim::shapes;

use super::*;
use crate::arguments::defaults;

#[test]
fn a_small_run_on_a_folder_of_meshes_reports_every_key() {
    let folder = std::env::temp_dir().join(format!("palpate-sva-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for name in ["hammer", "gear"] {
        let mesh = shapes::example(name).unwrap();
        std::fs::write(folder.join(format!("{name}.stl")), mesh.to_stl_bytes()).unwrap();
    }
    let config = SvaObjects {
        objects: ObjectSet { meshes: Some(folder.clone()), ..defaults() },
        trials: 3,
        touches: TouchSet { train_readings: 200, test_readings: 30, ..defaults() },
        readings: 10,
        as_printed: true,
        ..defaults()
    };
    let outcome = run(&config, &|_, _, _| ()).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let summary = &outcome.report.summary;
    assert!(summary["accuracy_at_10"] > 0.9, "{summary:?}");
    assert!(summary["position_error_mm_median_at_10"] < 10.0, "{summary:?}");
    assert!(summary["index_bytes"] < 20e6, "{summary:?}");
    assert!(summary.contains_key("literal_accuracy_at_10"));
    assert!(summary.contains_key("printed_range_accuracy_at_10"));
    assert_eq!(outcome.pictures.len(), 4, "front and back of both objects");
    assert!(outcome.plot.contains("polyline"));
    // The printed method also distinguishes a hammer from a gear.
    assert!(summary["as_printed_accuracy_at_10"] > 0.5, "{summary:?}");
    // T_a keeps some classes of 25, not all.
    let kept = summary["as_printed_classes_kept_mean"];
    assert!((1.0..10.0).contains(&kept), "{kept}");
    // Ten rows for each of five methods, one row of coverage per object, and the confusions.
    assert!(outcome.report.rows.len() >= 5 * 10 + 2);
}
