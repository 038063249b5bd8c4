//! Text output of a session's history.

use palpate_client::Client;
use palpate_client::schemas::{
    BeliefDetail, Explanation, PageQuery, ReadingContribution, ReadingMisfit, ReadingRetracted,
    Replay, ReplayQuery, SessionChange, SessionReading, SessionReadingPage, Writer,
};
use serde::Serialize;
use uuid::Uuid;

use super::NONE_OF_THESE;
use crate::output;
use crate::verdict::Verdict;

/// Steps per request.
const STEPS: u32 = 1000;

/// All readings of a session, as one page.
pub(super) async fn readings(client: &Client, session: Uuid) -> anyhow::Result<SessionReadingPage> {
    let mut all = SessionReadingPage { items: Vec::new(), next_cursor: None };
    loop {
        let query = PageQuery { limit: Some(1000), cursor: all.next_cursor.take() };
        let page = client.session_readings(session, &query).await?;
        all.items.extend(page.items);
        if page.next_cursor.is_none() {
            return Ok(all);
        }
        all.next_cursor = page.next_cursor;
    }
}

/// Retracts a reading, by its number within the session or by a robot's.
pub(super) async fn retract(
    client: &Client,
    session: Uuid,
    number: Option<u32>,
    of_robot: Option<(String, u64)>,
) -> anyhow::Result<ReadingRetracted> {
    let detail = BeliefDetail::Full;
    match (number, of_robot) {
        (_, Some((robot, seq))) => {
            Ok(client.retract_robot_reading(session, &robot, seq, detail).await?)
        }
        (Some(number), None) => Ok(client.retract_reading(session, number, detail).await?),
        (None, None) => anyhow::bail!("expected a reading's number, or --robot and --seq"),
    }
}

/// The whole replay after a revision, from as many requests as needed.
pub(super) async fn replay(
    client: &Client,
    session: Uuid,
    upto: Option<u32>,
    after: u32,
) -> anyhow::Result<Replay> {
    let ask = |upto, after| {
        let query = ReplayQuery { upto, after: Some(after), limit: Some(STEPS), poses: None };
        client.replay(session, query)
    };
    let mut all = ask(upto, after).await?;
    while let Some(after) = all.next_after {
        // Changes made meanwhile are not included.
        let more = ask(Some(all.upto), after).await?;
        all.steps.extend(more.steps);
        all.next_after = more.next_after;
        all.belief = more.belief;
    }
    Ok(all)
}

/// Readings, one per line.
pub(super) fn readings_words(page: &SessionReadingPage) -> String {
    output::table(
        ["number", "robot", "seq", "written by", "stamp", "received", "position (m)", ""],
        page.items.iter().map(|reading| {
            let stamp = reading.stamp.map(|s| format!("{}.{:09}", s.sec, s.nanosec));
            let position = reading.pose.as_ref().map(|pose| {
                let [x, y, z] = pose.position;
                format!("{x:.4} {y:.4} {z:.4}")
            });
            [
                reading.number.to_string(),
                reading.robot.clone().unwrap_or_default(),
                reading.seq.map(|seq| seq.to_string()).unwrap_or_default(),
                output::writer(reading.written_by.as_ref()),
                stamp.unwrap_or_default(),
                reading.received_at.clone(),
                position.unwrap_or_default(),
                remark(reading),
            ]
        }),
    )
}

fn remark(reading: &SessionReading) -> String {
    let Some(by) = reading.retracted_by else { return String::new() };
    let who = reading.retraction_written_by.as_ref();
    let who = who.map(|who| format!(" ({})", output::writer(Some(who)))).unwrap_or_default();
    format!("retracted by revision {by}{who}")
}

/// Keys and robots that wrote a session's readings, with counts.
pub(super) fn writers(page: &SessionReadingPage) -> Vec<Written> {
    let mut written: Vec<Written> = Vec::new();
    for reading in &page.items {
        let is_same = |it: &&mut Written| it.by == reading.written_by && it.robot == reading.robot;
        match written.iter_mut().find(is_same) {
            Some(it) => it.n_readings += 1,
            None => written.push(Written {
                by: reading.written_by.clone(),
                robot: reading.robot.clone(),
                n_readings: 1,
            }),
        }
    }
    written
}

/// Writers, one per line.
pub(super) fn writers_words(written: &[Written]) -> String {
    output::table(
        ["written by", "robot", "readings"],
        written.iter().map(|it| {
            let by = output::writer(it.by.as_ref());
            [by, it.robot.clone().unwrap_or_default(), it.n_readings.to_string()]
        }),
    )
}

/// Readings of one robot that one key wrote.
#[derive(Debug, Serialize)]
pub(super) struct Written {
    /// The key; `None` if it was not recorded.
    by: Option<Writer>,
    robot: Option<String>,
    n_readings: u32,
}

/// Steps, one per line.
pub(super) fn replay_words(replay: &Replay) -> String {
    let steps = output::table(
        ["revision", "what came", "readings", "likeliest", "", "entropy"],
        replay.steps.iter().map(|step| {
            let answer = Verdict::of_best(step.best.as_ref(), step.unknown);
            [
                step.revision.to_string(),
                change(&step.change),
                step.n_readings.to_string(),
                answer.name().to_owned(),
                format!("{:5.1} %", answer.probability * 100.0),
                format!("{:.2} bits", step.entropy_bits),
            ]
        }),
    );
    format!("{steps}\n\n{}", super::belief_words(&replay.belief))
}

fn change(change: &SessionChange) -> String {
    match change {
        SessionChange::Reading { number, robot, seq, late } => {
            let late = if *late { ", late" } else { "" };
            match (robot, seq) {
                (Some(robot), Some(seq)) => format!("reading {number} ({robot} {seq}{late})"),
                _ => format!("reading {number}{late}"),
            }
        }
        SessionChange::Retraction { number } => format!("retraction of {number}"),
        SessionChange::Closed => "the end".to_owned(),
    }
}

/// Contributions, one per line.
pub(super) fn explanation_words(explanation: &Explanation) -> String {
    let shown = |bits: Option<f64>| bits.map(|bits| format!("{bits:+.2}")).unwrap_or_default();
    let height = |m: &ReadingMisfit| m.height_m.map(|height| format!("{:+.1}", 1e3 * height));
    let turn = |m: &ReadingMisfit| m.turn_rad.map(|turn| format!("{:.0}", turn.to_degrees()));
    let image = |m: &ReadingMisfit| m.appearance_bits.map(|bits| format!("{bits:+.1}"));
    let space = |m: &ReadingMisfit| Some(format!("{:.1}", m.free_space_bits));
    let of = |reading: &ReadingContribution, value: &dyn Fn(&ReadingMisfit) -> Option<String>| {
        reading.misfit.as_ref().and_then(value).unwrap_or_default()
    };
    let rows = output::table(
        [
            "number",
            "robot",
            "seq",
            "bits",
            "information",
            "support",
            "fit",
            "height mm",
            "turn °",
            "image",
            "space",
            "",
        ],
        explanation.readings.iter().map(|reading| {
            [
                reading.number.to_string(),
                reading.robot.clone().unwrap_or_default(),
                reading.seq.map(|seq| seq.to_string()).unwrap_or_default(),
                shown(reading.bits),
                shown(reading.information_bits),
                shown(reading.support_bits),
                shown(reading.fit_bits),
                of(reading, &height),
                of(reading, &turn),
                of(reading, &image),
                of(reading, &space),
                if reading.disagrees { "disagrees with the rest" } else { "" }.to_owned(),
            ]
        }),
    );
    let answer = &explanation.answer;
    let name = answer.name.as_deref().unwrap_or(NONE_OF_THESE);
    let percent = answer.probability * 100.0;
    let rest = if explanation.complete { "" } else { "\n\ntime ran out before all were compared" };
    let nearest = explanation.nearest.as_ref().map_or(String::new(), |nearest| {
        let percent = nearest.probability * 100.0;
        let name = &nearest.name;
        format!("\nheight, turn, image and space compare with {name}, {percent:.1} %")
    });
    let against: String =
        explanation.against.iter().map(|objection| format!("\n- {}", objection.detail)).collect();
    let revision = explanation.revision;
    format!("revision {revision}: {name}, {percent:.1} %{nearest}{against}\n\n{rows}{rest}")
}
