//! `palpate keys`: manage API keys. And `palpate whoami`.

use clap::{Args, Subcommand};
use palpate_client::schemas::{ApiKey, CreateKey, NewApiKey, PageQuery, Role, RotateKey};
use serde_json::json;

use super::Context;
use super::storage::megabytes;
use crate::output::{self, word};

/// Arguments of `palpate keys`.
#[derive(Debug, Args)]
pub(crate) struct KeysArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Create a key and print its secret, once.
    Create {
        /// Name of the key, such as a robot's name.
        name: String,
        /// Role of the key.
        #[arg(long)]
        role: Role,
        /// Days until the key expires [default: never].
        #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u64).range(1..=3650))]
        expires_days: Option<u64>,
    },
    /// List the keys, including revoked ones.
    List,
    /// Show one key.
    Show {
        /// Name or id of the key.
        key: String,
    },
    /// Revoke a key.
    Revoke {
        /// Name or id of the key.
        key: String,
    },
    /// Rotate a key: give it a new secret and print it, once.
    Rotate {
        /// Name or id of the key.
        key: String,
        /// Seconds for which the previous secret stays valid.
        #[arg(long, value_name = "S", default_value_t = 0)]
        grace_s: u64,
    },
}

/// Runs the command.
pub(crate) async fn run(args: KeysArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::Create { name, role, expires_days } => {
            let expires_in_s = expires_days.map(|days| days * 86_400);
            let created = client.create_key(&CreateKey { name, role, expires_in_s }).await?;
            output.answer(&created, with_secret)?;
            if !client.whoami().await?.keys_required {
                output.say("This server does not require keys yet. It will from its next start.");
            }
            Ok(())
        }
        Action::List => {
            let page = client.keys(&PageQuery { limit: Some(1000), cursor: None }).await?;
            output.answer(&page, |page| table(&page.items))
        }
        Action::Show { key } => {
            let key = client.key(&key).await?;
            output.answer(&key, |key| table(std::slice::from_ref(key)))
        }
        Action::Revoke { key } => {
            client.revoke_key(&key).await?;
            output.answer(&json!({ "revoked": key }), |_| format!("revoked {key}"))
        }
        Action::Rotate { key, grace_s } => {
            let rotated = client.rotate_key(&key, &RotateKey { grace_s: Some(grace_s) }).await?;
            output.answer(&rotated, with_secret)
        }
    }
}

/// Shows the key and role that the server sees.
pub(crate) async fn whoami(context: &Context) -> anyhow::Result<()> {
    let whoami = context.client.whoami().await?;
    context.output.answer(&whoami, |whoami| match &whoami.key {
        Some(key) => format!("{}, {}\n{}", key.name, word(&whoami.role), table_of(key)),
        None => "this server requires no keys: every caller is admin".to_owned(),
    })
}

fn with_secret(new: &NewApiKey) -> String {
    format!(
        "{}\n\n{}\n\nThis is shown once. Its holder sets PALPATE_KEY to it, or sends it as\n\
         `Authorization: Bearer …`.",
        table_of(&new.key),
        new.secret
    )
}

fn table_of(key: &ApiKey) -> String {
    table(std::slice::from_ref(key))
}

fn table(keys: &[ApiKey]) -> String {
    output::table(
        ["id", "name", "role", "state", "holds", "created", "last used", "expires"],
        keys.iter().map(|key| {
            [
                key.id.to_string(),
                key.name.clone(),
                word(&key.role),
                state(key),
                megabytes(key.stored_bytes),
                key.created_at.clone(),
                key.last_used_at.clone().unwrap_or_else(|| "never".to_owned()),
                key.expires_at.clone().unwrap_or_else(|| "never".to_owned()),
            ]
        }),
    )
}

fn state(key: &ApiKey) -> String {
    match (&key.revoked_at, &key.rotating_until) {
        (Some(at), _) => format!("revoked {at}"),
        (None, _) if !key.active => "expired".to_owned(),
        (None, Some(until)) => format!("active, previous secret until {until}"),
        (None, None) => "active".to_owned(),
    }
}
