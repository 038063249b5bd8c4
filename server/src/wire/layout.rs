//! Conversion of layouts of taxels.

use glam::DVec3;
use palpate_core::sensor::{Layout, LayoutError, SensorDescription, Taxel, TaxelGrid};
use palpate_schemas as wire;

use crate::wire::Invalid;

/// Taxels in their wire form; `None` for those on the grid.
pub(crate) fn taxels(description: &SensorDescription) -> Option<Vec<wire::Taxel>> {
    let taxel = |taxel: &Taxel| wire::Taxel {
        position: point(taxel.position),
        normal: point(taxel.normal),
        width: taxel.width,
    };
    Some(description.layout()?.taxels().iter().map(taxel).collect())
}

/// What a layout means for images; `None` for taxels on the grid.
pub(crate) fn layout(description: &SensorDescription) -> Option<wire::Layout> {
    let layout = description.layout()?;
    let drawing = match (layout.is_near_grid(), description.radius()) {
        (true, _) => wire::Drawing::AsIs,
        (false, None) => wire::Drawing::OnPlane,
        (false, Some(_)) => wire::Drawing::AtContact,
    };
    Some(wire::Layout {
        drawing,
        drawing_loss: layout.resampling_loss(),
        radius: description.radius(),
    })
}

/// The layout of given taxels, near the places of a given grid or anywhere. A grid that is that of
/// the list's images, as in a description that was read, does not make it a grid.
pub(crate) fn layout_of(given: &[wire::Taxel], grid: Option<TaxelGrid>) -> Result<Layout, Invalid> {
    let vector = |point: wire::Point| DVec3::new(point.x, point.y, point.z);
    let taxel = |taxel: &wire::Taxel| Taxel {
        position: vector(taxel.position),
        normal: vector(taxel.normal),
        width: taxel.width,
    };
    let taxels: Vec<Taxel> = given.iter().map(taxel).collect();
    let Some(grid) = grid else { return Layout::list(taxels).map_err(refuse) };
    Layout::near_grid(taxels.clone(), grid).or_else(|error| {
        let listed = Layout::list(taxels).ok().filter(|listed| *listed.grid() == grid);
        listed.ok_or_else(|| refuse(error))
    })
}

/// The refusal of taxels, with the property that is wrong.
pub(crate) fn refuse(error: LayoutError) -> Invalid {
    let at = "/description/taxels";
    let pointer = match error.field() {
        Some((taxel, field)) => format!("{at}/{taxel}/{field}"),
        None => at.to_owned(),
    };
    Invalid::field(pointer, error)
}

fn point(at: DVec3) -> wire::Point {
    wire::Point { x: at.x, y: at.y, z: at.z }
}
