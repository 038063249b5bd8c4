//! Tests of the particle filter against hand-computed weights and a known posterior.

use super::*;
use palpate_core::units::DEG;

const PLANE: PoseRegion = PoseRegion::Planar { center: DVec3::ZERO, half: DVec3::splat(10.0 * MM) };

/// A Gaussian likelihood of object 1 around x = 4 mm, y = −2 mm, 60°; object 0 is less likely
/// by `odds` nats everywhere.
fn bump(odds: f64) -> impl Fn(usize, &Pose) -> f64 + Sync {
    let truth = Pose {
        rotation: DQuat::from_rotation_z(60.0 * DEG),
        translation: DVec3::new(4.0 * MM, -2.0 * MM, 0.0),
    };
    move |object, pose| {
        let moved = pose.distance_to(&truth) / (2.0 * MM);
        let turned = pose.angle_to(&truth) / (15.0 * DEG);
        -0.5 * (moved * moved + turned * turned).min(40.0) - if object == 1 { 0.0 } else { odds }
    }
}

fn run(options: ParticleOptions, readings: usize) -> ParticleFilter {
    let mut filter = ParticleFilter::new(options, PLANE, 2, 5);
    (0..readings).for_each(|_| filter.add(bump(1.0)));
    filter
}

#[test]
fn every_resampling_method_finds_object_and_pose() {
    let literal = ParticleOptions::literal(4_000);
    let systematic = ParticleOptions {
        resampling: Resampling::Systematic,
        resample_below: 0.5,
        injection: Injection::Augmented { slow: 0.05, fast: 0.5 },
        ..literal
    };
    let size =
        Some(KldSize { error: 0.05, quantile: 2.33, edge: 4.0 * MM, angle: 20.0 * DEG, min: 100 });
    let adaptive = ParticleOptions { size, injection: Injection::Share(0.02), ..literal };
    for options in [literal, systematic, adaptive] {
        let filter = run(options, 8);
        let identities = filter.identities();
        assert!((identities.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        // Eight readings of odds e each.
        assert!(identities[1] > 0.97, "{options:?}: {identities:?}");
        let mode = filter.mode(1, 1.0 * MM, 1.0).unwrap();
        let truth = DVec3::new(4.0 * MM, -2.0 * MM, 0.0);
        assert!(mode.translation.distance(truth) < 2.0 * MM, "{options:?}: {mode:?}");
    }
    assert!(run(adaptive, 8).particles().len() < 2_000);
}

#[test]
fn weights_and_effective_number_match_hand_computed_values() {
    // Two objects with likelihoods 3 to 1; the noise changes neither.
    let mut filter = ParticleFilter::new(ParticleOptions::literal(1_000), PLANE, 2, 1);
    let n_first = filter.particles().iter().filter(|p| p.object == 0).count() as f64;
    filter.add(|object, _| if object == 0 { 3.0_f64.ln() } else { 0.0 });
    let expected = 3.0 * n_first / (3.0 * n_first + 1_000.0 - n_first);
    assert!((filter.identities()[0] - expected).abs() < 1e-9);
    let effective = (1_000.0 + 2.0 * n_first).powi(2) / (1_000.0 + 8.0 * n_first);
    assert!((filter.effective() / effective - 1.0).abs() < 1e-9);
}

#[test]
fn systematic_resampling_keeps_whole_shares() {
    let mut stream = Stream::new(1, Purpose::Particles, 0);
    let picked: Vec<usize> =
        pick(&[0.5, 0.0, 0.25, 0.25], 8, Resampling::Systematic, &mut stream).collect();
    assert_eq!(picked, [0, 0, 0, 0, 2, 2, 3, 3]);
}

#[test]
fn multinomial_resampling_follows_the_weights() {
    let mut stream = Stream::new(2, Purpose::Particles, 0);
    let picked = pick(&[0.1, 0.9], 10_000, Resampling::Multinomial, &mut stream);
    let share = picked.filter(|idx| *idx == 1).count() as f64 / 1e4;
    // Deviation 0.003.
    assert!((share - 0.9).abs() < 0.015, "{share}");
}

#[test]
fn noise_turns_about_the_objects_origin() {
    let options = ParticleOptions { translation_noise: 0.0, ..ParticleOptions::literal(500) };
    let mut filter = ParticleFilter::new(options, PLANE, 1, 3);
    let before: Vec<Pose> = filter.particles().iter().map(|p| p.session_from_object).collect();
    filter.add(|_, _| 0.0);
    let mut turned = 0.0;
    for (before, particle) in before.iter().zip(filter.particles()) {
        assert!(before.distance_to(&particle.session_from_object) < 1e-12);
        turned += before.angle_to(&particle.session_from_object).powi(2) / 500.0;
    }
    // Deviation 0.1 rad, its own deviation 0.1/√1000 = 0.003.
    assert!((turned.sqrt() - 0.1).abs() < 0.015, "{}", turned.sqrt());
}

#[test]
fn the_cone_prefers_the_denser_of_two_places() {
    // 30 particles at (0, 0), 20 at (3 mm, 0) of equal weight.
    let mut filter = ParticleFilter::new(ParticleOptions::literal(50), PLANE, 1, 3);
    for (idx, particle) in filter.particles.iter_mut().enumerate() {
        let x = if idx < 30 { 0.0 } else { 3.0 * MM };
        particle.session_from_object = Pose { translation: DVec3::X * x, ..Pose::IDENTITY };
    }
    let mode = filter.mode(0, 1.0 * MM, 1.0).unwrap();
    assert!(mode.translation.length() < 1e-12);
    assert!(filter.mode(1, 1.0 * MM, 1.0).is_none());
}

#[test]
fn solid_regions_bound_translation_and_angle() {
    let center = Pose::from_parts(DQuat::from_rotation_x(1.0), DVec3::X);
    let region = PoseRegion::Solid { center, half: DVec3::splat(5.0 * MM), angle_max: 30.0 * DEG };
    let filter = ParticleFilter::new(ParticleOptions::literal(200), region, 3, 7);
    for particle in filter.particles() {
        let off = center.inverse() * particle.session_from_object;
        assert!(off.translation.abs().max_element() <= 5.0 * MM + 1e-12);
        assert!(off.angle_to(&Pose::IDENTITY) <= 30.0 * DEG + 1e-9);
    }
    assert!((0..3).all(|object| filter.particles().iter().any(|p| p.object == object)));
}

#[test]
fn foreign_hypotheses_replace_the_lightest_particles() {
    // Weights 1, 2, 3, 4 tenths; two foreign ones replace the first two with the mean, 0.25 each:
    // 0.25 + 0.25 + 0.3 + 0.4 = 1.2.
    let mut filter = ParticleFilter::new(ParticleOptions::literal(4), PLANE, 3, 3);
    for (idx, particle) in filter.particles.iter_mut().enumerate() {
        particle.object = 0;
        particle.log_weight = ((idx + 1) as f64 / 10.0).ln();
    }
    let pose = Pose { translation: DVec3::X * MM, ..Pose::IDENTITY };
    filter.replace_lightest(&[(1, pose), (2, pose)]);
    let identities = filter.identities();
    let expected = [0.7 / 1.2, 0.25 / 1.2, 0.25 / 1.2];
    assert!(identities.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{identities:?}");
    assert!(filter.particles()[0].session_from_object.distance_to(&pose) < 1e-15);
}
