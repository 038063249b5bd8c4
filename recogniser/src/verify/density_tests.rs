//! Tests that neither the density of training nor the size gives an object an advantage.

use glam::{DVec3, Quat, Vec3};

use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;

use super::density::Kernel;
use crate::model::thinning::farthest_first;
use crate::observe::inverse_pose::InversePose;
use crate::observe::touch::Touch;
use crate::options::SurfaceOptions;
use crate::test_support::{map_of, places, seen};

/// Places at random on the two faces of a plate of `side` millimetres, the second face
/// `thick` mm below the first.
fn plate(n: usize, side: f64, thick: f64, index: u64) -> Vec<Touch> {
    let mut stream = Stream::new(8, Purpose::Shape, index);
    let half = 0.5 * side * MM;
    let touch = |n: usize| {
        let (up, z) = if n.is_multiple_of(2) { (1.0, 0.0) } else { (-1.0, -thick * MM) };
        Touch {
            position: DVec3::new(stream.uniform(-half, half), stream.uniform(-half, half), z),
            normal: DVec3::Z * up,
            direction: DVec3::X,
            ..places(1, 0).remove(0)
        }
    };
    (0..n).map(touch).collect()
}

/// Mean excess (ln) of the score of touches on a map over that of touches spread uniformly over
/// a surface of this `area` (mm²).
fn excess(map: &[Touch], touches: &[Touch], area: f64) -> f64 {
    let options = SurfaceOptions::default();
    let kernel = Kernel::new(&options);
    let map = map_of(map);
    let pose = InversePose::new(Quat::IDENTITY, Vec3::ZERO);
    let scale = &options.scale;
    let across = 1.0 / (std::f32::consts::TAU.sqrt() * scale.across);
    // On a plane the scatter of normals has its minimum, 0.05 rad.
    let facing = 0.95 * 2.0 / (0.002_5 + scale.normal.powi(2)) + 0.05 * 3.0;
    let even = 0.99 * scale.workspace / (area * MM * MM) as f32 * across * facing;
    let score = |touch: &Touch| kernel.score(&map, &pose, &seen(touch, &Pose::IDENTITY));
    let mean = touches.iter().map(score).sum::<f32>() / touches.len() as f32;
    f64::from(mean - even.ln())
}

#[test]
fn density_does_not_depend_on_the_number_of_training_touches() {
    // Areas of both faces in mm², and numbers of touches: from one in 200 mm² to one per mm².
    let plates = [(20_000.0, 100), (20_000.0, 1_000), (3_000.0, 250), (3_000.0, 1_000)];
    for (area, n) in plates.into_iter().chain([(2_000.0, 2_000)]) {
        let side = f64::sqrt(0.5 * area);
        for thick in [30.0, 2.0] {
            let map = plate(n, side, thick, 0);
            // Away from the rim.
            let touches = plate(200, 0.3 * side, thick, 1);
            let excess = excess(&map, &touches, area);
            assert!(excess.abs() < 0.25, "{area} mm², {n} touches, {thick} mm: {excess}");
        }
    }
}

/// The mean score of touches of the ellipsoid on a map of `n` others, thinned to a thousand as
/// in training: at the true pose, each with an error of about a third of a millimetre and a
/// tenth of a radian.
fn score_of_training(n: usize) -> f32 {
    let kernel = Kernel::new(&SurfaceOptions::default());
    let disturbed = |n: usize, index: u64| -> Vec<Touch> {
        let mut stream = Stream::new(9, Purpose::Shape, index);
        let place = |place: Touch| {
            let off = 0.3 * MM * stream.direction();
            let normal = (place.normal + 0.1 * stream.direction()).normalize();
            Touch { position: place.position + off, normal, ..place }
        };
        places(n, index).into_iter().map(place).collect()
    };
    let trained = disturbed(n, 1);
    let found: Vec<(Vec3, Vec3)> =
        trained.iter().map(|t| (t.position.as_vec3(), t.normal.as_vec3())).collect();
    let kept = farthest_first(&found, 1_000);
    let map = map_of(&kept.into_iter().map(|index| trained[index].clone()).collect::<Vec<_>>());
    let pose = InversePose::new(Quat::IDENTITY, Vec3::ZERO);
    let touches = disturbed(400, 2);
    let score = |touch: &Touch| kernel.score(&map, &pose, &seen(touch, &Pose::IDENTITY));
    touches.iter().map(score).sum::<f32>() / touches.len() as f32
}

#[test]
fn training_an_object_better_hardly_raises_its_scores() {
    let [few, some, many] = [200, 600, 2_000].map(score_of_training);
    // The remaining difference is the better knowledge of the surface between more touches; for
    // ten touches it is half the cost of one touch in a wrong place.
    assert!((few - some).abs() < 0.4 && (some - many).abs() < 0.4, "{few} {some} {many}");
    assert!((few - many).abs() < 0.5, "{few} {many}");
}
