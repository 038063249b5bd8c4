//! The options as bytes, for work that others do.

use super::{
    Budget, ManyBudget, PairTolerance, RefinementScale, ScoreScale, SurfaceOptions, TouchScale,
};
use crate::coding::{Coded, NotWork};

/// All numbers of the options, in a fixed order.
struct Numbers<'a> {
    single: [&'a mut f32; 31],
    double: [&'a mut f64; 5],
    counts: [&'a mut usize; 20],
}

/// The numbers of options; without the motion, which is no number.
fn numbers(of: &mut SurfaceOptions) -> Numbers<'_> {
    let SurfaceOptions { scale, score, refinement, pairs, pair_deviation, budget, .. } = of;
    let SurfaceOptions { appearance_min, appearance_min_if_many, retrieval_floor, .. } = of;
    let SurfaceOptions { merge_distance, merge_angle, certain, unknown, motion: _, .. } = of;
    let TouchScale { across, along, normal, normal_outliers, direction, outliers, .. } = scale;
    let TouchScale { workspace, appearance, appearance_of_pose, .. } = scale;
    let ScoreScale { touch_max, poor, drop_within, drop_between, alike_within, .. } = score;
    let ScoreScale { refined_loss_max, contradiction, contradictions_max, .. } = score;
    let ScoreScale { self_match, self_match_share, loose_loss, negligible, .. } = score;
    let RefinementScale { across: refined_across, smoothing, normal_factor, tool } = refinement;
    let PairTolerance { distance, cosine } = pairs;
    let PairTolerance { distance: distance_deviation, cosine: cosine_deviation } = pair_deviation;
    let Budget { proposals_per_object, partners, partners_if_likely, partners_if_poor, .. } =
        budget;
    let Budget { per_object, total, refined, refined_objects, refined_proposals, many, .. } =
        budget;
    let ManyBudget { listed_per_root, listed_later_in_eight, listed_for_pair, .. } = many;
    let ManyBudget { explored, partners: many_partners, proposals, judged, .. } = many;
    let ManyBudget { paired, visited, visited_in_all, fitted, .. } = many;
    Numbers {
        single: [
            across,
            along,
            normal,
            normal_outliers,
            direction,
            outliers,
            workspace,
            appearance,
            appearance_of_pose,
            touch_max,
            poor,
            drop_within,
            drop_between,
            alike_within,
            refined_loss_max,
            contradiction,
            contradictions_max,
            loose_loss,
            refined_across,
            smoothing,
            normal_factor,
            tool,
            distance,
            cosine,
            distance_deviation,
            cosine_deviation,
            appearance_min,
            appearance_min_if_many,
            retrieval_floor,
            merge_distance,
            merge_angle,
        ],
        double: [self_match, self_match_share, negligible, certain, unknown],
        counts: [
            proposals_per_object,
            partners,
            partners_if_likely,
            partners_if_poor,
            per_object,
            total,
            refined,
            refined_objects,
            refined_proposals,
            listed_per_root,
            listed_later_in_eight,
            listed_for_pair,
            explored,
            many_partners,
            proposals,
            judged,
            paired,
            visited,
            visited_in_all,
            fitted,
        ],
    }
}

impl Coded for SurfaceOptions {
    fn put(&self, to: &mut Vec<u8>) {
        let mut copy = *self;
        let Numbers { single, double, counts } = numbers(&mut copy);
        single.iter().for_each(|number| number.put(to));
        double.iter().for_each(|number| number.put(to));
        counts.iter().for_each(|number| number.put(to));
        self.motion.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let mut all = Self::default();
        let Numbers { single, double, counts } = numbers(&mut all);
        for number in single {
            *number = Coded::take(from)?;
        }
        for number in double {
            *number = Coded::take(from)?;
        }
        for number in counts {
            *number = Coded::take(from)?;
        }
        all.motion = Coded::take(from)?;
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::reading::Looseness;

    use super::*;

    #[test]
    fn every_option_survives_coding() {
        let mut options = SurfaceOptions::default();
        let Numbers { single, double, counts } = numbers(&mut options);
        single.into_iter().enumerate().for_each(|(n, number)| *number = 0.5 + n as f32);
        double.into_iter().enumerate().for_each(|(n, number)| *number = 0.25 + n as f64);
        counts.into_iter().enumerate().for_each(|(n, number)| *number = 100 + n);
        options.motion = Some(Looseness { position: 0.1, angle: 0.2 });
        let mut bytes = Vec::new();
        options.put(&mut bytes);
        assert_eq!(SurfaceOptions::take(&mut bytes.as_slice()), Ok(options));
        // Debug prints every field: none has its default value any more.
        let usual = format!("{:?}", SurfaceOptions::default());
        let numbers = |text: &str| -> Vec<String> {
            text.split([' ', ','])
                .filter(|part| part.parse::<f64>().is_ok())
                .map(Into::into)
                .collect()
        };
        let (changed, usual) = (numbers(&format!("{options:?}")), numbers(&usual));
        assert_eq!(changed.len(), 31 + 5 + 20 + 2);
        let same = changed.iter().zip(&usual).filter(|(a, b)| a == b).count();
        assert!(same < 3, "{changed:?}");
    }
}
