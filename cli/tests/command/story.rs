//! Tests of the command: its exit codes, its output streams, and a complete round.

use std::path::Path;
use std::process::{Output, Stdio};

use tempfile::TempDir;

use crate::support::{Server, palpate, stderr, stdout};

/// Runs the command to its end.
fn run(folder: &Path, arguments: &str) -> Output {
    palpate(arguments).current_dir(folder).output().unwrap()
}

#[test]
fn health_exits_by_whether_a_server_serves() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(folder.path(), "");
    let address = server.said("server").to_owned();
    let healthy = run(folder.path(), &format!("health --server {address}"));
    assert_eq!(healthy.status.code(), Some(0), "{}", stderr(&healthy));
    let checks = stdout(&healthy);
    assert!(checks.contains("store") && checks.contains("room"), "{checks}");
    drop(server);
    let gone = run(folder.path(), &format!("health --server {address}"));
    assert_eq!(gone.status.code(), Some(3));
}

#[test]
fn wrong_usage_exits_with_two() {
    let folder = TempDir::new().unwrap();
    for arguments in
        ["", "objects", "touch --mesh mug.stl", "demo --json", "demo --trials 0", "explore"]
    {
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {}", stderr(&output));
    }
}

#[test]
fn an_unreachable_server_exits_with_three_and_a_hint() {
    let folder = TempDir::new().unwrap();
    let output = run(folder.path(), "--server http://127.0.0.1:1 objects list --json");
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("palpate serve"), "{}", stderr(&output));
    assert_eq!(stdout(&output), "");
}

#[test]
fn a_closed_output_does_not_end_the_work() {
    let folder = TempDir::new().unwrap();
    let mut command = palpate("objects example --all --out meshes");
    let command = command.current_dir(folder.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(stderr(&output), "");
    assert_eq!(std::fs::read_dir(folder.path().join("meshes")).unwrap().count(), 10);
}

#[test]
fn the_api_description_needs_no_server() {
    let folder = TempDir::new().unwrap();
    let output = run(folder.path(), "openapi");
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(document["paths"]["/v1/sessions/{session}/readings"].is_object());
}

#[test]
fn a_users_mesh_is_trained_and_recognised_after_a_restart() {
    let folder = TempDir::new().unwrap();
    let (at, data) = (folder.path(), folder.path().join("data"));
    let output = run(at, "objects example --all --out meshes --json");
    let written: Vec<String> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(written.len(), 10);

    let server = Server::start(&data, "");
    let ask = |server: &Server, arguments: &str| {
        run(at, &format!("--server {} {arguments}", server.said("server")))
    };
    for object in ["hammer", "gear", "mug"] {
        let output =
            ask(&server, &format!("objects add {object} --mesh meshes/{object}.stl --unit mm"));
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    }
    let taken = ask(&server, "objects add mug");
    assert_eq!(taken.status.code(), Some(1));
    assert!(stderr(&taken).contains("taken"), "{}", stderr(&taken));
    a_refused_mesh_leaves_no_object(at, |arguments| ask(&server, arguments));

    let train = "train --readings-per-object 300 --appearance --appearance-classes 12,24 --json";
    let trained = ask(&server, train);
    let answer: serde_json::Value = serde_json::from_slice(&trained.stdout).unwrap();
    assert_eq!(answer["version"]["report"]["objects"].as_array().unwrap().len(), 3);
    an_ended_job_is_removed(|arguments| ask(&server, arguments));
    let touch = "touch --object hammer --mesh meshes/hammer.stl --readings 10 --seed 7 --json";
    let touched = ask(&server, touch);
    assert_eq!(touched.status.code(), Some(0), "{}", stderr(&touched));
    let answer: serde_json::Value = serde_json::from_slice(&touched.stdout).unwrap();
    assert_eq!(answer["steps"].as_array().unwrap().len(), 10);
    // With few training readings the hammer may be turned end for end, but it lies within
    // ±200 mm of the origin: an error of frames or units would be off by far more than its
    // own 80 mm.
    assert!(answer["position_error_mm"].as_f64().unwrap() < 60.0, "{answer}");

    none_of_these_is_an_answer(|arguments| ask(&server, arguments));
    explored_readings_can_be_sent_again(at, |arguments| ask(&server, arguments));

    let report = ask(&server, "report --svg report.svg");
    assert_eq!(report.status.code(), Some(0), "{}", stderr(&report));
    assert!(stdout(&report).contains("similarity of the objects"), "{}", stdout(&report));
    let picture = std::fs::read_to_string(at.join("report.svg")).unwrap();
    // Two matrices of three objects.
    assert_eq!(picture.matches("<title>").count(), 18);
    let touch = "touch --object mug --mesh meshes/mug.stl --readings 40 --method appearance --json";
    let touched = ask(&server, touch);
    assert_eq!(touched.status.code(), Some(0), "{}", stderr(&touched));
    let answer: serde_json::Value = serde_json::from_slice(&touched.stdout).unwrap();
    assert_eq!(answer["position_error_mm"], serde_json::Value::Null, "no pose was sent");

    drop(server);
    let server = Server::start(&data, "");
    let mistaken = ask(&server, "touch --object gear --mesh meshes/mug.stl --readings 10");
    assert_eq!(mistaken.status.code(), Some(4), "{}", stdout(&mistaken));
    let listed = ask(&server, "sessions list --json");
    let sessions: serde_json::Value = serde_json::from_slice(&listed.stdout).unwrap();
    assert_eq!(
        sessions["items"].as_array().unwrap().len(),
        10,
        "those of before survived the restart"
    );

    let second = palpate("serve --listen 127.0.0.1:0").arg("--data").arg(&data).output().unwrap();
    assert_eq!(second.status.code(), Some(1));
    assert!(stderr(&second).contains("in use by another process"), "{}", stderr(&second));
}

/// Removing an ended job keeps the version it created, which later commands use.
fn an_ended_job_is_removed(ask: impl Fn(&str) -> Output) {
    let jobs = || -> serde_json::Value {
        serde_json::from_slice(&ask("jobs list --json").stdout).unwrap()
    };
    let listed = jobs();
    let id = listed["items"][0]["id"].as_str().unwrap();
    let removed = ask(&format!("jobs remove {id}"));
    assert_eq!(removed.status.code(), Some(0), "{}", stderr(&removed));
    assert_eq!(jobs()["items"], serde_json::json!([]));
    assert_eq!(ask(&format!("jobs remove {id}")).status.code(), Some(1));
}

/// A refused mesh leaves no object, and the error of a name in use names the command that
/// adds a mesh.
fn a_refused_mesh_leaves_no_object(at: &Path, ask: impl Fn(&str) -> Output) {
    std::fs::write(at.join("broken.off"), "OFF\n3 1 0\n0 0 0\n").unwrap();
    for _ in 0..2 {
        let refused = ask("objects add vase --mesh broken.off --unit mm");
        assert_eq!(refused.status.code(), Some(1));
        assert!(stderr(&refused).contains("vase was not added"), "{}", stderr(&refused));
    }
    assert!(!stdout(&ask("objects list")).contains("vase"));
    let taken = ask("objects add mug --mesh meshes/mug.stl --unit mm");
    assert!(stderr(&taken).contains("palpate objects mesh"), "{}", stderr(&taken));
    let added = ask("objects mesh mug meshes/mug.stl --unit mm");
    assert!(stdout(&added).contains("read as mm: mesh of"), "{}", stdout(&added));
}

/// Makes the prior decide for "none of these" without chance: it is the answer, and right
/// only for an object outside the catalogue.
fn none_of_these_is_an_answer(ask: impl Fn(&str) -> Output) {
    let touch = "touch --mesh meshes/hammer.stl --readings 1 --seed 7 --json";
    let sure = "--unknown-prior 0.999999999";
    for (object, code) in [("hammer", 4), ("none", 0)] {
        let touched = ask(&format!("{touch} {sure} --object {object}"));
        assert_eq!(touched.status.code(), Some(code), "{}", stderr(&touched));
        let answer: serde_json::Value = serde_json::from_slice(&touched.stdout).unwrap();
        assert_eq!(answer["right"], code == 0, "{answer}");
        let step = &answer["steps"][0];
        for said in [&answer, step] {
            assert_eq!(said["answer"], "none of these", "{answer}");
            assert_eq!(said["probability"], said["unknown"], "{answer}");
        }
        assert_eq!(step["right"], code == 0, "{answer}");
        assert!(stderr(&touched).contains("mesh read as mm: "), "{}", stderr(&touched));
    }
    let unknown = ask(&format!("{touch} --object vase"));
    assert_eq!(unknown.status.code(), Some(1));
    assert!(stderr(&unknown).contains("or none for an object"), "{}", stderr(&unknown));
    let cannot = ask(&format!("{touch} --object none --method sva"));
    assert!(stderr(&cannot).contains("needs the method surface"), "{}", stderr(&cannot));
    let explore = format!("explore --readings 1 --mesh meshes/mug.stl --json {sure}");
    let explored = ask(&format!("{explore} --object mug"));
    assert_eq!(explored.status.code(), Some(4), "{}", stderr(&explored));
    let explored = ask(&format!("{explore} --object none"));
    assert_eq!(explored.status.code(), Some(0), "{}", stderr(&explored));
    let answer: serde_json::Value = serde_json::from_slice(&explored.stdout).unwrap();
    for said in ["answer", "truth"] {
        assert_eq!(answer[said], "none of these", "{answer}");
    }
    let session = answer["session"].as_str().unwrap();
    let closed = ask(&format!("sessions close {session} --object none"));
    assert!(stdout(&closed).contains("it was none of these: right"), "{}", stdout(&closed));
    let unknown = ask("explore --readings 1 --object dragon");
    assert!(stderr(&unknown).contains("or none for an object"), "{}", stderr(&unknown));
}

/// Explores into a new session and a file, and sends the file into that session and another.
fn explored_readings_can_be_sent_again(at: &Path, ask: impl Fn(&str) -> Output) {
    let answer = |arguments: &str| -> serde_json::Value {
        let output = ask(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", stderr(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let mug = "explore --mesh meshes/mug.stl --readings 5 --json";
    let explored = answer(&format!("{mug} --method appearance --out mug.json"));
    assert_eq!((&explored["readings"], &explored["right"]), (&5.into(), &().into()));
    let session = explored["session"].as_str().unwrap();
    answer(&format!("explore --replay mug.json --session {session} --json"));
    let replayed = answer("explore --replay mug.json --method appearance --json");
    assert_ne!(replayed["session"], explored["session"]);
    for what in ["readings", "answer", "probability"] {
        assert_eq!(replayed[what], explored[what], "{what}");
    }
    assert!(explored["probability"].as_f64().unwrap() > 1.0 / 3.0, "{explored}");
    assert_eq!(replayed["planner"], serde_json::Value::Null);
    let listed = answer("sessions list --oldest --json");
    let counts: Vec<_> =
        listed["items"].as_array().unwrap().iter().map(|item| &item["n_readings"]).collect();
    // The earlier touches; a file that is sent twice counts once.
    assert_eq!(counts, [10, 1, 1, 1, 1, 5, 5]);
    a_session_is_looked_into(replayed["session"].as_str().unwrap(), &answer, &ask);
    let again = answer(&format!("{mug} --offline --out 2.json"));
    assert_eq!(again["session"], serde_json::Value::Null);
    let file = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert_eq!(file("mug.json"), file("2.json"));
    // A moving object, and a method that needs no poses.
    let moving = "explore --mesh meshes/mug.stl --readings 12 --perturb --method appearance --json";
    let moved = answer(moving);
    assert_eq!(moved["readings"], 12);
    assert!(moved["probability"].as_f64().unwrap() > 1.0 / 3.0, "{moved}");
}

/// Lists a session's five readings, retracts one, replays and explains the rest.
fn a_session_is_looked_into(
    session: &str,
    answer: &impl Fn(&str) -> serde_json::Value,
    ask: &impl Fn(&str) -> Output,
) {
    let readings = answer(&format!("sessions readings {session} --json"));
    let second = &readings["items"][1];
    let (robot, seq) = (second["robot"].as_str().unwrap(), &second["seq"]);
    let number = answer(&format!("sessions retract {session} 3 --json"));
    assert_eq!((&number["number"], &number["n_readings"]), (&3.into(), &4.into()));
    let robots = format!("sessions retract {session} --robot {robot} --seq {seq} --json");
    assert_eq!(answer(&robots)["number"], 1);
    let replay = answer(&format!("sessions replay {session} --upto 6 --after 2 --json"));
    assert_eq!(replay["steps"].as_array().unwrap().len(), 4);
    assert_eq!(replay["belief"]["n_readings"], 4);
    let explanation = answer(&format!("sessions explain {session} --json"));
    assert_eq!(explanation["readings"].as_array().unwrap().len(), 3);
    let words = |what: &str| stdout(&ask(&format!("sessions {what} {session}")));
    assert!(words("readings").contains("retracted by revision 6"), "{}", words("readings"));
    assert!(words("replay").contains("retraction of 3"), "{}", words("replay"));
    assert!(words("explain").contains("revision 7"), "{}", words("explain"));
    let neither = ask(&format!("sessions retract {session}"));
    assert_eq!(neither.status.code(), Some(2), "{}", stderr(&neither));
}

#[test]
fn a_newcomer_calibrates_a_sensor_with_a_simulated_indentation() {
    let folder = TempDir::new().unwrap();
    let (at, data) = (folder.path(), folder.path().join("data"));
    let server = Server::start(&data, "");
    let ask = |arguments: &str| {
        let output = run(at, &format!("--server {} {arguments}", server.said("server")));
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", stderr(&output));
        stdout(&output)
    };
    ask("sensors add finger --preset digitacts-6x6");
    let said = ask("sensors indent finger --out indentation.json --seed 3");
    assert!(said.contains("palpate sensors calibrate finger"), "{said}");
    let table = ask("sensors calibrate finger --file indentation.json");
    assert!(table.contains(" dead") && table.contains(" wired"), "{table}");
    let shown = ask("sensors calibration finger --json");
    let calibration: serde_json::Value = serde_json::from_str(&shown).unwrap();
    assert_eq!((&calibration["number"], &calibration["n_unusable"]), (&1.into(), &2.into()));
    let health = ask("sensors health finger");
    assert!(health.contains("finger: too little is known"), "{health}");
    let coverings = ask("analyses covering --thickness-mm 1,2.54 --force-resolution 0.05");
    assert!(coverings.contains("sharpest") && coverings.contains("2.54 mm"), "{coverings}");
}

#[test]
fn a_newcomer_commissions_a_sensor_with_simulated_touches() {
    let folder = TempDir::new().unwrap();
    let (at, data) = (folder.path(), folder.path().join("data"));
    let server = Server::start(&data, "");
    let run = |arguments: &str| run(at, &format!("--server {} {arguments}", server.said("server")));
    let ask = |arguments: &str| {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", stderr(&output));
        stdout(&output)
    };
    ask("sensors add finger --preset digitacts-6x6");
    assert!(ask("sensors reference").contains("50 × 50 × 50 mm"));
    ask("sensors reference ridge --out ridge.stl");
    assert!(std::fs::metadata(at.join("ridge.stl")).unwrap().len() > 100_000);
    let simulated = "sensors commission finger --object ridge --simulate --seed 4";
    let said = ask(&format!("{simulated} --mistake pressure-unit,mirror"));
    assert!(said.contains("20 left: touch the middle of a face"), "{said}");
    assert!(said.contains("after 8 touches: "), "{said}");
    assert!(said.contains("observed") && said.contains("predicted"), "{said}");
    assert!(said.contains("Multiply pressures by") && said.contains("reversed true"), "{said}");
    assert!(said.contains("To correct: pressure unit, image order"), "{said}");
    assert!(said.contains("nothing was stored"), "{said}");
    assert_eq!(run("sensors passport finger").status.code(), Some(1), "nothing was applied");
    let applied = ask(&format!("{simulated} --mistake quaternion-order --apply --json"));
    let answer: serde_json::Value = serde_json::from_str(&applied).unwrap();
    assert_eq!(answer["wrong"], serde_json::json!(["quaternion_order"]), "{applied}");
    assert_eq!(answer["calibration"], 1);
    assert!(ask("sensors show finger").contains("the passport of calibration 1 applies"));
    assert!(ask("sensors passport finger").contains("Send quaternions as x, y, z, w"));
    std::fs::write(at.join("few.jsonl"), "{\"image\": [], \"pose\": 1}\n").unwrap();
    let refused = run("sensors commission finger --reference cube --readings few.jsonl");
    assert!(stderr(&refused).contains("few.jsonl, line 1"), "{}", stderr(&refused));
}

#[test]
fn the_demo_ends_with_one_line_of_figures() {
    let folder = TempDir::new().unwrap();
    let output = run(
        folder.path(),
        "demo --once --json --listen 127.0.0.1:0 --trials 8 --readings-per-object 200",
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = stdout(&output);
    assert_eq!(text.lines().count(), 1, "{text}");
    let figures: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(figures["trials"], 8);
    assert!(figures["recognised"].as_u64().unwrap() >= 4, "{figures}");
    for key in [
        "touches_median",
        "position_error_mm_median",
        "angle_error_deg_median",
        "ms_per_reading_median",
    ] {
        assert!(figures[key].as_f64().unwrap() > 0.0, "{key} of {figures}");
    }
    assert!(stderr(&output).contains("/docs"), "{}", stderr(&output));
}
