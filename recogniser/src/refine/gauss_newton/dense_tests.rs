//! The reference of the elimination of bases: all unknowns solved at once.

use nalgebra::{DMatrix, DVector};
use palpate_core::reading::Base;
use palpate_core::rng::{Purpose, Stream};
use proptest::prelude::*;

use super::*;
use crate::test_support::{map_of, places, seen, single, some_pose};

/// The normal equations of pose, tool and all bases together, solved at once: the change of
/// pose and tool, and its covariance.
fn solved_at_once(systems: &Systems, tool: Vec3) -> (DVector<f64>, DMatrix<f64>) {
    let n = UNKNOWNS + 6 * systems.loose.len();
    let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    // A touch on a base moves with the pose, and against its base.
    let mut add = |system: &System, base: Option<usize>| {
        let unknowns = (0..UNKNOWNS).map(|unknown| (unknown, unknown, 1.0));
        let of_base =
            base.map(|base| (0..6).map(move |axis| (UNKNOWNS + 6 * base + axis, axis, -1.0)));
        let all: Vec<(usize, usize, f64)> = unknowns.chain(of_base.into_iter().flatten()).collect();
        for (row, i, sign) in &all {
            gradient[*row] += sign * system.gradient[*i];
            for (col, j, other) in &all {
                hessian[(*row, *col)] += sign * other * system.hessian[(*i, *j)];
            }
        }
    };
    add(&systems.exact, None);
    for (base, (_, system)) in systems.loose.iter().enumerate() {
        add(system, Some(base));
    }
    for (base, (looseness, _)) in systems.loose.iter().enumerate() {
        let prior = diagonal((looseness.position, looseness.angle), -2);
        (0..6).for_each(|axis| {
            let at = UNKNOWNS + 6 * base + axis;
            hessian[(at, at)] += prior[(axis, axis)];
        });
    }
    let mut tools = System::default();
    tools.add_tool(tool, &SurfaceOptions::default().refinement);
    let start = diagonal(START_DEVIATION, -2);
    for unknown in 0..UNKNOWNS {
        gradient[unknown] += tools.gradient[unknown];
        hessian[(unknown, unknown)] += tools.hessian[(unknown, unknown)];
        if unknown < 6 {
            hessian[(unknown, unknown)] += start[(unknown, unknown)];
        }
    }
    let factor = hessian.cholesky().unwrap();
    let covariance = factor.inverse().view((0, 0), (UNKNOWNS, UNKNOWNS)).into_owned();
    (factor.solve(&gradient).rows(0, UNKNOWNS).into_owned(), covariance)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn eliminated_bases_solve_as_all_at_once(
        seed in 0u64..1000,
        n in 1usize..40,
        robots in 1u32..20,
        position in 1e-4..0.3_f64,
        angle in 1e-3..1.5_f64,
        n_moved in 0usize..4,
    ) {
        let (map, truth) = (map_of(&places(400, 0)), some_pose(1));
        let options = SurfaceOptions::default();
        let kernel = Kernel::new(&options);
        let mut stream = Stream::new(seed, Purpose::Shape, 1);
        let touches: Vec<Observation> = places(n, 11 + seed).iter().enumerate().map(|(at, place)| {
            // One robot in three stands where it says.
            let robot = (stream.uniform(0.0, 1.0) * f64::from(robots)) as u32;
            let looseness = Looseness { position, angle };
            let base = (!robot.is_multiple_of(3)).then_some(Base { robot, looseness });
            let mut touch = seen(place, &truth).with_base(base);
            if at < n_moved {
                touch.discount(1, &Looseness { position: 0.003, angle: 0.1 });
            }
            touch
        }).collect();
        let (rotation, translation) = single(&truth);
        let hypothesis = Hypothesis::new(rotation, translation + Vec3::splat(0.001), 0.0);
        let all = systems(&hypothesis, &map, &touches, &kernel, &options);
        let (expected, covariance) = solved_at_once(&all, hypothesis.tool);
        let mut arrow = linearise(&hypothesis, &map, &touches, &kernel, &options);
        let mut of_pose = arrow.hessian.fixed_view_mut::<6, 6>(0, 0);
        of_pose += diagonal(START_DEVIATION, -2);
        let factor = arrow.hessian.cholesky().unwrap();
        let (found, inverse) = (factor.solve(&arrow.gradient), factor.inverse());
        for row in 0..UNKNOWNS {
            // In deviations: a tenth of a thousandth of what the touches say at best.
            let deviation = covariance[(row, row)].sqrt();
            let off = (found[row] - expected[row]).abs() / deviation;
            prop_assert!(off < 1e-4 * (1.0 + expected[row].abs() / deviation), "{row}: {off}");
            for col in 0..UNKNOWNS {
                let scale = deviation * covariance[(col, col)].sqrt();
                let off = (inverse[(row, col)] - covariance[(row, col)]).abs() / scale;
                prop_assert!(off < 1e-4, "{row} {col}: {off}");
            }
        }
    }
}
