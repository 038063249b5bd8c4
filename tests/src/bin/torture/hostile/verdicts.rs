//! Conditions after the attacks: a complete audit log, no logged secret, downloads end with
//! their key.

use std::time::Duration;

use reqwest::{Client, Method};
use serde_json::{Value, json};
use tokio::io::AsyncReadExt;

use super::attacks::DOWNLOADS;
use super::foe::Foe;
use crate::http::{Outcome, send};

/// Maximum duration of a download after its key was revoked.
const DOWNLOAD_PATIENCE: Duration = Duration::from_secs(15);

/// Name by which the changes made before the attacks are found.
pub(super) const EVIDENCE: &str = "evidence";

/// Checks that the audit log still has the earlier changes and the refusal of a named key,
/// and no secret.
pub(super) async fn audit(admin: &Client, url: &str, foes: &[Foe]) -> Vec<String> {
    let mut faults = Vec::new();
    let made = entries(admin, url, "operation=create_object&limit=1000").await;
    let is_evidence = |entry: &Value| entry["status"] == 201 && entry["key_name"] == "teacher";
    if !made.iter().any(is_evidence) {
        faults.push("the entry of a change is gone from the audit log".to_owned());
    }
    let refused = entries(admin, url, "operation=delete_object&limit=1000").await;
    let is_refused = |entry: &Value| entry["status"] == 403 && entry["key_name"] == "looker-0";
    if !refused.iter().any(is_refused) {
        faults.push("the refusal of a named key is gone from the audit log".to_owned());
    }
    let all = json!(entries(admin, url, "limit=1000").await).to_string();
    if foes.iter().any(|foe| all.contains(&foe.viewer_key)) {
        faults.push("a key is in the audit log".to_owned());
    }
    faults
}

async fn entries(admin: &Client, url: &str, query: &str) -> Vec<Value> {
    let (mut found, mut cursor) = (Vec::new(), String::new());
    for _ in 0..50 {
        let path = format!("{url}/v1/audit?{query}{cursor}");
        let Some(page) = send(admin, Method::GET, path, None).await.done() else { break };
        found.extend(page["items"].as_array().cloned().unwrap_or_default());
        let Some(next) = page["next_cursor"].as_str() else { break };
        cursor = format!("&cursor={next}");
    }
    found
}

/// Checks that a snapshot can be taken beside stalled downloads, and that these end with
/// their key.
pub(super) async fn downloads(admin: &Client, url: &str, foes: &mut [Foe]) -> Vec<String> {
    let mut faults = Vec::new();
    let taken = admin.post(format!("{url}/v1/snapshots")).send().await;
    match taken {
        Ok(answer) if answer.status().is_success() => match answer.bytes().await {
            Ok(bytes) if !bytes.is_empty() => {}
            other => faults.push(format!("a snapshot beside stalled ones broke off: {other:?}")),
        },
        other => faults.push(format!("a snapshot beside stalled ones is not given: {other:?}")),
    }
    let revoked = send(admin, Method::DELETE, format!("{url}/v1/keys/leaver"), None).await;
    if !matches!(revoked, Outcome::Done(_)) {
        faults.push(format!("the key cannot be revoked: {revoked:?}"));
    }
    for foe in foes {
        let held = foe.held.get_mut().unwrap_or_else(|held| held.into_inner());
        // Downloads of earlier attacks stay as they are.
        let earlier = held.len().saturating_sub(DOWNLOADS);
        for mut stream in held.split_off(earlier) {
            let mut rest = Vec::new();
            let reading = stream.read_to_end(&mut rest);
            if tokio::time::timeout(DOWNLOAD_PATIENCE, reading).await.is_err() {
                faults.push("a download goes on after its key was revoked".to_owned());
            }
        }
    }
    faults
}
