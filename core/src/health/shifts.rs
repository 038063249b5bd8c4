//! Sums over sessions: the shift of the sensor that all touches of a session share.

use crate::belief::answer::SensorShift;
use crate::units::MM;

/// Deviation that maps of objects add to a session's shift, metres. Chosen: half of the
/// smallest shift that is reported; without it a session of many touches would outweigh all
/// others, whatever its object's map is worth.
const MAP: f64 = 0.25 * MM;

/// Sums of the shifts of sessions, weighted by their information; x, y, z of the sensor frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShiftSums {
    /// Number of sessions.
    pub n_sessions: u32,
    /// Number of their touches.
    pub n_touches: u32,
    /// Sums of weights, m⁻².
    pub weights: [f64; 3],
    /// Sums of weighted shifts, m⁻¹.
    pub sums: [f64; 3],
    /// Sums of weighted squares of shifts.
    pub squares: [f64; 3],
}

/// The shift that sessions agree on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonShift {
    /// x, y, z of the sensor's true place relative to the stated one, sensor frame, metres.
    pub shift: [f64; 3],
    /// Standard deviation of each, metres.
    pub deviation: [f64; 3],
    /// Number of sessions.
    pub n_sessions: u32,
    /// Number of their touches.
    pub n_touches: u32,
}

impl ShiftSums {
    /// Adds the shift of one session.
    pub fn add(&mut self, found: &SensorShift) {
        let (shift, deviation) = (found.shift.to_array(), found.deviation.to_array());
        self.n_sessions = self.n_sessions.saturating_add(1);
        let n_touches = u32::try_from(found.n_touches).unwrap_or(u32::MAX);
        self.n_touches = self.n_touches.saturating_add(n_touches);
        for axis in 0..3 {
            let weight = 1.0 / (deviation[axis].powi(2) + MAP * MAP);
            self.weights[axis] += weight;
            self.sums[axis] += weight * shift[axis];
            self.squares[axis] += weight * shift[axis].powi(2);
        }
    }

    /// Adds the sums of other sessions.
    pub fn merge(&mut self, other: &Self) {
        self.n_sessions = self.n_sessions.saturating_add(other.n_sessions);
        self.n_touches = self.n_touches.saturating_add(other.n_touches);
        for axis in 0..3 {
            self.weights[axis] += other.weights[axis];
            self.sums[axis] += other.sums[axis];
            self.squares[axis] += other.squares[axis];
        }
    }

    /// The weighted mean of the shifts; `None` without a session. Its deviation is the larger of
    /// what the sessions state and what they differ by.
    #[must_use]
    pub fn common(&self) -> Option<CommonShift> {
        let (mut shift, mut deviation) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let weight = self.weights[axis];
            if weight <= 0.0 {
                return None;
            }
            shift[axis] = self.sums[axis] / weight;
            let apart = (self.squares[axis] / weight - shift[axis].powi(2)).max(0.0);
            let others = f64::from(self.n_sessions.saturating_sub(1).max(1));
            deviation[axis] = (1.0 / weight).max(apart / others).sqrt();
        }
        let Self { n_sessions, n_touches, .. } = *self;
        Some(CommonShift { shift, deviation, n_sessions, n_touches })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn session(z: f64, deviation: f64) -> SensorShift {
        let deviation = DVec3::splat(deviation * MM);
        SensorShift { shift: DVec3::Z * z * MM, deviation, n_touches: 8 }
    }

    fn of(sessions: &[SensorShift]) -> ShiftSums {
        let mut sums = ShiftSums::default();
        sessions.iter().for_each(|session| sums.add(session));
        sums
    }

    #[test]
    fn a_session_that_knows_less_weighs_less() {
        assert_eq!(ShiftSums::default().common(), None);
        // Variances 0.25² + 0² and 0.25² + 0.5² mm²: weights 5 to 1.
        let found = of(&[session(3.0, 0.0), session(0.0, 0.5)]).common().unwrap();
        assert!((found.shift[2] / MM - 2.5).abs() < 1e-9, "{found:?}");
        assert_eq!((found.n_sessions, found.n_touches), (2, 16));
        // They differ by more than they state: variance 5/6 · 0.5² + 1/6 · 2.5² = 1.25 mm².
        assert!((found.deviation[2] / MM - 1.25_f64.sqrt()).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn sessions_that_agree_make_the_shift_certain() {
        let sessions = [session(2.0, 0.0); 4];
        let found = of(&sessions).common().unwrap();
        assert!((found.deviation[2] / MM - 0.125).abs() < 1e-9, "0.25 mm / √4");
        let mut merged = of(&sessions[..1]);
        merged.merge(&of(&sessions[1..]));
        assert_eq!(merged, of(&sessions));
    }
}
