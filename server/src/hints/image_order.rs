//! Warning about a session whose images all look as if their order were another one.

use palpate_core::belief::answer::{ImageDoubt, LikelierOrder};
use palpate_schemas::{Warning, WarningCode};

/// Number of touches from which the warning is given. Chosen: as for a shifted sensor.
const TOUCHES_MIN: usize = 6;
/// Least ln of the likelihoods' ratio. Chosen: 1 in 400; sixty sessions with images in order gave
/// nothing above 0 (`recogniser/tests/beliefs/image_doubt.rs`).
const LOG_RATIO_MIN: f64 = 6.0;

/// The warning, if another order is clearly likelier.
pub(crate) fn of_images(found: &ImageDoubt) -> Option<Warning> {
    if found.n_touches < TOUCHES_MIN || found.log_ratio < LOG_RATIO_MIN {
        return None;
    }
    let order = match found.order {
        LikelierOrder::Mirrored => "with rows or columns reversed",
        LikelierOrder::Transposed => "with rows and columns exchanged",
        LikelierOrder::Turned => "turned by a quarter, as if the sensor or its image were",
    };
    let detail = format!(
        "the images of all {} touches fit the object better {order}: is `image_order` of the sensor \
         right? `palpate sensors commission` finds it",
        found.n_touches
    );
    Some(Warning { code: WarningCode::ImageOrder, pointer: String::new(), detail })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_order_is_named_once_it_is_clearly_likelier() {
        let warned = |log_ratio, n_touches| {
            of_images(&ImageDoubt { order: LikelierOrder::Mirrored, log_ratio, n_touches })
        };
        let said = warned(7.0, 8).unwrap();
        assert_eq!(said.code, WarningCode::ImageOrder);
        assert!(said.detail.contains("rows or columns reversed"), "{said:?}");
        assert_eq!(warned(5.0, 8), None);
        assert_eq!(warned(7.0, 5), None);
    }
}
