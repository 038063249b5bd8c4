//! `palpate fleet`: the open sessions, those that need attention first.

use clap::{Args, Subcommand};
use palpate_client::schemas::{
    AcknowledgeSessions, AttentionLevel, CloseSessions, Fleet, FleetChanged, FleetQuery,
};

use super::Context;
use crate::ids::{SessionName, ids};
use crate::output;
use crate::verdict;

/// Arguments of `palpate fleet`.
#[derive(Debug, Args)]
pub(crate) struct FleetArgs {
    #[command(subcommand)]
    action: Option<Action>,
    /// Only sessions that need attention.
    #[arg(long)]
    needed: bool,
    /// Maximum number of sessions.
    #[arg(long, default_value_t = 100)]
    limit: u32,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Say that somebody has seen the alarms of sessions: they need attention again when a new
    /// alarm comes.
    Acknowledge {
        /// Ids of the sessions, or their last digits.
        #[arg(required = true)]
        sessions: Vec<SessionName>,
        /// Minutes, up to a week, for which new alarms need no attention either; 0 ends this.
        #[arg(long, value_parser = clap::value_parser!(u32).range(0..=10_080))]
        mute_minutes: Option<u32>,
    },
    /// Close sessions; to state what an object was, use `palpate sessions close`.
    Close {
        /// Ids of the sessions, or their last digits.
        #[arg(required = true)]
        sessions: Vec<SessionName>,
    },
}

/// Runs the command.
pub(crate) async fn run(args: FleetArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let changed = match args.action {
        None => {
            let fleet = list(args.limit, args.needed, context).await?;
            return output.answer(&fleet, words);
        }
        Some(Action::Acknowledge { sessions, mute_minutes }) => {
            let sessions = ids(&sessions, client).await?;
            let mute_s = mute_minutes.map(|minutes| 60 * minutes);
            client.acknowledge_sessions(&AcknowledgeSessions { sessions, mute_s }).await?
        }
        Some(Action::Close { sessions }) => {
            let sessions = ids(&sessions, client).await?;
            client.close_sessions(&CloseSessions { sessions }).await?
        }
    };
    output.answer(&changed, changed_words)?;
    let n_failed = changed.results.len() - changed.n_done as usize;
    anyhow::ensure!(n_failed == 0, "failed for {n_failed} of {} sessions", changed.results.len());
    Ok(())
}

/// The first sessions of the list, from as many pages as it takes.
async fn list(limit: u32, needed: bool, context: &Context) -> anyhow::Result<Fleet> {
    let mut query = FleetQuery { needed: needed.then_some(true), ..FleetQuery::default() };
    query.limit = Some(limit.min(100));
    let mut fleet = context.client.fleet(&query).await?;
    while let Some(cursor) = fleet.next_cursor.take() {
        let missing = limit.saturating_sub(fleet.sessions.len() as u32);
        if missing == 0 {
            fleet.next_cursor = Some(cursor);
            break;
        }
        (query.limit, query.cursor) = (Some(missing.min(100)), Some(cursor));
        let next = context.client.fleet(&query).await?;
        fleet.sessions.extend(next.sessions);
        fleet.next_cursor = next.next_cursor;
    }
    Ok(fleet)
}

fn words(fleet: &Fleet) -> String {
    let table = output::table(
        ["session", "robots", "readings", "it is", "state", "reason", "since"],
        fleet.sessions.iter().map(|one| {
            let attention = &one.attention;
            [
                one.session.id.to_string(),
                one.session.touched_by.join(", "),
                one.session.n_readings.to_string(),
                verdict::in_short(one.session.latest.as_ref()),
                level(attention.level, attention.is_needed).to_owned(),
                attention.reason.clone(),
                attention.since.clone(),
            ]
        }),
    );
    let need = if fleet.n_needed == 1 { "needs" } else { "need" };
    let total = format!("{} open, {} {need} attention", fleet.n_open, fleet.n_needed);
    if fleet.sessions.is_empty() { total } else { format!("{table}\n\n{total}") }
}

/// The word for a state. Acknowledged and muted alarms are marked as seen.
fn level(level: AttentionLevel, is_needed: bool) -> &'static str {
    match (level, is_needed) {
        (AttentionLevel::Surprising, true) => "surprising",
        (AttentionLevel::Surprising, false) => "surprising (seen)",
        (AttentionLevel::Stuck, true) => "stuck",
        (AttentionLevel::Stuck, false) => "stuck (seen)",
        (AttentionLevel::Working, _) => "working",
        (AttentionLevel::Waiting, _) => "waiting",
        (AttentionLevel::Sure, _) => "sure",
    }
}

fn changed_words(changed: &FleetChanged) -> String {
    let line = |one: &palpate_client::schemas::FleetResult| match &one.problem {
        Some(problem) => format!("{}  {problem}", one.session),
        None => format!("{}  done", one.session),
    };
    changed.results.iter().map(line).collect::<Vec<_>>().join("\n")
}
