//! `palpate audit`: the audit log, newest first.

use clap::Args;
use palpate_client::schemas::{AuditEntry, AuditPage, AuditQuery, AuditRing};

use super::Context;
use crate::output;

/// Arguments of `palpate audit`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate audit\n  \
    palpate audit --by arm-3 --since 2026-05-01T00:00:00Z\n  \
    palpate audit --operation delete_object -n 1000 --json")]
pub(crate) struct AuditArgs {
    /// Earliest time (RFC 3339), inclusive.
    #[arg(long, value_name = "TIME")]
    since: Option<String>,
    /// Latest time (RFC 3339), exclusive.
    #[arg(long, value_name = "TIME")]
    until: Option<String>,
    /// Only entries of this key (name or id).
    #[arg(long, value_name = "KEY")]
    by: Option<String>,
    /// Only entries of this operation (an operation id of the API).
    #[arg(long, value_name = "ID")]
    operation: Option<String>,
    /// Only entries of this ring.
    #[arg(long, value_name = "RING")]
    ring: Option<AuditRing>,
    /// Maximum number of entries.
    #[arg(short, long, value_name = "N", default_value_t = 100)]
    n: usize,
}

/// Shows the entries.
pub(crate) async fn run(args: AuditArgs, context: &Context) -> anyhow::Result<()> {
    let AuditArgs { since, until, by, operation, ring, n } = args;
    let mut query = AuditQuery { since, until, key: by, operation, ring, ..AuditQuery::default() };
    let mut items: Vec<AuditEntry> = Vec::new();
    let next_cursor = loop {
        query.limit = u32::try_from((n - items.len()).clamp(1, 1000)).ok();
        let page = context.client.audit(&query).await?;
        items.extend(page.items);
        if page.next_cursor.is_none() || items.len() >= n {
            break page.next_cursor;
        }
        query.cursor = page.next_cursor;
    };
    context.output.answer(&AuditPage { items, next_cursor }, |page| table(&page.items))
}

fn table(entries: &[AuditEntry]) -> String {
    output::table(
        ["when", "who", "from", "what", "of", "outcome"],
        entries.iter().map(|entry| {
            [
                entry.at.clone(),
                entry.key_name.clone().unwrap_or_else(|| "–".to_owned()),
                entry.address.clone(),
                entry.operation.clone(),
                entry.resource.clone(),
                outcome(entry),
            ]
        }),
    )
}

fn outcome(entry: &AuditEntry) -> String {
    let status = entry.status.map_or_else(|| "not known".to_owned(), |status| status.to_string());
    let times = match entry.n {
        1 => String::new(),
        n => format!(", {n} times until {}", entry.last_at),
    };
    let left_out = match entry.n_left_out {
        0 => String::new(),
        n => format!(" ({n} earlier refusals not recorded)"),
    };
    format!("{status}{times}{left_out}")
}
