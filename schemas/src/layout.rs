//! Layouts of taxels on the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::pose::Point;

/// One taxel of a layout, in the sensor frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Taxel {
    /// Its centre on the covering's free surface, in metres.
    pub position: Point,
    /// Unit vector out of the covering there.
    pub normal: Point,
    /// Side of its sensing area, in metres.
    #[schema(example = 0.003)]
    pub width: f64,
}

/// What a list of taxels means for images.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Layout {
    /// Way in which values become images.
    pub drawing: Drawing,
    /// Share of a small contact that the drawing loses, 0 to 1: root mean square over contacts with a
    /// deviation of one pitch.
    pub drawing_loss: f64,
    /// Radius of the skin's curvature in metres; null for a flat layout.
    pub radius: Option<f64>,
}

/// Way in which a layout's values become images.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Drawing {
    /// Each value of the image is a taxel: the layout is near a grid.
    AsIs,
    /// Values are drawn on the plane of the layout.
    OnPlane,
    /// Values are drawn on the plane that touches the curved skin at the centre of pressure.
    AtContact,
}
