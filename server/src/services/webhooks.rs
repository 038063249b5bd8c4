//! Webhooks: receivers of signed events, with retries and a history.
//!
//! An event is stored with the deliveries to its receivers before anything is sent, so that a
//! restart or a crash loses none; a receiver may get one twice, under the same id. Webhooks and
//! deliveries change one after another, in the store first. Not here: what happens (`notices`).

mod announce;
mod backoff;
mod registry;
mod history;
mod elsewhere;
mod deliver;
pub(crate) mod error;
mod sender;
mod signature;
mod target;

use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use palpate_schemas as wire;
use palpate_store::database::Database;
use palpate_store::error::StoreError;
use palpate_store::webhook::{DeliveryState, PreviousKey, Webhook};
use tokio::sync::{Mutex, watch};
use uuid::Uuid;

use crate::cause::Cause;
use crate::clock::now_ms;
use crate::config::Config;
use crate::notices::Notices;
use crate::services::sessions::Sessions;
use crate::wire::webhook::{WebhookStatus, kinds};
use crate::wire::{self as convert, count, cursor, page_id, page_length};
use error::WebhookError;
use registry::{Entry, Known, Moment, Registry};
use sender::Sender;

/// Maximum number of webhooks.
const WEBHOOKS_MAX: usize = 32;
/// Maximum length of a description, characters.
const DESCRIPTION_CHARS_MAX: usize = 200;
/// Maximum time for which the previous secret signs beside the new one, in seconds.
const GRACE_S_MAX: u64 = 2_592_000;
/// Reason of a webhook that a receiver wants no more.
const GONE: &str = "the receiver answered 410 Gone";

/// All webhooks.
pub(crate) struct Webhooks {
    store: Database,
    sessions: Arc<Sessions>,
    notices: Arc<Notices>,
    sender: Sender,
    allows_private: bool,
    pauses: Vec<Duration>,
    registry: RwLock<Registry>,
    /// Locked while webhooks or deliveries change.
    changing: Mutex<()>,
    /// Notified of every change of a delivery.
    changed: watch::Sender<()>,
}

impl Webhooks {
    /// Reads the webhooks, their deliveries, and what was announced.
    pub(crate) async fn open(
        store: &Database,
        sessions: &Arc<Sessions>,
        notices: Arc<Notices>,
        config: &Config,
    ) -> Result<Self, Cause> {
        let (read, noted) = (store.clone(), Arc::clone(&notices));
        let reading = tokio::task::spawn_blocking(move || stored(&read, &noted));
        let registry = reading.await.map_err(|_| Cause::Panicked)??;
        let allows_private = config.webhook_allow_private;
        Ok(Self {
            store: store.clone(),
            sessions: Arc::clone(sessions),
            notices,
            sender: Sender::new(allows_private),
            allows_private,
            pauses: config.webhook_pauses.clone(),
            registry: RwLock::new(registry),
            changing: Mutex::default(),
            changed: watch::Sender::default(),
        })
    }

    /// Where events are noted.
    pub(crate) fn notices(&self) -> &Arc<Notices> {
        &self.notices
    }

    pub(crate) fn list(&self, query: &wire::PageQuery) -> Result<wire::WebhookPage, Cause> {
        let (after, limit, now) = (page_id(query)?, page_length(query)?, now_ms());
        Ok(self.read(|registry| {
            let behind = registry.0.iter().filter(|(id, _)| after.is_none_or(|after| **id > after));
            let mut items: Vec<_> = behind.take(limit + 1).collect();
            let more = items.len() > limit;
            items.truncate(limit);
            let next = items.last().filter(|_| more).map(|(id, _)| **id);
            let items = items.into_iter().map(|(_, known)| shown_webhook(known, now)).collect();
            wire::WebhookPage { items, next_cursor: cursor(next) }
        }))
    }

    pub(crate) fn get(&self, id: &str) -> Result<wire::Webhook, Cause> {
        let id = self.id(id)?;
        self.show(id)
    }

    pub(crate) async fn create(
        &self,
        request: &wire::CreateWebhook,
    ) -> Result<wire::NewWebhook, WebhookError> {
        let url = target::url(&request.url, self.allows_private)?;
        let events = kinds(&request.events)?;
        let description = request.description.clone().unwrap_or_default();
        convert::text("/description", &description, DESCRIPTION_CHARS_MAX)?;
        let secret = self.secret(request.secret.as_deref())?;
        let _changing = self.changing.lock().await;
        let n_webhooks = self.read(|registry| registry.0.len());
        if n_webhooks >= WEBHOOKS_MAX {
            return Err(WebhookError::Full { max: WEBHOOKS_MAX });
        }
        let now = now_ms();
        let webhook = Webhook {
            id: Uuid::now_v7(),
            url: url.into(),
            description,
            events,
            secret,
            previous: None,
            is_enabled: request.enabled.unwrap_or(true),
            disabled_because: None,
            created_at_ms: now,
            updated_at_ms: now,
            since_ms: now,
            failing_since_ms: None,
        };
        self.store.webhooks().create(&webhook).await?;
        let (id, secret) = (webhook.id, signature::shown(&webhook.secret));
        self.write(|registry| registry.0.insert(id, Known::new(webhook)));
        tracing::info!(webhook.id = %id, "Created webhook {id}");
        Ok(wire::NewWebhook { webhook: self.show(id)?, secret })
    }

    pub(crate) async fn update(
        &self,
        id: &str,
        request: &wire::UpdateWebhook,
    ) -> Result<wire::Webhook, WebhookError> {
        let id = self.id(id)?;
        let url = request.url.as_deref().map(|url| target::url(url, self.allows_private));
        let url = url.transpose()?;
        let events = request.events.as_deref().map(kinds).transpose()?;
        if let Some(description) = &request.description {
            convert::text("/description", description, DESCRIPTION_CHARS_MAX)?;
        }
        let _changing = self.changing.lock().await;
        let now = now_ms();
        let changed = self.change(id, |webhook| {
            webhook.updated_at_ms = now;
            if let Some(url) = &url {
                webhook.url = url.to_string();
            }
            if let Some(events) = &events {
                webhook.events.clone_from(events);
            }
            if let Some(description) = &request.description {
                webhook.description.clone_from(description);
            }
            if let Some(is_enabled) = request.enabled {
                if is_enabled && !webhook.is_enabled {
                    (webhook.since_ms, webhook.failing_since_ms) = (now, None);
                }
                (webhook.is_enabled, webhook.disabled_because) = (is_enabled, None);
            }
        });
        if !changed.await?.is_enabled {
            self.abandon_waiting(id).await?;
        }
        Ok(self.show(id)?)
    }

    pub(crate) async fn delete(&self, id: &str) -> Result<(), WebhookError> {
        let id = self.id(id)?;
        let _changing = self.changing.lock().await;
        let store = self.store.essential();
        store.webhooks().remove(id).await?;
        self.write(|registry| registry.0.remove(&id));
        // What a crash leaves here is removed at the next start.
        store.deliveries().remove_all(id).await?;
        tracing::info!(webhook.id = %id, "Deleted webhook {id}");
        Ok(())
    }

    /// Gives a webhook a new secret.
    pub(crate) async fn rotate(
        &self,
        id: &str,
        request: &wire::RotateWebhookSecret,
    ) -> Result<wire::NewWebhook, WebhookError> {
        let id = self.id(id)?;
        let grace_s = convert::within("/grace_s", request.grace_s.unwrap_or(0), 0, GRACE_S_MAX)?;
        let secret = self.secret(request.secret.as_deref())?;
        let _changing = self.changing.lock().await;
        let now = now_ms();
        let changed = self.change(id, |webhook| {
            let before = std::mem::replace(&mut webhook.secret, secret.clone());
            let until_ms = now + 1000 * grace_s;
            webhook.previous = (grace_s > 0).then_some(PreviousKey { secret: before, until_ms });
            webhook.updated_at_ms = now;
        });
        changed.await?;
        tracing::info!(webhook.id = %id, "Rotated the secret of webhook {id}");
        Ok(wire::NewWebhook { webhook: self.show(id)?, secret: signature::shown(&secret) })
    }

    /// Stores a changed webhook, then applies the change.
    async fn change(&self, id: Uuid, change: impl Fn(&mut Webhook)) -> Result<Webhook, StoreError> {
        let table = self.store.essential().webhooks();
        let changed = table.update(id, |webhook| {
            change(webhook);
            Ok::<(), StoreError>(())
        });
        let webhook = changed.await??;
        self.write(|registry| {
            if let Some(known) = registry.0.get_mut(&id) {
                known.webhook = webhook.clone();
            }
        });
        Ok(webhook)
    }

    fn secret(&self, given: Option<&str>) -> Result<Vec<u8>, WebhookError> {
        Ok(match given {
            Some(text) => signature::parse(text)?,
            None => signature::draw()?,
        })
    }

    fn enabled(&self, id: Uuid) -> Result<(), WebhookError> {
        let is_enabled =
            self.read(|registry| registry.0.get(&id).map(|known| known.webhook.is_enabled));
        match is_enabled {
            Some(true) => Ok(()),
            Some(false) => Err(WebhookError::Disabled { id }),
            None => Err(Cause::unknown("webhook", id).into()),
        }
    }

    /// The id of a webhook in a path.
    fn id(&self, reference: &str) -> Result<Uuid, Cause> {
        let unknown = || Cause::unknown("webhook", reference);
        let id = Uuid::try_parse(reference).map_err(|_| unknown())?;
        self.read(|registry| registry.0.contains_key(&id)).then_some(id).ok_or_else(unknown)
    }

    fn show(&self, id: Uuid) -> Result<wire::Webhook, Cause> {
        let now = now_ms();
        let shown =
            self.read(|registry| registry.0.get(&id).map(|known| shown_webhook(known, now)));
        shown.ok_or_else(|| Cause::unknown("webhook", id))
    }

    /// This moment.
    fn now(&self) -> Moment {
        let clock_ms = now_ms();
        Moment { clock_ms, ran_ms: self.store.running(clock_ms).now_ms() }
    }

    fn read<T>(&self, look: impl FnOnce(&Registry) -> T) -> T {
        look(&self.registry.read().unwrap_or_else(PoisonError::into_inner))
    }

    fn write<T>(&self, change: impl FnOnce(&mut Registry) -> T) -> T {
        change(&mut self.registry.write().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The webhooks of a store with their deliveries; what was announced goes to `notices`. Blocks.
fn stored(store: &Database, notices: &Notices) -> Result<Registry, StoreError> {
    let mut registry = Registry::default();
    for webhook in store.webhooks().list_whole(None, usize::MAX - 1)?.items {
        registry.0.insert(webhook.id, Known::new(webhook));
    }
    let running = store.running(now_ms());
    store.deliveries().each(|delivery| {
        if let Some(known) = registry.0.get_mut(&delivery.webhook) {
            known.entries.insert(delivery.event, Entry::of(&delivery, &running));
        }
    })?;
    for notice in store.deliveries().notices()? {
        notices.set_announced(notice);
    }
    Ok(registry)
}

fn shown_webhook(known: &Known, now_ms: u64) -> wire::Webhook {
    let entries = || known.entries.values();
    let delivered = entries().filter(|entry| entry.state == DeliveryState::Delivered);
    let status = WebhookStatus {
        n_waiting: count(entries().filter(|entry| entry.is_waiting()).count()),
        last_delivered_at_ms: delivered.filter_map(|entry| entry.tried_at_ms).max(),
        now_ms,
    };
    convert::webhook::webhook(&known.webhook, status)
}

/// Counts a delivery that ended.
fn count_end(outcome: &'static str) {
    metrics::counter!("palpate_webhook_deliveries_total", "outcome" => outcome).increment(1);
}
