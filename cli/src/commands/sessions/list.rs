//! `palpate sessions list`: open and ended sessions, filtered.

use clap::Args;
use palpate_client::schemas::{
    Method, Session, SessionOrder, SessionPage, SessionState, SessionsQuery,
};

use crate::commands::{Context, labels};
use crate::output;
use crate::verdict::{self, NONE};

/// Number of sessions per request.
const PER_REQUEST: u32 = 1000;

/// Arguments of `palpate sessions list`.
#[derive(Debug, Args)]
pub(super) struct ListArgs {
    /// Only open sessions.
    #[arg(long, conflicts_with = "ended")]
    open: bool,
    /// Only ended sessions.
    #[arg(long)]
    ended: bool,
    /// Oldest first.
    #[arg(long)]
    oldest: bool,
    /// Only sessions of this catalogue.
    #[arg(long)]
    catalogue: Option<String>,
    /// Only sessions of this method.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Only sessions of this robot.
    #[arg(long)]
    robot: Option<String>,
    /// Only sessions that touched this object (id, name, or `none` for none of these): the truth
    /// where it is known, else the likeliest answer.
    #[arg(long)]
    object: Option<String>,
    /// Only sessions created at this time or later, such as 2026-03-01T08:00:00Z.
    #[arg(long, value_name = "TIME")]
    since: Option<String>,
    /// Only sessions created before this time.
    #[arg(long, value_name = "TIME")]
    until: Option<String>,
    /// Only sessions with all these labels: `key` or `key:value`, separated by commas.
    #[arg(long)]
    labels: Option<String>,
    /// Only sessions that this cell forwarded.
    #[arg(long)]
    cell: Option<String>,
    /// Maximum number of sessions.
    #[arg(long, default_value_t = 100)]
    limit: usize,
}

/// Lists the sessions that fit, from as many requests as needed.
pub(super) async fn list(args: ListArgs, context: &Context) -> anyhow::Result<()> {
    let is_none = args.object.as_deref() == Some(NONE);
    let mut query = SessionsQuery {
        state: match (args.open, args.ended) {
            (true, _) => Some(SessionState::Open),
            (_, true) => Some(SessionState::Closed),
            (false, false) => None,
        },
        order: (!args.oldest).then_some(SessionOrder::Newest),
        catalogue: args.catalogue,
        method: args.method,
        robot: args.robot,
        object: args.object.filter(|_| !is_none),
        none_of_these: is_none.then_some(true),
        since: args.since,
        until: args.until,
        labels: args.labels,
        cell: args.cell,
        ..SessionsQuery::default()
    };
    let mut all = SessionPage { items: Vec::new(), next_cursor: None };
    loop {
        let missing = args.limit.saturating_sub(all.items.len());
        query.limit = Some(PER_REQUEST.min(u32::try_from(missing.max(1)).unwrap_or(PER_REQUEST)));
        let page = context.client.sessions(&query).await?;
        all.items.extend(page.items);
        all.next_cursor.clone_from(&page.next_cursor);
        query.cursor = page.next_cursor;
        if query.cursor.is_none() || all.items.len() >= args.limit {
            break;
        }
    }
    context.output.answer(&all, |page| {
        let more = if page.next_cursor.is_some() { "\nthere are more: --limit" } else { "" };
        format!("{}{more}", table(&page.items))
    })
}

/// Sessions, one per line.
pub(super) fn table(sessions: &[Session]) -> String {
    output::table(
        [
            "id",
            "catalogue",
            "method",
            "state",
            "readings",
            "answer",
            "truth",
            "robots",
            "labels",
            "created",
            "until",
        ],
        sessions.iter().map(|session| {
            [
                session.id.to_string(),
                format!("{} {}", session.catalogue, session.version),
                output::word(&session.method),
                output::word(&session.state),
                session.n_readings.to_string(),
                verdict::in_short(session.latest.as_ref()),
                truth(session),
                session.touched_by.join(", "),
                labels::words(&session.labels),
                session.created_at.clone(),
                // Time of its end, or of its expiry.
                session.closed_at.clone().or(session.expires_at.clone()).unwrap_or_default(),
            ]
        }),
    )
}

fn truth(session: &Session) -> String {
    let Some(truth) = &session.truth else { return "–".to_owned() };
    let right = if truth.was_right { "right" } else { "wrong" };
    format!("{} ({right})", verdict::name(truth.name.as_deref()))
}
