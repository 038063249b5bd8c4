//! The evidence of two touches (equation R17, k = 2).

use std::f64::consts::PI;

use super::object::{ObjectBelief, n_searched};
use crate::observe::observation::Observation;
use crate::options::SurfaceOptions;
use crate::propose::pair_density::mass;
use crate::propose::proposals::PairEvidence;

/// Share of pairs of touches with uninformative geometry: π₂ of equation R17.
const PAIR_OUTLIERS: f32 = 0.03;

/// Mean geometric weight of the stored pairs in the cells a query visits: π_v of equation R17.
const VISITED_WEIGHT: f32 = 0.03;

/// Density of pairs (equation R10) of an object that has as many about the observed geometry as
/// the mean over objects: g̅ π_v of equation R17.
pub(super) fn usual_density(objects: &[ObjectBelief]) -> f32 {
    let sum: f32 = objects.iter().map(|object| object.pair.geometry).sum();
    VISITED_WEIGHT * sum / n_searched(objects).max(1) as f32
}

/// ln L_o after two touches, beside the `usual` density. Equation R17 of docs/recogniser.md, k = 2.
pub(super) fn pair_evidence(pair: &PairEvidence, usual: f32) -> f64 {
    let density = if usual > 0.0 { pair.evidence / usual } else { 0.0 };
    let total = (1.0 - PAIR_OUTLIERS) * density + PAIR_OUTLIERS * pair.appearance;
    f64::from(total.max(f32::MIN_POSITIVE).ln())
}

/// Density of a pair of touches anywhere, on the scale of equation R10: as if the stored pairs
/// were of two touches anywhere in the workspace. Equation R36c of
/// docs/camera-model.md.
pub(super) fn density_anywhere(touches: [&Observation; 2], options: &SurfaceOptions) -> f64 {
    let distance = f64::from(touches[0].position.distance(touches[1].position));
    let volume = f64::from(options.scale.workspace);
    mass(touches, options) * 4.0 * PI * distance.powi(2) / volume / (8.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_weighs_as_computed_by_hand() {
        let object = |geometry| ObjectBelief {
            pair: PairEvidence { geometry, ..PairEvidence::default() },
            ..ObjectBelief::new(0.0)
        };
        // 0.03 · (0.1 + 0.3)/2; an object that is ruled out counts for nothing.
        let objects = [object(0.1), object(0.3), ObjectBelief::new(f64::NEG_INFINITY)];
        let usual = usual_density(&objects);
        assert!((usual - 0.006).abs() < 1e-8, "{usual}");
        // ln(0.97 · 0.012/0.006 + 0.03 · 2) = ln 2.
        let pair = PairEvidence { geometry: 0.1, evidence: 0.012, appearance: 2.0 };
        assert!((pair_evidence(&pair, usual) - 2f64.ln()).abs() < 1e-6);
        // Where no object has such a pair only the share of outliers tells: ln 0.06.
        assert!((pair_evidence(&pair, 0.0) - 0.06f64.ln()).abs() < 1e-6);
    }
}
