//! `palpate migrate`: upgrades stored data to the current layout.

use std::path::PathBuf;

use clap::Args;
use palpate_migrations::migrate;
use palpate_store::sled::{SledEngine, SledOptions};
use serde_json::json;

use crate::commands::fsck::require_data;
use crate::output::Output;

/// Arguments of `palpate migrate`.
#[derive(Debug, Args)]
#[command(
    after_help = "Copy the folder first: a migration cannot be undone. After an interruption, \
    run it again and it continues.\n\nExamples:\n  \
    palpate migrate --data /var/lib/palpate"
)]
pub(crate) struct MigrateArgs {
    /// Folder to migrate, which no server may have open.
    #[arg(long, env = "PALPATE_DATA", value_name = "DIR")]
    data: PathBuf,
}

/// Runs the command.
pub(crate) async fn run(args: MigrateArgs, output: Output) -> anyhow::Result<()> {
    require_data(&args.data)?;
    let work = move || {
        let engine = SledEngine::open(&args.data, &SledOptions::default())?;
        anyhow::Ok(migrate(&engine)?)
    };
    let done = tokio::task::spawn_blocking(work).await??;
    let answer = json!({"from": done.from, "to": done.to, "n_records": done.n_records});
    output.answer(&answer, |_| match done.from == done.to {
        true => format!("already layout {}: nothing to do", done.to),
        false => format!(
            "migrated from layout {} to {}: {} records written anew",
            done.from, done.to, done.n_records
        ),
    })
}
