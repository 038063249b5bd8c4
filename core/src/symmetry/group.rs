//! Finite groups of rotations: closed under composition, made exact, and decomposed into axes.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3, DVec4};

use crate::pose::rotation_angle;
use crate::units::DEG;

/// Largest order of a group: an icosahedron's, or that of a wheel of 30 teeth with equal sides.
pub(super) const ROTATIONS_MAX: usize = 60;

/// Angle below which two rotations are one: less than half of 12°, the step of a wheel of 30
/// teeth.
const SAME: f64 = 5.5 * DEG;

/// Every product of the generators, the identity first; `None` when there are more than
/// [`ROTATIONS_MAX`] or they do not close.
pub(super) fn closure(generators: &[DQuat]) -> Option<Vec<DQuat>> {
    let mut rotations = vec![DQuat::IDENTITY];
    let mut next = 0;
    while next < rotations.len() {
        for generator in generators {
            let product = rotations[next] * *generator;
            if find(&rotations, product).is_none() {
                rotations.push(product);
            }
        }
        if rotations.len() > ROTATIONS_MAX {
            return None;
        }
        next += 1;
    }
    exact(rotations)
}

/// The group nearest to nearly closed rotations (Grove, Karcher and Ruh, 1974): each becomes
/// the mean of the estimates from the others, gᵢ ← mean over j of gⱼ⁻¹ gⱼᵢ, whose error is
/// the square of the last.
fn exact(mut rotations: Vec<DQuat>) -> Option<Vec<DQuat>> {
    let n = rotations.len();
    let mut table = vec![0; n * n];
    for (j, left) in rotations.iter().enumerate() {
        let mut is_taken = vec![false; n];
        for (i, right) in rotations.iter().enumerate() {
            let product = find(&rotations, *left * *right)?;
            if std::mem::replace(&mut is_taken[product], true) {
                return None;
            }
            table[j * n + i] = product;
        }
    }
    for _round in 0..5 {
        let mean = |i: usize| {
            let sum: DVec4 = (0..n)
                .map(|j| rotations[j].conjugate() * rotations[table[j * n + i]])
                .map(|told| if told.dot(rotations[i]) < 0.0 { -told } else { told })
                .map(DVec4::from)
                .sum();
            DQuat::from_vec4(sum).normalize()
        };
        rotations = (0..n).map(mean).collect();
    }
    Some(rotations)
}

/// The index of the equal rotation in the list.
fn find(rotations: &[DQuat], rotation: DQuat) -> Option<usize> {
    let apart = |other: &DQuat| rotation_angle(other.conjugate() * rotation);
    let (index, nearest) =
        rotations.iter().map(apart).enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
    (nearest < SAME).then_some(index)
}

/// The axes of a closed group with their orders, highest order first.
pub(super) fn axes(rotations: &[DQuat]) -> Vec<(DVec3, u8)> {
    let mut axes: Vec<(DVec3, u8)> = Vec::new();
    for rotation in rotations.iter().filter(|r| rotation_angle(**r) > SAME) {
        let direction = upward(rotation.xyz().normalize_or(DVec3::Z));
        let known = axes.iter_mut().find(|axis| axis.0.dot(direction).abs() > SAME.cos());
        match known {
            Some(axis) => axis.1 += 1,
            None => axes.push((direction, 2)),
        }
    }
    axes.sort_by_key(|axis| std::cmp::Reverse(axis.1));
    axes
}

/// The one of an axis's two directions whose largest component is positive.
pub(super) fn upward(direction: DVec3) -> DVec3 {
    let largest = direction.abs().max_position();
    if direction[largest] < 0.0 { -direction } else { direction }
}

/// The rotations about an axis of finite order, without the identity.
pub(super) fn about(direction: DVec3, order: u8) -> impl Iterator<Item = DQuat> {
    let turn =
        move |k: u8| DQuat::from_axis_angle(direction, TAU * f64::from(k) / f64::from(order));
    (1..order).map(turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    #[track_caller]
    fn check(generators: &[(DVec3, u8)], n_rotations: usize, orders: &[(u8, usize)]) {
        let mut stream = Stream::new(1, Purpose::ObjectPose, 0);
        // Axes are found to half a degree; the angles about them are exact.
        let rough: Vec<DQuat> = generators
            .iter()
            .map(|(axis, order)| {
                let tilt = DQuat::from_scaled_axis(0.5 * DEG * stream.direction());
                step_about(tilt * *axis, *order)
            })
            .collect();
        let rotations = closure(&rough).unwrap();
        assert_eq!(rotations.len(), n_rotations);
        for (a, b) in rotations.iter().flat_map(|a| rotations.iter().map(move |b| (a, b))) {
            let product = *a * *b;
            let off = rotations.iter().map(|c| rotation_angle(c.conjugate() * product));
            assert!(off.fold(f64::INFINITY, f64::min) < 1e-7);
        }
        let axes = axes(&rotations);
        for (order, n) in orders {
            assert_eq!(axes.iter().filter(|axis| axis.1 == *order).count(), *n, "{axes:?}");
        }
        assert_eq!(axes.len(), orders.iter().map(|order| order.1).sum::<usize>());
        assert_eq!(1 + axes.iter().map(|a| about(a.0, a.1).count()).sum::<usize>(), n_rotations);
    }

    fn step_about(axis: DVec3, order: u8) -> DQuat {
        DQuat::from_axis_angle(axis.normalize(), TAU / f64::from(order))
    }

    #[test]
    fn rough_generators_close_to_exact_groups() {
        check(&[(DVec3::Z, 7)], 7, &[(7, 1)]);
        check(&[(DVec3::Z, 16), (DVec3::X, 2)], 32, &[(16, 1), (2, 16)]);
        check(&[(DVec3::Z, 30), (DVec3::X, 2)], 60, &[(30, 1), (2, 30)]);
        check(&[(DVec3::Z, 2), (DVec3::ONE, 3)], 12, &[(3, 4), (2, 3)]);
        check(&[(DVec3::Z, 4), (DVec3::ONE, 3)], 24, &[(4, 3), (3, 4), (2, 6)]);
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let five = DVec3::new(0.0, 1.0, golden);
        check(&[(five, 5), (DVec3::ONE, 3)], 60, &[(5, 6), (3, 10), (2, 15)]);
    }

    #[test]
    fn inconsistent_axes_make_no_group() {
        let third = |axis| step_about(axis, 3);
        assert_eq!(closure(&[third(DVec3::Z), third(DVec3::new(1.0, 0.0, 2.0))]), None);
    }
}
