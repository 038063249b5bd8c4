//! `palpate health`: whether a server does its work, for people and for supervisors that look at
//! exit codes, such as a container's health check.

use palpate_client::schemas::Readiness;

use super::Context;
use crate::output;

/// Asks for the checks. A server that is not ready fails the command, as one that is not there.
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
