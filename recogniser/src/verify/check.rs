//! One check of every fast path against the reference.

use super::reference::Session;

/// Largest differences allowed between a fast path and the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Largest difference (ln) of one session, per touch.
    pub each: f64,
    /// Largest difference (ln) of the mean over all sessions, per touch: a bias.
    pub mean: f64,
}

impl Tolerance {
    /// Single precision, and elongations and variances in 16 bits: sums over a few patches agree
    /// to a thousandth.
    pub const ROUNDING: Self = Self { each: 1e-3, mean: 1e-3 };

    /// With stretched contacts: ln I₀ is approximated to 0.08 (equation R6).
    pub const STRETCH: Self = Self { each: 0.1, mean: 0.1 };
}

/// Compares ln evidence of a fast path with that of the reference on named sessions.
///
/// # Panics
/// When they differ by more than the tolerance.
#[track_caller]
pub fn check_recogniser(
    fast: impl Fn(&Session<'_>) -> f64,
    reference: impl Fn(&Session<'_>) -> f64,
    sessions: &[(&str, Session<'_>)],
    tolerance: Tolerance,
) {
    let mut sum = 0.0;
    for (name, session) in sessions {
        let (found, expected) = (fast(session), reference(session));
        let off = (found - expected) / session.touches.len().max(1) as f64;
        assert!(off.abs() <= tolerance.each, "{name}: {found}, the reference has {expected}");
        sum += off;
    }
    let mean = sum / sessions.len().max(1) as f64;
    assert!(mean.abs() <= tolerance.mean, "in the mean {mean} a touch off the reference");
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use palpate_core::log_prob::log_sum_exp;
    use palpate_core::pose::Pose;
    use palpate_core::reading::Looseness;
    use palpate_core::rng::{Purpose, Stream};
    use palpate_core::stop::Stop;

    use super::super::density::Kernel;
    use super::super::evidence::{Evidence, Known};
    use super::super::motion_prior::MotionPrior;
    use super::super::reference::{evidence, pair_evidence};
    use super::*;
    use crate::model::SurfaceMap;
    use crate::model::agreement::stored;
    use crate::model::appearance::AppearanceSpace;
    use crate::observe::inverse_pose::InversePose;
    use crate::observe::observation::Observation;
    use crate::observe::touch::{PointDeviations, Touch};
    use crate::options::SurfaceOptions;
    use crate::propose::effort::Effort;
    use crate::propose::proposals::propose;
    use crate::test_support::{inverse, map_of, places, some_pose, space};

    /// Six patches represent all of a map, by a Gaussian about the voxel instead of the touch
    /// (equation R8); the largest difference of 180 sessions was 0.17.
    const THINNED: Tolerance = Tolerance { each: 0.25, mean: 0.1 };

    /// The same when no two patches look alike: an omitted patch counts with the appearance of
    /// the one that represents it. The largest difference of 120 sessions was 0.57.
    const THINNED_UNLIKE: Tolerance = Tolerance { each: 0.6, mean: 0.2 };

    /// The same on maps of few patches, whose continued surfaces meet a touch by chance.
    const THINNED_FEW: Tolerance = Tolerance { each: 1.0, mean: 0.3 };

    /// The observations of a session.
    fn observed(session: &Session<'_>) -> Vec<Observation> {
        let mut touches: Vec<Observation> = Vec::new();
        for touch in session.touches {
            let scale = &session.options.scale;
            let new = Observation::new(touch, DVec3::ZERO, session.space, scale);
            touches.push(new.weighed(&touches, session.options.motion.as_ref()));
        }
        if let Some(drift) = &session.options.motion {
            let n = touches.len();
            touches.iter_mut().enumerate().for_each(|(i, touch)| touch.discount(n - 1 - i, drift));
        }
        touches
    }

    /// ln L_o of equation R17 for k = 3 by the fast path.
    fn fast(session: &Session<'_>) -> f64 {
        let (kernel, touches) = (Kernel::new(session.options), observed(session));
        let (options, stop) = (session.options, &Stop::never());
        let (kernel, touches) = (&kernel, touches.as_slice());
        let fast = Evidence { maps: &[], kernel, touches, spaces: &[], options, stop };
        let known = Known { map: session.map, prior: &MotionPrior::default() };
        let tool = session.tool.as_vec3();
        let score = |pose| {
            let pose = InversePose { tool, ..inverse(pose) };
            f64::from(fast.score(known, &pose, f32::NEG_INFINITY).unwrap())
        };
        let lost = touches.iter().map(|touch| f64::from(kernel.floor_of(touch))).sum();
        log_sum_exp(session.poses.iter().map(score).chain([lost]))
    }

    /// ln P_o of equation R10 by the fast path.
    fn fast_pair(session: &Session<'_>) -> f64 {
        let touches = observed(session);
        let options = SurfaceOptions { appearance_min: 0.0, ..*session.options };
        let effort = Effort::new(&options, None, 2);
        let ratios = [0, 1].map(|n| effort.appearance_ratios(session.map, &touches[n]));
        let (pair, ratios) = ([&touches[0], &touches[1]], [&*ratios[0], &*ratios[1]]);
        let found = propose(session.map, pair, ratios, effort, &options).unwrap();
        f64::from(found.pair.evidence.ln())
    }

    /// Places with random features, evenness and elongation up to `elongation`.
    fn varied(places: Vec<Touch>, elongation: f64, seed: u64) -> Vec<Touch> {
        let mut stream = Stream::new(seed, Purpose::Sampling, 0);
        let vary = |place: Touch| Touch {
            feature: [(); 8].map(|()| stream.normal() as f32),
            evenness: stream.uniform(0.3, 0.8),
            elongation: elongation * stream.uniform(0.0, 1.0),
            ..place
        };
        places.into_iter().map(vary).collect()
    }

    fn map(places: &[Touch]) -> SurfaceMap {
        let plain = map_of(places);
        let patches = plain.patches().iter().zip(places);
        let patches = patches.map(|(patch, place)| crate::model::SurfacePatch {
            feature: stored(&place.feature),
            ..*patch
        });
        SurfaceMap::new(DVec3::ZERO, patches.collect(), plain.layout())
    }

    /// A space whose features vary.
    fn varied_space() -> AppearanceSpace {
        let plain = space();
        let anywhere = varied(places(50, 9), 0.0, 9);
        let anywhere = anywhere.iter().map(|place| stored(&place.feature)).collect();
        AppearanceSpace::new(*plain.grid(), plain.projection().clone(), anywhere)
    }

    /// The touches of an object in a pose, each with a small error of its place.
    fn touched(places: &[Touch], pose: &Pose, seed: u64) -> Vec<Touch> {
        let mut stream = Stream::new(seed, Purpose::Perturbation, 0);
        let touch = |place: &Touch| {
            let off = 0.000_4 * stream.direction();
            let normal = (place.normal + 0.1 * stream.direction()).normalize();
            Touch {
                position: *pose * (place.position + off),
                normal: pose.turn(normal),
                direction: pose.turn(place.direction),
                sensor_x: pose.turn(place.sensor_x),
                ..place.clone()
            }
        };
        places.iter().map(touch).collect()
    }

    /// Places within 2 mm of each other, so that a voxel lists them all.
    fn cluster(n: usize, elongation: f64) -> Vec<Touch> {
        let mut stream = Stream::new(3, Purpose::Shape, n as u64);
        let mut place = |place: Touch| {
            let normal = (DVec3::Z + 0.3 * stream.direction()).normalize();
            let direction = normal.any_orthonormal_vector();
            let position = 0.001 * stream.direction();
            Touch { position, normal, direction, sensor_x: direction, ..place }
        };
        varied(places(n, 0).into_iter().map(&mut place).collect(), elongation, 4)
    }

    /// The evidence of few patches, of which a voxel lists all.
    fn check_cluster(elongation: f64, tolerance: Tolerance) {
        let (space, pose) = (varied_space(), some_pose(2));
        let poses = [pose, some_pose(3)];
        for drift in [None, Some(Looseness { position: 0.002, angle: 0.05 })] {
            let options = SurfaceOptions { motion: drift, ..SurfaceOptions::default() };
            for n in [1, 3, 6] {
                let places = cluster(n, elongation);
                let (map, touches) = (map(&places), touched(&places, &pose, 5));
                let (space, options) = (&space, &options);
                for tool in [DVec3::ZERO, DVec3::new(0.001, -0.000_4, 0.000_7)] {
                    let (map, touches, poses) = (&map, touches.as_slice(), &poses);
                    let session = Session { map, space, options, touches, poses, tool };
                    check_recogniser(fast, evidence, &[("cluster", session)], tolerance);
                }
            }
        }
    }

    #[test]
    fn few_patches_score_as_in_the_reference() {
        check_cluster(0.0, Tolerance::ROUNDING);
    }

    #[test]
    fn contacts_without_an_image_score_as_in_the_reference() {
        let (space, options, pose) = (varied_space(), SurfaceOptions::default(), some_pose(2));
        let (places, poses) = (cluster(6, 0.0), [pose, some_pose(3)]);
        let map = map(&places);
        let session = |normals: [Option<f64>; 6]| -> Vec<Touch> {
            let felt = touched(&places, &pose, 5).into_iter().zip(normals).enumerate();
            let contact = |(index, (touch, normal)): (usize, (Touch, Option<f64>))| Touch {
                normal: normal.map_or(DVec3::ZERO, |_| touch.normal),
                elongation: 0.0,
                evenness: 1.0,
                // Every third is a press with an image.
                point: (index % 3 > 0).then_some(PointDeviations { position: 0.002, normal }),
                looseness: 0.001 * f64::from(u8::from(index % 4 == 0)),
                ..touch
            };
            felt.map(contact).collect()
        };
        let mixed = [Some(0.2), None, Some(0.1), Some(0.3), Some(0.2), None];
        for normals in [[Some(0.2); 6], mixed] {
            let touches = session(normals);
            let (map, space, options) = (&map, &space, &options);
            let (touches, poses, tool) = (touches.as_slice(), &poses, DVec3::ZERO);
            let session = Session { map, space, options, touches, poses, tool };
            check_recogniser(fast, evidence, &[("contacts", session)], Tolerance::ROUNDING);
        }
    }

    #[test]
    fn stretched_contacts_score_as_in_the_reference() {
        check_cluster(0.8, Tolerance::STRETCH);
    }

    /// Compares sessions of six touches on ellipsoids of these numbers of patches.
    fn check_thinned(
        patches: &[usize],
        n_sessions: u64,
        appearance: impl Fn(Touch) -> Touch,
        tolerance: Tolerance,
    ) {
        let (space, options, pose) = (varied_space(), SurfaceOptions::default(), some_pose(2));
        let poses = [pose];
        let varied = |n, index, seed| -> Vec<Touch> {
            varied(places(n, index), 0.0, seed).into_iter().map(&appearance).collect()
        };
        for map in patches.iter().map(|n| map(&varied(*n, 1, 6))) {
            let readings: Vec<Vec<Touch>> =
                (0..n_sessions).map(|n| touched(&varied(6, 20 + n, n), &pose, n)).collect();
            let session = |touches| Session {
                map: &map,
                space: &space,
                options: &options,
                touches,
                poses: &poses,
                tool: DVec3::ZERO,
            };
            let sessions: Vec<(&str, Session<'_>)> =
                readings.iter().map(|touches| ("ellipsoid", session(touches))).collect();
            check_recogniser(fast, evidence, &sessions, tolerance);
        }
    }

    #[test]
    fn thinned_maps_score_as_in_the_reference() {
        let alike = |place| Touch { feature: [0.0; 8], ..place };
        check_thinned(&[250, 1_000], 16, alike, THINNED);
    }

    #[test]
    fn thinned_maps_of_unlike_patches_score_near_the_reference() {
        check_thinned(&[250, 1_000], 16, |place| place, THINNED_UNLIKE);
    }

    #[test]
    fn thinned_maps_of_few_patches_score_near_the_reference() {
        check_thinned(&[60], 8, |place| place, THINNED_FEW);
    }

    #[test]
    fn pairs_weigh_as_in_the_reference() {
        let (space, options, pose) = (varied_space(), SurfaceOptions::default(), some_pose(2));
        let places = varied(places(120, 1), 0.0, 6);
        let map = map(&places);
        let pairs: Vec<Vec<Touch>> = (0..12)
            .map(|n| touched(&[places[n].clone(), places[n + 40].clone()], &pose, n as u64))
            .collect();
        let sessions: Vec<(&str, Session<'_>)> = pairs
            .iter()
            .map(|touches| {
                let (map, space, options) = (&map, &space, &options);
                let (poses, tool) = (&[], DVec3::ZERO);
                ("pair", Session { map, space, options, touches, poses, tool })
            })
            .collect();
        let reference = |session: &Session<'_>| pair_evidence(session).unwrap().ln();
        check_recogniser(fast_pair, reference, &sessions, Tolerance::ROUNDING);
    }

    #[test]
    #[should_panic(expected = "the reference has")]
    fn a_wrong_normal_density_is_noticed() {
        let (space, pose) = (varied_space(), some_pose(2));
        let places = cluster(3, 0.0);
        let (map, touches) = (map(&places), touched(&places, &pose, 5));
        let options = SurfaceOptions::default();
        let poses = [pose];
        let session = Session {
            map: &map,
            space: &space,
            options: &options,
            touches: &touches,
            poses: &poses,
            tool: DVec3::ZERO,
        };
        // As if the fast path assumed a deviation of normals larger by a half.
        let mut wrong = options;
        wrong.scale.normal *= 1.5;
        let fast = |session: &Session<'_>| fast(&Session { options: &wrong, ..*session });
        check_recogniser(fast, evidence, &[("cluster", session)], Tolerance::ROUNDING);
    }
}
