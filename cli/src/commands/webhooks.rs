//! `palpate webhooks`: receivers of signed events, and what was delivered to them.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::{Args, Subcommand};
use palpate_client::schemas::{
    CreateWebhook, NewWebhook, PageQuery, RotateWebhookSecret, UpdateWebhook, Webhook,
    WebhookDelivery, WebhookDeliveryState, WebhookEventType,
};
use serde_json::json;

use super::Context;
use crate::output;

/// Arguments of `palpate webhooks`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate webhooks create https://mes.example/touch \
    --events session.decided,session.unknown\n  palpate webhooks test ID\n  \
    palpate webhooks deliveries ID --failed\n  palpate webhooks redeliver ID EVENT")]
pub(crate) struct WebhooksArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Create a webhook and print its secret, once.
    Create {
        /// URL to which events are posted.
        url: String,
        /// Types of the events to send.
        #[arg(long, value_name = "TYPES", value_delimiter = ',', required = true)]
        events: Vec<WebhookEventType>,
        /// Description for people.
        #[arg(long, value_name = "TEXT")]
        description: Option<String>,
        /// File with the secret, `whsec_…` [default: the server draws one].
        #[arg(long, value_name = "FILE")]
        secret_file: Option<PathBuf>,
    },
    /// List the webhooks.
    List,
    /// Show one webhook.
    Show {
        /// Id of the webhook.
        webhook: String,
    },
    /// Change a webhook: its URL, events or description; disable it, or enable it again.
    Update {
        /// Id of the webhook.
        webhook: String,
        /// New URL.
        #[arg(long)]
        url: Option<String>,
        /// New types of the events to send.
        #[arg(long, value_name = "TYPES", value_delimiter = ',')]
        events: Option<Vec<WebhookEventType>>,
        /// New description.
        #[arg(long, value_name = "TEXT")]
        description: Option<String>,
        /// Whether events are sent.
        #[arg(long, value_name = "BOOL")]
        enabled: Option<bool>,
    },
    /// Delete a webhook with its history.
    Delete {
        /// Id of the webhook.
        webhook: String,
    },
    /// Rotate a webhook's secret: give it a new one and print it, once.
    Rotate {
        /// Id of the webhook.
        webhook: String,
        /// Seconds for which the previous secret signs as well.
        #[arg(long, value_name = "S", default_value_t = 0)]
        grace_s: u64,
        /// File with the new secret, `whsec_…` [default: the server draws one].
        #[arg(long, value_name = "FILE")]
        secret_file: Option<PathBuf>,
    },
    /// Send a test message and show the answer; fails if it is not accepted.
    Test {
        /// Id of the webhook.
        webhook: String,
    },
    /// List the newest deliveries to a webhook.
    Deliveries {
        /// Id of the webhook.
        webhook: String,
        /// Only deliveries that failed or were abandoned.
        #[arg(long)]
        failed: bool,
        /// Maximum number of deliveries.
        #[arg(short, long, value_name = "N", default_value_t = 50,
            value_parser = clap::value_parser!(u32).range(1..=200))]
        n: u32,
    },
    /// Deliver an event again.
    Redeliver {
        /// Id of the webhook.
        webhook: String,
        /// Id of the event.
        event: String,
    },
}

/// Runs the command.
pub(crate) async fn run(args: WebhooksArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::Create { url, events, description, secret_file } => {
            let secret = secret(secret_file)?;
            let asked = CreateWebhook { url, events, description, secret, enabled: None };
            output.answer(&client.create_webhook(&asked).await?, with_secret)
        }
        Action::List => {
            let page = client.webhooks(&PageQuery { limit: Some(1000), cursor: None }).await?;
            output.answer(&page, |page| table(&page.items))
        }
        Action::Show { webhook } => output.answer(&client.webhook(&webhook).await?, table_of),
        Action::Update { webhook, url, events, description, enabled } => {
            let changes = UpdateWebhook { url, events, description, enabled };
            output.answer(&client.update_webhook(&webhook, &changes).await?, table_of)
        }
        Action::Delete { webhook } => {
            client.delete_webhook(&webhook).await?;
            output.answer(&json!({ "deleted": webhook }), |_| format!("deleted {webhook}"))
        }
        Action::Rotate { webhook, grace_s, secret_file } => {
            let secret = secret(secret_file)?;
            let how = RotateWebhookSecret { secret, grace_s: Some(grace_s) };
            output.answer(&client.rotate_webhook_secret(&webhook, &how).await?, with_secret)
        }
        Action::Test { webhook } => {
            let delivery = client.test_webhook(&webhook).await?;
            let is_accepted = delivery.state == WebhookDeliveryState::Delivered;
            output.answer(&delivery, |delivery| deliveries(std::slice::from_ref(delivery)))?;
            if is_accepted { Ok(()) } else { bail!("the receiver did not accept the message") }
        }
        Action::Deliveries { webhook, failed, n } => {
            let limit = if failed { 200 } else { n };
            let page = PageQuery { limit: Some(limit), cursor: None };
            let mut page = client.webhook_deliveries(&webhook, &page).await?;
            page.items.retain(|one| !failed || has_failed(one));
            page.items.truncate(n as usize);
            output.answer(&page, |page| deliveries(&page.items))
        }
        Action::Redeliver { webhook, event } => {
            let delivery = client.redeliver_webhook(&webhook, &event).await?;
            output.answer(&delivery, |delivery| format!("event {} is due again", delivery.id))
        }
    }
}

/// The secret in a file. Command lines are seen by other users of the machine.
fn secret(file: Option<PathBuf>) -> anyhow::Result<Option<String>> {
    let Some(path) = file else { return Ok(None) };
    let text = std::fs::read_to_string(&path);
    let text = text.with_context(|| format!("cannot read {}", path.display()))?;
    Ok(Some(text.trim().to_owned()))
}

fn has_failed(delivery: &WebhookDelivery) -> bool {
    matches!(delivery.state, WebhookDeliveryState::Failed | WebhookDeliveryState::Abandoned)
}

fn with_secret(new: &NewWebhook) -> String {
    format!(
        "{}\n\n{}\n\nThis is shown once. The receiver verifies signatures with it, as Standard \
         Webhooks describes.",
        table_of(&new.webhook),
        new.secret
    )
}

fn table_of(webhook: &Webhook) -> String {
    table(std::slice::from_ref(webhook))
}

fn table(webhooks: &[Webhook]) -> String {
    output::table(
        ["id", "url", "events", "state", "waiting", "last delivered", "description"],
        webhooks.iter().map(|webhook| {
            let events: Vec<&str> = webhook.events.iter().map(|event| event.name()).collect();
            [
                webhook.id.to_string(),
                webhook.url.clone(),
                events.join(", "),
                state(webhook),
                webhook.n_waiting.to_string(),
                webhook.last_delivered_at.clone().unwrap_or_else(|| "never".to_owned()),
                webhook.description.clone(),
            ]
        }),
    )
}

fn state(webhook: &Webhook) -> String {
    match (webhook.enabled, &webhook.disabled_reason, &webhook.failing_since) {
        (false, Some(reason), _) => format!("disabled: {reason}"),
        (false, None, _) => "disabled".to_owned(),
        (true, _, Some(since)) => format!("failing since {since}"),
        (true, _, None) => "enabled".to_owned(),
    }
}

fn deliveries(deliveries: &[WebhookDelivery]) -> String {
    output::table(
        ["event", "type", "created", "state", "attempts", "last answer", "next attempt"],
        deliveries.iter().map(|delivery| {
            let last = delivery.attempts.last();
            let answer = last.map_or_else(
                || "none yet".to_owned(),
                |last| match (&last.error, last.status) {
                    (Some(error), _) => error.clone(),
                    (None, status) => status.map_or_else(String::new, |it| it.to_string()),
                },
            );
            [
                delivery.id.to_string(),
                delivery.kind.name().to_owned(),
                delivery.created_at.clone(),
                delivery.state.name().to_owned(),
                delivery.attempts.len().to_string(),
                answer,
                delivery.next_attempt_at.clone().unwrap_or_else(|| "none".to_owned()),
            ]
        }),
    )
}
