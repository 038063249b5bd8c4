//! Images in another order than stated: found from the stretches of a session's touches.

use std::sync::Arc;

use palpate_core::belief::answer::{ImageDoubt, LikelierOrder};
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::sensor::{ImageOrder, SensorParameters};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::options::SurfaceOptions;

use crate::ellipsoids::*;

/// What ten touches of each of some sessions say, sent in another order than the server knows.
fn doubts(order: ImageOrder, n: usize) -> Vec<Option<ImageDoubt>> {
    let sensor = six_by_six();
    let parameters = SensorParameters { image_order: order, ..sensor.parameters().clone() };
    let sent_as = SensorDescription::new(parameters).unwrap();
    let session = |index: usize| {
        let options = SurfaceOptions::default();
        let mut belief = SurfaceBelief::new(Arc::clone(&MODEL), options, None).unwrap();
        for reading in touches(index % N_OBJECTS, 10, 700 + index as u64) {
            let (id, pose) = (reading.sensor(), reading.session_from_sensor());
            let wrong = Reading::new(id, &sent_as, &reading.values(), pose).unwrap();
            belief.add(&wrong, &sensor);
        }
        belief.answer(3).image_doubt
    };
    (0..n).map(session).collect()
}

/// Whether a doubt is as strong as what the server warns of.
fn is_strong(doubt: &Option<ImageDoubt>) -> bool {
    doubt.is_some_and(|doubt| doubt.log_ratio > 6.0 && doubt.n_touches >= 6)
}

#[test]
fn mirrored_and_transposed_images_are_noticed() {
    let plain = ImageOrder::default();
    for (order, expected) in [
        (ImageOrder { rows_reversed: true, ..plain }, LikelierOrder::Mirrored),
        (ImageOrder { cols_reversed: true, ..plain }, LikelierOrder::Mirrored),
        (ImageOrder { transposed: true, ..plain }, LikelierOrder::Transposed),
        (ImageOrder { transposed: true, rows_reversed: true, ..plain }, LikelierOrder::Turned),
    ] {
        let found = doubts(order, 12);
        let strong: Vec<&ImageDoubt> =
            found.iter().filter(|doubt| is_strong(doubt)).flatten().collect();
        let right = strong.iter().filter(|doubt| doubt.order == expected).count();
        assert!(right >= 7 && right + 1 >= strong.len(), "{order:?}: {found:?}");
    }
}

#[test]
fn images_in_the_stated_order_raise_no_doubt() {
    let found = doubts(ImageOrder::default(), 60);
    assert!(!found.iter().any(is_strong), "{found:?}");
}
