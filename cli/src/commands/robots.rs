//! `palpate robots`: which key each robot's name belongs to.

use clap::{Args, Subcommand};
use palpate_client::schemas::{PageQuery, Robot};
use serde_json::json;

use super::Context;
use crate::output;

/// Arguments of `palpate robots`.
#[derive(Debug, Args)]
pub(crate) struct RobotsArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the names that belong to keys.
    List,
    /// Give a robot's name to a key, whatever key it belonged to.
    Bind {
        /// The robot's name, as its readings have it.
        robot: String,
        /// The key's name or id.
        #[arg(long)]
        to: String,
    },
    /// Release a robot's name: it belongs to the key that uses it next.
    Release {
        /// The robot's name.
        robot: String,
    },
}

/// Does what was asked.
pub(crate) async fn run(args: RobotsArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::List => {
            let page = client.robots(&PageQuery { limit: Some(1000), cursor: None }).await?;
            output.answer(&page, |page| table(&page.items))
        }
        Action::Bind { robot, to } => {
            let robot = client.bind_robot(&robot, &to).await?;
            output.answer(&robot, |robot| table(std::slice::from_ref(robot)))
        }
        Action::Release { robot } => {
            client.release_robot(&robot).await?;
            output.answer(&json!({ "released": robot }), |_| format!("{robot} belongs to no key"))
        }
    }
}

fn table(robots: &[Robot]) -> String {
    output::table(
        ["robot", "key", "key id", "since"],
        robots.iter().map(|robot| {
            let holder = &robot.holder;
            [
                robot.name.clone(),
                output::writer(Some(holder)),
                holder.key_id.to_string(),
                robot.since.clone(),
            ]
        }),
    )
}
