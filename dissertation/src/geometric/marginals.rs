//! Marginal distributions of the pose's axes, for plotting.

use crate::filter::adaptive::{AdaptiveHistogram, Bin};
use palpate_core::log_prob::normalize;
use palpate_core::object::ObjectIdx;

/// The distribution along one axis of the pose.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisMarginal {
    /// The axis: `x`, `y`, `theta`; for solid poses `x`, `y`, `z`, `rx`, `ry`, `rz`.
    pub axis: &'static str,
    /// Start of the first cell, metres or rad.
    pub low: f64,
    /// End of the last cell, metres or rad.
    pub high: f64,
    /// The probability of each of the equal cells between; they sum to 1.
    pub probabilities: Vec<f64>,
}

/// The joint distribution of x and y in the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneMarginal {
    /// Corner with the smallest x and y, metres.
    pub low: [f64; 2],
    /// Corner with the largest x and y, metres.
    pub high: [f64; 2],
    /// Cells along x and y.
    pub n: [usize; 2],
    /// Probabilities, x fastest; they sum to 1.
    pub probabilities: Vec<f64>,
}

/// The marginal distributions of one object's pose, given the object.
#[derive(Clone, Debug, PartialEq)]
pub struct Marginals {
    /// One distribution an axis.
    pub axes: Vec<AxisMarginal>,
    /// x against y, for planar poses.
    pub plane: Option<PlaneMarginal>,
}

/// The marginals of one object of a histogram over the box from `low` to `high`, with `n`
/// cells an axis; `None` when the object has no bins.
pub(super) fn of_object<const D: usize>(
    histogram: &AdaptiveHistogram<D>,
    object: ObjectIdx,
    names: &[&'static str; D],
    low: [f64; D],
    high: [f64; D],
    n: usize,
) -> Option<Marginals> {
    let bins: Vec<&Bin<D>> = histogram.bins().iter().filter(|bin| bin.object == object.0).collect();
    if bins.is_empty() {
        return None;
    }
    let logs: Vec<f64> = bins.iter().map(|bin| histogram.log_mass(bin)).collect();
    let probabilities = normalize(&logs);
    let edge = |bin: &Bin<D>, side: f64| -> [f64; D] {
        let widths = histogram.division().widths(bin.depth as usize);
        std::array::from_fn(|axis| bin.center[axis] + side * widths[axis])
    };
    let spans: Vec<([f64; D], [f64; D])> =
        bins.iter().map(|bin| (edge(bin, -0.5), edge(bin, 0.5))).collect();
    let boxes: Vec<Share<'_>> = spans
        .iter()
        .zip(&probabilities)
        .map(|((low, high), probability)| Share { low, high, probability: *probability })
        .collect();
    let one = |(index, name): (usize, &&'static str)| {
        axis(name, index, (low[index], high[index]), n, &boxes)
    };
    let axes = names.iter().enumerate().map(one).collect();
    let joint = || plane([low[0], low[1]], [high[0], high[1]], n, &boxes);
    Some(Marginals { axes, plane: (D == 3).then(joint) })
}

/// A box of poses with its probability.
pub(super) struct Share<'a> {
    pub low: &'a [f64],
    pub high: &'a [f64],
    pub probability: f64,
}

/// The shares of `n` equal cells from `low` to `high` in a span: (cell, share).
pub(super) fn overlaps(
    span: (f64, f64),
    low: f64,
    high: f64,
    n: usize,
) -> impl Iterator<Item = (usize, f64)> {
    let width = (high - low) / n as f64;
    let clamp = |value: f64| value.clamp(low, high);
    let (from, to) = (clamp(span.0), clamp(span.1));
    let first = (((from - low) / width) as usize).min(n - 1);
    let last = (((to - low) / width) as usize).min(n - 1);
    let length = (to - from).max(f64::MIN_POSITIVE);
    (first..=last).map(move |cell| {
        let (begin, end) = (low + cell as f64 * width, low + (cell + 1) as f64 * width);
        (cell, ((to.min(end) - from.max(begin)).max(0.0) / length).min(1.0))
    })
}

/// The marginal of one axis from boxes.
pub(super) fn axis(
    name: &'static str,
    index: usize,
    range: (f64, f64),
    n: usize,
    boxes: &[Share<'_>],
) -> AxisMarginal {
    let mut probabilities = vec![0.0; n];
    for share in boxes {
        let span = (share.low[index], share.high[index]);
        for (cell, part) in overlaps(span, range.0, range.1, n) {
            probabilities[cell] += part * share.probability;
        }
    }
    rescale(&mut probabilities);
    AxisMarginal { axis: name, low: range.0, high: range.1, probabilities }
}

/// The joint marginal of the first two axes from boxes.
pub(super) fn plane(low: [f64; 2], high: [f64; 2], n: usize, boxes: &[Share<'_>]) -> PlaneMarginal {
    let mut probabilities = vec![0.0; n * n];
    for share in boxes {
        let span = |axis: usize| (share.low[axis], share.high[axis]);
        for (row, up) in overlaps(span(1), low[1], high[1], n) {
            for (col, along) in overlaps(span(0), low[0], high[0], n) {
                probabilities[col + n * row] += up * along * share.probability;
            }
        }
    }
    rescale(&mut probabilities);
    PlaneMarginal { low, high, n: [n, n], probabilities }
}

fn rescale(probabilities: &mut [f64]) {
    let total: f64 = probabilities.iter().sum();
    if total > 0.0 {
        probabilities.iter_mut().for_each(|p| *p /= total);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_boxs_mass_is_split_by_overlap() {
        // Cells of width 1 from 0 to 4; a box from 0.5 to 2.0 covers a third and two thirds.
        let boxes = [Share { low: &[0.5, 0.0], high: &[2.0, 1.0], probability: 0.3 }];
        let found = axis("x", 0, (0.0, 4.0), 4, &boxes);
        let expected = [1.0 / 3.0, 2.0 / 3.0, 0.0, 0.0];
        for (found, expected) in found.probabilities.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12);
        }
        let joint = plane([0.0, 0.0], [4.0, 4.0], 4, &boxes);
        assert!((joint.probabilities[1] - 2.0 / 3.0).abs() < 1e-12);
        assert!((joint.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
