//! `palpate members`: the servers that divide catalogues, and the blocks that they hold.

use palpate_client::schemas::{Member, MemberBlocks, Members};

use super::Context;
use crate::output;

/// Runs the command.
pub(crate) async fn run(context: &Context) -> anyhow::Result<()> {
    let members = context.client.members().await?;
    context.output.answer(&members, words)
}

fn words(members: &Members) -> String {
    let Some(copies) = members.copies else {
        return "this server holds whole catalogues (`palpate serve --divide-copies` divides them)"
            .to_owned();
    };
    let mut words = format!("{} servers, {copies} copies of each object", members.members.len());
    if members.n_foreign > 0 {
        words += &format!("; {} more run another program and are not asked", members.n_foreign);
    }
    let rows = members.members.iter().flat_map(rows);
    let heads = ["server", "since", "catalogue", "blocks", "in use"];
    format!("{words}\n\n{}", output::table(heads, rows))
}

fn rows(member: &Member) -> Vec<[String; 5]> {
    let name =
        if member.is_self { format!("{} (asked)", member.id) } else { member.id.to_string() };
    let start = [name, member.since.clone()];
    let row = |blocks: &MemberBlocks| {
        let [name, since] = start.clone();
        let version = format!("{}@{}", blocks.catalogue, blocks.version);
        let held = format!("{} of {}", blocks.n_held, blocks.n_blocks);
        let used = if blocks.is_used { "yes" } else { "no" };
        [name, since, version, held, used.to_owned()]
    };
    if member.blocks.is_empty() {
        let [name, since] = start;
        return vec![[name, since, "-".to_owned(), "-".to_owned(), "-".to_owned()]];
    }
    member.blocks.iter().map(row).collect()
}
