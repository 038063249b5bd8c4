//! Schmid's isotropic filters: a negative control, invariant to rotation and poor in detail.
//!
//! Source: section 4.3.2 omits them for poor performance; Schmid (2001) for the 13 filters
//! cos(π τ r / σ) exp(−r² / 2σ²). Her supports of 49 pixels become twice the shorter side: σ
//! is in 24ths of it. A feature is the mean magnitude and the deviation of each filter's
//! responses over the inscribed circle.

use super::disc::{Disc, DiscTaxel};
use super::filter_bank::{FilterBank, Kernel};
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// (σ, τ) of Schmid's filters.
const FILTERS: [(f64, f64); 13] = [
    (2.0, 1.0),
    (4.0, 1.0),
    (4.0, 2.0),
    (6.0, 1.0),
    (6.0, 2.0),
    (6.0, 3.0),
    (8.0, 1.0),
    (8.0, 2.0),
    (8.0, 3.0),
    (10.0, 1.0),
    (10.0, 2.0),
    (10.0, 3.0),
    (10.0, 4.0),
];

/// Schmid's descriptor for images of one shape.
#[derive(Clone, Debug)]
pub struct Schmid {
    disc: Disc,
    taxels: Vec<DiscTaxel>,
    bank: FilterBank,
}

impl Schmid {
    /// Plans for images of `rows` × `cols` taxels.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        let disc = Disc { rows, cols };
        let unit = disc.diameter() as f64 / 24.0;
        let kernels = FILTERS.map(|(sigma, tau)| Kernel::Ripple { sigma: sigma * unit, tau });
        Self { disc, taxels: disc.taxels(), bank: FilterBank::new(rows, cols, &kernels) }
    }
}

impl Descriptor for Schmid {
    fn shape(&self) -> (usize, usize) {
        (self.disc.rows, self.disc.cols)
    }

    fn dimension(&self) -> usize {
        2 * FILTERS.len()
    }

    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]) {
        let n = image.pressures.len();
        // One channel more than there are filters: they come in pairs.
        let (responses, buffer) = workspace.lend((FILTERS.len() + 1) * n, self.bank.n_buffer());
        self.bank.respond(image, buffer, |pair, taxel, response| {
            responses[2 * pair * n + taxel] = response.re;
            responses[(2 * pair + 1) * n + taxel] = response.im;
        });
        let n_inside = self.taxels.len() as f64;
        for (channel, places) in responses.chunks_exact(n).zip(features.as_chunks_mut::<2>().0) {
            let mean = |value: &dyn Fn(f64) -> f64| {
                self.taxels.iter().map(|inside| value(channel[inside.taxel])).sum::<f64>()
                    / n_inside
            };
            let center = mean(&|response| response);
            *places = [mean(&f64::abs), mean(&|response| (response - center).powi(2)).sqrt()];
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::descriptor::DescriptorKind;
    use crate::descriptor::test_support::{any_image, check_quarter_turn, turned_affinity};

    proptest! {
        #[test]
        fn quarter_turns_change_nothing(square in any_image(6, 6), long in any_image(5, 8)) {
            check_quarter_turn(DescriptorKind::Schmid, &square, 1e-9);
            check_quarter_turn(DescriptorKind::Schmid, &long, 1e-9);
        }

        #[test]
        fn rotation_of_a_smooth_image_changes_little(angle in -3.1..3.1_f64) {
            let kept = turned_affinity(DescriptorKind::Schmid, angle);
            prop_assert!(kept > 0.99, "{kept}");
        }
    }
}
