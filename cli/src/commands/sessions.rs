//! `palpate sessions`: sessions, their readings and beliefs.

mod export;
mod feel;
mod history;
mod list;

use clap::{Args, Subcommand};
use futures::StreamExt;
use palpate_client::schemas::{
    AxisUnit, Belief, BeliefQuery, CloseSession, ExplainQuery, Marginals, MarginalsQuery, Session,
    SessionEvent,
};
use serde::Serialize;

use super::Context;
use super::labels::LabelArgs;
use crate::calibrated;
use crate::exit::Ended;
use crate::ids::SessionName;
use crate::output;
use crate::symmetry;
use crate::verdict::{NONE, NONE_OF_THESE, Verdict};
use list::table;

/// Arguments of `palpate sessions`.
#[derive(Debug, Args)]
pub(crate) struct SessionsArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the sessions, newest first, and search for some.
    #[command(after_help = "Examples:\n  palpate sessions list --open\n  palpate sessions list \
        --object mug --since 2026-03-01T00:00:00Z\n  palpate sessions list --object none \
        --labels site:oslo,shift:night")]
    List(list::ListArgs),
    /// Set the labels of a session.
    #[command(after_help = "Example:\n  palpate sessions label <session> site=oslo shift=night")]
    Label(LabelArgs),
    /// Write a session to a file, to be looked at with other programs.
    #[command(after_help = "Examples:\n  palpate sessions export <session> > session.json\n  \
        palpate sessions export <session> --format csv --out session.csv")]
    Export(export::ExportArgs),
    /// Keep a session open without new readings (a lease).
    Extend {
        /// Id of the session, or its last digits.
        session: SessionName,
        /// Seconds from now for which the session stays open.
        #[arg(long, value_parser = clap::value_parser!(u32).range(1..=31_536_000))]
        seconds: u32,
    },
    /// Close a session: it accepts no more readings, but its belief can still be read.
    Close {
        /// Id of the session, or its last digits.
        session: SessionName,
        /// Id or name of the true object, or `none` if the catalogue does not have it. The server
        /// counts how often it was right.
        #[arg(long, alias = "truth", conflicts_with = "none_of_these")]
        object: Option<String>,
        /// The object was not in the catalogue.
        #[arg(long)]
        none_of_these: bool,
    },
    /// Show a session and its belief.
    Show {
        /// Id of the session, or its last digits.
        session: SessionName,
        /// Maximum number of pose hypotheses.
        #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(0..=100))]
        poses: u32,
    },
    /// Follow a session's belief until the session closes or Ctrl-C.
    Watch {
        /// Id of the session, or its last digits.
        session: SessionName,
    },
    /// Show the marginals of the pose (methods `geometric…`).
    Marginals {
        /// Id of the session, or its last digits.
        session: SessionName,
        /// Id or name of an object of the session's version [default: the likeliest].
        #[arg(long)]
        object: Option<String>,
    },
    /// List a session's readings, including retracted ones.
    Readings {
        /// Id of the session, or its last digits.
        session: SessionName,
    },
    /// Send one contact without an image: of a bumper, a force–torque sensor or a single taxel.
    #[command(after_help = "Examples:\n  palpate sessions feel <session> --sensor wrist \
        --position 0.41 -0.08 0.16 --normal 0 0 1\n  palpate sessions feel <session> \
        --sensor wrist --position 0.41 -0.08 0.16 --deviation-mm 10 --missed")]
    Feel(feel::FeelArgs),
    /// Retract a reading: it no longer counts, as if it had never arrived.
    #[command(after_help = "Examples:\n  palpate sessions retract <session> 17\n  \
        palpate sessions retract <session> --robot arm-3 --seq 4")]
    Retract {
        /// Id of the session, or its last digits.
        session: SessionName,
        /// Number of the reading within the session, as `readings` lists it.
        #[arg(required_unless_present = "robot", conflicts_with = "robot")]
        number: Option<u32>,
        /// Robot that took the reading.
        #[arg(long, requires = "seq")]
        robot: Option<String>,
        /// The robot's sequence number of the reading.
        #[arg(long, requires = "robot")]
        seq: Option<u64>,
    },
    /// Show the answer of a session at each revision.
    Replay {
        /// Id of the session, or its last digits.
        session: SessionName,
        /// Last revision [default: the newest].
        #[arg(long)]
        upto: Option<u32>,
        /// Show only the steps after this revision.
        #[arg(long, default_value_t = 0)]
        after: u32,
    },
    /// Show what each reading contributed, and which readings disagree with the rest.
    Explain {
        /// Id of the session, or its last digits.
        session: SessionName,
        /// Revision to explain [default: the newest].
        #[arg(long)]
        at: Option<u32>,
    },
    /// Delete a session with its readings.
    Remove {
        /// Id of the session, or its last digits.
        session: SessionName,
    },
}

/// A session and its belief.
#[derive(Debug, Serialize)]
struct Shown {
    session: Session,
    belief: Belief,
    written: Vec<history::Written>,
}

/// Runs the command.
pub(crate) async fn run(args: SessionsArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::List(args) => list::list(args, context).await,
        Action::Label(args) => {
            let id: SessionName = args.thing.parse().map_err(anyhow::Error::msg)?;
            let id = id.id(client).await?;
            let session = client.set_session_labels(id, &args.labels()).await?;
            output.answer(&session, |session| table(std::slice::from_ref(session)))
        }
        Action::Export(args) => export::export(client, args).await,
        Action::Extend { session, seconds } => {
            let session = client.extend_session(session.id(client).await?, seconds).await?;
            output.answer(&session, |session| table(std::slice::from_ref(session)))
        }
        Action::Close { session, object, none_of_these } => {
            let is_none = none_of_these || object.as_deref() == Some(NONE);
            let object = object.filter(|_| !is_none);
            let told = CloseSession { object, none_of_these: is_none.then_some(true), pose: None };
            let session = client.close_session_with(session.id(client).await?, &told).await?;
            output.answer(&session, closed_words)
        }
        Action::Show { session, poses } => {
            let session = session.id(client).await?;
            let belief =
                client.belief(session, BeliefQuery { poses: Some(poses), at: None }).await?;
            let session = client.session(session).await?;
            let written = history::writers(&history::readings(client, session.id).await?);
            output.answer(&Shown { session, belief, written }, |shown| {
                let session = table(std::slice::from_ref(&shown.session));
                let written = history::writers_words(&shown.written);
                format!("{session}\n\n{}\n\n{written}", belief_words(&shown.belief))
            })
        }
        Action::Watch { session } => watch(session.id(client).await?, context).await,
        Action::Marginals { session, object } => {
            let marginals =
                client.marginals(session.id(client).await?, &MarginalsQuery { object }).await?;
            output.answer(&marginals, marginals_words)
        }
        Action::Readings { session } => {
            let readings = history::readings(client, session.id(client).await?).await?;
            output.answer(&readings, history::readings_words)
        }
        Action::Feel(args) => {
            let added = feel::feel(client, args).await?;
            output.answer(&added, |added| {
                let warnings = added.warnings.iter().map(|warning| format!("\n{}", warning.detail));
                let belief = added.belief.as_ref().map(one_line).unwrap_or_default();
                format!("{belief}{}", warnings.collect::<String>())
            })
        }
        Action::Retract { session, number, robot, seq } => {
            let retracted =
                history::retract(client, session.id(client).await?, number, robot.zip(seq)).await?;
            output.answer(&retracted, |retracted| {
                let belief = retracted.belief.as_ref().map(one_line).unwrap_or_default();
                format!("retracted reading {}\n{belief}", retracted.number)
            })
        }
        Action::Replay { session, upto, after } => {
            let replay = history::replay(client, session.id(client).await?, upto, after).await?;
            output.answer(&replay, history::replay_words)
        }
        Action::Explain { session, at } => {
            let explanation =
                client.explain(session.id(client).await?, ExplainQuery { at }).await?;
            output.answer(&explanation, history::explanation_words)
        }
        Action::Remove { session } => {
            let session = session.id(client).await?;
            client.delete_session(session).await?;
            output.say(format!("removed session {session}"));
            Ok(())
        }
    }
}

async fn watch(session: uuid::Uuid, context: &Context) -> anyhow::Result<()> {
    let mut events = context.client.session_events(session, None).await?;
    loop {
        let event = tokio::select! {
            event = events.next() => event,
            interrupted = tokio::signal::ctrl_c() => {
                interrupted?;
                return Err(Ended::Interrupted.into());
            }
        };
        let Some(event) = event.transpose()? else { return Ok(()) };
        context.output.answer(&event, |event| match event {
            SessionEvent::Belief { belief } => one_line(belief),
            SessionEvent::Closed { .. } => "closed".to_owned(),
            SessionEvent::Deleted { .. } => "removed".to_owned(),
        })?;
        if !matches!(event, SessionEvent::Belief { .. }) {
            return Ok(());
        }
    }
}

/// A closed session, and whether its answer was right.
fn closed_words(session: &Session) -> String {
    let closed = table(std::slice::from_ref(session));
    let Some(truth) = &session.truth else { return closed };
    let was = truth.name.as_deref().unwrap_or(NONE_OF_THESE);
    let right = if truth.was_right { "right" } else { "wrong" };
    format!("{closed}\n\nit was {was}: {right}, with {:.1} %", truth.probability * 100.0)
}

fn one_line(belief: &Belief) -> String {
    let verdict = Verdict::of(belief);
    format!(
        "{:4} readings  {:<16} {} {:5.1} %  {:.2} bits",
        belief.n_readings,
        verdict.name(),
        output::bar(verdict.probability),
        verdict.probability * 100.0,
        belief.entropy_bits
    )
}

/// Objects and poses, likeliest first.
fn belief_words(belief: &Belief) -> String {
    let objects = output::table(
        ["object", "probability", ""],
        belief
            .objects
            .iter()
            .take(10)
            .map(|object| (object.name.as_str(), object.probability))
            .chain((belief.unknown > 0.0).then_some((NONE_OF_THESE, belief.unknown)))
            .map(|(name, probability)| {
                let percent = format!("{:.1} %", probability * 100.0);
                [name.to_owned(), percent, output::bar(probability)]
            }),
    );
    let poses = output::table(
        ["pose of", "share", "position (m)", "orientation x y z w", "symmetry"],
        belief.poses.iter().map(|mode| {
            let [x, y, z] = mode.pose.position;
            let orientation: Vec<_> =
                mode.pose.orientation.iter().map(|part| format!("{part:.3}")).collect();
            [
                mode.name.clone(),
                format!("{:.1} %", mode.weight * 100.0),
                format!("{x:.4} {y:.4} {z:.4}"),
                orientation.join(" "),
                symmetry::words(&mode.symmetry),
            ]
        }),
    );
    let entropy = belief.entropy_bits;
    let note = belief.uncalibrated_reason.map(|reason| format!("\n{}", calibrated::note(reason)));
    let note = note.unwrap_or_default();
    let warnings = belief.warnings.iter().map(|warning| format!("\n{}", warning.detail));
    let warnings: String = warnings.collect();
    let n = belief.n_readings;
    format!("{objects}\n\n{poses}\n\n{n} readings, {entropy:.2} bits{note}{warnings}")
}

/// The likeliest bin of each coordinate.
fn marginals_words(marginals: &Marginals) -> String {
    let rows = marginals.axes.iter().map(|axis| {
        let shown = |value: f64| match axis.unit {
            AxisUnit::M => output::mm(value),
            AxisUnit::Rad => output::degrees(value),
        };
        let width = (axis.high - axis.low) / axis.probabilities.len().max(1) as f64;
        let best = axis.probabilities.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let (bin, probability) = best.unwrap_or((0, &0.0));
        let begin = axis.low + bin as f64 * width;
        [
            axis.axis.clone(),
            format!("{} to {}", shown(axis.low), shown(axis.high)),
            format!("{} to {}", shown(begin), shown(begin + width)),
            format!("{:.1} %", probability * 100.0),
        ]
    });
    let rows = output::table(["axis", "range", "likeliest bin", "probability"], rows);
    format!("{}, {:.1} %\n\n{rows}", marginals.name, marginals.probability * 100.0)
}
