//! The tables and the plot of the experiment with unknown objects.

use std::sync::Arc;

use palpate_recogniser::model::SurfaceModel;
use palpate_sim::plot::{Line, Panel};
use serde::Serialize;

use super::{Doubled, Kind, Unknown, Verdict};
use crate::objects::TestObject;
use crate::report::Report;
use crate::stated::{
    Stated, auroc, crossings, expected_calibration_error, reliability, stops, wilson,
};
use crate::statistics::{mean, standard_error_over_groups};

/// Bins of the calibration error.
const N_BINS: usize = 15;

/// Numbers of touches whose figures the summary states.
const STATED_AT: [usize; 5] = [2, 4, 6, 8, 10];

/// Levels of doubt at which stopping sessions are counted.
const DOUBTS: [f64; 10] = [0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.000_1];

/// Risks that a client accepts, and their names in keys.
const RISKS: [(f64, &str); 4] = [(0.1, "0_1"), (0.05, "0_05"), (0.01, "0_01"), (0.001, "0_001")];

#[derive(Serialize)]
struct Stage {
    fold: usize,
    known_objects: usize,
    stage: usize,
    temperature: f64,
    log_unknown: f64,
    log_unknown_per_touch: f64,
}

pub(super) fn report_calibration(report: &mut Report, fold: usize, model: &Arc<SurfaceModel>) {
    for (at, stage) in model.calibration.stages.iter().enumerate() {
        report.row(Stage {
            fold,
            known_objects: model.maps().len(),
            stage: at + 1,
            temperature: stage.temperature,
            log_unknown: stage.unknown,
            log_unknown_per_touch: stage.unknown_per_touch,
        });
    }
}

pub(super) fn report_sessions(
    report: &mut Report,
    config: &Unknown,
    kind: Kind,
    verdicts: &[Verdict],
) {
    for readings in 1..=config.readings {
        report_after(report, kind, readings, verdicts);
    }
    if kind.infix.is_empty() {
        report.summarise(&format!("{}sessions", kind.prefix), verdicts.len() as f64);
        let error = error(&stated_after(verdicts, 6.min(config.readings)));
        if kind.prefix.is_empty() {
            report.summarise("expected_calibration_error", error);
        }
    }
    report_stops(report, config, kind, verdicts);
}

/// States what doubling every touch adds to the probabilities, on the mean over sessions with known
/// and with unknown objects.
pub(super) fn report_doubled(report: &mut Report, doubled: &[Doubled]) {
    for (kind, is_known) in [("known", true), ("unknown", false)] {
        let of: Vec<&Doubled> = doubled.iter().filter(|one| one.is_known == is_known).collect();
        let n = of.first().map_or(0, |one| one.gains.len());
        for readings in std::iter::once(1).chain(STATED_AT).filter(|readings| *readings <= n) {
            let gains = |which: usize| -> Vec<f64> {
                of.iter().map(|one| one.gains[readings - 1][which]).collect()
            };
            let (truth, none) = (gains(0), gains(1));
            let name = |figure: &str| format!("doubled_{kind}_{figure}_at_{readings}");
            report.summarise(&name("gain"), mean(&truth));
            report.summarise(
                &name("gain_error"),
                standard_error_over_groups((0..).zip(truth.iter().copied())),
            );
            report.summarise(&name("none_of_these_gain"), mean(&none));
        }
    }
}

fn stated_after(verdicts: &[Verdict], readings: usize) -> Vec<Stated> {
    verdicts.iter().map(|v| v.stated(readings)).collect()
}

fn error(stated: &[Stated]) -> f64 {
    expected_calibration_error(&reliability(stated, N_BINS))
}

#[derive(Serialize)]
struct AfterReadings {
    readings: usize,
    sessions: usize,
    auroc: f64,
    known_right: f64,
    unknown_right: f64,
    #[serde(rename = "unknown_called_known_at_0.8")]
    unknown_called_known: f64,
    calibration_error: f64,
}

/// Adds the row and the figures after this many touches.
fn report_after(report: &mut Report, kind: Kind, readings: usize, verdicts: &[Verdict]) {
    let share = |of: &dyn Fn(&Verdict) -> bool, within: &dyn Fn(&Verdict) -> bool| {
        let n = verdicts.iter().filter(|v| within(v)).count();
        verdicts.iter().filter(|v| within(v) && of(v)).count() as f64 / n as f64
    };
    let right = |v: &Verdict| v.stated(readings).is_right;
    let is_sure_and_wrong = |v: &Verdict| {
        let stated = v.stated(readings);
        stated.best >= 0.8 && !stated.is_right
    };
    let error = error(&stated_after(verdicts, readings));
    let area = area_after(readings, verdicts);
    let known_right = share(&right, &|v| v.is_known);
    let unknown_right = share(&right, &|v| !v.is_known);
    let sure_of_wrong = share(&is_sure_and_wrong, &|v| !v.is_known);
    report.labelled(
        &[("method", kind.method)],
        AfterReadings {
            readings,
            sessions: verdicts.len(),
            auroc: area,
            known_right,
            unknown_right,
            unknown_called_known: sure_of_wrong,
            calibration_error: error,
        },
    );
    if !STATED_AT.contains(&readings) {
        return;
    }
    let Kind { prefix, infix, .. } = kind;
    let mut state = |key: &str, value| {
        report.summarise(&format!("{prefix}{key}_{infix}at_{readings}"), value);
    };
    state("auroc", area);
    state("known_accuracy", known_right);
    if prefix.is_empty() {
        state("unknown_accuracy", unknown_right);
        state("calibration_error", error);
        state("called_known", sure_of_wrong);
    }
}

/// Area under the ROC curve for the detection of unknown objects; the printed method has no such
/// answer, so that its score is 1 − its best probability.
fn area_after(readings: usize, verdicts: &[Verdict]) -> f64 {
    let score = |v: &Verdict| {
        let stated = v.stated(readings);
        let is_told = v.probabilities[readings - 1].last().is_some_and(|unknown| *unknown > 0.0);
        (if is_told { stated.unknown } else { 1.0 - stated.best }, !v.is_known)
    };
    auroc(&verdicts.iter().map(score).collect::<Vec<_>>())
}

#[derive(Serialize)]
struct AtRisk {
    risk: f64,
    stopped: usize,
    wrong_stops: usize,
    wrong_share: f64,
    wrong_share_low: f64,
    wrong_share_high: f64,
    touches_at_stop_mean: f64,
    never_stopped: f64,
}

#[derive(Serialize)]
struct AtDoubt {
    doubt: f64,
    stopped: usize,
    wrong_stops: usize,
    wrong_share_high: f64,
}

fn report_stops(report: &mut Report, config: &Unknown, kind: Kind, verdicts: &[Verdict]) {
    for (risk, name) in RISKS {
        for (which, keep) in [("all", None), ("known", Some(true)), ("unknown", Some(false))] {
            let steps = statements(config, verdicts, keep);
            let found = stops(&steps, risk);
            let (low, high) = wilson(found.wrong, found.stopped);
            let wrong = found.wrong as f64 / found.stopped as f64;
            let never = 1.0 - found.stopped as f64 / found.sessions as f64;
            report.labelled(
                &[("method", kind.method), ("objects", which)],
                AtRisk {
                    risk,
                    stopped: found.stopped,
                    wrong_stops: found.wrong,
                    wrong_share: wrong,
                    wrong_share_low: low,
                    wrong_share_high: high,
                    touches_at_stop_mean: found.touches_mean,
                    never_stopped: never,
                },
            );
            if keep.is_none() && kind.prefix.is_empty() {
                let mut state = |key: &str, value| {
                    report.summarise(&format!("{key}_{}at_risk_{name}", kind.infix), value);
                };
                state("wrong_stops", wrong);
                state("wrong_stops_low", low);
                state("wrong_stops_high", high);
                state("touches", found.touches_mean);
                state("never_stopped", never);
            }
        }
    }
    let steps = statements(config, verdicts, None);
    for doubt in DOUBTS {
        let (stopped, wrong) = crossings(&steps, doubt);
        report.labelled(
            &[("method", kind.method)],
            AtDoubt {
                doubt,
                stopped,
                wrong_stops: wrong,
                wrong_share_high: wilson(wrong, stopped).1,
            },
        );
    }
}

/// Statements touch by touch in all sessions, or in those with known or unknown objects.
fn statements(config: &Unknown, verdicts: &[Verdict], keep: Option<bool>) -> Vec<Vec<Stated>> {
    let steps =
        |v: &Verdict| -> Vec<Stated> { (1..=config.readings).map(|n| v.stated(n)).collect() };
    verdicts.iter().filter(|v| keep.is_none_or(|known| known == v.is_known)).map(steps).collect()
}

#[derive(Serialize)]
struct Confused {
    is_known: bool,
    readings: usize,
    sessions: usize,
    wrong: usize,
    times: usize,
}

/// Adds a row per object: the results of its sessions after six touches, and the objects named
/// instead.
pub(super) fn report_confused(
    report: &mut Report,
    config: &Unknown,
    objects: &[TestObject],
    verdicts: &[Verdict],
) {
    let readings = 6.min(config.readings);
    for (at, object) in objects.iter().enumerate() {
        for is_known in [true, false] {
            let own = || verdicts.iter().filter(|v| v.object == at && v.is_known == is_known);
            let wrong: Vec<Option<usize>> =
                own().filter(|v| !v.stated(readings).is_right).map(|v| v.named(readings)).collect();
            let Some(first) = wrong.first() else { continue };
            let often = wrong.iter().fold((*first, 0), |top, one| {
                let count = wrong.iter().filter(|other| *other == one).count();
                if count > top.1 { (*one, count) } else { top }
            });
            let name = often.0.map_or("none of these", |named| objects[named].name.as_str());
            report.labelled(
                &[("object", &object.name), ("most_often_named", name)],
                Confused {
                    is_known,
                    readings,
                    sessions: own().count(),
                    wrong: wrong.len(),
                    times: often.1,
                },
            );
        }
    }
}

#[derive(Serialize)]
struct InBin {
    readings: usize,
    bin_stated: f64,
    bin_right: f64,
    bin_count: usize,
}

pub(super) fn panels(
    report: &mut Report,
    config: &Unknown,
    verdicts: &[Verdict],
    literal: &[Verdict],
) -> Vec<Panel> {
    let mut lines = vec![Line { name: "as stated".into(), points: vec![(0.0, 0.0), (1.0, 1.0)] }];
    for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
        let stated: Vec<Stated> = verdicts.iter().map(|v| v.stated(readings)).collect();
        let bins = reliability(&stated, N_BINS);
        for bin in &bins {
            report.row(InBin {
                readings,
                bin_stated: bin.stated,
                bin_right: bin.right,
                bin_count: bin.count,
            });
        }
        let points = bins.iter().map(|bin| (bin.stated, bin.right)).collect();
        lines.push(Line { name: format!("{readings} touches"), points });
    }
    let mut panels = vec![panel("reliability", "stated probability", "share right", lines)];
    let area = |name: &str, verdicts: &[Verdict]| {
        let at = |n: usize| (n as f64, area_after(n, verdicts));
        Line { name: name.into(), points: (1..=config.readings).map(at).collect() }
    };
    let mut lines = vec![area("surface", verdicts)];
    if !literal.is_empty() {
        lines.push(area("literal", literal));
    }
    panels.push(panel("telling unknown objects", "readings", "AUROC", lines));
    let digits = |share: f64| -share.log10();
    let sessions = statements(config, verdicts, None);
    let line = |name: &str, of: &dyn Fn(f64) -> f64| {
        let points = RISKS.iter().map(|(risk, _)| (digits(*risk), of(*risk))).collect();
        Line { name: name.into(), points }
    };
    let wrong = |risk: f64| (stops(&sessions, risk).wrong, stops(&sessions, risk).stopped);
    let lines = vec![
        line("as named", &digits),
        line("wrong stops", &|risk| digits(wrong(risk).0 as f64 / wrong(risk).1 as f64)),
        line("95 % at most", &|risk| digits(wilson(wrong(risk).0, wrong(risk).1).1)),
    ];
    panels.push(panel("stop rule", "risk named (−log10)", "wrong (−log10)", lines));
    let lines = vec![line("all", &|risk| stops(&sessions, risk).touches_mean)];
    panels.push(panel("touches at the stop", "risk named (−log10)", "mean touches", lines));
    panels
}

fn panel(title: &str, x: &str, y: &str, lines: Vec<Line>) -> Panel {
    Panel { title: title.into(), x: x.into(), y: y.into(), lines }
}
