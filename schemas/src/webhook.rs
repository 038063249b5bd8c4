//! Webhooks on the wire: receivers, their deliveries, and the body that is posted to them.
//!
//! Signatures follow Standard Webhooks (<https://www.standardwebhooks.com>), so that existing
//! libraries verify them: headers `webhook-id`, `webhook-timestamp` and `webhook-signature`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::belief::Belief;
use crate::fleet::Attention;
use crate::job::JobState;
use crate::session::Session;

/// Type of an event.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum WebhookEventType {
    /// A test message (`POST /v1/webhooks/{webhook}/test`). No webhook subscribes to it.
    #[serde(rename = "ping")]
    #[cfg_attr(feature = "clap", value(skip))]
    Ping,
    /// A session decided for an object: `stop.reached` became true, or the decided object changed.
    /// Only sessions with a `risk` decide.
    #[serde(rename = "session.decided")]
    #[cfg_attr(feature = "clap", value(name = "session.decided"))]
    SessionDecided,
    /// A session decided for "none of these". Only sessions with a `risk` decide.
    #[serde(rename = "session.unknown")]
    #[cfg_attr(feature = "clap", value(name = "session.unknown"))]
    SessionUnknown,
    /// A session began to need attention: `attention.is_needed` of `GET /v1/fleet` became true.
    #[serde(rename = "session.needs_attention")]
    #[cfg_attr(feature = "clap", value(name = "session.needs_attention"))]
    SessionNeedsAttention,
    /// A training or recalibration succeeded or failed.
    #[serde(rename = "training.finished")]
    #[cfg_attr(feature = "clap", value(name = "training.finished"))]
    TrainingFinished,
    /// A snapshot was sent completely.
    #[serde(rename = "snapshot.made")]
    #[cfg_attr(feature = "clap", value(name = "snapshot.made"))]
    SnapshotMade,
    /// A snapshot broke off.
    #[serde(rename = "snapshot.failed")]
    #[cfg_attr(feature = "clap", value(name = "snapshot.failed"))]
    SnapshotFailed,
}

impl WebhookEventType {
    /// The types that a webhook can subscribe to.
    pub const ALL: [Self; 6] = [
        Self::SessionDecided,
        Self::SessionUnknown,
        Self::SessionNeedsAttention,
        Self::TrainingFinished,
        Self::SnapshotMade,
        Self::SnapshotFailed,
    ];

    /// Name of the type on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ping => "ping",
            Self::SessionDecided => "session.decided",
            Self::SessionUnknown => "session.unknown",
            Self::SessionNeedsAttention => "session.needs_attention",
            Self::TrainingFinished => "training.finished",
            Self::SnapshotMade => "snapshot.made",
            Self::SnapshotFailed => "snapshot.failed",
        }
    }
}

/// A new webhook.
#[derive(Clone, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateWebhook {
    /// URL to which events are posted: `https://`, or `http://` if the server was started with
    /// `--webhook-allow-private`; without user name and fragment.
    #[schema(min_length = 1, max_length = 2048)]
    pub url: String,
    /// Types of the events to send; each once, not `ping`.
    #[schema(min_items = 1, max_items = 6)]
    pub events: Vec<WebhookEventType>,
    /// Description for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub description: Option<String>,
    /// Key of the signatures: `whsec_` and 16 to 64 random bytes in base64. Default: one that the
    /// server draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 94, pattern = "^whsec_[A-Za-z0-9+/]{22,86}={0,2}$")]
    pub secret: Option<String>,
    /// Whether events are sent. Default: true.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enabled: Option<bool>,
}

impl std::fmt::Debug for CreateWebhook {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // A secret must not appear in a log.
        let mut shown = formatter.debug_struct("CreateWebhook");
        shown.field("events", &self.events).finish_non_exhaustive()
    }
}

/// Changes to a webhook. Omitted fields stay as they are.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct UpdateWebhook {
    /// A new URL. Waiting deliveries go there, too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 2048)]
    pub url: Option<String>,
    /// New types of the events to send.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 6)]
    pub events: Option<Vec<WebhookEventType>>,
    /// A new description.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub description: Option<String>,
    /// Whether events are sent. Disabling abandons the waiting deliveries. A webhook enabled again
    /// receives events from then on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enabled: Option<bool>,
}

/// Rotation of a webhook's secret.
#[derive(Clone, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RotateWebhookSecret {
    /// The new secret, as in `CreateWebhook`. Default: one that the server draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 94, pattern = "^whsec_[A-Za-z0-9+/]{22,86}={0,2}$")]
    pub secret: Option<String>,
    /// Seconds for which the previous secret signs as well, 0 to 2,592,000 (30 days). Default: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 2_592_000)]
    pub grace_s: Option<u64>,
}

impl std::fmt::Debug for RotateWebhookSecret {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = formatter.debug_struct("RotateWebhookSecret");
        shown.field("grace_s", &self.grace_s).finish_non_exhaustive()
    }
}

/// A receiver of events, without its secret.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Webhook {
    /// Id of the webhook.
    pub id: Uuid,
    /// URL to which events are posted.
    pub url: String,
    /// Types of the events to send.
    pub events: Vec<WebhookEventType>,
    /// Description for people.
    pub description: String,
    /// Whether events are sent.
    pub enabled: bool,
    /// Why the server disabled the webhook; null if it did not.
    pub disabled_reason: Option<String>,
    /// Since when every attempt has failed; null if the last one succeeded, or none was made.
    #[schema(format = DateTime)]
    pub failing_since: Option<String>,
    /// When the newest delivery in the history was accepted; null if none was.
    #[schema(format = DateTime)]
    pub last_delivered_at: Option<String>,
    /// Number of deliveries waiting for an attempt.
    pub n_waiting: u32,
    /// Until when the previous secret signs as well; null if only the current one does.
    #[schema(format = DateTime)]
    pub rotating_until: Option<String>,
    /// When the webhook was created.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When the webhook was last changed by a client.
    #[schema(format = DateTime)]
    pub updated_at: String,
}

/// A webhook with its secret, which is shown only once.
#[derive(Clone, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct NewWebhook {
    /// The webhook.
    pub webhook: Webhook,
    /// Key of the signatures: `whsec_` and random bytes in base64. It cannot be shown again.
    #[schema(pattern = "^whsec_[A-Za-z0-9+/]{22,86}={0,2}$")]
    pub secret: String,
}

impl std::fmt::Debug for NewWebhook {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("NewWebhook").field("webhook", &self.webhook).finish_non_exhaustive()
    }
}

/// A page of webhooks.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct WebhookPage {
    /// The webhooks, oldest first.
    pub items: Vec<Webhook>,
    /// Cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// State of a delivery.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WebhookDeliveryState {
    /// Not attempted yet.
    Pending,
    /// The last attempt failed, and another one follows at `next_attempt_at`.
    Failed,
    /// The receiver answered with a status from 200 to 299.
    Delivered,
    /// No attempt follows: all failed, the receiver answered 410, or the webhook was disabled.
    Abandoned,
}

impl WebhookDeliveryState {
    /// Name of the state on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pending => "pending",
            Self::Failed => "failed",
            Self::Delivered => "delivered",
            Self::Abandoned => "abandoned",
        }
    }
}

/// Delivery of an event to a webhook.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct WebhookDelivery {
    /// Id of the event, sent as `webhook-id`; equal for every attempt and every webhook.
    pub id: Uuid,
    /// Type of the event.
    #[serde(rename = "type")]
    pub kind: WebhookEventType,
    /// State of the delivery.
    pub state: WebhookDeliveryState,
    /// When the event was recorded.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When the next attempt is made; null if none follows.
    #[schema(format = DateTime)]
    pub next_attempt_at: Option<String>,
    /// The newest attempts, oldest first.
    #[schema(max_items = 20)]
    pub attempts: Vec<WebhookAttempt>,
    /// The body as it is sent: JSON of a `WebhookEvent`.
    pub body: String,
}

/// One attempt of a delivery.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct WebhookAttempt {
    /// When the attempt began.
    #[schema(format = DateTime)]
    pub at: String,
    /// Milliseconds until the answer or the failure.
    pub duration_ms: u32,
    /// HTTP status of the answer; null if there was none.
    pub status: Option<u16>,
    /// Why the attempt failed; null if it succeeded.
    pub error: Option<String>,
}

/// A page of a webhook's deliveries.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct WebhookDeliveryPage {
    /// The deliveries, newest event first.
    pub items: Vec<WebhookDelivery>,
    /// Cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// The body that is posted to webhooks.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct WebhookEvent {
    /// Id of the event. Receivers ignore an event whose id they have seen.
    pub id: Uuid,
    /// Type of the event.
    #[serde(rename = "type")]
    pub kind: WebhookEventType,
    /// Time of the event, by the server's clock.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// Content of the event.
    pub data: WebhookEventData,
}

/// Content of an event. Fields that belong to other types of events are missing.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct WebhookEventData {
    /// The session, in events `session.…`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<Session>,
    /// The deciding belief, in `session.decided` and `session.unknown`: the likeliest object alone,
    /// with its likeliest pose if it is decided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub belief: Option<Belief>,
    /// Reason for the attention, in `session.needs_attention`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attention: Option<Attention>,
    /// The job, in `training.finished`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub job: Option<WebhookJob>,
    /// The snapshot, in events `snapshot.…`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub snapshot: Option<WebhookSnapshot>,
}

/// An ended job in short; `GET /v1/jobs/{job}` has the request.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct WebhookJob {
    /// Id of the job.
    pub id: Uuid,
    /// Name of the catalogue.
    pub catalogue: String,
    /// `succeeded` or `failed`.
    pub state: JobState,
    /// The version that the job made; null if it failed.
    pub version: Option<u32>,
    /// Why the job failed; null if it did not.
    pub reason: Option<String>,
    /// When the job ended.
    #[schema(format = DateTime)]
    pub finished_at: Option<String>,
}

/// A snapshot that was sent.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct WebhookSnapshot {
    /// Bytes sent.
    pub bytes: u64,
    /// Seconds that the sending took.
    pub duration_s: f64,
    /// Why it failed; null if it did not.
    pub reason: Option<String>,
}
