//! Touches that the recogniser chooses: the gain of a robot that follows the next-touch planner.
//!
//! The first two touches of a session are those of the random sessions; from the third on the
//! robot presses where the planner ranks its own approaches best (`next_touch`), centres
//! contacts off the array's centre, and tries again after a miss. Misses are evidence but not
//! touches.

use std::sync::Arc;

use palpate_core::reading::Reading;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;
use palpate_sim::press::PressSimulator;
use serde::Serialize;

use super::{InCatalogue, SurfaceScale};
use crate::disturbance::Presented;
use crate::next_touch::robot::{Met, Policy, Robot};
use crate::object_sessions::Sessions;
use crate::objects::TestObject;
use crate::report::{Progress, Report};
use crate::statistics::mean;

/// Number of touches that are not chosen.
const GIVEN: usize = 2;

/// Readings a session.
const READINGS: usize = 6;

/// Maximum number of presses without a touch, after which the robot is guided to the surface once.
const PRESSES_MAX: usize = 10;

/// Answers of a session after each of its touches.
struct Chosen {
    /// Whether the right object was named.
    right: Vec<bool>,
    /// Presses for the chosen touches, misses included.
    presses: usize,
}

#[derive(Serialize)]
struct Recognised {
    readings: usize,
    trials: usize,
    accuracy: f64,
}

/// Plays the first trials of each object with chosen touches; adds rows and figures to the report.
pub(super) fn run(
    config: &SurfaceScale,
    model: &Arc<SurfaceModel>,
    objects: &[TestObject],
    sessions: &Sessions<'_>,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<()> {
    let (count, trials) = (objects.len(), config.chosen_trials);
    let mut played = Vec::with_capacity(count * trials);
    for (object, TestObject { mesh, .. }) in objects.iter().enumerate() {
        progress("chosen touches", object, count);
        let simulator = PressSimulator::new(mesh.clone(), config.touches.sensor.clone());
        for trial in 0..trials {
            let given = sessions.presented(object, trial);
            let index = trial * count + object;
            played.push(play(config, model, &simulator, &given, object, index)?);
        }
    }
    for readings in 1..=READINGS {
        let right: Vec<f64> =
            played.iter().map(|p| f64::from(u8::from(p.right[readings - 1]))).collect();
        report.labelled(
            &[("method", "surface, chosen touches")],
            InCatalogue {
                objects: count,
                figures: Recognised { readings, trials: right.len(), accuracy: mean(&right) },
            },
        );
        if matches!(readings, 4 | READINGS) {
            report.summarise(&format!("accuracy_{count}_at_{readings}_chosen"), mean(&right));
        }
    }
    let presses: Vec<f64> =
        played.iter().map(|p| p.presses as f64 / (READINGS - GIVEN) as f64).collect();
    report.summarise(&format!("presses_per_touch_{count}_chosen"), mean(&presses));
    Ok(())
}

fn play(
    config: &SurfaceScale,
    model: &Arc<SurfaceModel>,
    simulator: &PressSimulator,
    given: &[Presented],
    object: usize,
    trial: usize,
) -> anyhow::Result<Chosen> {
    let session_from_object = given[0].session_from_object;
    let robot =
        |policy| Robot { simulator, object, session_from_object, policy, seed: config.seed, trial };
    let (planner, guided) = (robot(Policy::Information), robot(Policy::Sampler));
    let mut belief = SurfaceBelief::new(Arc::clone(model), SurfaceOptions::default(), None)?;
    let mut contacts: Vec<Reading> = Vec::with_capacity(READINGS);
    let mut chosen = Chosen { right: Vec::with_capacity(READINGS), presses: 0 };
    while chosen.right.len() < READINGS {
        let touched = if contacts.len() < GIVEN {
            Some(given[contacts.len()].reading.clone())
        } else {
            chosen_touch(&planner, &guided, &mut belief, &contacts, &mut chosen.presses)
        };
        if let Some(reading) = touched {
            belief.add(&reading, &config.touches.sensor);
            contacts.push(reading);
        }
        // A session without any touch has learnt nothing.
        let named = belief.answer(1).best_object();
        chosen.right.push(named.is_some_and(|named| named.0 as usize == object));
    }
    Ok(chosen)
}

/// A touch that the planner chose; a miss is added to the belief and counted.
fn chosen_touch(
    planner: &Robot<'_>,
    guided: &Robot<'_>,
    belief: &mut SurfaceBelief,
    contacts: &[Reading],
    presses: &mut usize,
) -> Option<Reading> {
    for _ in 0..PRESSES_MAX {
        let (approach, _) = planner.choose(*presses, belief, contacts);
        let pressed = planner.press(*presses, &approach);
        *presses += 1;
        match pressed.reading {
            Some(reading) if pressed.met == Met::Contact => return Some(reading),
            Some(miss) => belief.add(&miss, planner.simulator.sensor()),
            None => {}
        }
    }
    let (approach, _) = guided.choose(*presses, belief, contacts);
    *presses += 1;
    guided.press(*presses, &approach).reading
}
