//! `palpate next-touch`: the touches that tell most about a session's object.

use std::path::PathBuf;

use clap::Args;
use palpate_client::schemas::{AskNextTouches, NextTouches, TouchWorkspace};

use super::Context;
use crate::ids::SessionName;
use crate::json_file::read_json;
use crate::numbers::numbers;
use crate::output;

/// Arguments of `palpate next-touch`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate next-touch 0198a0d0-0000-7000-8000-000000000000 \
    --recenters\n  palpate next-touch <session> --candidates reachable.json\n  \
    palpate next-touch <session> --workspace 0.4,-0.1,0.05,0.15\n\n\
    A file of candidates is a JSON list: [{\"pose\": {\"position\": [0.4, 0, 0.3], \
    \"orientation\": [1, 0, 0, 0]}, \"reach_m\": 0.2, \"cost\": 1.5}, …].")]
pub(crate) struct NextTouchArgs {
    /// Id of the session, or its last digits.
    session: SessionName,
    /// Id or name of the sensor that will touch.
    #[arg(long, default_value = "digitacts-6x6")]
    sensor: String,
    /// Approaches that the robot can make, as JSON; `-` reads standard input [default: the service
    /// generates them].
    #[arg(long, value_name = "FILE")]
    candidates: Option<PathBuf>,
    /// Number of touches to show.
    #[arg(short, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    n: u32,
    /// Time limit of the evaluation, in milliseconds.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    deadline_ms: u32,
    /// Assume that the robot centres a contact before it presses.
    #[arg(long)]
    recenters: bool,
    /// Ball that contains the object, in metres in the session frame; required before the first
    /// touch.
    #[arg(long, value_name = "X,Y,Z,RADIUS", value_parser = workspace, allow_hyphen_values = true)]
    workspace: Option<TouchWorkspace>,
    /// Seed of random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

fn workspace(text: &str) -> Result<TouchWorkspace, String> {
    let wrong = || format!("came {text:?}, expected four numbers: x,y,z,radius in metres");
    let [x, y, z, radius] = numbers(text).ok_or_else(wrong)?;
    Ok(TouchWorkspace { center: [x, y, z], radius })
}

/// Runs the command.
pub(crate) async fn run(args: NextTouchArgs, context: &Context) -> anyhow::Result<()> {
    let question = AskNextTouches {
        sensor: args.sensor,
        candidates: args.candidates.map(read_json).transpose()?,
        n: Some(args.n),
        deadline_ms: Some(args.deadline_ms),
        recenters: Some(args.recenters),
        workspace: args.workspace,
        seed: Some(args.seed),
    };
    let session = args.session.id(&context.client).await?;
    let answer = context.client.next_touches(session, &question).await?;
    context.output.answer(&answer, words)
}

fn words(answer: &NextTouches) -> String {
    let bits = |bits: f64| format!("{bits:.2}");
    let rows = answer.touches.iter().map(|touch| {
        let [x, y, z] = touch.pose.position;
        let orientation: Vec<String> =
            touch.pose.orientation.iter().map(|part| format!("{part:.3}")).collect();
        [
            touch.candidate.map_or("–".to_owned(), |candidate| candidate.to_string()),
            bits(touch.information_bits),
            bits(touch.pose_bits),
            format!("{:.0} %", touch.contact_probability * 100.0),
            touch.bits_per_cost.map_or("–".to_owned(), bits),
            format!("{x:.4} {y:.4} {z:.4}"),
            orientation.join(" "),
            format!("{:.3}", touch.reach_m),
        ]
    });
    let table = output::table(
        [
            "candidate",
            "bits",
            "of pose",
            "contact",
            "bits/cost",
            "from (m)",
            "orientation x y z w",
            "reach (m)",
        ],
        rows,
    );
    let cut = if answer.complete { "" } else { ", cut short by the deadline" };
    let (evaluated, entropy) = (answer.evaluated, answer.entropy_bits);
    format!("{table}\n\n{evaluated} evaluated{cut}; {entropy:.2} bits of uncertainty left")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_workspace_is_four_numbers() {
        let expected = TouchWorkspace { center: [0.4, -0.1, 0.05], radius: 0.15 };
        assert_eq!(workspace("0.4, -0.1,0.05,0.15"), Ok(expected));
        for wrong in ["", "1,2,3", "1,2,3,4,5", "1,2,3,r"] {
            assert!(workspace(wrong).unwrap_err().contains("x,y,z,radius"), "{wrong}");
        }
    }
}
