//! `palpate storage`: stored bytes of a server, per key, and the things that take most.

use palpate_client::schemas::{Storage, StorageHolder, StoredThing};

use super::Context;
use crate::output::{self, word};

/// Runs the command.
pub(crate) async fn run(context: &Context) -> anyhow::Result<()> {
    let storage = context.client.storage().await?;
    context.output.answer(&storage, words)
}

fn words(storage: &Storage) -> String {
    let free = storage.free_bytes.map_or_else(|| "unknown".to_owned(), megabytes);
    let quota = storage.quota_bytes.map_or_else(|| "none".to_owned(), megabytes);
    format!(
        "{} live, {} on the disk, {free} free ({} stay free), quota of each key: {quota}\n\n{}\n\n{}",
        megabytes(storage.live_bytes),
        megabytes(storage.stored_bytes),
        megabytes(storage.reserve_bytes),
        output::table(["key", "holds"], storage.holders.iter().map(holder)),
        output::table(["what frees most", "name", "bytes"], storage.largest.iter().map(thing)),
    )
}

fn holder(holder: &StorageHolder) -> [String; 2] {
    let key = match &holder.key {
        Some(key) => key.key_name.clone().unwrap_or_else(|| key.key_id.to_string()),
        None => "(no key asked for)".to_owned(),
    };
    [key, megabytes(holder.bytes)]
}

fn thing(thing: &StoredThing) -> [String; 3] {
    [word(&thing.kind), thing.name.clone(), megabytes(thing.bytes)]
}

/// Bytes in megabytes, as text.
pub(crate) fn megabytes(bytes: u64) -> String {
    palpate_core::units::Bytes(bytes).to_string()
}
