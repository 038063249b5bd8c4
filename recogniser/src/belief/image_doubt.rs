//! Whether all images of a session look as if their driver sent them in another order.
//!
//! A contact is stretched along ridges and shafts. If the order of the image is wrong, every stretch
//! is mirrored or turned in the frame of its sensor. At a pose that places and normals fix, the
//! touches are therefore scored again with each stretch as another order would have it. Rows and
//! columns mirrored cannot be told apart by stretches, which have no sign.

use glam::Vec2;
use palpate_core::belief::answer::{ImageDoubt, LikelierOrder};

use crate::model::SurfaceMap;
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::{Observation, Says};
use crate::verify::density::Kernel;

/// What an order makes of a stretch in the sensor's plane.
type Turned = fn(Vec2) -> Vec2;

/// The orders that are compared with the stated one.
const ORDERS: [(LikelierOrder, Turned); 3] = [
    (LikelierOrder::Mirrored, |along| Vec2::new(along.x, -along.y)),
    (LikelierOrder::Transposed, |along| Vec2::new(along.y, along.x)),
    (LikelierOrder::Turned, |along| Vec2::new(-along.y, along.x)),
];

/// The order that explains the touches best, if it explains them better than the stated one.
pub(super) fn image_doubt(
    touches: &[Observation],
    map: &SurfaceMap,
    pose: &InversePose,
    kernel: &Kernel,
) -> Option<ImageDoubt> {
    let shown = || touches.iter().filter(|touch| touch.says == Says::All);
    let gain = |turned: Turned| -> f32 {
        let of = |touch: &Observation| {
            let axes = touch.session_from_sensor;
            let along =
                Vec2::new(axes.x_axis.dot(touch.direction), axes.y_axis.dot(touch.direction));
            let along = turned(along);
            let direction = axes.x_axis * along.x + axes.y_axis * along.y;
            let other = touch.stretched_along(direction);
            kernel.score(map, pose, &other) - kernel.score(map, pose, touch)
        };
        shown().map(of).sum()
    };
    let gains = ORDERS.map(|(order, turned)| (order, gain(turned)));
    let (order, gain) = gains.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (log_ratio, n_touches) = (f64::from(gain), shown().count());
    (gain > 0.0).then_some(ImageDoubt { order, log_ratio, n_touches })
}
