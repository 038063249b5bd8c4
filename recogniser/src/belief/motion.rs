//! Object motion: one announced move, announced drift between touches, or unannounced drift.
//!
//! Unannounced drift is a mixture (equation R16): a component at rest, and components that drift
//! by one amplitude each. They start once the best explanation at rest is poor, receive every
//! reading, and are dropped when rest explains the touches well and drift is improbable.

use palpate_core::reading::Looseness;

use crate::model::SurfaceModel;
use crate::observe::placement::HALF;
use crate::options::TouchScale;

/// Amplitudes of unannounced drift: about a factor of four apart, they span 1 to 10 mm.
pub(super) const AMPLITUDES: usize = 3;

/// Prior of unannounced drift, shared evenly by its amplitudes: fixtures seldom fail.
const UNANNOUNCED: f64 = 0.02;

/// Number of places from which motion is distinguishable from rest: three determine a pose.
pub(super) const TOUCHES_MIN: usize = 4;

/// Probability below which drift is dropped while rest explains the touches well; it then
/// changes no probability by more than a thousandth.
pub(super) const NEGLIGIBLE: f64 = 1e-3;

/// A component's model of the object's motion between touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// The object rests.
    Rest,
    /// The object drifts as announced.
    Announced(Looseness),
    /// The object drifts by these deviations without announcement.
    Unannounced(Looseness),
}

impl Motion {
    /// The drift that a session announces, or rest.
    pub(super) fn announced(drift: Option<Looseness>) -> Self {
        drift.map_or(Self::Rest, Self::Announced)
    }

    /// Deviations of the drift between any two touches; `None` at rest.
    pub(super) fn drift(&self) -> Option<&Looseness> {
        match self {
            Self::Rest => None,
            Self::Announced(drift) | Self::Unannounced(drift) => Some(drift),
        }
    }

    pub(super) fn is_unannounced(&self) -> bool {
        matches!(self, Self::Unannounced(_))
    }
}

/// The amplitudes of unannounced drift: the smallest is a touch's own deviation across the
/// surface, the largest halves the weight of the previous touch, and the middle one is their
/// geometric mean. Rotations displace the rim of the median object by the same distances.
pub(super) fn amplitudes(model: &SurfaceModel, scale: &TouchScale) -> [Looseness; AMPLITUDES] {
    let median = median_radius(model);
    let (least, most) = (scale.across, HALF);
    [least, (least * most).sqrt(), most].map(|position| Looseness {
        position: f64::from(position),
        angle: f64::from(position / median),
    })
}

/// Radius of the median object, metres.
pub(super) fn median_radius(model: &SurfaceModel) -> f32 {
    let mut radii: Vec<f32> = (0..model.n_objects()).map(|o| model.radius(o)).collect();
    radii.sort_unstable_by(f32::total_cmp);
    radii.get(radii.len() / 2).copied().unwrap_or_default().max(HALF)
}

/// ln of the prior of rest, then of each of `n` drifting components.
pub(super) fn log_priors(n: usize) -> impl Iterator<Item = f64> {
    let rests = if n == 0 { 0.0 } else { (1.0 - UNANNOUNCED).ln() };
    let moves = (UNANNOUNCED / n.max(1) as f64).ln();
    std::iter::once(rests).chain(std::iter::repeat_n(moves, n))
}

/// The drifting component that is likelier than any other component, by the joint probabilities
/// (rest first, "none of these" last in each row); `None` when rest is.
pub(super) fn leader(joint: &[Vec<f64>]) -> Option<usize> {
    let (rest, drifting) = joint.split_first()?;
    let best = drifting.iter().map(|row| known(row)).enumerate();
    let best = best.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
    best.filter(|(_, share)| *share > known(rest)).map(|(index, _)| index)
}

/// The probability that the object is one of the catalogue and the component's row holds.
pub(super) fn known(row: &[f64]) -> f64 {
    row.split_last().map_or(0.0, |(_, known)| known.iter().sum())
}

#[cfg(test)]
mod tests {
    use palpate_core::units::MM;

    use super::*;
    use crate::options::SurfaceOptions;
    use crate::test_support::{model_of, places};

    #[test]
    fn amplitudes_span_a_touchs_deviation_to_a_halved_weight() {
        let scale = SurfaceOptions::default().scale;
        let found = amplitudes(&model_of(&[places(200, 0), places(200, 1)]), &scale);
        let expected = [0.7, 7f64.sqrt(), 10.0];
        let millimetres = found.map(|motion| motion.position / MM);
        assert!(millimetres.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4));
        // Half axes of 40, 30 and 20 mm: the rim of a turn by 10 mm is 40 mm away.
        assert!((found[2].angle - 0.25).abs() < 0.02, "{}", found[2].angle);
    }

    #[test]
    fn priors_of_components_sum_to_one() {
        let shares: Vec<f64> = log_priors(AMPLITUDES).map(f64::exp).collect();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12 && shares.len() == 4);
        assert!((log_priors(0).next().unwrap()).abs() < 1e-12);
    }

    #[test]
    fn drift_leads_only_when_it_is_likelier_than_rest() {
        let row = |p: f64| vec![p, 0.1];
        assert_eq!(leader(&[row(0.4), row(0.3), row(0.2)]), None);
        assert_eq!(leader(&[row(0.2), row(0.3), row(0.3)]), Some(0), "the first of equal ones");
        assert_eq!(leader(&[row(0.9)]), None);
    }
}
