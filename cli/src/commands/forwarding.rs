//! `palpate forwarding`: what a cell has to forward, and the state of its line.

use palpate_client::schemas::Forwarding;

use super::Context;
use crate::output;

/// Runs the command.
pub(crate) async fn run(context: &Context) -> anyhow::Result<()> {
    let forwarding = context.client.forwarding().await?;
    context.output.answer(&forwarding, words)
}

fn words(state: &Forwarding) -> String {
    let (Some(to), Some(cell)) = (&state.to, &state.cell) else {
        return "this server is no cell: it forwards nothing".to_owned();
    };
    let line = match (&state.down_since, &state.last_error, &state.last_answer_at) {
        (Some(since), Some(error), _) => format!("down since {since}: {error}"),
        (Some(since), None, _) => format!("down since {since}"),
        (None, _, Some(at)) => format!("up, last answer at {at}"),
        (None, _, None) => "not tried yet".to_owned(),
    };
    let since = state.oldest_waiting_since.as_ref();
    let since = since.map(|since| format!(", the oldest since {since}")).unwrap_or_default();
    let mut words = format!(
        "cell {cell:?} forwards to {to}\nline: {line}\nwaiting: {} sessions with {} readings and \
         retractions{since}",
        state.sessions_waiting, state.entries_waiting
    );
    let number = |version: Option<u32>| version.map_or_else(|| "–".to_owned(), |n| n.to_string());
    let catalogues = state.catalogues.iter().map(|followed| {
        let problem = followed.problem.clone().unwrap_or_default();
        let (there, here) = (number(followed.current_there), number(followed.current_here));
        [followed.name.clone(), there, here, problem]
    });
    words += "\n\n";
    words += &output::table(["catalogue", "current there", "here", "problem"], catalogues);
    if state.sessions_refused > 0 {
        let refused = state.refused.iter();
        let refused = refused.map(|one| [one.session.to_string(), one.reason.clone()]);
        words += &format!("\n\n{} sessions were refused:\n", state.sessions_refused);
        words += &output::table(["session", "reason"], refused);
    }
    if !state.sensors.is_empty() {
        let sensors = state.sensors.iter().map(|one| [one.name.clone(), one.problem.clone()]);
        words += "\n\n";
        words += &output::table(["sensor", "problem"], sensors);
    }
    words
}
