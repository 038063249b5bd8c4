//! Arrays that people own, as far as their makers describe them.
//!
//! Each says what its figures come from. What no source states is assumed, and open in the
//! ranges: check the pitch, the thickness and the range of your own unit. Lengths in metres,
//! pressures in pascal.

use std::sync::Arc;

use glam::DVec3;

use super::coupling::{Coupling, CoveringEdge};
use super::defaults;
use super::description::{ImageOrder, SensorParameters};
use super::grid::TaxelGrid;
use super::layout::{Layout, Taxel};
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

/// One module of Pressure Profile Systems' DigiTacts, 6 × 4 elements, or two side by side.
///
/// From section 2.1.1: squares of 1.8 mm with gaps of 0.1 mm, 0.2 mm down the middle of each
/// module, and 8 bits; 20 kPa and the covering of 0.10 inch as in the dissertation's experiments.
/// Assumed: the gap between modules is 0.1 mm too.
pub(super) fn pps_digitacts(modules: usize) -> (SensorParameters, StatedRanges) {
    let (pitch, width, middle) = (1.9 * MM, 1.8 * MM, 2.0 * MM);
    let grid = TaxelGrid { rows: 6, cols: 4 * modules, pitch, taxel_width: width };
    // Centres of the columns: a module begins a pitch after the last column of the one before.
    let steps = (1..grid.cols).map(|col| if col % 4 == 2 { middle } else { pitch });
    let mut along = vec![0.0];
    steps.for_each(|step| along.push(along[along.len() - 1] + step));
    let half = 0.5 * along[along.len() - 1];
    let taxel = |index: usize| {
        let y = grid.center(index / grid.cols, 0).1;
        let position = DVec3::new(along[index % grid.cols] - half, y, 0.0);
        Taxel { position, normal: DVec3::Z, width }
    };
    let taxels = (0..grid.n_taxels()).map(taxel).collect();
    let layout = Layout::near_grid(taxels, grid).expect("elements are within 0.1 mm of a grid");
    let known = covered(grid, 0.10 * INCH, 20.0 * KPA, Coupling::default());
    let known = SensorParameters {
        layout: Some(Arc::new(layout)),
        quantisation: 20.0 * KPA / 256.0,
        ..known
    };
    (known, StatedRanges::default())
}

/// The fingertip of the iCub's hand with 12 taxels.
///
/// Positions and normals from its maker (`icub-tech-iit/electronics-boards-public`,
/// `sensor-boards/ftx2`), said to be within 0.5 mm. Here +z is the normal of the middle of the pad
/// (its taxel 6), the origin is that taxel's centre, and +x points to the tip. Assumed: taxels of
/// 3 mm, 1.5 mm of soft fabric, 100 kPa, and 5 % of hysteresis, since Jamali et al. (2015) saw some.
pub(super) fn icub_fingertip_12() -> (SensorParameters, StatedRanges) {
    // Root frame of the source, in its order: normal (any norm), position in mm.
    const SOURCE: [([f64; 3], [f64; 3]); 12] = [
        ([0.0, 0.5, -0.866], [-10.3, 2.2, -3.8]),
        ([0.0, 1.0, 0.0], [-10.3, 4.4, 0.0]),
        ([0.0, 0.5, 0.866], [-10.3, 2.2, 3.8]),
        ([0.0, 0.0, 1.0], [-12.5, -1.4, 4.4]),
        ([0.0, 0.0, -1.0], [-12.5, -1.4, -4.4]),
        ([0.0, 0.5, 0.866], [-14.1, 2.2, 3.8]),
        ([0.0, 1.0, 0.0], [-14.1, 4.4, 0.0]),
        ([0.0, 0.5, -0.866], [-14.1, 2.2, -3.8]),
        ([-0.5, 0.472, -0.726], [-18.7, 1.6, -2.5]),
        ([-0.5, 0.866, 0.0], [-18.7, 3.15, 0.0]),
        ([-0.5, 0.472, 0.726], [-18.7, 1.6, 2.5]),
        ([-1.0, 0.0, 0.0], [-20.9, 0.0, 0.0]),
    ];
    let pad = DVec3::from_array(SOURCE[6].1);
    let turned = |v: DVec3| DVec3::new(-v.x, v.z, v.y);
    let taxel = |(normal, position): ([f64; 3], [f64; 3])| Taxel {
        position: turned(DVec3::from_array(position) - pad) * MM,
        normal: turned(DVec3::from_array(normal)).normalize(),
        width: 3.0 * MM,
    };
    let layout = Layout::list(SOURCE.map(taxel).to_vec()).expect("the taxels are a layout");
    let coupling = Coupling { hysteresis: 0.05, ..Coupling::default() };
    let known = covered(*layout.grid(), 1.5 * MM, 100.0 * KPA, coupling);
    let ranges = StatedRanges { margin: Some((0.0, 2.0 * MM)), ..StatedRanges::default() };
    (SensorParameters { layout: Some(Arc::new(layout)), ..known }, ranges)
}

/// A fingertip for simulations: 24 taxels on a cap of 10 mm radius, in rings of 1, 6, 8 and 9 that
/// are 3.5 mm apart along the skin. Chosen: about the size and number of electrodes of a human-sized
/// robot finger.
pub(super) fn fingertip_curved_24() -> SensorParameters {
    const RADIUS: f64 = 10.0 * MM;
    let ring = |(number, count): (usize, usize)| {
        let tilt = number as f64 * 3.5 * MM / RADIUS;
        (0..count).map(move |index| {
            // Every other ring is turned by half a taxel.
            let share = (index as f64 + 0.5 * (number % 2) as f64) / count as f64;
            let around = share * std::f64::consts::TAU;
            let normal =
                DVec3::new(tilt.sin() * around.cos(), tilt.sin() * around.sin(), tilt.cos());
            Taxel { position: RADIUS * (normal - DVec3::Z), normal, width: 3.0 * MM }
        })
    };
    let taxels = [1, 6, 8, 9].into_iter().enumerate().flat_map(ring).collect();
    let layout = Layout::list(taxels).expect("the rings are a layout");
    let known = covered(*layout.grid(), 0.10 * INCH, 20.0 * KPA, Coupling::default());
    let quantisation = 20.0 * KPA / 256.0;
    SensorParameters {
        layout: Some(Arc::new(layout)),
        quantisation,
        point_spread: 2.0 * MM,
        ..known
    }
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
        layout: None,
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
