//! Hypotheses of one object: poses with their scores, merged and bounded.

use glam::{Quat, Vec3};

use super::options::HybridOptions;

/// A pose of an object, relative to the session's anchor, and how well it explains all
/// touches so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hypothesis {
    pub(super) rotation: Quat,
    pub(super) translation: Vec3,
    /// Sum over the touches of the ln density ratios.
    pub(super) score: f32,
}

/// Merges hypotheses that are (nearly) one pose, best first, and keeps the best few.
pub(super) fn merge(hypotheses: &mut Vec<Hypothesis>, options: &HybridOptions) {
    hypotheses.sort_by(|a, b| b.score.total_cmp(&a.score));
    let distance = options.merge_distance.powi(2);
    // Angle φ between unit quaternions: |q·p| = cos φ/2.
    let alike = (0.5 * options.merge_angle).cos();
    let mut kept: Vec<Hypothesis> = Vec::with_capacity(hypotheses.len());
    let best = hypotheses.first().map_or(0.0, |best| best.score);
    for candidate in hypotheses.iter() {
        if kept.len() == options.budget.per_object || candidate.score < best - options.drop_within {
            break;
        }
        let known = kept.iter().any(|other| {
            other.translation.distance_squared(candidate.translation) < distance
                && other.rotation.dot(candidate.rotation).abs() > alike
        });
        if !known {
            kept.push(*candidate);
        }
    }
    *hypotheses = kept;
}
