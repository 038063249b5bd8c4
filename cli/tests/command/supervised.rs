//! Tests of what a supervisor sees of the server: metrics from the first moment, notices to systemd,
//! and a first admin key that comes from a secret.

use std::fs;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::time::Duration;

use tempfile::TempDir;

use crate::support::{Server, palpate, stderr, stdout};

/// A key as an operator may choose it.
const CHOSEN: &str = "palpate_7b1c0e9f52d84a63b0c1d2e3f4a59687_\
    9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08";

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

/// The next notice of a server; `None` when there is none within the socket's time limit.
fn notice(socket: &UnixDatagram) -> Option<String> {
    let mut bytes = [0; 256];
    match socket.recv(&mut bytes) {
        Ok(n) => Some(String::from_utf8(bytes[..n].to_vec()).unwrap().trim().to_owned()),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => None,
        Err(error) => panic!("{error}"),
    }
}

/// Plays systemd for a server: its watchdog is content until the server is frozen.
fn supervise(arguments: &str) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let variables = [("NOTIFY_SOCKET", path.to_str().unwrap()), ("WATCHDOG_USEC", "900000")];
    let server = Server::start_with(&folder.path().join("data"), arguments, &variables);
    for expected in ["READY=1", "WATCHDOG=1", "WATCHDOG=1", "WATCHDOG=1"] {
        assert_eq!(notice(&socket).as_deref(), Some(expected));
    }
    server.signal("STOP");
    // Notices that were sent before it froze, then none for longer than the watchdog waits.
    socket.set_read_timeout(Some(Duration::from_secs(2))).unwrap();
    assert!((0..20).any(|_| notice(&socket).is_none()), "a frozen server notifies");
    server.signal("CONT");
    socket.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    assert_eq!(notice(&socket).as_deref(), Some("WATCHDOG=1"));
    server.signal("TERM");
    assert!((0..20).any(|_| notice(&socket).as_deref() == Some("STOPPING=1")), "no STOPPING=1");
    assert!(server.ended_well());
}

#[test]
fn systemd_sees_a_server_ready_answering_frozen_and_stopping() {
    supervise("");
}

#[test]
fn a_server_with_tls_answers_itself_and_says_when_it_ends() {
    let folder = TempDir::new().unwrap();
    // The name is not the address at which the server asks itself.
    let made = rcgen::KeyPair::generate().unwrap();
    let mut params = rcgen::CertificateParams::new(vec!["palpate.lab".to_owned()]).unwrap();
    params.not_after = rcgen::date_time_ymd(2040, 1, 2);
    let certificate = params.self_signed(&made).unwrap();
    let (cert, key) = (folder.path().join("cert.pem"), folder.path().join("key.pem"));
    fs::write(&cert, certificate.pem()).unwrap();
    fs::write(&key, made.serialize_pem()).unwrap();
    let arguments = format!("--tls-cert {} --tls-key {}", cert.display(), key.display());
    let server = Server::start(&folder.path().join("data"), &arguments);
    let asking = async {
        let client = reqwest::Client::builder().tls_danger_accept_invalid_certs(true);
        let url = format!("{}/metrics", server.said("server"));
        client.build().unwrap().get(url).send().await.unwrap().text().await.unwrap()
    };
    let _ = rustls::crypto::ring::default_provider().install_default();
    let figures = tokio::runtime::Runtime::new().unwrap().block_on(asking);
    // 70 years with 17 leap days, and a day, after 1970.
    let expected = format!("palpate_certificate_expiry_timestamp_seconds {}", 25_568 * 86_400_u64);
    assert!(figures.lines().any(|line| line == expected), "{figures}");
    supervise(&arguments);
}

/// A file with a text.
fn file(folder: &Path, text: &str) -> String {
    let path = folder.join("first.key");
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn the_first_admin_key_comes_from_a_secret() {
    let folder = TempDir::new().unwrap();
    let data = folder.path().join("data");
    let arguments =
        format!("--first-admin-key-file {}", file(folder.path(), &format!("{CHOSEN}\n")));
    let server = Server::start(&data, &arguments);
    let who = server.run(CHOSEN, "whoami");
    assert!(stdout(&who).starts_with("admin, admin"), "{}", stderr(&who));
    assert!(!server.run("", "objects list").status.success());
    // It is not repeated anywhere.
    let secret = &CHOSEN[41..];
    assert!(!server.started.to_string().contains(secret) && !data.join("admin.key").exists());
    let made = server.run(CHOSEN, "keys create me --role admin");
    let made = stdout(&made);
    let mine = made.lines().find(|line| line.starts_with("palpate_")).unwrap().to_owned();
    assert!(server.run(&mine, "keys revoke admin").status.success());
    let log = server.log();
    assert!(!log.contains(secret), "{log}");
    // A revoked key does not come back while there is another admin's.
    let server = Server::start(&data, &arguments);
    assert!(!server.run(CHOSEN, "whoami").status.success());
    assert!(server.run(&mine, "whoami").status.success());
}

#[test]
fn a_chosen_first_key_lets_a_new_server_listen_for_others() {
    let folder = TempDir::new().unwrap();
    let key = file(folder.path(), CHOSEN);
    let arguments = format!("--listen 0.0.0.0:0 --first-admin-key-file {key}");
    let server = Server::start(&folder.path().join("data"), &arguments);
    let port = server.said("server").rsplit(':').next().unwrap();
    let ask = |key: &str| {
        let mut command = palpate(&format!("objects list --server http://127.0.0.1:{port}"));
        command.env("PALPATE_KEY", key).output().unwrap()
    };
    assert!(ask(CHOSEN).status.success(), "{}", stderr(&ask(CHOSEN)));
    assert!(!ask(&CHOSEN.replace("00a08", "00a09")).status.success());
}

#[test]
fn a_refused_start_leaves_no_folder_behind() {
    let folder = TempDir::new().unwrap();
    let data = folder.path().join("data");
    let key = file(folder.path(), CHOSEN);
    let first = format!("--access open --new-admin-key --first-admin-key-file {key}");
    for (arguments, expected) in [
        ("--listen 0.0.0.0:0", "requires no keys"),
        ("--cors-origin nowhere", "is no origin"),
        ("--forward-to http://127.0.0.1:9 --cell a --forward-key-file no.key", "cannot read"),
        (&first, "needs no keys"),
    ] {
        let command = format!("serve {arguments} --data {}", data.display());
        let refused = palpate(&command).output().unwrap();
        assert_eq!(refused.status.code(), Some(1), "{arguments}");
        assert!(stderr(&refused).contains(expected), "{arguments}: {}", stderr(&refused));
        assert!(!data.exists(), "{arguments}");
    }
}

#[test]
fn weak_first_keys_and_open_access_are_refused() {
    let folder = TempDir::new().unwrap();
    let check = |text: &str, access: &str, expected: &str| {
        let data = folder.path().join("data");
        let key = file(folder.path(), text);
        let command = format!("serve --listen 127.0.0.1:0 --first-admin-key-file {key}");
        let mut command =
            palpate(&format!("{command} --access {access} --data {}", data.display()));
        let refused = command.output().unwrap();
        assert_eq!(refused.status.code(), Some(1), "{expected}");
        let said = stderr(&refused);
        assert!(said.contains(expected) && !said.contains(text), "{said}");
        assert!(!data.exists(), "{expected}");
    };
    check("secret123", "keys", "64 hexadecimal digits");
    check(&format!("{}{}", &CHOSEN[..41], "00".repeat(32)), "keys", "too regular");
    check(CHOSEN, "open", "needs no keys");
}
