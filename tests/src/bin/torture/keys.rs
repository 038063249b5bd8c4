//! API keys under fire: created and revoked while the server is killed, and tried afterwards.
//!
//! A created key must be accepted, a revoked one refused, and no key may exist that was not
//! requested.

use anyhow::{Context, bail};
use reqwest::{Client, Method};
use serde_json::json;

use crate::check::Found;
use crate::http::{Outcome, client_with, send};
use crate::ledger::{Fate, Key, Ledger};
use crate::robot::Robot;

/// Number of keys made before the first kill: the admin's, the trainer's, and the robots'.
pub(crate) fn n_given(n_robots: usize) -> usize {
    2 + n_robots
}

/// Creates a key for every robot, and trainer and admin clients for all of them.
pub(crate) async fn give(robots: &mut [Robot], url: &str, admin_key: &str) -> anyhow::Result<()> {
    let keeper = client_with(admin_key)?;
    let teacher = client_with(&made(&keeper, url, "teacher", "trainer").await?)?;
    for robot in robots {
        robot.client = client_with(&made(&keeper, url, &robot.name, "robot").await?)?;
        robot.teacher = teacher.clone();
        robot.keeper = Some(keeper.clone());
    }
    Ok(())
}

async fn made(keeper: &Client, url: &str, name: &str, role: &str) -> anyhow::Result<String> {
    let key = json!({"name": name, "role": role});
    match send(keeper, Method::POST, format!("{url}/v1/keys"), Some(&key)).await {
        Outcome::Done(made) => {
            Ok(made["secret"].as_str().context("a key without a secret")?.to_owned())
        }
        other => bail!("cannot make the key {name}: {other:?}"),
    }
}

/// Revokes the oldest valid key when there are two or more, otherwise creates one.
pub(crate) async fn change(
    keeper: &Client,
    url: &str,
    ledger: &mut Ledger,
    fresh: String,
) -> Outcome {
    let stands = |key: &&mut Key| key.created == Fate::Acknowledged && key.revoked.is_none();
    let n_standing = ledger.keys.iter_mut().filter(stands).count();
    if let Some(key) = ledger.keys.iter_mut().find(stands).filter(|_| n_standing >= 2) {
        key.is_fresh = true;
        let path = format!("{url}/v1/keys/{}", key.name);
        let outcome = send(keeper, Method::DELETE, path, None).await;
        key.revoked = match outcome {
            Outcome::Done(_) => Some(Fate::Acknowledged),
            Outcome::Refused(..) => None,
            Outcome::Unknown => Some(Fate::Unknown),
        };
        ledger.keys_revoked += u64::from(key.revoked == Some(Fate::Acknowledged));
        return outcome;
    }
    let body = json!({"name": fresh, "role": "viewer"});
    let outcome = send(keeper, Method::POST, format!("{url}/v1/keys"), Some(&body)).await;
    let (secret, created) = match &outcome {
        Outcome::Done(made) => (made["secret"].as_str().map(str::to_owned), Fate::Acknowledged),
        Outcome::Refused(..) => return outcome,
        Outcome::Unknown => (None, Fate::Unknown),
    };
    ledger.keys_created += u64::from(created == Fate::Acknowledged);
    ledger.keys.push(Key { name: fresh, secret, created, revoked: None, is_fresh: true });
    outcome
}

/// Tries the keys, the older ones only if `all`.
pub(crate) async fn check(
    keeper: &Client,
    url: &str,
    all: bool,
    ledger: &mut Ledger,
    found: &mut Found,
) {
    let mut kept = Vec::with_capacity(ledger.keys.len());
    for mut key in std::mem::take(&mut ledger.keys) {
        if all || key.is_fresh {
            ledger.keys_tried += 1;
            if !is_there(keeper, url, &mut key, found).await {
                continue;
            }
        }
        key.is_fresh = false;
        kept.push(key);
    }
    ledger.keys = kept;
}

/// Whether a key is stored; settles the fate of unanswered requests.
async fn is_there(keeper: &Client, url: &str, key: &mut Key, found: &mut Found) -> bool {
    let path = format!("{url}/v1/keys/{}", key.name);
    let listed = send(keeper, Method::GET, path, None).await;
    match (&listed, key.created) {
        (Outcome::Done(_), _) => key.created = Fate::Acknowledged,
        // The name of a revoked key may have been reused: it is found by its secret alone.
        (Outcome::Refused(404, _), Fate::Acknowledged) if key.revoked.is_some() => {}
        (Outcome::Refused(404, _), Fate::Unknown) => return false,
        (other, _) => found.lost(format!("the key {}: {other:?}", key.name)),
    }
    let Some(secret) = &key.secret else { return true };
    let Ok(holder) = client_with(secret) else { return true };
    let tried = send(&holder, Method::GET, format!("{url}/v1/whoami"), None).await;
    match (&tried, key.revoked) {
        (Outcome::Done(me), Some(Fate::Unknown) | None) if me["role"] == "viewer" => {
            key.revoked = None;
        }
        (Outcome::Refused(401, _), Some(_)) => key.revoked = Some(Fate::Acknowledged),
        (Outcome::Done(_), Some(Fate::Acknowledged)) => {
            found.lost(format!("the revocation of the key {}", key.name));
        }
        (other, _) => found.lost(format!("who has the key {}: {other:?}", key.name)),
    }
    true
}
