//! Tests of the commands that search for sessions, label and export them, and compare versions.

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Server, stderr, stdout};

#[test]
fn sessions_are_searched_labelled_exported_and_replayed() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(&folder.path().join("data"), "");
    let done = |arguments: &str| {
        let output = server.run("", arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", stderr(&output));
        stdout(&output)
    };
    let read = |arguments: &str| -> Value { serde_json::from_str(&done(arguments)).unwrap() };
    let meshes = folder.path().display();
    for object in ["hammer", "mug"] {
        done(&format!("objects example {object} --out {meshes}"));
        done(&format!("objects add {object} --mesh {meshes}/{object}.stl --unit mm"));
    }
    done("train --readings-per-object 60");
    let touch = |object: &str, seed: u32| {
        let mesh = format!("{meshes}/{object}.stl");
        let options = format!("--readings 6 --seed {seed} --json");
        // The answer may be wrong, which is exit 4: the session is there all the same.
        let output = server.run("", &format!("touch --object {object} --mesh {mesh} {options}"));
        let touched: Value = serde_json::from_str(&stdout(&output)).unwrap();
        touched["session"].as_str().unwrap().to_owned()
    };
    let (mug, hammer) = (touch("mug", 3), touch("hammer", 4));
    done(&format!("sessions close {mug} --object mug"));

    let ids = |arguments: &str| -> Vec<String> {
        let page = read(&format!("sessions list --json {arguments}"));
        let items = page["items"].as_array().unwrap().clone();
        items.iter().map(|one| one["id"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(ids(""), [&*hammer, &*mug], "newest first");
    assert_eq!(ids("--oldest"), [&*mug, &*hammer]);
    assert_eq!(ids("--ended"), [&*mug]);
    assert_eq!(ids("--object mug --ended"), [&*mug]);
    assert_eq!(ids("--limit 1"), [&*hammer]);
    let table = done("sessions list --ended");
    assert!(table.contains("mug (") && table.contains(&mug), "{table}");

    let labelled = done(&format!("sessions label {mug} site=oslo shift=night"));
    assert!(labelled.contains("shift=night, site=oslo"), "{labelled}");
    assert_eq!(ids("--labels site:oslo"), [&*mug]);
    done(&format!("sessions label {mug}"));
    assert_eq!(ids("--labels site:oslo"), [""; 0]);
    assert!(done("objects label mug line=3").contains("line=3"));
    assert!(done("objects list --labels line:3").contains("mug"));
    assert!(!done("objects list --labels line:4").contains("mug"));
    assert!(done("sensors label digitacts-6x6 side=left").contains("side=left"));
    assert!(done("catalogues label default team=b").contains("team=b"));

    let exported = read(&format!("sessions export {mug}"));
    assert_eq!(exported["readings"].as_array().unwrap().len(), 6);
    assert_eq!(exported["replay"]["steps"].as_array().unwrap().len(), 7, "six and the end");
    let file = folder.path().join("mug.csv");
    done(&format!("sessions export {mug} --format csv --out {}", file.display()));
    let table = std::fs::read_to_string(&file).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert!(lines[0].starts_with("revision,at,change,reading,robot,seq,x_m"), "{}", lines[0]);
    assert_eq!(lines.len(), 8);
    let last = &exported["replay"]["steps"][6];
    let best = last["best"]["probability"].as_f64().unwrap().max(last["unknown"].as_f64().unwrap());
    assert!(lines[7].contains(",closed,") && lines[7].contains(&best.to_string()), "{}", lines[7]);

    done("train --readings-per-object 60 --seed 9");
    assert!(done("catalogues alias default before 1").contains("before = 1"));
    let report = read("catalogues compare default 1 --json");
    let report = &report["shadow_report"];
    assert_eq!((&report["version"], &report["against"]), (&1.into(), &2.into()));
    assert_eq!((&report["n_sessions"], &report["n_with_truth"]), (&1.into(), &1.into()));
    assert!(done("catalogues compare default 1").contains("decided"));
    assert!(done("catalogues unalias default before").contains("removed"));
}
