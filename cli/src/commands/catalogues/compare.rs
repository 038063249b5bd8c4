//! `palpate catalogues compare`: a version beside the current one, on recorded sessions.

use clap::Args;
use palpate_client::schemas::{Job, JobState, ShadowAnswer, ShadowReport, ShadowVersion};

use crate::commands::{Context, train};
use crate::exit::Ended;
use crate::ids::{SessionName, ids};
use crate::output;
use crate::verdict::NONE_OF_THESE;

/// Arguments of `palpate catalogues compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate catalogues compare default 4\n  \
    palpate catalogues compare default 4 --against 2 --risk 0.01\n\n\
    Both versions replay the same ended sessions; nothing else changes.")]
pub(crate) struct CompareArgs {
    /// Name of the catalogue.
    catalogue: String,
    /// Version to try.
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    version: u32,
    /// Version to compare with [default: the current one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    against: Option<u32>,
    /// Only these sessions, at most 300 [default: the newest 100 that have ended].
    #[arg(long = "session", value_name = "SESSION")]
    sessions: Vec<SessionName>,
    /// Accepted risk at which a session counts as decided [default: 0.05].
    #[arg(long)]
    risk: Option<f64>,
}

/// Compares the versions and prints the report.
pub(super) async fn run(args: CompareArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let sessions = ids(&args.sessions, client).await?;
    let request = ShadowVersion {
        against: args.against,
        sessions: (!sessions.is_empty()).then_some(sessions),
        risk: args.risk,
    };
    let job = client.shadow_version(&args.catalogue, args.version, &request).await?;
    let job = train::follow(client, &job, output).await?;
    output.answer(&job, words)?;
    match job.state {
        JobState::Succeeded => Ok(()),
        JobState::Cancelled => Err(Ended::Interrupted.into()),
        _ => anyhow::bail!("the comparison failed: {}", job.reason.unwrap_or_default()),
    }
}

fn words(job: &Job) -> String {
    let Some(report) = &job.shadow_report else {
        return format!("comparison {} is {}", job.id, job.state.name());
    };
    let ShadowReport { version, against, old, new, n_sessions, n_with_truth, .. } = report;
    let mean = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.2}"));
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let share = |value: Option<f64>| value.map_or("–".to_owned(), percent);
    let rows = [
        ["decided".to_owned(), old.n_decided.to_string(), new.n_decided.to_string()],
        ["touches until then".to_owned(), mean(old.touches), mean(new.touches)],
        [
            "decided wrongly".to_owned(),
            old.n_decided_wrongly.to_string(),
            new.n_decided_wrongly.to_string(),
        ],
        ["right at the end".to_owned(), share(old.accuracy), share(new.accuracy)],
        [NONE_OF_THESE.to_owned(), percent(old.unknown), percent(new.unknown)],
        ["ms a touch".to_owned(), format!("{:.1}", old.touch_ms), format!("{:.1}", new.touch_ms)],
    ];
    let (before, after) = (format!("version {against}"), format!("version {version}"));
    let figures = output::table(["", &before, &after], rows);
    let rows = report.changed.iter().map(|one| {
        let truth = one.truth.clone().unwrap_or_else(|| "–".to_owned());
        [one.session.to_string(), truth, answer(&one.old), answer(&one.new)]
    });
    let changed = match report.n_changed {
        0 => "all end with the same answer".to_owned(),
        n => {
            let rows = output::table(["session", "truth", &before, &after], rows);
            format!("{n} with another answer\n{rows}")
        }
    };
    let left_out = match report.n_left_out {
        0 => String::new(),
        n => format!(", {n} could not be replayed"),
    };
    format!(
        "{n_sessions} sessions, {n_with_truth} with a known truth{left_out}; decided at a risk of \
         {}\n\n{figures}\n\n{changed}",
        percent(report.risk)
    )
}

fn answer(answer: &ShadowAnswer) -> String {
    let name = answer.name.as_deref().unwrap_or(NONE_OF_THESE);
    let decided = answer.decided_after.map(|n| format!(", decided after {n}")).unwrap_or_default();
    format!("{name} {:.1} %{decided}", 100.0 * answer.probability)
}
