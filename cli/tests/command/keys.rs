//! Tests of keys, TLS and the audit log from a shell.

use std::path::Path;
use std::process::Output;

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Server, palpate};

#[track_caller]
fn done(output: &Output) -> String {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    text
}

#[track_caller]
fn failed(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn mode(path: &Path) -> u32 {
    use std::os::unix::fs::PermissionsExt;
    std::fs::metadata(path).unwrap().permissions().mode() & 0o777
}

/// Everything in a folder, with the folder itself.
fn all(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut found = vec![folder.to_owned()];
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        match entry.file_type().unwrap().is_dir() {
            true => found.extend(all(&entry.path())),
            false => found.push(entry.path()),
        }
    }
    found
}

#[test]
fn other_users_of_the_machine_cannot_read_the_folder() {
    use std::os::unix::fs::PermissionsExt;
    let folder = TempDir::new().unwrap();
    let data = folder.path().join("data");
    drop(Server::start(&data, ""));
    // As left by an earlier version, or by an administrator.
    for path in all(&data) {
        let open = std::fs::Permissions::from_mode(if path.is_dir() { 0o755 } else { 0o644 });
        std::fs::set_permissions(path, open).unwrap();
    }
    let server = Server::start(&data, "");
    for path in all(&data) {
        let expected = if path.is_dir() { 0o700 } else { 0o600 };
        assert_eq!(mode(&path), expected, "{}", path.display());
    }
    drop(server);
}

#[test]
fn a_restored_snapshot_accepts_only_chosen_keys() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let key_file = at("the.key");
    let with_file = format!("--access keys --admin-key-file {}", key_file.display());
    let server = Server::start(&at("data"), &with_file);
    assert_eq!(mode(&key_file), 0o600);
    let admin = std::fs::read_to_string(&key_file).unwrap().trim().to_owned();
    done(&server.run(&admin, "keys create arm-3 --role robot"));
    let snapshot = at("monday.snapshot").display().to_string();
    done(&server.run(&admin, &format!("snapshot create {snapshot}")));
    assert_eq!(mode(&at("monday.snapshot")), 0o600);
    done(&server.run(&admin, "keys revoke arm-3"));
    done(&server.run(&admin, "keys create arm-4 --role robot"));
    drop(server);

    let restore = |name: &str, how: &str| {
        let data = at(name).display().to_string();
        palpate(&format!("snapshot restore {snapshot} --data {data} --json {how}"))
            .output()
            .unwrap()
    };
    let refused = failed(&restore("none", ""));
    assert!(refused.contains("arm-3") && refused.contains("--keys"), "{refused}");
    assert!(!at("none").exists());
    let keys = |output: &Output| -> Vec<String> {
        let said: Value = serde_json::from_str(&done(output)).unwrap();
        serde_json::from_value(said["keys"].clone()).unwrap()
    };
    assert_eq!(keys(&restore("kept", "--keys keep")), ["admin", "arm-3"]);
    assert_eq!(keys(&restore("dropped", "--keys drop")), [""; 0]);
    let current = format!("--keys newer --current {}", at("data").display());
    assert_eq!(keys(&restore("newer", &current)), ["admin", "arm-4"]);

    let server = Server::start(&at("newer"), "--access keys");
    assert!(server.started.get("admin_key_file").is_none(), "the admin's key is there already");
    let listed = done(&server.run(&admin, "keys list"));
    assert!(listed.contains("arm-3") && listed.contains("revoked"), "{listed}");
}

#[test]
fn keys_are_created_used_rotated_and_revoked_from_a_shell() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(folder.path(), "--access keys");
    // Standard output is not a terminal here, so the key goes to a file that only its owner
    // can read.
    assert!(server.started.get("admin_key").is_none());
    let file = server.said("admin_key_file").to_owned();
    assert_eq!(std::path::Path::new(&file), folder.path().join("admin.key"));
    assert_eq!(mode(Path::new(&file)), 0o600);
    let admin = std::fs::read_to_string(&file).unwrap().trim().to_owned();
    let by_file = palpate(&format!("whoami --key-file {file} --server {}", server.said("server")));
    assert!(done(&{ by_file }.output().unwrap()).starts_with("admin, admin"));
    let refused = failed(&server.run("", "objects list"));
    assert!(refused.contains("API key") && refused.contains("PALPATE_KEY"), "{refused}");

    let said = done(&server.run(&admin, "keys create arm-3 --role robot"));
    assert!(said.contains("shown once"), "{said}");
    let secret = |said: &str| {
        let secret = said.lines().find(|line| line.starts_with("palpate_"));
        secret.unwrap_or_else(|| panic!("{said}")).to_owned()
    };
    let first = secret(&said);
    let whoami = done(&server.run(&first, "whoami"));
    assert!(whoami.starts_with("arm-3, robot"), "{whoami}");
    let refused = failed(&server.run(&first, "objects add mug"));
    assert!(refused.contains("has the role robot"), "{refused}");
    let second = secret(&done(&server.run(&admin, "keys rotate arm-3")));
    let rotated = failed(&server.run(&first, "sessions list"));
    assert!(rotated.contains("rotated"), "{rotated}");
    done(&server.run(&second, "sessions list"));
    done(&server.run(&admin, "keys revoke arm-3"));
    assert!(failed(&server.run(&second, "sessions list")).contains("revoked"));
    let last = failed(&server.run(&admin, "keys revoke admin"));
    assert!(last.contains("last valid admin key"), "{last}");
    let listed = done(&server.run(&admin, "keys list"));
    assert!(listed.contains("revoked") && !listed.contains("palpate_"), "{listed}");

    let audit = done(&server.run(&admin, "audit -n 3"));
    assert_eq!(audit.lines().count(), 4, "{audit}");
    let by = done(&server.run(&admin, "audit --by arm-3 --json"));
    let by: Value = serde_json::from_str(&by).unwrap();
    let operations: Vec<_> =
        by["items"].as_array().unwrap().iter().map(|entry| &entry["operation"]).collect();
    assert_eq!(operations, ["list_sessions", "create_object"]);
    assert_eq!(by["items"][0]["n"], 2, "rotated, then revoked: both were refused alike");
    let log = server.log();
    for secret in [&admin, &first, &second] {
        assert!(!log.contains(secret.as_str()) && !log.contains(&secret[41..]), "{log}");
    }
}

#[test]
fn a_command_trusts_the_given_authority() {
    let folder = TempDir::new().unwrap();
    let key = rcgen::KeyPair::generate().unwrap();
    let names = vec!["127.0.0.1".to_owned()];
    let certificate = rcgen::CertificateParams::new(names).unwrap().self_signed(&key).unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(path("c.pem"), certificate.pem()).unwrap();
    std::fs::write(path("k.pem"), key.serialize_pem()).unwrap();
    let files = format!("--tls-cert {} --tls-key {}", path("c.pem"), path("k.pem"));
    let server = Server::start(&folder.path().join("data"), &files);
    assert!(server.said("server").starts_with("https://"));
    done(&server.run("", &format!("whoami --ca {}", path("c.pem"))));
    let strange = server.run("", "whoami");
    assert_eq!(strange.status.code(), Some(3), "nobody has signed it: {strange:?}");
    let wrong = failed(&server.run("", &format!("whoami --ca {}", path("k.pem"))));
    assert!(wrong.contains("BEGIN CERTIFICATE"), "{wrong}");
    let missing = failed(&server.run("", "whoami --ca missing.pem"));
    assert!(missing.contains("missing.pem"), "{missing}");
    drop(server);

    let swapped = format!("--tls-cert {} --tls-key {}", path("k.pem"), path("c.pem"));
    let serve = palpate(&format!("serve --listen 127.0.0.1:0 {swapped} --data {}", path("data")));
    let error = failed(&{ serve }.output().unwrap());
    assert!(error.contains("k.pem has no certificate"), "{error}");
}

#[test]
fn other_machines_are_refused_with_a_helpful_message() {
    let folder = TempDir::new().unwrap();
    let mut serve = palpate("serve --listen 0.0.0.0:0");
    let error = failed(&serve.arg("--data").arg(folder.path()).output().unwrap());
    assert!(error.contains("--access keys") && error.contains("127.0.0.1"), "{error}");
}
