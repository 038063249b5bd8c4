//! API keys. All are in memory; changes are durable before they take effect.
//!
//! A secret is returned once, when it is created; only its hash is kept. Hashes are compared
//! in constant time, and an unknown key takes as long as a known one. Not here: permissions
//! of roles (`roles`), and the check of requests (`guard`).

mod elsewhere;
pub(crate) mod error;
mod holding;
mod latest;
mod robots;

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock};

use axum::http::{HeaderMap, HeaderValue, header};
use palpate_schemas as wire;
use palpate_store::access::{AccessKey, PreviousSecret, Role};
use palpate_store::database::Database;
use palpate_store::error::StoreError;
use subtle::ConstantTimeEq;
use tokio::sync::watch;
use uuid::Uuid;

use crate::cause::Cause;
use crate::config::Access;
use crate::secret::{self, ChosenKey};
use crate::wire::{self as convert, cursor, page_id, page_length};
use error::{KeyError, KeyFault, OpenError};
use latest::Latest;

/// Precision of a key's time of last use, in milliseconds.
const LAST_USED_STEP_MS: u64 = 3_600_000;
/// Maximum number of keys, revoked ones included; those revoked first are dropped.
const KEYS_MAX: usize = 10_000;
/// Permitted lifetimes of a key, in seconds.
const EXPIRES_IN_S: (u64, u64) = (60, 315_360_000);
/// Maximum time for which the previous secret stays valid beside the new one, in seconds.
const GRACE_S_MAX: u64 = 2_592_000;

/// All keys.
pub(crate) struct Keys {
    store: Database,
    known: Arc<RwLock<BTreeMap<Uuid, AccessKey>>>,
    /// The names of robots owned by keys.
    holders: RwLock<robots::Known>,
    /// Locked while keys change: the guarantee that an admin key is left concerns all of them.
    changing: tokio::sync::Mutex<()>,
    required: bool,
    latest: Latest,
    /// Notified of every change, so that streams of a key's holder can end.
    changes: watch::Sender<()>,
}

impl Keys {
    /// Reads the keys. With `fresh`, creates an admin's key and returns its secret. If keys are
    /// required and there is no valid admin's, stores the chosen one, or creates one as with `fresh`.
    pub(crate) async fn open(
        store: Database,
        access: Access,
        fresh: bool,
        chosen: Option<ChosenKey>,
    ) -> Result<(Self, Option<String>), OpenError> {
        let _alone = elsewhere::alone(&store).await.map_err(StoreError::from)?;
        let all = elsewhere::read_keys(&store)?;
        let latest = Latest::new(store.latest_time()?);
        let now = latest.now_ms();
        let stored = all.values().any(|key| key.revoked_at_ms.is_none());
        let required = match access {
            Access::Keys => true,
            Access::Auto => stored || fresh || chosen.is_some(),
            Access::Open => false,
        };
        let needs_admin = fresh || (required && n_admins(&all, now) == 0);
        let known = Arc::new(RwLock::new(all));
        let holders = RwLock::new(Self::read_robots(&store)?);
        let changing = tokio::sync::Mutex::default();
        let changes = watch::Sender::default();
        let keys = Self { store, known, holders, changing, required, latest, changes };
        if !needs_admin {
            if chosen.is_some_and(|chosen| keys.find_id(chosen.id).is_none()) {
                tracing::warn!("There is an admin key: the given first admin key is not used");
            }
            return Ok((keys, None));
        }
        let name = keys.free_name("admin");
        let (key, secret) = match chosen.filter(|_| !fresh) {
            Some(chosen) if keys.find_id(chosen.id).is_some() => {
                // Robots go on meanwhile.
                tracing::error!(
                    "No admin key is valid, and the given first admin key was revoked, has expired \
                     or has another role: start with a new one, or with `--new-admin-key`"
                );
                return Ok((keys, None));
            }
            Some(chosen) => (key(chosen.id, chosen.hash, name, Role::Admin, now), None),
            None => {
                let (key, secret) = new_key(name, Role::Admin, now, None)?;
                (key, Some(secret))
            }
        };
        keys.store.keys().create(&key).await?;
        keys.learn(key);
        Ok((keys, secret))
    }

    /// Whether requests without a key are refused.
    pub(crate) fn required(&self) -> bool {
        self.required
    }

    /// Whether a request has a valid key, or keys are not required.
    pub(crate) fn admits(&self, headers: &HeaderMap) -> bool {
        let header = headers.get(header::AUTHORIZATION).map(HeaderValue::as_bytes);
        !self.required() || self.verify(header).is_ok()
    }

    /// The key of an `Authorization` header.
    pub(crate) fn verify(&self, header: Option<&[u8]>) -> Result<AccessKey, KeyFault> {
        let header = header.ok_or(KeyFault::Missing)?;
        let text = std::str::from_utf8(header).map_err(|_| KeyFault::NotAKey)?;
        let (scheme, token) = text.trim().split_once(' ').ok_or(KeyFault::NotAKey)?;
        if !scheme.eq_ignore_ascii_case("bearer") {
            return Err(KeyFault::NotAKey);
        }
        let presented = secret::parse(token.trim()).ok_or(KeyFault::NotAKey)?;
        let now = self.now_ms();
        let found = self.find_id(presented.id);
        let expected = found.as_ref().map_or([0; 32], |key| key.hash);
        let previous = found.as_ref().and_then(|key| key.previous);
        let is_current = bool::from(presented.hash.ct_eq(&expected));
        let before = previous.map_or([0; 32], |previous| previous.hash);
        let is_previous = bool::from(presented.hash.ct_eq(&before));
        let key = found.filter(|_| is_current || is_previous).ok_or(KeyFault::Unknown)?;
        if key.revoked_at_ms.is_some() {
            return Err(KeyFault::Revoked(Box::new(key)));
        }
        if key.expires_at_ms.is_some_and(|at| at <= now) {
            return Err(KeyFault::Expired(Box::new(key)));
        }
        if !is_current && previous.is_none_or(|previous| previous.until_ms <= now) {
            return Err(KeyFault::Rotated(Box::new(key)));
        }
        self.used(&key, now);
        Ok(key)
    }

    /// The key with an id or a name; of equal names preferably a valid one.
    pub(crate) fn get(&self, reference: &str) -> Result<AccessKey, Cause> {
        let found = match Uuid::try_parse(reference) {
            Ok(id) => self.find_id(id),
            Err(_) => self.read(|keys| {
                let named = keys.values().filter(|key| key.name == reference);
                named.max_by_key(|key| (key.revoked_at_ms.is_none(), key.id)).cloned()
            }),
        };
        found.ok_or_else(|| Cause::unknown("key", reference))
    }

    /// A key as it is now, for the wire.
    pub(crate) fn shown(&self, key: &AccessKey) -> wire::ApiKey {
        let held = self.store.held().get(&key.id).copied().unwrap_or(0);
        convert::access::key(key, self.now_ms(), held)
    }

    pub(crate) fn list(&self, query: &wire::PageQuery) -> Result<wire::ApiKeyPage, Cause> {
        let (after, limit) = (page_id(query)?, page_length(query)?);
        let (now, held) = (self.now_ms(), self.store.held());
        let shown = |key: &AccessKey| {
            convert::access::key(key, now, held.get(&key.id).copied().unwrap_or(0))
        };
        Ok(self.read(|keys| {
            let behind = keys.values().filter(|key| after.is_none_or(|after| key.id > after));
            let mut items: Vec<_> = behind.take(limit + 1).collect();
            let more = items.len() > limit;
            items.truncate(limit);
            let next = items.last().filter(|_| more).map(|key| key.id);
            let items = items.into_iter().map(shown).collect();
            wire::ApiKeyPage { items, next_cursor: cursor(next) }
        }))
    }

    pub(crate) async fn create(
        &self,
        request: &wire::CreateKey,
    ) -> Result<wire::NewApiKey, KeyError> {
        convert::name(&request.name)?;
        let (low, high) = EXPIRES_IN_S;
        let within = |s| convert::within("/expires_in_s", s, low, high);
        let expires_in_s = request.expires_in_s.map(within).transpose()?;
        let _alone = self.alone().await?;
        if self.is_taken(&request.name) {
            let name = request.name.clone();
            return Err(StoreError::NameTaken { what: "key", name }.into());
        }
        self.make_room().await?;
        let role = convert::access::stored_role(request.role);
        let now = self.now_ms();
        let (key, secret) = new_key(request.name.clone(), role, now, expires_in_s)?;
        self.store.keys().create(&key).await?;
        self.learn(key.clone());
        tracing::info!(key.id = %key.id, "Created key {:?}", key.name);
        Ok(wire::NewApiKey { key: self.shown(&key), secret })
    }

    /// Revokes a key; no effect on a revoked one.
    pub(crate) async fn revoke(&self, reference: &str) -> Result<(), KeyError> {
        let _alone = self.alone().await?;
        let key = self.get(reference)?;
        let now = self.now_ms();
        if key.revoked_at_ms.is_some() {
            return Ok(());
        }
        let is_admin = key.role == Role::Admin && key.is_active(now);
        if is_admin && self.read(|keys| n_admins(keys, now)) == 1 {
            return Err(KeyError::LastAdmin { name: key.name });
        }
        let revoked = AccessKey { revoked_at_ms: Some(now), previous: None, ..key };
        self.change(revoked).await?;
        Ok(())
    }

    /// Gives a key a new secret.
    pub(crate) async fn rotate(
        &self,
        reference: &str,
        request: &wire::RotateKey,
    ) -> Result<wire::NewApiKey, KeyError> {
        let grace_s = request.grace_s.unwrap_or(0);
        let grace_s = convert::within("/grace_s", grace_s, 0, GRACE_S_MAX)?;
        let _alone = self.alone().await?;
        let key = self.get(reference)?;
        let now = self.now_ms();
        if !key.is_active(now) {
            return Err(KeyError::Refused { name: key.name });
        }
        let (secret, hash) = secret::draw(key.id)?;
        let previous = PreviousSecret { hash: key.hash, until_ms: now + grace_s * 1000 };
        let rotated = AccessKey { hash, previous: Some(previous), ..key };
        self.change(rotated.clone()).await?;
        tracing::info!(key.id = %rotated.id, "Rotated key {:?}", rotated.name);
        Ok(wire::NewApiKey { key: self.shown(&rotated), secret })
    }

    /// Stores a changed key, then applies the change.
    async fn change(&self, key: AccessKey) -> Result<(), StoreError> {
        let change = |stored: &mut AccessKey| {
            *stored = AccessKey { last_used_at_ms: stored.last_used_at_ms, ..key.clone() };
            Ok::<(), StoreError>(())
        };
        let stored = self.store.essential().keys().update(key.id, change).await??;
        self.learn(stored);
        Ok(())
    }

    /// Records the use of a key, if the stored time is too old.
    fn used(&self, key: &AccessKey, now: u64) {
        if key.last_used_at_ms.is_some_and(|at| now < at.saturating_add(LAST_USED_STEP_MS)) {
            return;
        }
        let id = key.id;
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        if let Some(key) = known.get_mut(&id) {
            key.last_used_at_ms = Some(now);
        }
        drop(known);
        let table = self.store.keys();
        tokio::spawn(async move {
            let note = |key: &mut AccessKey| {
                key.last_used_at_ms = Some(now);
                Ok::<(), ()>(())
            };
            if let Err(error) = table.update(id, note).await {
                tracing::warn!(key.id = %id, %error, "Cannot store when key {id} was used");
            }
        });
    }

    /// Drops the key revoked first, when there are too many.
    async fn make_room(&self) -> Result<(), KeyError> {
        let n_keys = self.read(BTreeMap::len);
        if n_keys < KEYS_MAX {
            return Ok(());
        }
        let oldest = self.read(|keys| {
            let revoked = keys.values().filter(|key| key.revoked_at_ms.is_some());
            revoked.min_by_key(|key| key.revoked_at_ms).map(|key| key.id)
        });
        let Some(id) = oldest else { return Err(KeyError::Full { found: n_keys }) };
        self.store.keys().remove(id).await?;
        self.known.write().unwrap_or_else(PoisonError::into_inner).remove(&id);
        Ok(())
    }

    fn is_taken(&self, name: &str) -> bool {
        self.read(|keys| keys.values().any(|k| k.name == name && k.revoked_at_ms.is_none()))
    }

    fn free_name(&self, wanted: &str) -> String {
        let numbered = (2..).map(|number| format!("{wanted}-{number}"));
        let mut names = std::iter::once(wanted.to_owned()).chain(numbered);
        names.find(|name| !self.is_taken(name)).expect("there are more numbers than keys")
    }

    fn find_id(&self, id: Uuid) -> Option<AccessKey> {
        self.read(|keys| keys.get(&id).cloned())
    }

    fn learn(&self, key: AccessKey) {
        self.known.write().unwrap_or_else(PoisonError::into_inner).insert(key.id, key);
        self.changes.send_replace(());
    }

    fn read<T>(&self, look: impl FnOnce(&BTreeMap<Uuid, AccessKey>) -> T) -> T {
        look(&self.known.read().unwrap_or_else(PoisonError::into_inner))
    }
}

fn n_admins(keys: &BTreeMap<Uuid, AccessKey>, now_ms: u64) -> usize {
    keys.values().filter(|key| key.role == Role::Admin && key.is_active(now_ms)).count()
}

fn new_key(
    name: String,
    role: Role,
    created_at_ms: u64,
    expires_in_s: Option<u64>,
) -> Result<(AccessKey, String), getrandom::Error> {
    let id = Uuid::now_v7();
    let (secret, hash) = secret::draw(id)?;
    let expires_at_ms = expires_in_s.map(|s| created_at_ms + s * 1000);
    Ok((AccessKey { expires_at_ms, ..key(id, hash, name, role, created_at_ms) }, secret))
}

/// A key that was never used and never ends.
fn key(id: Uuid, hash: [u8; 32], name: String, role: Role, created_at_ms: u64) -> AccessKey {
    AccessKey {
        id,
        name,
        role,
        hash,
        previous: None,
        created_at_ms,
        expires_at_ms: None,
        last_used_at_ms: None,
        revoked_at_ms: None,
    }
}
