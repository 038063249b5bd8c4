//! The order of an image's taxels: rows and columns mirrored, transposed, rotated.
//!
//! Each of the eight orders is fitted at each likely place of the object. Equation C5.

use palpate_core::sensor::{ImageOrder, SensorDescription};

use crate::estimate::{Choice, posterior};
use crate::images::{Images, LN_GAIN, LN_SPREAD, N, OBJECT, STIFFEN, TOOL};
use crate::solve::Solution;
use crate::surface::Placed;

/// Prior probability of the stated order. Chosen: as for the unit of pressure.
const STATED: f64 = 0.9;

/// Effective number of independent values of a touch's image. Chosen: a blurred image of
/// neighbouring taxels has a centre, an extent and a direction.
const PER_TOUCH: f64 = 2.0;

/// Most fits with all parameters, the cost relative to the least from which none is made, and
/// steps of each fit.
const FULL: usize = 3;
const HOPELESS: f64 = 1.8;
const QUICK_ROUNDS: usize = 3;
const FULL_ROUNDS: usize = 10;

/// Parameters of the quick fit: offset, roll and gain.
const QUICK: [usize; 5] = [0, 1, 2, 5, LN_GAIN];

/// The eight orders, the identity first.
pub const ORDERS: [ImageOrder; 8] = {
    let mut all = [ImageOrder { transposed: false, rows_reversed: false, cols_reversed: false }; 8];
    let mut code = 0;
    while code < 8 {
        all[code] = ImageOrder {
            transposed: code & 4 != 0,
            rows_reversed: code & 1 != 0,
            cols_reversed: code & 2 != 0,
        };
        code += 1;
    }
    all
};

/// The likeliest order with its fit.
pub(crate) struct Ordered<'a> {
    /// The order relative to the description's.
    pub(crate) order: Choice<ImageOrder>,
    /// The images in that order.
    pub(crate) images: Images<'a>,
    /// Their fit.
    pub(crate) solution: Solution,
    /// Negative logarithm of the likelihood of the fit and its prior.
    pub(crate) loss: f64,
}

/// One order at one place of the object.
struct Tried<'a> {
    code: usize,
    images: Images<'a>,
    solution: Solution,
}

/// Chooses the order and the place of the object. `places` is not empty.
pub(crate) fn choose<'a>(sent: &Images<'a>, places: &[Placed]) -> Option<Ordered<'a>> {
    let sensor = sent.simulator.sensor();
    let mut tried: Vec<Tried<'a>> = Vec::new();
    for place in places {
        for (code, order) in ORDERS.iter().enumerate() {
            let images = Images {
                measured: sent
                    .measured
                    .iter()
                    .map(|image| reordered(image, *order, sensor))
                    .collect(),
                poses: sent.poses.clone(),
                object_from_session: place.object_from_session,
                ..*sent
            };
            let solution = images.fit(&start_at(place), &QUICK, QUICK_ROUNDS);
            tried.push(Tried { code, images, solution });
        }
    }
    let n = PER_TOUCH * 0.5 * sent.measured.len() as f64;
    let loss = |solution: &Solution| n * solution.cost.ln() + solution.penalty;
    tried.sort_by(|a, b| loss(&a.solution).total_cmp(&loss(&b.solution)));
    let least = tried.first()?.solution.cost;
    let mut full: Vec<Tried<'a>> = Vec::new();
    let mut losses = [f64::INFINITY; 8];
    for one in tried {
        losses[one.code] = losses[one.code].min(loss(&one.solution));
        let n_alike = full.iter().filter(|other| other.code == one.code).count();
        let is_hopeful = full.len() < FULL && one.solution.cost < HOPELESS * least;
        if (is_hopeful || full.is_empty() || one.code == 0 && n_alike == 0) && n_alike < 2 {
            let start = values(&one.solution);
            let solution = one.images.fit(&start, &all(), FULL_ROUNDS);
            full.push(Tried { solution, ..one });
        }
    }
    for one in &full {
        losses[one.code] = losses[one.code].min(loss(&one.solution));
    }
    full.sort_by(|a, b| loss(&a.solution).total_cmp(&loss(&b.solution)));
    let prior = |code: usize| if code == 0 { STATED } else { (1.0 - STATED) / 7.0 };
    let alternatives: Vec<(f64, f64)> =
        losses.iter().enumerate().map(|(code, loss)| (-loss, prior(code))).collect();
    let probabilities = posterior(&alternatives);
    let likeliest = (0..8).max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]))?;
    let at = full.iter().position(|one| one.code == likeliest).unwrap_or(0);
    let best = full.into_iter().nth(at)?;
    let order = Choice {
        value: ORDERS[best.code],
        probability: probabilities[best.code],
        stated: ORDERS[0],
    };
    let loss = loss(&best.solution);
    Some(Ordered { order, images: best.images, solution: best.solution, loss })
}

/// All parameters.
pub(crate) fn all() -> Vec<usize> {
    TOOL.chain([LN_GAIN, STIFFEN, LN_SPREAD]).chain(OBJECT).collect()
}

/// The parameters of a solution.
pub(crate) fn values(solution: &Solution) -> [f64; N] {
    std::array::from_fn(|at| solution.values[at])
}

/// Parameters to start from at a place of the object.
fn start_at(place: &Placed) -> [f64; N] {
    let turn = place.tool.rotation.to_scaled_axis();
    let mut start = [0.0; N];
    start[..3].copy_from_slice(&place.tool.translation.to_array());
    start[3..6].copy_from_slice(&turn.to_array());
    start
}

/// An image in another order.
pub(crate) fn reordered<T: Copy>(
    image: &[T],
    order: ImageOrder,
    sensor: &SensorDescription,
) -> Vec<T> {
    order.row_major(image, sensor.grid().rows, sensor.grid().cols)
}

/// The order of `first` and then `second`, as one.
#[must_use]
pub fn composed(first: ImageOrder, second: ImageOrder, sensor: &SensorDescription) -> ImageOrder {
    let (rows, cols) = (sensor.grid().rows, sensor.grid().cols);
    let places: Vec<usize> = (0..rows * cols).collect();
    let both = second.row_major(&first.row_major(&places, rows, cols), rows, cols);
    let is_both = |order: &&ImageOrder| order.row_major(&places, rows, cols) == both;
    ORDERS.iter().find(is_both).copied().unwrap_or(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_orders_of_a_square_image_are_one() {
        let sensor = SensorDescription::digitacts_6x6();
        for first in ORDERS {
            for second in ORDERS {
                let both = composed(first, second, &sensor);
                let image: Vec<usize> = (0..36).map(|at| at * at).collect();
                let stepwise = reordered(&reordered(&image, first, &sensor), second, &sensor);
                assert_eq!(reordered(&image, both, &sensor), stepwise, "{first:?} {second:?}");
            }
        }
    }
}
