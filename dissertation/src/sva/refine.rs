//! Continuous refinement of a pose: aligns contacts with the patches of the object's map.
//!
//! Histogram bins are 8 mm and 30° wide; a few Gauss–Newton steps on the readings' contact
//! points and normals find the pose within them. Each contact is drawn to the map patch that
//! explains it best: stiffly along that patch's normal, softly along the surface (the map is
//! a sample of it), and by its normal. Contacts that fit nowhere lose their weight (Geman and
//! McClure, 1987). Not part of the dissertation, which answers bin centres.

use glam::{DQuat, DVec3};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::patch::Patch;
use palpate_core::object::MapPatch;
use palpate_core::pose::Pose;
use palpate_core::units::{DEG, MM};

/// Deviations of contacts from the map, and limits of a refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// Deviation of a contact from its patch along the patch's normal, metres.
    pub across: f64,
    /// Deviation of a contact from its patch along the surface, metres.
    pub along: f64,
    /// Deviation of a well-fixed normal, rad.
    pub normal: f64,
    /// Normalised distance at which a contact has lost three quarters of its weight.
    pub outlier: f64,
    /// Largest translation of the pose, metres.
    pub distance_max: f64,
    /// Largest rotation of the pose, rad.
    pub angle_max: f64,
    /// Minimum number of contacts; with fewer the pose stays.
    pub contacts_min: usize,
    /// Maximum number of steps.
    pub steps_max: usize,
}

impl Default for Refinement {
    fn default() -> Self {
        Self {
            across: 0.7 * MM,
            along: 3.0 * MM,
            normal: 0.2,
            outlier: 3.0,
            distance_max: 20.0 * MM,
            angle_max: 45.0 * DEG,
            contacts_min: 3,
            steps_max: 12,
        }
    }
}

/// A refined pose with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// The pose of the object in the session frame.
    pub session_from_object: Pose,
    /// Covariance of x, y, z (m) and rotation about the session's fixed axes (rad).
    pub covariance: Matrix6<f64>,
}

/// One Gauss–Newton system: normal equations and the robust cost at a pose.
struct System {
    hessian: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
}

/// Refines a pose; `None` when there are too few contacts, the contacts leave a direction
/// entirely free, or the best fit lies farther away than permitted.
#[must_use]
pub fn refine(
    start: Pose,
    contacts: &[Patch],
    map: &[MapPatch],
    settings: &Refinement,
) -> Option<Refined> {
    if contacts.len() < settings.contacts_min || map.is_empty() {
        return None;
    }
    let mut pose = start;
    let mut system = linearise(pose, contacts, map, settings);
    for _step in 0..settings.steps_max {
        let Some(next) = step(pose, &system) else { break };
        let tried = linearise(next, contacts, map, settings);
        if tried.cost >= system.cost {
            break;
        }
        let settled = system.cost - tried.cost < 1e-5;
        (pose, system) = (next, tried);
        if settled {
            break;
        }
    }
    let near = pose.distance_to(&start) <= settings.distance_max
        && pose.angle_to(&start) <= settings.angle_max;
    let covariance = covariance(&system)?;
    near.then_some(Refined { session_from_object: pose, covariance })
}

/// Prior stiffness that holds free directions (a turn about an axis of symmetry), as if the
/// start were known to 20 mm and 30°.
fn stiffness() -> Vector6<f64> {
    let (position, rotation) = ((20.0 * MM).powi(-2), (30.0 * DEG).powi(-2));
    Vector6::new(position, position, position, rotation, rotation, rotation)
}

fn step(pose: Pose, system: &System) -> Option<Pose> {
    let damped = system.hessian + Matrix6::from_diagonal(&stiffness());
    let change = damped.cholesky()?.solve(&system.gradient);
    let (moved, turned) = (change.fixed_rows::<3>(0), change.fixed_rows::<3>(3));
    let moved = DVec3::new(moved[0], moved[1], moved[2]);
    let turned = DVec3::new(turned[0], turned[1], turned[2]);
    Some(Pose::from_parts(
        DQuat::from_scaled_axis(turned) * pose.rotation,
        pose.translation + moved,
    ))
}

fn covariance(system: &System) -> Option<Matrix6<f64>> {
    let informed = system.hessian + Matrix6::from_diagonal(&stiffness());
    // The map samples the surface: no pose is more accurate than this.
    let (position, rotation) = ((0.2 * MM).powi(2), (0.5 * DEG).powi(2));
    let floor = Vector6::new(position, position, position, rotation, rotation, rotation);
    Some(informed.cholesky()?.inverse() + Matrix6::from_diagonal(&floor))
}

fn linearise(pose: Pose, contacts: &[Patch], map: &[MapPatch], settings: &Refinement) -> System {
    let mut hessian = Matrix6::zeros();
    let mut gradient = Vector6::zeros();
    let mut cost = 0.0;
    let object_from_session = pose.inverse();
    for contact in contacts {
        let (patch, distance) = nearest(object_from_session, contact, map, settings);
        let square = (distance / settings.outlier).powi(2);
        cost += square / (1.0 + square);
        let weight = (1.0 + square).powi(-2);

        let lever = pose.turn(position(patch));
        let surface_normal = pose.turn(normal(patch));
        let residual = column(contact.position - (lever + pose.translation));
        let outward = column(surface_normal);
        let stiff = outward * outward.transpose();
        let information = stiff * settings.across.powi(-2)
            + (Matrix3::identity() - stiff) * settings.along.powi(-2);
        // A turn by ω moves the patch by ω × lever = −[lever]ₓ ω.
        let mut moves = nalgebra::Matrix3x6::zeros();
        moves.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
        moves.fixed_view_mut::<3, 3>(0, 3).copy_from(&-column(lever).cross_matrix());
        hessian += weight * moves.transpose() * information * moves;
        gradient += weight * moves.transpose() * information * residual;

        let turns = -outward.cross_matrix();
        let trust = weight * contact.normal_confidence * settings.normal.powi(-2);
        let bent = column(contact.normal - surface_normal);
        let mut rotation = hessian.fixed_view_mut::<3, 3>(3, 3);
        rotation += trust * turns.transpose() * turns;
        let mut pull = gradient.fixed_rows_mut::<3>(3);
        pull += trust * turns.transpose() * bent;
    }
    System { hessian, gradient, cost: cost / contacts.len() as f64 }
}

/// The patch that explains a contact best, and its distance in deviations.
fn nearest<'a>(
    object_from_session: Pose,
    contact: &Patch,
    map: &'a [MapPatch],
    settings: &Refinement,
) -> (&'a MapPatch, f64) {
    let seen = object_from_session * contact.position;
    let facing = object_from_session.turn(contact.normal);
    let (across, along) = (settings.across.powi(-2), settings.along.powi(-2));
    let bent = contact.normal_confidence * settings.normal.powi(-2);
    let mut best = (&map[0], f64::INFINITY);
    for patch in map {
        let off = seen - position(patch);
        let squared = off.length_squared() * along;
        if squared >= best.1 {
            continue;
        }
        let outward = normal(patch);
        let height = off.dot(outward);
        let full =
            squared + height * height * (across - along) + 2.0 * bent * (1.0 - facing.dot(outward));
        if full < best.1 {
            best = (patch, full);
        }
    }
    (best.0, best.1.max(0.0).sqrt())
}

fn position(patch: &MapPatch) -> DVec3 {
    DVec3::from_array(patch.position.map(f64::from))
}

fn normal(patch: &MapPatch) -> DVec3 {
    DVec3::from_array(patch.normal.map(f64::from))
}

fn column(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::rng::{Purpose, Stream};

    /// Patches on an asymmetric ellipsoid.
    fn ellipsoid(n: usize, seed: u64) -> Vec<Patch> {
        let half = DVec3::new(40.0 * MM, 25.0 * MM, 15.0 * MM);
        let mut stream = Stream::new(seed, Purpose::Sampling, 0);
        let patch = |_| {
            let on_sphere = stream.direction();
            // A bump along +x breaks the mirror symmetries.
            let stretch = if on_sphere.x > 0.0 { 1.0 + 0.3 * on_sphere.y } else { 1.0 };
            let position = on_sphere * half * stretch;
            let normal = (on_sphere / half).normalize();
            Patch { position, normal, normal_confidence: 0.8, classes: Vec::new() }
        };
        (0..n).map(patch).collect()
    }

    fn map(patches: &[Patch]) -> Vec<MapPatch> {
        let single = |v: DVec3| v.to_array().map(|value| value as f32);
        let stored = |patch: &Patch| MapPatch {
            position: single(patch.position),
            normal: single(patch.normal),
            normal_confidence: 0.8,
        };
        patches.iter().map(stored).collect()
    }

    fn moved(patches: &[Patch], pose: Pose) -> Vec<Patch> {
        let by = |patch: &Patch| Patch {
            position: pose * patch.position,
            normal: pose.turn(patch.normal),
            ..patch.clone()
        };
        patches.iter().map(by).collect()
    }

    fn disturbed(pose: Pose) -> Pose {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.1, -0.12, 0.08));
        Pose::from_parts(turn * pose.rotation, pose.translation + DVec3::splat(2.5 * MM))
    }

    #[test]
    fn a_disturbed_pose_is_recovered() {
        let truth = Pose::from_parts(DQuat::from_rotation_y(0.7), DVec3::new(0.3, -0.1, 0.2));
        let contacts = moved(&ellipsoid(15, 2), truth);
        let start = disturbed(truth);
        let map = map(&ellipsoid(1_500, 1));
        let refined = refine(start, &contacts, &map, &Refinement::default()).unwrap();
        let found = refined.session_from_object;
        assert!(start.distance_to(&truth) > 4.0 * MM && start.angle_to(&truth) > 9.0 * DEG);
        assert!(found.distance_to(&truth) < 1.0 * MM, "{}", found.distance_to(&truth));
        assert!(found.angle_to(&truth) < 3.0 * DEG, "{}", found.angle_to(&truth) / DEG);
    }

    #[test]
    fn an_outlier_does_not_move_the_pose() {
        let mut contacts = ellipsoid(15, 2);
        contacts[0].position += DVec3::new(0.0, 0.0, 60.0 * MM);
        let map = map(&ellipsoid(1_500, 1));
        let start = disturbed(Pose::IDENTITY);
        let refined = refine(start, &contacts, &map, &Refinement::default()).unwrap();
        let error = refined.session_from_object.distance_to(&Pose::IDENTITY);
        assert!(error < 1.2 * MM, "{error}");
    }

    #[test]
    fn two_contacts_are_too_few() {
        let map = map(&ellipsoid(100, 1));
        let contacts = ellipsoid(2, 2);
        assert_eq!(refine(Pose::IDENTITY, &contacts, &map, &Refinement::default()), None);
    }

    #[test]
    fn contacts_on_a_plane_leave_sliding_uncertain() {
        let flat = |n: usize, seed| -> Vec<Patch> {
            let mut stream = Stream::new(seed, Purpose::Sampling, 1);
            let mut along = || stream.uniform(-30.0 * MM, 30.0 * MM);
            let patch = |_| Patch {
                position: DVec3::new(along(), along(), 0.0),
                normal: DVec3::Z,
                normal_confidence: 1.0,
                classes: Vec::new(),
            };
            (0..n).map(patch).collect()
        };
        let map = map(&flat(2_000, 1));
        let refined = refine(Pose::IDENTITY, &flat(8, 2), &map, &Refinement::default()).unwrap();
        assert!(refined.covariance[(0, 0)] > 4.0 * refined.covariance[(2, 2)]);
    }
}
