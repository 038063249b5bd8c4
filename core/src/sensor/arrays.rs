//! Arrays that people own, as far as their makers describe them.
//!
//! Each says what its figures come from. What no source states is assumed, and open in the
//! ranges: check the pitch, the thickness and the range of your own unit. Taxels lie on a plane and
//! a square grid here; lengths in metres, pressures in pascal.

use super::coupling::{Coupling, CoveringEdge};
use super::defaults;
use super::description::{ImageOrder, SensorParameters, TaxelGrid};
use super::point_spread::point_spread_of_covering;
use super::ranges::StatedRanges;
use crate::units::{INCH, KPA, MM};

/// Pressure that stands for a height in images of cameras in a gel, Pa/m: 10 Pa for each
/// micrometre. Chosen: the range of 15 kPa is then about that of the other presets.
pub const PRESSURE_PER_HEIGHT: f64 = 1e7;

/// XELA uSkin, 4 × 4 three-axis taxels in a soft skin (uSPa 44).
///
/// From XELA: 16 taxels at 4.7 mm; at most 3 N on a taxel, sensors are not calibrated, and
/// magnets near it disturb it (instruction manual of the XR1944, 2020). 3 N on 4.7 mm × 4.7 mm
/// are 136 kPa. Assumed: a skin of 4 mm, 4 mm wide taxels, and uneven gains and hysteresis of 10 %
/// as for magnets in silicone. Its values are counts of the normal axis; a driver scales them
/// such that the largest permitted force is 136 kPa.
pub(super) fn xela_uskin_4x4() -> (SensorParameters, StatedRanges) {
    let grid = TaxelGrid { rows: 4, cols: 4, pitch: 4.7 * MM, taxel_width: 4.0 * MM };
    let coupling = Coupling { gain_spread: 0.1, hysteresis: 0.1, ..Coupling::default() };
    // One pitch: the module is hardly wider than its taxels.
    let ranges = StatedRanges { margin: Some((0.0, 4.7 * MM)), ..StatedRanges::default() };
    (covered(grid, 4.0 * MM, 136.0 * KPA, coupling), ranges)
}

/// Contactile PapillArray, 3 × 3 silicone pillars that measure three forces each.
///
/// From Contactile: nine pillars in a square, separate from each other. Assumed: 7 mm from pillar
/// to pillar, tips of 6 mm, 10 N a pillar (278 kPa) and 3 mm of travel. A pillar carries what
/// touches it and nothing else: the spread is that of its own tip, an even press reads the same in
/// all of them, and there is no covering around the array. Not described: the middle pillar of some models is
/// taller. A driver divides the normal force by 36 mm².
pub(super) fn contactile_papillarray_3x3() -> (SensorParameters, StatedRanges) {
    let grid = TaxelGrid { rows: 3, cols: 3, pitch: 7.0 * MM, taxel_width: 6.0 * MM };
    let coupling = Coupling { margin: Some(0.0), ..Coupling::default() };
    let known = covered(grid, 3.0 * MM, 278.0 * KPA, coupling);
    let ranges = StatedRanges {
        spread_factor: Some((0.5, 2.0)),
        edges: Some(vec![CoveringEdge::Continues]),
        cross_talk: Some((0.0, 0.05)),
        ..StatedRanges::default()
    };
    (SensorParameters { point_spread: 1.0 * MM, ..known }, ranges)
}

/// One module of Pressure Profile Systems' DigiTacts, 6 × 4 elements.
///
/// From section 2.1.1: squares of 1.8 mm with gaps of 0.1 mm, and 8 bits; 20 kPa and the covering
/// of 0.10 inch as in the dissertation's experiments. The wider gap of 0.2 mm down the middle is
/// left out, so elements are within 0.05 mm of their places.
pub(super) fn pps_digitacts_6x4() -> (SensorParameters, StatedRanges) {
    let grid = TaxelGrid { rows: 6, cols: 4, pitch: 1.9 * MM, taxel_width: 1.8 * MM };
    let known = covered(grid, 0.10 * INCH, 20.0 * KPA, Coupling::default());
    (SensorParameters { quantisation: 20.0 * KPA / 256.0, ..known }, StatedRanges::default())
}

/// GelSight Mini, as a map of 18 × 24 heights.
///
/// From GelSight: a field of 18.6 mm × 14.3 mm, so 24 columns are 0.775 mm apart and 18 rows
/// cover 13.95 mm of it. Assumed: 1.5 mm of useful indentation and heights within 0.02 mm.
pub(super) fn gelsight_mini_18x24() -> (SensorParameters, StatedRanges) {
    gel(TaxelGrid { rows: 18, cols: 24, pitch: 0.775 * MM, taxel_width: 0.775 * MM })
}

/// DIGIT, as a map of 16 × 19 heights.
///
/// From Lambeta et al. (2020), arXiv:2005.14679: a field of 19 mm × 16 mm; the gel of its
/// simulator is 20 mm × 30 mm (`facebookresearch/tacto`, `config_digit.yml`). Assumed: 1.5 mm of
/// useful indentation and heights within 0.02 mm. Its slight convexity is left out: 0.45 mm at the
/// ends of the field for the simulator's radius of 100 mm.
pub(super) fn digit_16x19() -> (SensorParameters, StatedRanges) {
    gel(TaxelGrid { rows: 16, cols: 19, pitch: 1.0 * MM, taxel_width: 1.0 * MM })
}

/// A camera that looks at a gel from inside: its image is a height map of the contact, which a
/// driver reduces to means over the cells of `grid` and multiplies by [`PRESSURE_PER_HEIGHT`].
/// Heights have no stiffness and no cross-talk; the gel goes on beyond the field of view, and
/// drapes from what it touches within about half a millimetre (assumed).
fn gel(grid: TaxelGrid) -> (SensorParameters, StatedRanges) {
    let depth = 1.5 * MM;
    let known = covered(grid, depth, PRESSURE_PER_HEIGHT * depth, Coupling::default());
    let noise = 0.02 * MM * PRESSURE_PER_HEIGHT;
    let ranges = StatedRanges {
        spread_factor: Some((0.5, 2.0)),
        margin: Some((0.5 * MM, 5.0 * MM)),
        edges: Some(vec![CoveringEdge::Continues]),
        cross_talk: Some((0.0, 0.0)),
        stiffness: Some((0.8, 1.25)),
        stiffening: Some((0.0, 0.2)),
        ..StatedRanges::default()
    };
    (SensorParameters { point_spread: 0.5 * MM, noise, ..known }, ranges)
}

fn covered(
    grid: TaxelGrid,
    covering_thickness: f64,
    saturation: f64,
    coupling: Coupling,
) -> SensorParameters {
    SensorParameters {
        grid,
        covering_thickness,
        point_spread: point_spread_of_covering(covering_thickness),
        force_curve: defaults::force_curve(covering_thickness, saturation),
        saturation,
        noise: defaults::noise(saturation, 0.0),
        quantisation: 0.0,
        image_order: ImageOrder::default(),
        coupling,
    }
}
