//! `palpate health`: readiness of a server, with an exit code for supervisors such as a container's
//! health check.

use palpate_client::schemas::Readiness;

use super::Context;
use crate::output;

/// Runs the readiness checks. Fails if the server is not ready or not reachable.
pub(crate) async fn run(context: &Context) -> anyhow::Result<()> {
    let readiness = context.client.ready().await?;
    context.output.answer(&readiness, table)
}

fn table(readiness: &Readiness) -> String {
    output::table(
        ["check", "passed", "found"],
        readiness.checks.iter().map(|check| {
            let passed = if check.passed { "yes" } else { "no" };
            [check.name.clone(), passed.to_owned(), check.detail.clone()]
        }),
    )
}
