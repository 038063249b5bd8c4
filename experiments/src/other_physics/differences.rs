//! Differences between the touches of two simulators: at the same poses, and in the poses at
//! which the sensor comes to rest.

use glam::DVec3;
use palpate_core::contact::CONTACT_SHARE;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::{DEG, KPA, MM};
use palpate_recogniser::model::AppearanceSpace;
use palpate_recogniser::observe::touch::observe_touch;
use palpate_sim::mesh::Mesh;
use rayon::prelude::*;
use serde::Serialize;

use crate::objects::TestObject;
use crate::report::Report;
use crate::statistics::{mean, median, quantile};

/// Distribution of one aspect of touches.
#[derive(Serialize)]
struct Spread {
    touches: usize,
    mean: f64,
    median: f64,
    p90: f64,
}

impl Spread {
    fn of(values: &[f64]) -> Self {
        let (touches, mean, median) = (values.len(), mean(values), median(values));
        Self { touches, mean, median, p90: quantile(values, 0.9) }
    }
}

/// Adds rows and figures of the differences between `other` and `own` readings at the same poses.
pub(super) fn report(
    report: &mut Report,
    name: &str,
    own: &[Vec<Reading>],
    other: &[Vec<Reading>],
    sensor: &SensorDescription,
    space: &AppearanceSpace,
) {
    let mut aspects: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::new());
    let mut lost = 0;
    for (own, other) in own.iter().flatten().zip(other.iter().flatten()) {
        let Some(a) = observe_touch(own, sensor, space) else { continue };
        let Some(b) = observe_touch(other, sensor, space) else {
            lost += 1;
            continue;
        };
        let distance = a.feature.iter().zip(&b.feature).map(|(a, b)| f64::from(a - b).powi(2));
        let peak = |reading: &Reading| reading.image().max();
        let found = [
            a.position.distance(b.position) / MM,
            a.direction.dot(b.direction).abs().min(1.0).acos() / DEG,
            b.elongation - a.elongation,
            distance.sum::<f64>().sqrt(),
            (peak(other) - peak(own)) / KPA,
            area(other) as f64 - area(own) as f64,
        ];
        aspects.iter_mut().zip(found).for_each(|(all, one)| all.push(one));
    }
    let names = [
        "contact_shift_mm",
        "stretch_turn_deg",
        "elongation_change",
        "appearance_distance",
        "peak_change_kpa",
        "contact_taxels_change",
    ];
    for (aspect, values) in names.into_iter().zip(&aspects) {
        report.labelled(
            &[("covering", name), ("at", "the point spread's poses"), ("aspect", aspect)],
            Spread::of(values),
        );
        report.summarise(&format!("{name}_{aspect}_median"), median(values));
    }
    report.summarise(&format!("{name}_touches_lost"), f64::from(lost));
}

/// Number of taxels in contact: those with at least half of the maximum pressure.
fn area(reading: &Reading) -> usize {
    let image = reading.image();
    let bar = CONTACT_SHARE * image.max();
    image.pressures.iter().filter(|pressure| **pressure >= bar).count()
}

/// Adds rows and figures of the height of touches above the mesh at the sensor's resting poses.
pub(super) fn report_heights(
    report: &mut Report,
    name: &str,
    objects: &[TestObject],
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
    space: &AppearanceSpace,
) {
    let heights = |(object, readings): (&TestObject, &Vec<Reading>)| -> Vec<[f64; 2]> {
        let touches = readings.iter().filter_map(|r| observe_touch(r, sensor, space));
        touches.map(|touch| above(&object.mesh, touch.position, touch.normal)).collect()
    };
    let all: Vec<[f64; 2]> = objects.par_iter().zip(readings).flat_map_iter(heights).collect();
    for (at, aspect, unit) in [(0, "height_mm", MM), (1, "normal_error_deg", DEG)] {
        let values: Vec<f64> = all.iter().map(|pair| pair[at] / unit).collect();
        report.labelled(
            &[("covering", name), ("at", "its own poses"), ("aspect", aspect)],
            Spread::of(&values),
        );
        report.summarise(&format!("{name}_{aspect}_mean"), mean(&values));
    }
}

/// Height of a point above the nearest face of a mesh whose normal is within 60° of `normal`
/// (along the face's normal, metres), and the angle between the two normals (rad).
fn above(mesh: &Mesh, point: DVec3, normal: DVec3) -> [f64; 2] {
    let mut best = (f64::INFINITY, [0.0; 2]);
    for triangle in 0..mesh.triangles().len() {
        let corners = mesh.corners(triangle);
        let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        let cosine = face.dot(normal);
        if cosine < 0.5 {
            continue;
        }
        let distance = point.distance_squared(nearest_in(corners, point));
        if distance < best.0 {
            best = (distance, [face.dot(point - corners[0]), cosine.min(1.0).acos()]);
        }
    }
    best.1
}

/// The point of a triangle that is nearest (Ericson, 2004, section 5.1.5).
fn nearest_in([a, b, c]: [DVec3; 3], point: DVec3) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let (vc, vb, va) = (d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let scale = 1.0 / (va + vb + vc);
    a + ab * (vb * scale) + ac * (vc * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_is_a_corner_an_edge_or_inside() {
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let near = |x, y, z| nearest_in(triangle, DVec3::new(x, y, z));
        assert_eq!(near(-1.0, -2.0, 0.5), DVec3::ZERO);
        assert_eq!(near(2.0, -1.0, 0.0), DVec3::X);
        assert_eq!(near(-1.0, 3.0, 0.0), DVec3::Y);
        assert!(near(0.5, -1.0, 1.0).distance(DVec3::new(0.5, 0.0, 0.0)) < 1e-12);
        assert!(near(1.0, 1.0, 0.0).distance(DVec3::new(0.5, 0.5, 0.0)) < 1e-12);
        assert!(near(0.25, 0.25, -3.0).distance(DVec3::new(0.25, 0.25, 0.0)) < 1e-12);
    }

    #[test]
    fn height_above_a_face_ignores_faces_behind() {
        let mesh = palpate_sim::shapes::example("mug").unwrap();
        let corners = mesh.corners(0);
        let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let [height, angle] = above(&mesh, middle - 0.1 * MM * face, face);
        assert!((height + 0.1 * MM).abs() < 0.02 * MM, "{height}");
        assert!(angle < 10.0 * DEG, "{angle}");
    }
}
