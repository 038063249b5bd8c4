//! Readings from bytes to their stored and folded forms, without a server, for fuzzing.
//!
//! The steps are those of the handlers: parse, check against the sensor, make the entry of
//! the journal and the reading to fold.

use axum::response::IntoResponse;
use palpate_schemas::AddReadings;
use palpate_store::database::Database;

use crate::clock::now_ms;
use crate::extract::{parse, parse_msgpack};
use crate::services::sensors::Sensors;
use crate::wire::felt::from_store;
use crate::wire::reading::{check_size, given, readings};

/// Encoding of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// JSON.
    Json,
    /// MessagePack.
    MessagePack,
}

/// A refused body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// The status of the answer.
    pub status: u16,
    /// Text of the answer.
    pub words: String,
}

/// Accepts bodies of readings of the preset sensors; nothing is stored.
pub struct Intake {
    sensors: Sensors,
}

impl Intake {
    /// A new intake.
    ///
    /// # Panics
    /// Never: a database in memory accepts the presets.
    #[must_use]
    pub fn new() -> Self {
        let sensors = Sensors::new(Database::in_memory());
        let adding = sensors.add_presets();
        futures::executor::block_on(adding).expect("a database in memory takes the presets");
        Self { sensors }
    }

    /// Reads a body and returns its number of readings.
    ///
    /// # Errors
    /// [`Refused`], as a robot would receive it.
    ///
    /// # Panics
    /// When an accepted reading cannot be folded from its stored form.
    pub fn read(&self, form: Form, body: &[u8]) -> Result<usize, Refused> {
        let parsed: Result<AddReadings, _> = match form {
            Form::Json => parse(body, &|_| Ok(())),
            Form::MessagePack => parse_msgpack(body, &|_| Ok(())),
        };
        let taken = parsed.and_then(|body| {
            let given = given(&body.readings);
            check_size("/readings", given.len(), &given)?;
            Ok(readings(&given, self.sensors.sources(&given)?, None)?)
        });
        let taken = taken.map_err(|refusal| {
            let words = refusal.to_string();
            Refused { status: refusal.into_response().status().as_u16(), words }
        })?;
        for incoming in &taken {
            drop(incoming.entry(now_ms(), None));
            let again = from_store(&incoming.stored, &incoming.sensor, None);
            assert!(again.is_ok(), "what was accepted is refused after a restart: {again:?}");
        }
        Ok(taken.len())
    }
}

impl Default for Intake {
    fn default() -> Self {
        Self::new()
    }
}
