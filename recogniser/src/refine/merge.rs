//! Merging: hypotheses of one object with nearly the same pose, and bounds on their number.

use crate::options::SurfaceOptions;
use crate::verify::hypothesis::Hypothesis;

/// Merges hypotheses of (nearly) the same pose, best first, and keeps the best few.
pub(crate) fn merge(hypotheses: &mut Vec<Hypothesis>, options: &SurfaceOptions) {
    hypotheses.sort_by(|a, b| b.score.total_cmp(&a.score));
    let distance = options.merge_distance.powi(2);
    // Angle φ between unit quaternions: |q·p| = cos φ/2.
    let alike = (0.5 * options.merge_angle).cos();
    let mut kept: Vec<Hypothesis> = Vec::with_capacity(hypotheses.len());
    let best = hypotheses.first().map_or(0.0, |best| best.score);
    for candidate in hypotheses.iter() {
        if kept.len() == options.budget.per_object
            || candidate.score < best - options.score.drop_within
        {
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

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::options::Budget;

    fn at(x: f32, angle: f32, score: f32) -> Hypothesis {
        let (rotation, translation) = (Quat::from_rotation_z(angle), Vec3::new(x, 0.0, 0.0));
        Hypothesis::new(rotation, translation, score)
    }

    /// The remaining scores.
    fn merged(mut hypotheses: Vec<Hypothesis>, options: &SurfaceOptions) -> Vec<f32> {
        merge(&mut hypotheses, options);
        hypotheses.iter().map(|hypothesis| hypothesis.score).collect()
    }

    #[test]
    fn near_poses_become_the_best_of_them() {
        // 3 mm and 0.12 rad are one pose: 2.9 mm with 0.11 rad are, 3.1 mm or 0.13 rad are not.
        let options = SurfaceOptions::default();
        let near = vec![at(0.002_9, 0.11, 4.0), at(0.0, 0.0, 5.0)];
        assert_eq!(merged(near, &options), [5.0]);
        let apart = vec![at(0.003_1, 0.0, 3.0), at(0.0, 0.13, 4.0), at(0.0, 0.0, 5.0)];
        assert_eq!(merged(apart, &options), [5.0, 4.0, 3.0]);
    }

    #[test]
    fn a_quaternion_and_its_negative_are_one_rotation() {
        let (same, mut other) = (at(0.0, 0.3, 5.0), at(0.0, 0.3, 4.0));
        other.rotation = -other.rotation;
        assert_eq!(merged(vec![same, other], &SurfaceOptions::default()), [5.0]);
    }

    #[test]
    fn few_stay_and_none_that_are_hopeless() {
        let defaults = SurfaceOptions::default();
        let budget = Budget { per_object: 2, ..defaults.budget };
        let options = SurfaceOptions { budget, ..defaults };
        let row = |scores: &[f32]| -> Vec<Hypothesis> {
            scores.iter().enumerate().map(|(n, score)| at(0.01 * n as f32, 0.0, *score)).collect()
        };
        assert_eq!(merged(row(&[1.0, 3.0, 2.0]), &options), [3.0, 2.0]);
        assert_eq!(merged(row(&[20.0, 7.9]), &options), [20.0], "12.1 below the best");
        assert_eq!(merged(Vec::new(), &options), [0.0; 0]);
    }
}
