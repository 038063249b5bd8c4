//! Stored form of a sensor's days. Sums of taxels are f32: their deviations are far below the
//! noise.

use bincode::{Decode, Encode};
use palpate_core::health::day::Day;
use palpate_core::health::presses::{PressSums, TaxelSums};
use palpate_core::health::shifts::ShiftSums;
use uuid::Uuid;

use super::SensorDay;
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, read, write};

#[derive(Encode, Decode)]
struct SensorDayV1 {
    sensor: IdV1,
    day: u32,
    calibration: u32,
    sessions: Vec<IdV1>,
    n_presses: u32,
    n_quiet: u32,
    taxels: Vec<TaxelV1>,
    shifts: ShiftsV1,
}

#[derive(Encode, Decode)]
struct TaxelV1 {
    n_quiet: u32,
    mean: f32,
    latest: f32,
    n_steps: u32,
    steps: f32,
    n_asked: u32,
    n_answered: u32,
    own: f32,
    around: f32,
    low: f32,
    high: f32,
}

#[derive(Encode, Decode)]
struct ShiftsV1 {
    n_sessions: u32,
    n_touches: u32,
    weights: [f64; 3],
    sums: [f64; 3],
    squares: [f64; 3],
}

impl Record for SensorDay {
    const KIND: Kind = Kind::SensorDay;

    fn to_payload(&self) -> Vec<u8> {
        let Day { day, calibration, presses, shifts } = &self.day;
        write(&SensorDayV1 {
            sensor: self.sensor.into_bytes(),
            day: *day,
            calibration: *calibration,
            sessions: self.sessions.iter().map(|id| id.into_bytes()).collect(),
            n_presses: presses.n_presses,
            n_quiet: presses.n_quiet,
            taxels: presses.taxels.iter().map(taxel_to_stored).collect(),
            shifts: ShiftsV1 {
                n_sessions: shifts.n_sessions,
                n_touches: shifts.n_touches,
                weights: shifts.weights,
                sums: shifts.sums,
                squares: shifts.squares,
            },
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: SensorDayV1 = read(payload)?;
        let ShiftsV1 { n_sessions, n_touches, weights, sums, squares } = stored.shifts;
        Ok(Self {
            sensor: Uuid::from_bytes(stored.sensor),
            sessions: stored.sessions.into_iter().map(Uuid::from_bytes).collect(),
            day: Day {
                day: stored.day,
                calibration: stored.calibration,
                presses: PressSums {
                    n_presses: stored.n_presses,
                    n_quiet: stored.n_quiet,
                    taxels: stored.taxels.iter().map(taxel_from_stored).collect(),
                },
                shifts: ShiftSums { n_sessions, n_touches, weights, sums, squares },
            },
        })
    }
}

fn taxel_to_stored(sums: &TaxelSums) -> TaxelV1 {
    TaxelV1 {
        n_quiet: sums.n_quiet,
        mean: sums.mean as f32,
        latest: sums.latest as f32,
        n_steps: sums.n_steps,
        steps: sums.steps as f32,
        n_asked: sums.n_asked,
        n_answered: sums.n_answered,
        own: sums.own as f32,
        around: sums.around as f32,
        low: sums.low as f32,
        high: sums.high as f32,
    }
}

fn taxel_from_stored(stored: &TaxelV1) -> TaxelSums {
    TaxelSums {
        n_quiet: stored.n_quiet,
        mean: stored.mean.into(),
        latest: stored.latest.into(),
        n_steps: stored.n_steps,
        steps: stored.steps.into(),
        n_asked: stored.n_asked,
        n_answered: stored.n_answered,
        own: stored.own.into(),
        around: stored.around.into(),
        low: stored.low.into(),
        high: stored.high.into(),
    }
}
