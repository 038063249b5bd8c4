//! Short runs of `torture`, and the operator's commands on stored data, with the real command.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::command::palpate;

fn torture(arguments: &[&str]) -> Value {
    let done = Command::new(env!("CARGO_BIN_EXE_torture"))
        .args(arguments)
        .arg("--palpate")
        .arg(palpate())
        .output()
        .unwrap();
    let (said, log) = (String::from_utf8(done.stdout).unwrap(), String::from_utf8(done.stderr));
    let counts = serde_json::from_str(said.lines().last().unwrap_or_default()).unwrap_or_default();
    assert!(done.status.success(), "{counts}\n{}", log.unwrap_or_default());
    counts
}

fn run(arguments: &[&str], data: &Path) -> Output {
    Command::new(palpate())
        .args(arguments)
        .arg("--data")
        .arg(data)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn error(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Writes a dump of pairs (hexadecimal, a line each) as a database.
fn database(folder: &Path, dump: &str) {
    use palpate_store::engine::{Commit, Engine};
    use palpate_store::sled::{SledEngine, SledOptions};
    let unhex = |text: &str| -> Vec<u8> {
        let digits = |place| u8::from_str_radix(&text[place..place + 2], 16).unwrap();
        (0..text.len()).step_by(2).map(digits).collect()
    };
    let engine = SledEngine::open(folder, &SledOptions::default()).unwrap();
    let commit = dump.lines().fold(Commit::new(), |commit, line| {
        let (key, value) = line.split_once(' ').unwrap();
        commit.put(unhex(key), unhex(value))
    });
    engine.commit(commit).wait().unwrap();
}

#[test]
fn a_killed_server_loses_and_invents_nothing() {
    let counts = torture(&["kill", "--rounds", "3", "--writers", "6", "--seed", "101", "--json"]);
    let number = |name: &str| counts[name].as_u64().unwrap();
    for fault in ["acknowledged_lost", "invented", "beliefs_differ", "unexpected_answers"] {
        assert_eq!(number(fault), 0, "{fault}");
    }
    assert_eq!(number("rounds"), 3);
    assert!(number("acknowledged") > 50 && number("beliefs_compared") > 5, "{counts}");
}

#[test]
fn valid_keys_survive_a_kill_and_revoked_ones_stay_revoked() {
    let counts = torture(&[
        "kill",
        "--access",
        "keys",
        "--rounds",
        "3",
        "--writers",
        "4",
        "--seed",
        "102",
        "--json",
    ]);
    let number = |name: &str| counts[name].as_u64().unwrap();
    for fault in ["acknowledged_lost", "invented", "beliefs_differ", "unexpected_answers"] {
        assert_eq!(number(fault), 0, "{fault}");
    }
    assert!(number("keys_created") > 3 && number("keys_revoked") > 0, "{counts}");
    assert!(number("keys_tried") > number("keys_created"), "{counts}");
}

#[test]
fn a_short_soak_loses_nothing_and_frees_space() {
    let figures = torture(&[
        "soak",
        "--minutes",
        "0.1",
        "--slack-mb",
        "1",
        "--writers",
        "2",
        "--seed",
        "101",
        "--json",
    ]);
    let number = |name: &str| figures[name].as_f64().unwrap();
    assert!(number("acknowledged_lost") < 0.5, "{figures}");
    assert!(number("readings_written") > 100.0, "{figures}");
    assert!(number("compactions") > 0.5 && number("samples") > 2.0, "{figures}");
    let bound = 4.0 * number("live_mb_after_restart") + 64.0;
    assert!(number("stored_mb_after_restart") <= bound, "{figures}");
}

#[test]
fn damaged_files_are_refused_or_reported() {
    let counts = torture(&["corrupt", "--rounds", "16", "--seed", "101", "--json"]);
    let number = |name: &str| counts[name].as_u64().unwrap();
    assert_eq!((number("silent_corruptions"), number("damages")), (0, 16));
    assert!(number("damages_refused") > 5, "{counts}");
}

#[test]
fn readings_in_any_order_give_one_belief() {
    let counts = torture(&["order", "--rounds", "4", "--seed", "101", "--json"]);
    let number = |name: &str| counts[name].as_u64().unwrap();
    assert_eq!((number("orders_differ"), number("orders_compared")), (0, 32));
    assert_eq!((number("restarts"), number("beliefs_compared")), (1, 32));
}

#[cfg(target_os = "linux")]
#[test]
fn attackers_harm_no_honest_robot_and_hold_nothing() {
    let counts =
        torture(&["hostile", "--seconds", "1", "--seed", "101", "--review", "1", "--json"]);
    let number = |name: &str| counts[name].as_u64().unwrap();
    for fault in ["honest_refused", "attacks_that_worked", "held_after_60_s"] {
        assert_eq!(number(fault), 0, "{fault}: {counts}");
    }
    let attacks = counts["attacks"].as_array().unwrap();
    assert_eq!(attacks.len(), 12);
    assert!(attacks.iter().all(|attack| attack["attempts"].as_u64() > Some(3)), "{counts}");
    let aside = counts["aside"].as_array().unwrap();
    let findings: Vec<u64> = aside.iter().map(|one| one["finding"].as_u64().unwrap()).collect();
    assert_eq!(findings, [4, 5, 12, 15, 21, 22]);
    assert!(aside.iter().all(|one| one["attempts"].as_u64() > Some(1)), "{counts}");
    assert!(
        number("honest_requests") > 500 && counts["peak_mb"].as_f64() < Some(1200.0),
        "{counts}"
    );
}

#[test]
fn an_older_layout_is_refused_then_migrated_then_served() {
    let folder = tempfile::tempdir().unwrap();
    database(folder.path(), include_str!("../../migrations/golden/layout1.txt"));
    let refused = run(&["serve", "--listen", "127.0.0.1:0"], folder.path());
    assert_eq!(refused.status.code(), Some(1));
    assert!(error(&refused).contains("palpate migrate --data DIR"), "{}", error(&refused));
    let migrated = run(&["migrate", "--json"], folder.path());
    let answer: Value = serde_json::from_slice(&migrated.stdout).unwrap();
    assert_eq!((&answer["from"], &answer["to"]), (&Value::from(1), &Value::from(2)), "{answer}");
    let checked = run(&["fsck", "--json"], folder.path());
    let answer: Value = serde_json::from_slice(&checked.stdout).unwrap();
    assert_eq!(
        (checked.status.code(), &answer["whole"]),
        (Some(0), &Value::from(true)),
        "{answer}"
    );
}

#[test]
fn a_newer_layout_and_an_empty_folder_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let layout = palpate_store::envelope::seal(
        palpate_store::envelope::Kind::Layout,
        1,
        &[&9u32.to_le_bytes()[..], &3u64.to_le_bytes(), b"new"].concat(),
    );
    let hex: String = layout.iter().map(|byte| format!("{byte:02x}")).collect();
    database(folder.path(), &format!("21 {hex}\n"));
    for arguments in [&["serve", "--listen", "127.0.0.1:0", "--migrate"][..], &["migrate"]] {
        let refused = run(arguments, folder.path());
        assert_eq!(refused.status.code(), Some(1));
        let words = error(&refused);
        assert!(words.contains("layout 9") && words.contains("use a newer version"), "{words}");
    }
    let nothing = tempfile::tempdir().unwrap();
    let refused = run(&["fsck"], nothing.path());
    assert!(error(&refused).contains("holds no stored data"), "{}", error(&refused));
    assert!(std::fs::read_dir(nothing.path()).unwrap().next().is_none(), "nothing was made");
}

#[test]
fn fsck_names_damage_and_sets_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let whole = include_str!("../../migrations/golden/layout2.txt");
    // A database without the first entry of the first session's journal.
    let gap: String =
        whole.lines().filter(|line| !line.starts_with("72")).flat_map(|l| [l, "\n"]).collect();
    database(folder.path(), &gap);
    let checked = run(&["fsck"], folder.path());
    assert_eq!(checked.status.code(), Some(5), "{}", error(&checked));
    let words = String::from_utf8(checked.stdout).unwrap();
    assert!(words.contains("journal entry") && words.contains("entry 0: it is missing"), "{words}");
}

#[tokio::test(flavor = "multi_thread")]
async fn snapshots_of_a_running_server_verify_and_restore() {
    use palpate_server::{Config, Server};
    let folder = tempfile::tempdir().unwrap();
    let listen = std::net::SocketAddr::from((std::net::Ipv4Addr::LOCALHOST, 0));
    let at = |name: &str| folder.path().join(name);
    let config = |data: &str| Config { listen, ..Config::new(at(data)) };
    let server = Server::start(config("data")).await.unwrap();
    let url = format!("http://{}", server.local_addr());
    let object = palpate_schemas::CreateObject {
        name: "mug".to_owned(),
        description: "?".into(),
        ..palpate_schemas::CreateObject::default()
    };
    let client = palpate_client::Client::new(&url).unwrap();
    let mug = client.create_object(&object).await.unwrap();
    let file = at("monday.snapshot");
    let command = |arguments: &[&str]| {
        let mut command = Command::new(palpate());
        command.args(["--server", &url, "snapshot"]).args(arguments).stdin(Stdio::null());
        tokio::task::block_in_place(|| command.output().unwrap())
    };
    let path = file.to_str().unwrap();
    let taken = command(&["create", path, "--json"]);
    assert!(taken.status.success(), "{}", error(&taken));
    let answer: Value = serde_json::from_slice(&taken.stdout).unwrap();
    assert_eq!((&answer["n_damaged"], &answer["records"]["object"]), (&0.into(), &1.into()));
    let again = command(&["create", path]);
    assert!(error(&again).contains("exists already"), "{}", error(&again));
    server.shutdown().await;

    let restored = at("restored");
    let arguments = ["restore", path, "--data", restored.to_str().unwrap()];
    assert!(command(&arguments).status.success());
    let refused = command(&arguments);
    assert!(error(&refused).contains("is not empty"), "{}", error(&refused));
    let bytes = std::fs::read(&file).unwrap();
    let cut = at("cut.snapshot");
    std::fs::write(&cut, &bytes[..bytes.len() - 1]).unwrap();
    for action in [&["verify"][..], &["restore", "--data", at("never").to_str().unwrap()]] {
        let arguments: Vec<&str> = action.iter().copied().chain(cut.to_str()).collect();
        let refused = command(&arguments);
        assert_eq!(refused.status.code(), Some(1));
        assert!(error(&refused).contains("was not written to its end"), "{}", error(&refused));
    }
    assert!(!at("never").exists(), "nothing is left");

    let server = Server::start(config("restored")).await.unwrap();
    let client = palpate_client::Client::new(&format!("http://{}", server.local_addr())).unwrap();
    assert_eq!(client.object("mug").await.unwrap(), mug);
    server.shutdown().await;
}
