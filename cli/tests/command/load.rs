//! Tests of `palpate load`: preparation of the server, its answer, its exit codes.

use std::process::Output;

use serde_json::Value;

use crate::support::Server;

fn load(server: &Server, arguments: &str) -> Output {
    server.run("", &format!("load {arguments}"))
}

#[test]
fn load_prepares_and_measures_and_fails_over_its_bounds() {
    let folder = tempfile::TempDir::new().unwrap();
    let server = Server::start(&folder.path().join("data"), "");
    let untrained = load(&server, "--rate 5");
    let words = String::from_utf8(untrained.stderr).unwrap();
    assert_eq!(untrained.status.code(), Some(1));
    assert!(words.contains("--prepare"), "{words}");

    let picture = folder.path().join("load.svg");
    let short = "--prepare --training-readings 20 --touches 5 --warmup-s 0 --sessions 4 --seed 101";
    let pid = server.process();
    let output = load(
        &server,
        &format!(
            "{short} --steps 20,40 --duration-s 1 --soak 0.03 --pid {pid} --json --picture {} \
             --max-p99-ms 30000",
            picture.display()
        ),
    );
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let offered: Vec<u64> = answer["steps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|step| step["offered"].as_u64().unwrap())
        .collect();
    assert_eq!(offered, [20, 40]);
    assert!(answer["soak"]["memory"]["end_bytes"].as_f64().unwrap() > 1e6, "{answer}");
    assert_eq!(answer["broken"], Value::Array(Vec::new()));
    assert!(std::fs::read_to_string(picture).unwrap().starts_with("<svg"));

    let output = load(&server, "--rate 20 --duration-s 0.5 --touches 5 --max-p99-ms 0.001");
    assert_eq!(output.status.code(), Some(6));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("EXCEEDED: p99 of accepted requests is"), "{said}");
    assert!(said.contains("saturation was not reached"), "{said}");
}
