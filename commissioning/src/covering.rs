//! The covering's end: where it is, and what it does to force.

use palpate_core::sensor::CoveringEdge;

use crate::estimate::{Choice, posterior};
use crate::images::{Edge, Images, LN_GAIN, LN_SPREAD, STIFFEN};
use crate::order::{all, values};
use crate::solve::Solution;

/// Extents of the covering beyond the array that are tried, pitches.
const MARGINS: [f64; 3] = [0.0, 1.0, 2.0];

/// Parameters and steps of the quick fit, and steps of the last one.
const QUICK: [usize; 4] = [2, LN_GAIN, STIFFEN, LN_SPREAD];
const QUICK_ROUNDS: usize = 3;
const FULL_ROUNDS: usize = 12;

/// Effective number of independent values of a touch's image, as for the order.
const PER_TOUCH: f64 = 2.0;

/// Chooses the covering's end and fits all parameters with it.
pub(crate) fn choose<'a>(
    images: Images<'a>,
    found: &Solution,
) -> (Choice<Edge>, Images<'a>, Solution) {
    let pitch = images.simulator.sensor().grid().pitch;
    let stated = images.edge;
    let mut edges = vec![stated];
    for margin in MARGINS {
        for effect in CoveringEdge::ALL {
            edges.push(Edge { margin: Some(margin * pitch), effect });
        }
    }
    edges.push(Edge { margin: None, effect: CoveringEdge::Continues });
    let mut kept: Vec<Edge> = Vec::new();
    for edge in edges {
        if !kept.contains(&edge) {
            kept.push(edge);
        }
    }
    let start = values(found);
    let mut images = images;
    let mut costs = Vec::new();
    let mut best = (f64::INFINITY, stated, start);
    for edge in &kept {
        images.edge = *edge;
        let solution = images.fit(&start, &QUICK, QUICK_ROUNDS);
        costs.push(solution.cost);
        if solution.cost < best.0 {
            best = (solution.cost, *edge, values(&solution));
        }
    }
    let n = 0.5 * PER_TOUCH * images.measured.len() as f64;
    let alternatives: Vec<(f64, f64)> = costs.iter().map(|cost| (-n * cost.ln(), 1.0)).collect();
    let probabilities = posterior(&alternatives);
    let at = kept.iter().position(|edge| *edge == best.1).unwrap_or(0);
    let choice = Choice { value: best.1, probability: probabilities[at], stated };
    images.edge = best.1;
    let solution = images.fit(&best.2, &all(), FULL_ROUNDS);
    (choice, images, solution)
}
