//! Tests of what a supervisor sees of the server: metrics from the first moment.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use tempfile::TempDir;

use crate::support::{Server, stderr};

/// The body of an answer, without a key.
fn get(server: &Server, path: &str) -> String {
    let address = server.said("server").strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    answer
}

#[test]
fn counters_of_alerts_are_0_before_anything_happens() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(folder.path(), "");
    let figures = get(&server, "/metrics");
    let route = r#"method="POST",route="/v1/sessions/{session}/readings""#;
    let answers = |status| format!("palpate_http_requests_total{{{route},status=\"{status}\"}}");
    let mut expected: Vec<String> = ["200", "429", "500", "503", "507"].map(answers).into();
    for state in ["Succeeded", "Failed", "Cancelled"] {
        expected.push(format!("palpate_jobs_total{{state=\"{state}\"}}"));
    }
    for status in ["401", "403", "429"] {
        expected.push(format!("palpate_requests_denied_total{{status=\"{status}\"}}"));
    }
    for object in ["known", "unknown"] {
        expected.push(format!("palpate_feedback_total{{answer=\"wrong\",object=\"{object}\"}}"));
    }
    for bucket in ["1", "1.5", "2", "3", "5", "+Inf"] {
        let labels = format!("{route},le=\"{bucket}\"");
        expected.push(format!("palpate_http_request_seconds_bucket{{{labels}}}"));
    }
    expected.push("palpate_feedback_probability_count".to_owned());
    expected.push("palpate_snapshots_total".to_owned());
    expected.push("palpate_snapshot_timestamp_seconds".to_owned());
    for series in expected {
        assert!(figures.contains(&format!("\n{series} 0\n")), "{series} in {figures}");
    }
    for series in ["palpate_build_info{version=\"", "palpate_start_timestamp_seconds "] {
        assert!(figures.contains(&format!("\n{series}")), "{series} in {figures}");
    }
}

#[test]
fn the_time_of_the_newest_snapshot_is_a_metric() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(&folder.path().join("data"), "");
    let file = folder.path().join("monday.snapshot");
    let taken = server.run("", &format!("snapshot create {}", file.display()));
    assert!(taken.status.success(), "{}", stderr(&taken));
    let figures = get(&server, "/metrics");
    assert!(figures.contains("\npalpate_snapshots_total 1\n"), "{figures}");
    let line = figures.lines().find(|line| line.starts_with("palpate_snapshot_timestamp_seconds "));
    let at: f64 = line.unwrap().split(' ').nth(1).unwrap().parse().unwrap();
    let now = std::time::UNIX_EPOCH.elapsed().unwrap().as_secs_f64();
    assert!((0.0..60.0).contains(&(now - at)), "{at}, now {now}");
}
