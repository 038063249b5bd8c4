//! Kinds of requests of robots, and their shares.

use std::fmt;
use std::str::FromStr;

use palpate_core::rng::Stream;
use serde::Serialize;
use thiserror::Error;

/// A request of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Operation {
    /// Starts a session.
    Create,
    /// Sends a reading.
    Reading,
    /// Requests the belief.
    Belief,
    /// Requests the next touches.
    NextTouches,
    /// Closes a session.
    Close,
}

impl Operation {
    /// All operations.
    pub const ALL: [Self; 5] =
        [Self::Create, Self::Reading, Self::Belief, Self::NextTouches, Self::Close];

    /// The name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Create => "create",
            Self::Reading => "reading",
            Self::Belief => "belief",
            Self::NextTouches => "next_touches",
            Self::Close => "close",
        }
    }
}

/// Relative rates of requests within sessions, in any unit. Sessions also start and end as
/// their readings require.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mix {
    /// Readings.
    pub readings: f64,
    /// Beliefs.
    pub beliefs: f64,
    /// Next touches.
    pub next_touches: f64,
}

/// Error of an invalid mix.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum MixError {
    /// A part has an invalid form.
    #[error(
        "{found:?} is no part of a mix, expected readings=N, beliefs=N or next-touches=N with \
         N of at least 0"
    )]
    Part {
        /// The given text.
        found: String,
    },
    /// There are no readings, so sessions would never end.
    #[error("the mix has no readings, expected readings=N with N above 0")]
    NoReadings,
}

impl Default for Mix {
    fn default() -> Self {
        Self { readings: 90.0, beliefs: 9.0, next_touches: 1.0 }
    }
}

impl Mix {
    /// Draws the next operation.
    pub(super) fn draw(&self, stream: &mut Stream) -> Operation {
        let sum = self.readings + self.beliefs + self.next_touches;
        let at = stream.uniform(0.0, sum);
        match () {
            () if at < self.readings => Operation::Reading,
            () if at < self.readings + self.beliefs => Operation::Belief,
            () => Operation::NextTouches,
        }
    }
}

impl FromStr for Mix {
    type Err = MixError;

    /// Parses `readings=90,beliefs=9,next-touches=1`; missing parts are 0.
    fn from_str(text: &str) -> Result<Self, MixError> {
        let mut mix = Self { readings: 0.0, beliefs: 0.0, next_touches: 0.0 };
        for part in text.split(',') {
            let error = || MixError::Part { found: part.to_owned() };
            let (name, weight) = part.split_once('=').ok_or_else(error)?;
            let weight: f64 = weight.trim().parse().map_err(|_| error())?;
            if !(weight.is_finite() && weight >= 0.0) {
                return Err(error());
            }
            match name.trim() {
                "readings" => mix.readings = weight,
                "beliefs" => mix.beliefs = weight,
                "next-touches" => mix.next_touches = weight,
                _ => return Err(error()),
            }
        }
        if mix.readings > 0.0 { Ok(mix) } else { Err(MixError::NoReadings) }
    }
}

impl fmt::Display for Mix {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { readings, beliefs, next_touches } = self;
        write!(formatter, "readings={readings},beliefs={beliefs},next-touches={next_touches}")
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;

    use super::*;

    #[test]
    fn a_mix_parses_from_its_text() {
        assert_eq!(Mix::default().to_string().parse(), Ok(Mix::default()));
        let mix: Mix = "next-touches=0.5, readings=2".parse().unwrap();
        assert_eq!(mix, Mix { readings: 2.0, beliefs: 0.0, next_touches: 0.5 });
        for wrong in ["", "readings", "readings=-1", "readings=many", "touches=3", "readings=inf"] {
            assert!(matches!(wrong.parse::<Mix>(), Err(MixError::Part { .. })), "{wrong}");
        }
        assert_eq!("beliefs=3".parse::<Mix>(), Err(MixError::NoReadings));
    }

    #[test]
    fn drawn_operations_have_the_shares_of_the_mix() {
        let mix: Mix = "readings=6,beliefs=3,next-touches=1".parse().unwrap();
        let mut stream = Stream::new(101, Purpose::Arrivals, 0);
        let mut n = [0u32; 3];
        for _ in 0..10_000 {
            n[match mix.draw(&mut stream) {
                Operation::Reading => 0,
                Operation::Belief => 1,
                _ => 2,
            }] += 1;
        }
        // Deviations of the counts are at most 50.
        for (found, expected) in n.iter().zip([6_000, 3_000, 1_000]) {
            assert!(found.abs_diff(expected) < 200, "{n:?}");
        }
    }
}
