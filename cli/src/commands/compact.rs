//! `palpate compact`: frees the disk space of removed and replaced records, in a running server or
//! in a folder that no server has open.

use std::path::PathBuf;

use clap::Args;
use palpate_store::engine::Engine;
use palpate_store::sled::{SledEngine, SledOptions};
use serde_json::{Value, json};

use crate::commands::Context;
use crate::commands::fsck::require_data;
use crate::output::Output;

/// Arguments of `palpate compact`.
#[derive(Debug, Args)]
#[command(after_help = "An interruption loses nothing: run it again, or start the server.\n\n\
    Examples:\n  palpate compact\n  palpate compact --data /var/lib/palpate")]
pub(crate) struct CompactArgs {
    /// Folder to compact, which no server may have open. Without it, the running server compacts.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

/// Runs the command.
pub(crate) async fn run(
    args: CompactArgs,
    output: Output,
    context: impl FnOnce() -> anyhow::Result<Context>,
) -> anyhow::Result<()> {
    let answer = match args.data {
        Some(data) => {
            require_data(&data)?;
            let work = move || {
                let engine = SledEngine::open(&data, &SledOptions::default())?;
                anyhow::Ok(engine.compact()?)
            };
            let done = tokio::task::spawn_blocking(work).await??;
            json!({"before_bytes": done.before_bytes, "after_bytes": done.after_bytes,
                "live_bytes": done.live_bytes})
        }
        None => serde_json::to_value(context()?.client.compact().await?)?,
    };
    output.answer(&answer, words)
}

/// The answer for people.
fn words(answer: &Value) -> String {
    let megabytes = |name: &str| answer[name].as_f64().unwrap_or_default() / 1e6;
    format!(
        "compacted from {:.1} MB to {:.1} MB; {:.1} MB are live",
        megabytes("before_bytes"),
        megabytes("after_bytes"),
        megabytes("live_bytes")
    )
}
