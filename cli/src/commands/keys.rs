//! `palpate keys`: who is let in. And `palpate whoami`.

use clap::{Args, Subcommand, ValueEnum};
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
    /// Create a key; its secret is shown this once.
    Create {
        /// What to call its holder, such as a robot's name.
        name: String,
        /// What its holder may do.
        #[arg(long)]
        role: RoleChoice,
        /// After how many days it is refused; never when not given.
        #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u64).range(1..=3650))]
        expires_days: Option<u64>,
    },
    /// List the keys, revoked ones too.
    List,
    /// Show one key.
    Show {
        /// Its name or id.
        key: String,
    },
    /// Refuse a key from now on.
    Revoke {
        /// Its name or id.
        key: String,
    },
    /// Give a key a new secret; it is shown this once.
    Rotate {
        /// Its name or id.
        key: String,
        /// For how many seconds the secret before is still let in.
        #[arg(long, value_name = "S", default_value_t = 0)]
        grace_s: u64,
    },
}

/// What the holder of a key may do.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum RoleChoice {
    /// Touch things: sessions, readings, next touches.
    Robot,
    /// Teach: objects, sensors, trainings; and look on.
    Trainer,
    /// Look on.
    Viewer,
    /// Everything, also giving keys.
    Admin,
}

impl From<RoleChoice> for Role {
    fn from(choice: RoleChoice) -> Self {
        match choice {
            RoleChoice::Robot => Self::Robot,
            RoleChoice::Trainer => Self::Trainer,
            RoleChoice::Viewer => Self::Viewer,
            RoleChoice::Admin => Self::Admin,
        }
    }
}

/// Does what was asked.
pub(crate) async fn run(args: KeysArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::Create { name, role, expires_days } => {
            let expires_in_s = expires_days.map(|days| days * 86_400);
            let created =
                client.create_key(&CreateKey { name, role: role.into(), expires_in_s }).await?;
            output.answer(&created, with_secret)?;
            if !client.whoami().await?.keys_required {
                output.say("This server asks nobody for a key yet. It does from its next start.");
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
            output.answer(&json!({ "revoked": key }), |_| format!("{key} is refused from now on"))
        }
        Action::Rotate { key, grace_s } => {
            let rotated = client.rotate_key(&key, &RotateKey { grace_s: Some(grace_s) }).await?;
            output.answer(&rotated, with_secret)
        }
    }
}

/// Says whom the server takes this key for.
pub(crate) async fn whoami(context: &Context) -> anyhow::Result<()> {
    let whoami = context.client.whoami().await?;
    context.output.answer(&whoami, |whoami| match &whoami.key {
        Some(key) => format!("{}, {}\n{}", key.name, word(&whoami.role), table_of(key)),
        None => "nobody is asked for a key here: everybody may do everything".to_owned(),
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
        (None, Some(until)) => format!("active, secret before until {until}"),
        (None, None) => "active".to_owned(),
    }
}
