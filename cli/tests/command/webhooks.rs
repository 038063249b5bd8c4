//! A story of webhooks from a shell: created, tested, failing, delivered again, rotated, deleted.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::process::Output;
use std::sync::mpsc::{Receiver, channel};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Server, stderr, stdout};

/// Answers one POST after another with these statuses; the receiver of the bodies, and its URL.
fn receiver(statuses: &'static [&'static str]) -> (String, Receiver<String>) {
    receiver_at("127.0.0.1:0", statuses)
}

fn receiver_at(address: &str, statuses: &'static [&'static str]) -> (String, Receiver<String>) {
    let listener = TcpListener::bind(address).unwrap();
    let url = format!("http://{}/hook", listener.local_addr().unwrap());
    let (sender, bodies) = channel();
    std::thread::spawn(move || {
        for status in statuses {
            let (stream, _) = listener.accept().unwrap();
            let mut reader = BufReader::new(stream);
            let (mut line, mut length) = (String::new(), 0);
            while reader.read_line(&mut line).unwrap() > 2 {
                if let Some(found) = line.to_lowercase().strip_prefix("content-length:") {
                    length = found.trim().parse().unwrap();
                }
                line.clear();
            }
            let mut body = vec![0; length];
            reader.read_exact(&mut body).unwrap();
            let answer =
                format!("HTTP/1.1 {status}\r\ncontent-length: 0\r\nconnection: close\r\n\r\n");
            reader.get_mut().write_all(answer.as_bytes()).unwrap();
            sender.send(String::from_utf8(body).unwrap()).unwrap();
        }
    });
    (url, bodies)
}

#[track_caller]
fn json(output: &Output) -> Value {
    let text = stdout(output);
    serde_json::from_str(&text).unwrap_or_else(|_| panic!("{text}{}", stderr(output)))
}

#[test]
fn a_webhook_is_made_tested_repaired_and_deleted() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(&folder.path().join("data"), "--webhook-allow-private");
    let run = |arguments: &str| server.run("", &format!("webhooks {arguments}"));
    let (url, bodies) = receiver(&["200 OK", "500 Broken", "204 Fine"]);
    let made = json(&run(&format!("create {url} --events session.decided,snapshot.made --json")));
    let id = made["webhook"]["id"].as_str().unwrap();
    assert!(made["secret"].as_str().unwrap().starts_with("whsec_"));

    let tested = run(&format!("test {id}"));
    assert!(tested.status.success(), "{}", stderr(&tested));
    assert!(bodies.recv().unwrap().contains(r#""type":"ping""#));
    let failed = run(&format!("test {id}"));
    assert_eq!(failed.status.code(), Some(1));
    assert!(stdout(&failed).contains("500"), "{}", stdout(&failed));
    assert!(stdout(&run("list")).contains("failing since"));

    let listed = json(&run(&format!("deliveries {id} --failed --json")));
    assert_eq!(listed["items"].as_array().unwrap().len(), 1);
    let event = listed["items"][0]["id"].as_str().unwrap();
    bodies.recv().unwrap();
    assert!(stdout(&run(&format!("redeliver {id} {event}"))).contains("due again"));
    assert!(bodies.recv().unwrap().contains(event));

    let secret = folder.path().join("secret");
    std::fs::write(&secret, "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw\n").unwrap();
    let file = secret.display();
    let rotated = run(&format!("rotate {id} --grace-s 60 --secret-file {file}"));
    assert!(stdout(&rotated).contains("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"));
    assert!(stdout(&run(&format!("update {id} --enabled false"))).contains("disabled"));
    assert_eq!(run(&format!("test {id}")).status.code(), Some(1));
    assert!(stdout(&run(&format!("delete {id}"))).contains("deleted"));
    assert_eq!(json(&run("list --json"))["items"], Value::Array(vec![]));
}

#[test]
fn an_event_survives_a_killed_server() {
    let folder = TempDir::new().unwrap();
    let data = folder.path().join("data");
    let server = Server::start(&data, "--webhook-allow-private");
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let create = format!("webhooks create http://{address}/hook --events snapshot.made --json");
    let made = json(&server.run("", &create));
    let deliveries =
        format!("webhooks deliveries {} --json", made["webhook"]["id"].as_str().unwrap());
    let file = folder.path().join("monday.snapshot");
    assert!(server.run("", &format!("snapshot create {}", file.display())).status.success());
    let waiting = loop {
        let listed = json(&server.run("", &deliveries));
        match listed["items"][0]["state"].as_str() {
            Some("failed") => break listed["items"][0].clone(),
            Some("pending") | None => std::thread::sleep(std::time::Duration::from_millis(50)),
            Some(other) => panic!("{other}: {listed}"),
        }
    };
    // With the signal that no process can catch.
    drop(server);
    let (_, bodies) = receiver_at(&address.to_string(), &["200 OK"]);
    let server = Server::start(&data, "--webhook-allow-private");
    let body = bodies.recv_timeout(std::time::Duration::from_secs(60)).unwrap();
    assert_eq!(waiting["body"], body.as_str());
    drop(server);
}
