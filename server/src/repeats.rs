//! Repeated readings, which count once.
//!
//! A robot and its sequence number identify a reading. Equal content under the same number is
//! a retry and changes nothing; other content is a conflict. Two readings of one request with
//! the same number are one if they are equal, otherwise one of the numbers is wrong.

use std::collections::HashMap;

use palpate_schemas::FieldError;
use palpate_store::entity::{ReadingId, StoredReading};

use crate::cause::Cause;
use crate::wire::Invalid;
use crate::wire::reading::Incoming;

/// The new readings. `stored` looks up the reading stored under a robot's number.
pub(crate) fn new_readings(
    readings: &[Incoming],
    stored: impl Fn(&ReadingId) -> Result<Option<StoredReading>, Cause>,
) -> Result<Vec<&Incoming>, Cause> {
    let mut new: Vec<&Incoming> = Vec::with_capacity(readings.len());
    let mut first: HashMap<&ReadingId, usize> = HashMap::new();
    for (index, reading) in readings.iter().enumerate() {
        let Some(id) = &reading.id else {
            new.push(reading);
            continue;
        };
        if let Some(first) = first.get(id) {
            if !readings[*first].stored.is_repeated_by(&reading.stored) {
                return Err(twice(id, &readings[*first], reading));
            }
            continue;
        }
        first.insert(id, index);
        match stored(id)? {
            None => new.push(reading),
            Some(before) if before.is_repeated_by(&reading.stored) => {}
            Some(_) => {
                return Err(Cause::ReadingConflict {
                    pointer: reading.pointer.clone(),
                    robot: id.robot.clone(),
                    seq: id.seq,
                });
            }
        }
    }
    Ok(new)
}

/// The refusal of two different readings of one request under one number.
fn twice(id: &ReadingId, first: &Incoming, second: &Incoming) -> Cause {
    let ReadingId { robot, seq } = id;
    let error = |one: &Incoming, other: &Incoming| FieldError {
        pointer: format!("{}/seq", one.pointer),
        detail: format!(
            "{} and {} both are reading {seq} of robot {robot:?}, with different content: expected \
             another seq than that of {}",
            first.pointer, second.pointer, other.pointer
        ),
    };
    Invalid(vec![error(second, first), error(first, second)]).into()
}
