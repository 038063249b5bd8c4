//! Errors of a rig and array that no recogniser models.
//!
//! The planar method assumes placement errors, tilts, depths and gains that are normal and
//! independent from press to press (`core::mosaic`), and [`super::RigNoise::physical`] draws
//! just these. The errors here are of other families: positions that wander over a session,
//! rare large slips, taxels with a bent response, and rows that leak into each other. Every
//! magnitude was chosen before anything was recognised under it.

use std::f64::consts::TAU;

use palpate_core::rng::{Purpose, Stream};

use super::PlanarPose;

/// Periods of a wander, in presses: one long, two shorter, none a divisor of another.
const PERIODS: [f64; 3] = [192.0, 67.0, 31.0];

/// Errors beyond those of [`super::RigNoise`]'s own numbers; all 0 is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unmatched {
    /// Largest wander of the position along x and along y over a session, metres.
    pub wander: f64,
    /// Largest wander of the angle over a session, radians.
    pub wander_angle: f64,
    /// Fraction of presses that slip, 0 to 1.
    pub slip_share: f64,
    /// Largest slip along x and along y, metres; the length is uniform.
    pub slip: f64,
    /// Largest rotation of a slip, radians; the angle is uniform.
    pub slip_angle: f64,
    /// Standard deviation of the logarithm of the exponent of a taxel's response; the
    /// response at saturation stays.
    pub bend: f64,
    /// Fraction of a taxel's response that is the mean of its row instead of its own.
    pub crosstalk: f64,
}

impl Unmatched {
    /// No such errors.
    #[must_use]
    pub const fn none() -> Self {
        Self {
            wander: 0.0,
            wander_angle: 0.0,
            slip_share: 0.0,
            slip: 0.0,
            slip_angle: 0.0,
            bend: 0.0,
            crosstalk: 0.0,
        }
    }

    /// Draws the exponents of the responses of `n_taxels` taxels.
    pub(super) fn powers(&self, n_taxels: usize, stream: &mut Stream) -> Vec<f64> {
        if self.bend <= 0.0 {
            return vec![1.0; n_taxels];
        }
        (0..n_taxels).map(|_| (self.bend * stream.normal()).exp()).collect()
    }

    /// The position that a press meant for `at` slips to.
    pub(super) fn slipped(&self, at: PlanarPose, stream: &mut Stream) -> PlanarPose {
        if self.slip_share <= 0.0 || stream.uniform(0.0, 1.0) >= self.slip_share {
            return at;
        }
        PlanarPose {
            x: at.x + stream.uniform(-self.slip, self.slip),
            y: at.y + stream.uniform(-self.slip, self.slip),
            angle: at.angle + stream.uniform(-self.slip_angle, self.slip_angle),
        }
    }

    /// Mixes a fraction of the row's mean into each taxel.
    pub(super) fn leak(&self, pressures: &mut [f64], cols: usize) {
        for row in pressures.chunks_mut(cols) {
            let mean = row.iter().sum::<f64>() / row.len() as f64;
            row.iter_mut().for_each(|p| *p += self.crosstalk * (mean - *p));
        }
    }
}

/// The value that a taxel with a bent response reports at a pressure, pascal.
pub(super) fn bent(pressure: f64, power: f64, saturation: f64) -> f64 {
    // An exponent of 1 changes no bit.
    let straight = (power - 1.0).abs() < f64::EPSILON || pressure <= 0.0;
    if straight { pressure } else { saturation * (pressure / saturation).powf(power) }
}

/// The wander of the rig over the presses of one session: a sum of slow waves.
pub(super) struct Wander {
    /// Phases of the waves along x, along y and in angle.
    phases: [[f64; 3]; 3],
    noise: Unmatched,
}

impl Wander {
    /// The wander of a session; equal seeds and sessions wander equally.
    pub(super) fn new(noise: Unmatched, seed: u64, session: u64) -> Self {
        let mut stream = Stream::new(seed, Purpose::RigWander, session);
        let phases = [[(); 3]; 3].map(|waves| waves.map(|()| stream.uniform(0.0, TAU)));
        Self { phases, noise }
    }

    /// The true position of press number `press` when it is commanded to `at`.
    pub(super) fn moved(&self, at: PlanarPose, press: usize) -> PlanarPose {
        let along = |axis: usize, largest: f64| {
            let waves = self.phases[axis].iter().zip(PERIODS);
            let sum: f64 = waves.map(|(phase, n)| (TAU * press as f64 / n + phase).sin()).sum();
            largest * sum / PERIODS.len() as f64
        };
        PlanarPose {
            x: at.x + along(0, self.noise.wander),
            y: at.y + along(1, self.noise.wander),
            angle: at.angle + along(2, self.noise.wander_angle),
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::units::{DEG, KPA, MM};

    use super::*;

    const AT: PlanarPose = PlanarPose { x: 0.0, y: 0.0, angle: 0.0 };

    fn noise() -> Unmatched {
        Unmatched { wander: 1.0 * MM, wander_angle: 3.0 * DEG, ..Unmatched::none() }
    }

    #[test]
    fn a_wander_is_bounded_and_slow() {
        let wander = Wander::new(noise(), 7, 0);
        let places: Vec<PlanarPose> = (0..192).map(|press| wander.moved(AT, press)).collect();
        assert!(places.iter().all(|p| p.x.abs() <= 1.0 * MM && p.angle.abs() <= 3.0 * DEG));
        let reach = places.iter().map(|p| p.x.abs()).fold(0.0, f64::max);
        assert!(reach > 0.3 * MM, "{reach}");
        // The steepest step: 1 mm / 3 · 2π (1/192 + 1/67 + 1/31) = 0.11 mm.
        let steps = places.windows(2).map(|pair| (pair[1].x - pair[0].x).abs());
        assert!(steps.fold(0.0, f64::max) < 0.11 * MM);
    }

    #[test]
    fn wander_depends_on_session_and_seed_alone() {
        let place = |seed, session| Wander::new(noise(), seed, session).moved(AT, 40);
        assert_eq!(place(7, 0), place(7, 0));
        assert!((place(7, 0).x - place(7, 1).x).abs() > 1e-6);
        assert!((place(7, 0).x - place(8, 0).x).abs() > 1e-6);
    }

    #[test]
    fn a_tenth_of_the_presses_slips() {
        let slips = Unmatched { slip_share: 0.1, slip: 2.0 * MM, ..Unmatched::none() };
        let mut stream = Stream::new(3, Purpose::RigNoise, 0);
        let moved: Vec<f64> = (0..4_000).map(|_| slips.slipped(AT, &mut stream).x.abs()).collect();
        let slipped = moved.iter().filter(|x| **x > 0.0).count();
        // 400 are expected, with a deviation of 19; five of them.
        assert!((305..495).contains(&slipped), "{slipped}");
        assert!(moved.iter().all(|x| *x <= 2.0 * MM));
    }

    #[test]
    fn a_bent_response_keeps_zero_and_saturation() {
        // Power 2 at half of the saturation: a quarter of it.
        assert!((bent(10.0 * KPA, 2.0, 20.0 * KPA) - 5.0 * KPA).abs() < 1e-9);
        assert!((bent(20.0 * KPA, 1.3, 20.0 * KPA) - 20.0 * KPA).abs() < 1e-9);
        assert!(bent(0.0, 0.7, 20.0 * KPA).abs() < 1e-12);
    }

    #[test]
    fn crosstalk_stays_within_a_row() {
        // Row means 2 and 10; a tenth of each value becomes its row's mean.
        let mut pressures = [1.0, 3.0, 10.0, 10.0];
        Unmatched { crosstalk: 0.1, ..Unmatched::none() }.leak(&mut pressures, 2);
        let expected = [1.1, 2.9, 10.0, 10.0];
        assert!(pressures.iter().zip(expected).all(|(p, e)| (p - e).abs() < 1e-12));
    }
}
