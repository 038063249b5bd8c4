//! Tests of `palpate fleet`: the open sessions, and what is done to several at once.

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Server, stderr, stdout};

#[test]
fn open_sessions_are_listed_acknowledged_and_closed() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(&folder.path().join("data"), "");
    let done = |arguments: &str| {
        let output = server.run("", arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", stderr(&output));
        stdout(&output)
    };
    let meshes = folder.path().display();
    for object in ["hammer", "mug"] {
        done(&format!("objects example {object} --out {meshes}"));
        done(&format!("objects add {object} --mesh {meshes}/{object}.stl --unit mm"));
    }
    done("train --readings-per-object 60");
    assert_eq!(done("fleet").trim(), "0 open, 0 need attention");
    let touch = format!("touch --object mug --mesh {meshes}/mug.stl --readings 6 --seed 3 --json");
    for _ in 0..2 {
        server.run("", &touch);
    }
    let fleet: Value = serde_json::from_str(&done("fleet --json")).unwrap();
    assert_eq!(fleet["n_open"], 2);
    let ids: Vec<&str> = fleet["sessions"].as_array().unwrap().iter().map(id).collect();
    let table = done("fleet --limit 1");
    assert!(table.contains("2 open") && table.contains(ids[0]) && !table.contains(ids[1]));

    assert!(done(&format!("fleet acknowledge {} --mute-minutes 5", ids[0])).contains("done"));
    let fleet: Value = serde_json::from_str(&done("fleet --json")).unwrap();
    let mut sessions = fleet["sessions"].as_array().unwrap().iter();
    let muted = sessions.find(|one| id(one) == ids[0]).unwrap();
    assert!(muted["attention"]["muted_until"].is_string(), "{muted}");

    done(&format!("fleet close {}", ids.join(" ")));
    let late = server.run("", &format!("fleet acknowledge {}", ids[0]));
    assert_eq!(late.status.code(), Some(1), "{}", stdout(&late));
    assert!(stdout(&late).contains("was closed"), "{}", stdout(&late));
    assert!(stderr(&late).contains("failed for 1 of 1"), "{}", stderr(&late));
}

fn id(one: &Value) -> &str {
    one["session"]["id"].as_str().unwrap()
}
