//! Tests of the rig: frames, noise, and the accuracy of the contact classifier.

use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, KPA, MM};

use super::*;
use crate::letters::{Font, Letter};

const ID: SensorId = SensorId(1);
const VOWELS: [char; 5] = ['A', 'E', 'I', 'O', 'U'];

fn rig(noise: RigNoise, seed: u64) -> Rig {
    Rig::new(ID, &rig_sensor(), noise, seed)
}

/// The classes of equation 3.3: below 2 kPa is noise, and below three tenths of the press's
/// largest value may be blur. `Some(true)` is contact, `None` unknown.
fn classified(pressures: &[f64]) -> Vec<Option<bool>> {
    let largest = pressures.iter().copied().fold(0.0, f64::max);
    pressures
        .iter()
        .map(|pressure| {
            if largest < 2.0 * KPA || *pressure < 0.3 * largest {
                Some(false)
            } else if *pressure > 2.0 * KPA {
                Some(true)
            } else {
                None
            }
        })
        .collect()
}

/// Whether any of the letter lies in the 2 mm cell of each taxel, at the planned pose.
fn truth(rig: &Rig, letter: &Letter, at: PlanarPose) -> Vec<bool> {
    let pose = rig.object_from_sensor(at);
    let n = 8;
    let along = |index: i32| (f64::from(index) / f64::from(n - 1) - 0.5) * 2.0 * MM;
    rig.centers
        .iter()
        .map(|(x, y)| {
            (0..n * n).any(|point| {
                let in_sensor = glam::DVec3::new(x + along(point % n), y + along(point / n), 0.0);
                let in_letter = pose * in_sensor;
                letter.contains(in_letter.x, in_letter.y)
            })
        })
        .collect()
}

#[test]
fn the_classifier_is_right_nine_times_out_of_ten() {
    let font = Font::built_in();
    for seed in 1..=5 {
        let rig = rig(RigNoise::physical(), seed);
        let (mut right, mut known, mut n, mut saturated) = (0, 0, 0, 0);
        for symbol in VOWELS {
            let letter = font.letter(symbol).unwrap();
            for (reading, at) in rig.session(&rig.field(letter), 0).iter().zip(plan()) {
                let pressures = &reading.image().pressures;
                saturated += pressures.iter().filter(|p| **p >= 20.0 * KPA).count();
                for (class, covered) in
                    classified(pressures).into_iter().zip(truth(&rig, letter, at))
                {
                    n += 1;
                    known += usize::from(class.is_some());
                    right += usize::from(class == Some(covered));
                }
            }
        }
        let share = right as f64 / known as f64;
        println!(
            "seed {seed}: right {share:.4} of {:.4} known, saturated {:.4}",
            known as f64 / n as f64,
            saturated as f64 / n as f64
        );
        assert!((0.86..0.94).contains(&share), "seed {seed}: {share}");
    }
}

#[test]
fn equal_sessions_are_equal_and_repetitions_differ() {
    let font = Font::built_in();
    let rig = rig(RigNoise::harsh(), 4);
    let field = rig.field(font.letter('E').unwrap());
    assert_eq!(rig.session(&field, 0), rig.session(&field, 0));
    assert_ne!(rig.session(&field, 0), rig.session(&field, 1));
    assert_eq!(rig.session(&field, 0).len(), 192);
}

#[test]
fn a_seed_gives_equal_gains_under_any_covering() {
    let thick = SensorDescription::digitacts_6x6();
    let covered = Rig::new(ID, &thick, RigNoise::physical(), 9);
    assert_eq!(covered.gains(), rig(RigNoise::physical(), 9).gains());
    assert_ne!(covered.gains(), rig(RigNoise::physical(), 10).gains());
}

#[test]
fn a_press_shows_the_letter_at_the_planned_pose() {
    // The foot of an L is at the lower right. With the sensor's x along the letter's, its y
    // runs down the page: low y of the letter is a high row of the image.
    let font = Font::built_in();
    let rig = rig(RigNoise::none(), 1);
    let field = rig.field(font.letter('L').unwrap());
    let mut stream = Stream::new(1, Purpose::RigNoise, 0);
    let mut press = |x: f64, y: f64, angle: f64| {
        let at = PlanarPose { x: x * MM, y: y * MM, angle: angle * DEG };
        rig.press(&field, at, &mut stream).image().clone()
    };
    let strongest = |image: &palpate_core::reading::TactileImage| {
        let by_pressure =
            |a: &usize, b: &usize| image.pressures[*a].total_cmp(&image.pressures[*b]);
        (0..36).max_by(by_pressure).map(|taxel| (taxel / 6, taxel % 6)).unwrap()
    };
    // 5 mm right of the middle and 5 mm above the foot: the foot is in the last rows.
    let (row, _) = strongest(&press(4.0, -5.5, 0.0));
    assert_eq!(row, 5);
    // Turned by a quarter, the sensor's y is the letter's x, its x the letter's y: the foot,
    // at low y, is in the first columns.
    let (_, col) = strongest(&press(4.0, -5.5, 90.0));
    assert_eq!(col, 0);
}

#[test]
fn a_wide_face_reads_sixteen_kilopascals() {
    // Over the middle of a bar far wider than the blur the sensor reads 0.8 of 20 kPa.
    let thick = SensorDescription::digitacts_6x6();
    for sensor in [rig_sensor(), thick] {
        let rig = Rig::new(ID, &sensor, RigNoise::none(), 1);
        let full = sensor.parameters().force_curve.pressure(rig.indentation());
        assert!((full - 16.0 * KPA).abs() < 1e-6, "{full}");
    }
}
