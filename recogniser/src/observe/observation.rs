//! An observation: a touch in single precision relative to the session's anchor, with its weight.

use std::ops::Range;

use glam::{DVec3, Mat3, Vec3};
use palpate_core::reading::{Base, Looseness};

use super::placement::{Placement, Variances, apart_by};
use super::steadiness::Steadiness;
use super::touch::Touch;
use crate::model::agreement::{Feature, StoredFeature, ratio};
use crate::model::appearance::AppearanceSpace;
use crate::model::features::Features;
use crate::model::thinning::NORMAL_REACH;
use crate::options::TouchScale;

/// A touch of the session, relative to the anchor (the first touch).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Observation {
    pub(crate) position: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) elongation: f32,
    /// The sensor's axes in the session frame; zero if an error of its tool centre is not shared
    /// with the other touches.
    pub(crate) session_from_sensor: Mat3,
    /// Weight of its evidence: its novelty, lower after motion of the object.
    pub(crate) weight: f32,
    /// Probability that no earlier touch was at its place.
    pub(crate) novelty: f32,
    /// Uncertainty of its place.
    pub(crate) placement: Placement,
    /// [`Placement::off_object_density`] of its placement.
    pub(crate) off_object: f32,
    /// Reliability of its normal and its stretch.
    pub(crate) steadiness: Steadiness,
    /// What the touch says.
    pub(crate) says: Says,
    /// Loss of score (ln) by the deviation of a contact's position, even at its own place.
    point_loss: f32,
    feature: Feature,
    /// Comparison for finding pairs.
    sharp: Comparison,
    /// Comparison for scoring poses.
    soft: Comparison,
}

/// What a touch says besides its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Says {
    /// Normal, stretch and appearance: a press with an image.
    All,
    /// The normal: a contact without an image.
    Normal,
    /// Nothing: a contact whose normal was not felt.
    Position,
}

impl Says {
    /// What a touch says.
    pub(crate) fn of(touch: &Touch) -> Self {
        match touch.point.map(|point| point.normal) {
            None => Self::All,
            Some(Some(_)) => Self::Normal,
            Some(None) => Self::Position,
        }
    }
}

/// Parameters for comparing a feature with others: the softness, and the density of features of
/// touches anywhere at this feature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Comparison {
    pub(crate) softness: f32,
    pub(crate) density: f32,
}

impl Comparison {
    /// The comparison of a touch without appearance: its ratio is 1 everywhere, the limit of
    /// equation R7 for an unbounded softness.
    pub(crate) const NOTHING: Self = Self { softness: f32::INFINITY, density: 1.0 };
}

impl Observation {
    /// The observation of a touch, relative to `anchor`.
    pub(crate) fn new(
        touch: &Touch,
        anchor: DVec3,
        space: &AppearanceSpace,
        scale: &TouchScale,
    ) -> Self {
        let comparison = |softness| match touch.point {
            None => {
                let density = space.density_anywhere(&touch.feature, softness);
                Comparison { softness, density }
            }
            Some(_) => Comparison::NOTHING,
        };
        let (sharp, soft) = (comparison(scale.appearance), comparison(scale.appearance_of_pose));
        let seen = Self::compared(touch, anchor, sharp, soft);
        Self { point_loss: point_loss(seen.placement.own(), scale), ..seen }
    }

    /// The observation of a touch whose feature is compared with these parameters.
    pub(crate) fn compared(
        touch: &Touch,
        anchor: DVec3,
        sharp: Comparison,
        soft: Comparison,
    ) -> Self {
        let placement = Placement::default().of_own(touch.own_deviation());
        Self {
            position: (touch.position - anchor).as_vec3(),
            normal: touch.normal.as_vec3(),
            direction: touch.direction.as_vec3(),
            elongation: touch.elongation as f32,
            session_from_sensor: touch.sensor_axes(),
            weight: 1.0,
            novelty: 1.0,
            placement,
            off_object: placement.off_object_density(),
            steadiness: match touch.point.and_then(|point| point.normal) {
                Some(deviation) => Steadiness::of_normal(deviation),
                None => Steadiness::new(touch.evenness),
            },
            says: Says::of(touch),
            point_loss: 0.0,
            feature: touch.feature,
            sharp,
            soft,
        }
    }

    /// The same with another direction of stretch.
    pub(crate) fn stretched_along(&self, direction: Vec3) -> Self {
        Self { direction, ..self.clone() }
    }

    /// Its position if the sensor is `tool` (sensor frame, metres) beside its stated place.
    #[inline]
    pub(crate) fn position_with(&self, tool: Vec3) -> Vec3 {
        self.position + self.session_from_sensor * tool
    }

    /// The observation by another sensor than the session's first one, whose tool centre has an
    /// error of its own.
    pub(crate) fn with_own_tool(mut self) -> Self {
        self.session_from_sensor = Mat3::ZERO;
        self
    }

    /// The observation of a robot with this base.
    pub(crate) fn with_base(mut self, base: Option<Base>) -> Self {
        self.place(self.placement.on_base(base));
        self
    }

    /// Discounts the observation for `moves` moves of the object since, by `motion` each.
    /// Equation R14 of docs/recogniser.md.
    pub(crate) fn discount(&mut self, moves: usize, motion: &Looseness) {
        self.place(self.placement.after(moves, motion));
        self.weight = self.novelty * self.placement.recency();
    }

    fn place(&mut self, placement: Placement) {
        self.placement = placement;
        self.off_object = placement.off_object_density();
    }

    /// Variances from base and motion: of the position (m²) and of the normal (rad²).
    #[inline]
    pub(crate) fn looseness(&self) -> Variances {
        self.placement.variances()
    }

    /// Variances of this observation relative to another one.
    pub(crate) fn looseness_to(&self, other: &Self) -> Variances {
        self.placement.variances_to(&other.placement)
    }

    /// Weight in the evidence of "none of these", which unannounced motion does not reduce.
    pub(crate) fn counts(&self, is_announced: bool) -> f32 {
        if is_announced { self.weight } else { self.novelty }
    }

    /// Loss of score (ln) under every object because the touch is unsteady or loosely placed.
    /// `loose_loss` is [`ScoreScale::loose_loss`](crate::options::ScoreScale::loose_loss).
    pub(crate) fn loss(&self, is_announced: bool, loose_loss: f32) -> f32 {
        self.steadiness.loss() + self.placement.loss(is_announced, loose_loss) + self.point_loss
    }

    /// Score (ln) that a contact without an image lacks at its own place, against a steady press.
    pub(crate) fn expected_loss(&self) -> f32 {
        self.point_loss
            + match self.says {
                Says::All => 0.0,
                Says::Normal => self.steadiness.loss(),
                Says::Position => Steadiness::normal_worth(),
            }
    }

    /// The observation with its weight beside `earlier` ones of an object that moves by `drift`
    /// between any two touches. Equation R2 of docs/recogniser.md.
    pub(crate) fn weighed(mut self, earlier: &[Self], drift: Option<&Looseness>) -> Self {
        let apart = |(index, other): (usize, &Self)| {
            let moves = earlier.len() - index;
            let before = drift.map_or(other.placement, |by| other.placement.after(moves, by));
            let (moved, turned_by) = self.placement.shifting_to(&before);
            let (turned, turned_by) = match (self.says, other.says) {
                (Says::Position, _) | (_, Says::Position) => (0.0, 0.0),
                _ => (NORMAL_REACH * self.normal.distance(other.normal), turned_by),
            };
            let loose = 3.0 * moved + 2.0 * NORMAL_REACH.powi(2) * turned_by;
            self.position.distance(other.position).hypot(turned).hypot(loose.sqrt())
        };
        let is_new = |(index, other): (usize, &Self)| {
            1.0 - other.novelty * (1.0 - apart_by(apart((index, other))))
        };
        self.novelty = earlier.iter().enumerate().map(is_new).product();
        self.weight = self.novelty;
        self
    }

    /// Probability that the touch is far enough from another one for their pair to be a stored one:
    /// 0 where a normal is missing. Part of equation R17a.
    pub(crate) fn pairs_with(&self, other: &Self) -> f32 {
        if [self.says, other.says].contains(&Says::Position) {
            return 0.0;
        }
        apart_by(self.position.distance(other.position))
    }

    /// Appearance likelihood ratio at a patch with this feature, for finding pairs. Equation R7 of
    /// docs/recogniser.md.
    #[inline]
    pub(crate) fn appearance_ratio(&self, other: &StoredFeature) -> f32 {
        ratio(&self.feature, other, self.sharp.softness, self.sharp.density)
    }

    /// [`Self::appearance_ratio`] at each of a `range` of patches, appended to `found`.
    pub(crate) fn appearance_ratios(
        &self,
        of: &Features,
        range: Range<usize>,
        found: &mut Vec<f32>,
    ) {
        of.ratios(&self.feature, range, [self.sharp.softness, self.sharp.density], found);
    }

    /// Appearance likelihood ratio for scoring a pose, with a larger softness. Equation R7 of
    /// docs/recogniser.md.
    #[inline]
    pub(crate) fn appearance_ratio_of_pose(&self, other: &StoredFeature) -> f32 {
        ratio(&self.feature, other, self.soft.softness, self.soft.density)
    }
}

/// What the deviation of a contact's position costs at its own place: ln of the peak of the
/// kernel of R4 without it over that with it. `variance` in m². Part of equation R13.
fn point_loss(variance: f32, scale: &TouchScale) -> f32 {
    let wider = |deviation: f32| (1.0 + variance / (deviation * deviation)).ln();
    0.5 * wider(scale.across) + wider(scale.along)
}

#[cfg(test)]
mod tests {
    use palpate_core::pose::Pose;

    use super::*;
    use crate::test_support::{COMPARISON, places, seen, some_pose};

    #[test]
    fn a_repeated_touch_counts_less() {
        let mut place = places(1, 0).remove(0);
        place.normal = DVec3::Z;
        let first = seen(&place, &Pose::IDENTITY);
        assert!((first.clone().weighed(&[], None).weight - 1.0).abs() < 1e-6);
        let again = |off: DVec3, normal: DVec3| {
            let moved = Touch { position: place.position + off, normal, ..place.clone() };
            seen(&moved, &Pose::IDENTITY).weighed(std::slice::from_ref(&first), None).weight
        };
        assert!(again(DVec3::ZERO, DVec3::Z) < 1e-4, "nothing new");
        // Φ(−1), Φ(0) and Φ(2): 3, 4 and 6 mm.
        assert!((again(DVec3::X * 0.003, DVec3::Z) - 0.159).abs() < 5e-3);
        assert!((again(DVec3::X * 0.004, DVec3::Z) - 0.5).abs() < 1e-4);
        assert!((again(DVec3::X * 0.006, DVec3::Z) - 0.977).abs() < 5e-3);
        // Turned by a right angle: 6 mm · √2 apart.
        assert!((again(DVec3::ZERO, DVec3::X) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_repeated_touch_counts_where_the_object_may_have_moved() {
        let place = places(1, 0).remove(0);
        let first = seen(&place, &Pose::IDENTITY);
        let millimetres = |position: f64| Looseness { position: position * 1e-3, angle: 0.0 };
        let drifted = |earlier: usize, drift: Looseness| {
            first.clone().weighed(&vec![first.clone(); earlier], Some(&drift)).weight
        };
        // √3 · 4/√3 mm: Φ(0).
        let half = 4.0 / 3f64.sqrt();
        assert!((drifted(1, millimetres(half)) - 0.5).abs() < 1e-4);
        // Turned by 4/(6 √2) rad about each axis.
        let turn = Looseness { position: 0.0, angle: 4.0 / (6.0 * 2f64.sqrt()) };
        assert!((drifted(1, turn) - 0.5).abs() < 1e-4);
        // Two earlier touches, one and two moves ago: Φ(0) Φ(4 (√2 − 1)) = 0.5 · 0.951.
        assert!((drifted(2, millimetres(half)) - 0.4756).abs() < 1e-3);
        let rests = first.clone().weighed(std::slice::from_ref(&first), None);
        assert_eq!(drifted(1, millimetres(0.0)).to_bits(), rests.weight.to_bits());
        // Half of that variance by the base of each robot; one base shifts both touches alike.
        let looseness = millimetres(half / 2f64.sqrt());
        let on = |robot| first.clone().with_base(Some(Base { robot, looseness }));
        let beside = |robot| on(1).weighed(&[on(robot)], None).weight;
        assert!((beside(2) - 0.5).abs() < 1e-4 && beside(1) < 1e-4);
    }

    #[test]
    fn a_place_counts_once_however_often_it_is_pressed() {
        let place = Touch { normal: DVec3::Z, ..places(1, 0).remove(0) };
        let counted = |offsets: &[DVec3]| {
            let mut touches: Vec<Observation> = Vec::new();
            for off in offsets {
                let position = place.position + *off;
                let touch = seen(&Touch { position, ..place.clone() }, &Pose::IDENTITY);
                touches.push(touch.weighed(&touches, None));
            }
            touches.iter().map(|touch| touch.weight).sum::<f32>()
        };
        let jitter = |n: u32| DVec3::new(f64::from(n % 5), f64::from(n % 3), 0.0) * 1e-4;
        let often: Vec<DVec3> = (0..50).map(jitter).collect();
        assert!((counted(&often) - 1.0).abs() < 0.01, "{}", counted(&often));
        // A finger that creeps along in steps of 0.5 mm meets a new place about every 2.5 mm.
        let along: Vec<DVec3> = (0..80).map(|n| DVec3::X * 5e-4 * f64::from(n)).collect();
        assert!((12.0..20.0).contains(&counted(&along)), "{}", counted(&along));
    }

    #[test]
    fn a_touch_a_kilometre_away_is_the_same_beside_its_anchor() {
        let pose = some_pose(1);
        let far = Pose::from_parts(pose.rotation, pose.translation + DVec3::splat(1_000.0));
        for place in places(20, 1) {
            let observation = |pose: &Pose, anchor: DVec3| {
                let position = *pose * place.position;
                let touch = Touch { position, ..place.clone() };
                Observation::compared(&touch, anchor, COMPARISON, COMPARISON).position
            };
            let near = observation(&pose, pose.translation);
            let away = observation(&far, far.translation);
            assert!(near.distance(away) < 1e-8, "{near} {away}");
        }
    }
}
