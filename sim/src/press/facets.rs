//! Presses of a layout of taxels: every point of the covering is pressed along its own normal.
//!
//! The covering is sampled about each taxel, out to half a pitch, to the border with its
//! neighbours, and beyond the outermost taxels as far as the covering reaches; on a curved skin the
//! samples follow the curvature. A sample's depth is how far the object reaches behind it along its
//! normal. Depths are spread over the straight distance between samples and taxels, with the edge
//! of the covering as in `imaging`. Source: section 2.5.1, for taxels that do not lie on a grid.

use std::ops::Range;

use glam::{DQuat, DVec2, DVec3};
use palpate_core::pose::Pose;
use palpate_core::sensor::{CoveringEdge, Layout, SensorDescription, SpreadKernel, Taxel};
use palpate_core::units::MM;

use super::HOUSING_DEPTH;
use super::bvh::Bvh;

/// Largest distance between samples, as a share of the pitch and of the spread; never below
/// [`STEP_MIN`]. Chosen: a ball's image on a flat array is then within 5 % of that of `imaging`.
const STEP: (f64, f64) = (0.5, 0.6);

/// Smallest distance between samples, metres. Chosen: bounds the work for narrow spreads.
const STEP_MIN: f64 = 0.5 * MM;

/// Standard deviations of the spread within which a sample acts on a taxel. Chosen: a Gaussian is
/// e^−8 of its peak there.
const REACH: f64 = 4.0;

/// Covering drawn beyond the outermost taxels when it has no edge: standard deviations of the
/// spread, as in `PressConfig::for_sensor`.
const BEYOND: f64 = 2.3;

/// How far behind a sample the object is looked for, in thicknesses of the covering. Chosen: beyond
/// the deepest press, and within a finger.
const BEHIND: f64 = 1.5;

/// Largest extent of the covering beyond the outermost taxels, in pitches. Chosen: bounds the work.
const BEYOND_MAX: f64 = 8.0;

/// A sample of the covering.
#[derive(Clone, Copy, Debug)]
struct Sample {
    position: DVec3,
    normal: DVec3,
    /// Whether it lies on a taxel's own area, and not on covering beyond the array.
    on_array: bool,
}

/// The samples about one taxel, and a ball that holds them.
#[derive(Clone, Debug)]
struct Facet {
    range: Range<usize>,
    center: DVec3,
    radius: f64,
}

/// The sampled covering, and the effect of each sample on each taxel.
#[derive(Clone, Debug)]
pub(super) struct Facets {
    samples: Vec<Sample>,
    facets: Vec<Facet>,
    /// For each taxel the samples that act on it, with their weights.
    weights: Vec<Vec<(u32, f64)>>,
    thickness: f64,
}

impl Facets {
    pub(super) fn new(sensor: &SensorDescription, layout: &Layout) -> Self {
        let parameters = sensor.parameters();
        let pitch = layout.grid().pitch;
        let step = (STEP.0 * pitch).min(STEP.1 * parameters.point_spread).max(STEP_MIN);
        // A whole number of samples a pitch, so that none lies on the border of two taxels.
        let step = pitch / (pitch / step).ceil();
        let beyond = parameters.coupling.margin.unwrap_or(BEYOND * parameters.point_spread);
        let (samples, facets) = samples(layout, step, beyond.min(BEYOND_MAX * pitch));
        let weights = weights(sensor, layout, &samples, step);
        Self { samples, facets, weights, thickness: parameters.covering_thickness }
    }

    /// The height of the object's nearest point above the array along +z, metres; infinite when
    /// there is none within `reach`.
    pub(super) fn lowest(&self, bvh: &Bvh, object_from_sensor: Pose, reach: f64) -> f64 {
        let ahead = object_from_sensor.turn(DVec3::Z);
        let height = |sample: &Sample| {
            let back = object_from_sensor * sample.position - HOUSING_DEPTH * ahead;
            bvh.first_hit(back, ahead, HOUSING_DEPTH + reach).map(|far| far - HOUSING_DEPTH)
        };
        let on_array = self.samples.iter().filter(|sample| sample.on_array);
        on_array.filter_map(height).fold(f64::INFINITY, f64::min)
    }

    /// Blurred displacements of the taxels, metres.
    pub(super) fn displacements(&self, bvh: &Bvh, object_from_sensor: Pose) -> Vec<f64> {
        let behind = (BEHIND * self.thickness).min(HOUSING_DEPTH);
        let depth = |sample: &Sample| {
            let outwards = object_from_sensor.turn(sample.normal);
            let back = object_from_sensor * sample.position - behind * outwards;
            let far = bvh.first_hit(back, outwards, behind);
            far.map_or(0.0, |far| (behind - far).clamp(0.0, self.thickness))
        };
        let mut depths = vec![0.0; self.samples.len()];
        for facet in &self.facets {
            let center = object_from_sensor * facet.center;
            if bvh.is_near_segment(center, center, facet.radius + behind) {
                for at in facet.range.clone() {
                    depths[at] = depth(&self.samples[at]);
                }
            }
        }
        let taxel = |weights: &Vec<(u32, f64)>| {
            weights.iter().map(|(sample, weight)| weight * depths[*sample as usize]).sum()
        };
        self.weights.iter().map(taxel).collect()
    }
}

/// Samples of a covering that reaches `beyond` metres further than half a pitch from its taxels.
fn samples(layout: &Layout, step: f64, beyond: f64) -> (Vec<Sample>, Vec<Facet>) {
    let half = 0.5 * layout.grid().pitch;
    let n_beyond = (beyond / step).ceil() as i32;
    let n_own = (2.0 * half / step).round() as i32;
    let place = |index: i32| (f64::from(index) + 0.5) * step - half;
    let (mut samples, mut facets) = (Vec::new(), Vec::new());
    for (index, taxel) in layout.taxels().iter().enumerate() {
        let turn = DQuat::from_rotation_arc(DVec3::Z, taxel.normal);
        let first = samples.len();
        let all = -n_beyond..n_own + n_beyond;
        for (row, col) in all.clone().flat_map(|row| all.clone().map(move |col| (row, col))) {
            let off = DVec2::new(place(col), place(row));
            let away = off.abs().max_element() - half;
            if away > beyond + 1e-9 {
                continue;
            }
            let (position, normal) = on_skin(taxel, turn, off, layout.radius());
            if is_nearest(layout, index, position) {
                samples.push(Sample { position, normal, on_array: away <= 1e-9 });
            }
        }
        let (range, center) = (first..samples.len(), taxel.position);
        let farthest = |most: f64, sample: &Sample| most.max(sample.position.distance(center));
        let radius = samples[range.clone()].iter().fold(0.0, farthest);
        facets.push(Facet { range, center, radius });
    }
    (samples, facets)
}

/// The place and normal at a distance along the skin from a taxel.
fn on_skin(taxel: &Taxel, turn: DQuat, off: DVec2, radius: f64) -> (DVec3, DVec3) {
    let along = off.length();
    if radius.is_infinite() || along <= 0.0 {
        return (taxel.position + turn * off.extend(0.0), taxel.normal);
    }
    let angle = (along / radius).min(std::f64::consts::FRAC_PI_2);
    let towards = turn * (off / along).extend(0.0);
    let position =
        taxel.position + radius * (angle.sin() * towards - (1.0 - angle.cos()) * taxel.normal);
    (position, angle.cos() * taxel.normal + angle.sin() * towards)
}

/// Whether no taxel is nearer to a place than the one with an index; of equally near ones the first.
fn is_nearest(layout: &Layout, index: usize, place: DVec3) -> bool {
    let distance = |taxel: &Taxel| taxel.position.distance_squared(place);
    let own = distance(&layout.taxels()[index]);
    layout.taxels().iter().enumerate().all(|(other, taxel)| match other.cmp(&index) {
        std::cmp::Ordering::Less => distance(taxel) > own + 1e-15,
        std::cmp::Ordering::Equal => true,
        std::cmp::Ordering::Greater => distance(taxel) >= own - 1e-15,
    })
}

/// The effect of samples on each taxel: 1 in total, or less or more at the edge of the covering.
fn weights(
    sensor: &SensorDescription,
    layout: &Layout,
    samples: &[Sample],
    step: f64,
) -> Vec<Vec<(u32, f64)>> {
    let coupling = &sensor.parameters().coupling;
    let sigma = sensor.parameters().point_spread;
    // A taxel's area widens the spread by the variance of its width.
    let kernel = |distance: f64, width: f64| {
        let deviation = (sigma.powi(2) + width.powi(2) / 12.0).sqrt();
        match coupling.kernel {
            SpreadKernel::Gaussian => (-0.5 * (distance / deviation).powi(2)).exp(),
            SpreadKernel::Exponential => (-std::f64::consts::SQRT_2 * distance / deviation).exp(),
        }
    };
    // The sum of the weights over a flat covering without an edge.
    let whole = |width: f64| {
        let n = (REACH * sigma / step).ceil() as i32;
        let all = (-n..=n).flat_map(|row| (-n..=n).map(move |col| (row, col)));
        let far = |(row, col): (i32, i32)| step * f64::from(row * row + col * col).sqrt();
        all.map(far).filter(|far| *far <= REACH * sigma).map(|far| kernel(far, width)).sum::<f64>()
    };
    let acting = |from: DVec3, width: f64| {
        let near = samples
            .iter()
            .enumerate()
            .map(move |(at, sample)| (at as u32, sample.position.distance(from)));
        near.filter(|(_, far)| *far <= REACH * sigma)
            .map(|(at, far)| (at, kernel(far, width)))
            .collect::<Vec<(u32, f64)>>()
    };
    let kept: Vec<f64> = match coupling.edge {
        CoveringEdge::ConservesForce => {
            let unbounded = whole(0.0);
            let share = |sample: &Sample| {
                let inside: f64 = acting(sample.position, 0.0).iter().map(|(_, w)| w).sum();
                (inside / unbounded).clamp(0.1, 1.0)
            };
            samples.iter().map(share).collect()
        }
        CoveringEdge::Continues | CoveringEdge::LosesForce => vec![1.0; samples.len()],
    };
    let of_taxel = |taxel: &Taxel| {
        let raw = acting(taxel.position, taxel.width);
        let own: f64 = raw.iter().map(|(_, w)| w).sum();
        let total = match coupling.edge {
            CoveringEdge::Continues => own,
            // A curved covering may have more within reach than a flat one.
            CoveringEdge::ConservesForce | CoveringEdge::LosesForce => whole(taxel.width).max(own),
        };
        let scaled = |(at, w): (u32, f64)| (at, w / total / kept[at as usize]);
        raw.into_iter().map(scaled).collect()
    };
    layout.taxels().iter().map(of_taxel).collect()
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::sync::Arc;

    use palpate_core::reading::SensorId;
    use palpate_core::sensor::{Coupling, SensorParameters};
    use palpate_core::units::DEG;

    use super::*;
    use crate::mesh::Mesh;
    use crate::mesh::tests_support::{cuboid, sphere};
    use crate::press::{Load, PressSimulator};
    use crate::sampler::{SamplerConfig, sample};

    fn displacements(mesh: Mesh, sensor: SensorDescription, height: f64) -> Vec<f64> {
        let down = DQuat::from_rotation_x(std::f64::consts::PI);
        let pose = Pose::from_parts(down, DVec3::new(0.0, 0.0, height));
        match PressSimulator::new(mesh, sensor).press(pose).load {
            Load::Displacements(displacements) => displacements,
            Load::Pressures(_) => panic!("the point spread gives displacements"),
        }
    }

    /// The same sensor with its taxels as a list.
    fn listed(sensor: &SensorDescription) -> SensorDescription {
        let taxels = (0..sensor.n_taxels()).map(|index| sensor.taxel(index)).collect();
        let layout = Some(Arc::new(Layout::near_grid(taxels, *sensor.grid()).unwrap()));
        let parameters = SensorParameters { layout, ..sensor.parameters().clone() };
        SensorDescription::new(parameters).unwrap()
    }

    #[test]
    fn a_listed_grid_presses_like_the_grid() {
        let grid = SensorDescription::digitacts_6x6();
        let edges = [
            (None, CoveringEdge::Continues),
            (Some(0.0), CoveringEdge::LosesForce),
            (Some(0.0), CoveringEdge::ConservesForce),
            (Some(4.0 * MM), CoveringEdge::LosesForce),
        ];
        for (margin, edge) in edges {
            let coupling = Coupling { margin, edge, ..Coupling::default() };
            let parameters = SensorParameters { coupling, ..grid.parameters().clone() };
            let sensor = SensorDescription::new(parameters).unwrap();
            let ball = || sphere(12.0 * MM, 120);
            let exact = displacements(ball(), sensor.clone(), 10.8 * MM);
            let sampled = displacements(ball(), listed(&sensor), 10.8 * MM);
            let most = exact.iter().copied().fold(0.0, f64::max);
            for (a, b) in exact.iter().zip(&sampled) {
                assert!((a - b).abs() < 0.05 * most, "{margin:?} {edge:?}: {a} {b} of {most}");
            }
        }
    }

    #[test]
    fn a_dome_on_a_plate_is_pressed_along_its_normals() {
        // Without spread a taxel tilted by θ is pressed by (d − R (1 − cos θ)) / cos θ.
        let dome = SensorDescription::preset_named("fingertip-curved-24").unwrap();
        let spread = 0.2 * MM;
        let parameters = SensorParameters { point_spread: spread, ..dome.parameters().clone() };
        let dome = SensorDescription::new(parameters).unwrap();
        let (depth, radius) = (1.5 * MM, 10.0 * MM);
        let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
        let found = displacements(plate, dome.clone(), 5.0 * MM - depth);
        for (index, found) in found.iter().enumerate() {
            let cosine = dome.taxel(index).normal.z;
            let expected = ((depth - radius * (1.0 - cosine)) / cosine).max(0.0);
            // The mean over 3 mm of a dome differs from its middle by less than 0.2 mm.
            assert!((found - expected).abs() < 0.2 * MM, "{index}: {found} for {expected}");
        }
        assert!(found[0] > 1.2 * MM && found[20] < 1e-9, "{found:?}");
    }

    #[test]
    fn touches_by_a_fingertip_lie_on_the_object_and_face_it() {
        for name in ["fingertip-curved-24", "icub-fingertip-12"] {
            let sensor = SensorDescription::preset_named(name).unwrap();
            let simulator = PressSimulator::new(sphere(30.0 * MM, 60), sensor.clone());
            let config = SamplerConfig::for_simulator(&simulator);
            let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
            let readings = sample(&simulator, SensorId(1), 30, 5, &config, &mut go_on).unwrap();
            for reading in &readings {
                let pose = reading.session_from_sensor();
                let outward = pose.translation.normalize();
                let turned = pose.turn(DVec3::Z).angle_between(-outward);
                assert!(turned < 20.0 * DEG, "{name}: {turned}");
                let depth = 30.0 * MM - pose.translation.length();
                assert!((-0.3 * MM..2.6 * MM).contains(&depth), "{name}: {depth}");
                assert_eq!(reading.values().len(), sensor.n_taxels());
                let sent = simulator.reading(
                    SensorId(1),
                    reading.sent_pose(),
                    &reading.values().into_iter().flatten().collect::<Vec<f64>>(),
                );
                assert!(sent.session_from_sensor().distance_to(&pose) < 1e-9);
            }
        }
    }
}
