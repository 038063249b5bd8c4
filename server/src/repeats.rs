//! Retries: a reading that came already is not counted twice.
//!
//! A robot and its sequence number identify a reading. The same content again is a retry and
//! changes nothing; other content under the same number is a conflict.

use palpate_store::entity::{ReadingId, StoredReading};

use crate::refusal::Refusal;
use crate::wire::reading::Incoming;

/// The readings that are new. `stored` looks up what is stored under a robot's number.
pub(crate) fn new_readings(
    readings: &[Incoming],
    stored: impl Fn(&ReadingId) -> Result<Option<StoredReading>, Refusal>,
) -> Result<Vec<&Incoming>, Refusal> {
    let mut new: Vec<&Incoming> = Vec::with_capacity(readings.len());
    let mut ids: std::collections::HashMap<&ReadingId, &StoredReading> =
        std::collections::HashMap::new();
    for (index, reading) in readings.iter().enumerate() {
        let Some(id) = &reading.id else {
            new.push(reading);
            continue;
        };
        let is_same = match ids.get(id) {
            Some(before) => Some(before.is_repeated_by(&reading.stored)),
            None => stored(id)?.map(|before| before.is_repeated_by(&reading.stored)),
        };
        match is_same {
            Some(true) => {}
            Some(false) => {
                return Err(Refusal::ReadingConflict {
                    pointer: format!("/readings/{index}"),
                    robot: id.robot.clone(),
                    seq: id.seq,
                });
            }
            None => {
                ids.insert(id, &reading.stored);
                new.push(reading);
            }
        }
    }
    Ok(new)
}
