//! `palpate robots`: robot names and the keys that hold them.

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
    /// List the robot names that keys hold.
    List,
    /// Assign a robot name to a key, whichever key holds it.
    Bind {
        /// Robot name, as readings give it.
        robot: String,
        /// Name or id of the key.
        #[arg(long)]
        to: String,
    },
    /// Release a robot name: the next key that uses it gets it.
    Release {
        /// Robot name.
        robot: String,
    },
}

/// Runs the command.
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
            output.answer(&json!({ "released": robot }), |_| format!("released {robot}"))
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
