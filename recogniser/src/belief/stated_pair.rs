//! The density of a pair of touches over the poses that a hypothesis states. Equations R36, R36a
//! and R36b of docs/camera-model.md.
//!
//! Every patch is laid onto one touch, place onto place and about normal onto normal. So the
//! integral over places and over both angles of the normal is exact. What is left of the rotation
//! is drawn, and the other touch judges each pose.

use glam::{Mat3, Quat, Vec3};

use crate::model::SurfaceMap;
use crate::model::facet::Facet;
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::Observation;
use crate::verify::density::{Kernel, Width};
use crate::verify::gaussian::quasi_normal;
use crate::verify::stated_prior::{StatedPrior, Turning};

/// Rotations in which a patch is laid onto a touch, by all hypotheses together; at least one by
/// each.
const TURNS: usize = 4;

/// Rotations of neighbouring patches together, which stand for all.
const ABOUT: usize = 32;

/// Poses that the other touch judges, of all hypotheses together, and the least number of one.
const JUDGED: usize = 256;
const JUDGED_MIN: usize = 64;

/// Squared deviations of place and normal beyond which a patch is not laid onto a touch: e^−9 of
/// the peak.
const FAR: f32 = 18.0;

/// Two touches on an object.
pub(super) struct Pair<'a> {
    pub(super) kernel: &'a Kernel,
    pub(super) map: &'a SurfaceMap,
    /// The touch that patches are laid onto, and its appearance ratios at all of them.
    pub(super) laid: &'a Observation,
    pub(super) ratios: &'a [f32],
    /// The touch that judges.
    pub(super) judge: &'a Observation,
}

/// A patch on a touch, and what it leaves open.
struct Fit {
    /// Squared deviations, and the density of the normal over that of any.
    square: f32,
    facing: f32,
    /// Mean of the rotation vector, and its covariance.
    mean: Vec3,
    left: Mat3,
}

/// A pose of the object, with its share of the mean density.
struct Laid {
    share: f32,
    pose: InversePose,
    /// Variances of the judging touch over what the pose stands for.
    more: [f32; 2],
}

impl Pair<'_> {
    /// Mean density of both touches over the poses of a hypothesis where the laid touch is on the
    /// object. The poses that judge are chosen evenly by their shares.
    pub(super) fn density(&self, stated: &StatedPrior, hypothesis: usize) -> f32 {
        let laid = self.laid(stated, hypothesis);
        let n = (JUDGED / stated.n_poses()).max(JUDGED_MIN);
        let step = laid.iter().map(|pose| pose.share).sum::<f32>() / n as f32;
        let (mut sum, mut passed, mut next) = (0.0, 0.0, 0.5 * step);
        for Laid { share, pose, more } in &laid {
            passed += share;
            if next < passed {
                // The steps that end within its share.
                let part = ((passed - next) / step).ceil() * step;
                next += part;
                sum += part * self.kernel.score_about(self.map, pose, self.judge, *more).exp();
            }
        }
        sum
    }

    /// Poses in which a patch lies on the touch.
    fn laid(&self, stated: &StatedPrior, hypothesis: usize) -> Vec<Laid> {
        let Self { kernel, map, laid: touch, ratios, judge } = self;
        let turning = stated.turning(hypothesis);
        let n = (TURNS / stated.n_poses()).max(1);
        // Each rotation stands for its share of the volume.
        let about = (ABOUT as f32).powf(-2.0 / 3.0);
        let narrower = (1.0 - about).sqrt();
        let normals: Vec<Vec3> = (ABOUT..2 * ABOUT).map(|index| normal(index) * narrower).collect();
        let part = ((n * ratios.len()) as f32).recip();
        let width = kernel.width(map, touch);
        let lever = (judge.position - touch.position).cross(judge.normal);
        let mut laid = Vec::new();
        for (index, (facet, appearance)) in map.facets().iter().zip(*ratios).enumerate() {
            let Some(fit) = fit(&turning, facet, touch, kernel, width) else { continue };
            let factor = cholesky(fit.left);
            let spread = about * fit.left;
            let trace = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
            let more = [lever.dot(spread * lever), trace / 3.0];
            for normal in (0..n).map(|turn| &normals[(n * index + turn) % ABOUT]) {
                let turned = fit.mean + factor * *normal;
                let rotation = Quat::from_scaled_axis(turned) * turning.rotation;
                let place = touch.position - rotation * facet.position;
                let square = turning.square(turned, place);
                if square + fit.square > FAR || !stated.holds(place) {
                    continue;
                }
                let pose = InversePose::new(rotation, place);
                let direction = pose.object_from_session * touch.direction;
                let stretch = kernel.stretch(facet, direction, touch);
                let share = part * appearance * fit.facing * stretch * turning.density(square);
                laid.push(Laid { share, pose, more });
            }
        }
        laid
    }
}

/// What a hypothesis says of the rotation once a patch lies on a touch, normal onto normal; `None`
/// if it does not face that way.
fn fit(
    turning: &Turning,
    facet: &Facet,
    touch: &Observation,
    kernel: &Kernel,
    width: Width,
) -> Option<Fit> {
    let normal = turning.rotation * facet.normal;
    let cosine = normal.dot(touch.normal);
    if cosine <= 0.0 {
        return None;
    }
    // The smallest rotation of the normal onto the touch's, about each of the patch's axes.
    let axis = normal.cross(touch.normal);
    let sine = axis.length();
    let smallest = axis * if sine > 1e-6 { sine.atan2(cosine) / sine } else { 1.0 };
    let along = turning.rotation * facet.direction;
    let across = normal.cross(along);
    let (about_across, about_along) = (smallest.dot(across), smallest.dot(along));
    // A turn about the one moves the normal along the other.
    let [scatter_along, scatter_across] = facet.normal_variances();
    let (first, second) = (turning.turn * across, turning.turn * along);
    let a = across.dot(first) + scatter_along + width.normal_variance;
    let b = along.dot(second) + scatter_across + width.normal_variance;
    let mixed = across.dot(second);
    let determinant = a * b - mixed * mixed;
    let gain_across = (first * b - second * mixed) / determinant;
    let gain_along = (second * a - first * mixed) / determinant;
    let mean = gain_across * about_across + gain_along * about_along;
    let square = (b * about_across * about_across - 2.0 * mixed * about_across * about_along
        + a * about_along * about_along)
        / determinant;
    if square > FAR {
        return None;
    }
    let left = turning.turn - outer(gain_across, first) - outer(gain_along, second);
    let facing = kernel.normal_peak(determinant) * (-0.5 * square).exp();
    Some(Fit { square, facing, mean, left })
}

fn outer(a: Vec3, b: Vec3) -> Mat3 {
    Mat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Lower triangular factor of a covariance.
fn cholesky(of: Mat3) -> Mat3 {
    let root = |square: f32| square.max(f32::MIN_POSITIVE).sqrt();
    let xx = root(of.x_axis.x);
    let (xy, xz) = (of.x_axis.y / xx, of.x_axis.z / xx);
    let yy = root(of.y_axis.y - xy * xy);
    let yz = (of.y_axis.z - xy * xz) / yy;
    let zz = root(of.z_axis.z - xz * xz - yz * yz);
    Mat3::from_cols(Vec3::new(xx, xy, xz), Vec3::new(0.0, yy, yz), Vec3::new(0.0, 0.0, zz))
}

/// Three quasi-random standard normal numbers.
fn normal(index: usize) -> Vec3 {
    let n = quasi_normal(index);
    Vec3::new(n.x as f32, n.y as f32, n.z as f32)
}
