//! How well a belief predicts a reading that it has not seen: what tells a wrong one.
//!
//! The reading's density under the hypotheses, each with its share, over that of a touch
//! anywhere, given that the object is one of the known ones. A reading that fits nowhere on
//! the object as the others have it is less likely than a touch anywhere.

use super::SurfaceBelief;
use super::pattern::Pattern;
use super::sighting::Sighting;
use crate::surface::touch::observe_touch;
use palpate_core::log_prob::{log_sum_exp, normalize};
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;

/// Objects less probable than this predict nothing.
const PROBABILITY_MIN: f64 = 1e-6;

impl SurfaceBelief {
    /// ln of how much likelier the reading is than a touch anywhere, where the object is now;
    /// `None` while fewer than three touches say where that is.
    #[must_use]
    pub fn log_fit(&self, reading: &Reading, sensor: &SensorDescription) -> Option<f64> {
        if self.stage < 3 {
            return None;
        }
        let (space, scale) = (&self.model.space, &self.options.scale);
        let touch = observe_touch(reading, sensor, space).map(|touch| {
            Sighting::new(&touch, self.anchor, space, scale).with_base(reading.base())
        });
        let pattern = match touch {
            Some(_) => Pattern::of_touch(reading, sensor, self.anchor),
            None => Pattern::of_miss(reading, sensor, self.anchor),
        };
        let mut probabilities = self.probabilities();
        probabilities.pop();
        let known: f64 = probabilities.iter().sum();
        let mut logs = Vec::new();
        let leader = self.leader();
        let objects = leader.objects.iter().zip(self.model.maps()).zip(&probabilities);
        for ((state, map), probability) in objects {
            let share = probability / known;
            if share.is_nan() || share < PROBABILITY_MIN {
                continue;
            }
            let scores: Vec<f64> = state.hypotheses.iter().map(|h| f64::from(h.score)).collect();
            for (hypothesis, weight) in state.hypotheses.iter().zip(normalize(&scores)) {
                let pose = hypothesis.pose();
                let fit = |touch: &Sighting| self.kernel.score(map, &pose, touch);
                let fit = touch.as_ref().map_or(0.0, fit)
                    + pattern.contradiction(map, &pose, &self.options.pattern);
                logs.push((share * weight).ln() + f64::from(fit));
            }
        }
        (!logs.is_empty()).then(|| log_sum_exp(logs.into_iter()))
    }
}
