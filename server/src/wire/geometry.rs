//! Conversion of chapter 3's geometry: trainings, pose priors, maps and reports.

use std::f64::consts::PI;

use palpate_dissertation::geometric::model::{GeometricMap, GeometricModel};
use palpate_dissertation::geometric::train::GeometricConfig;
use palpate_dissertation::geometric::{AxisMarginal, Marginals, PosePrior as CorePrior};
use palpate_dissertation::occupancy::OccupancyGrid;
use palpate_schemas as wire;
use palpate_schemas::{AxisUnit, GeometricKind, PosePrior};
use palpate_store::catalogue::VersionObject;
use uuid::Uuid;

use crate::wire::Invalid;
use crate::wire::{count, number, reading};

/// Minimum and maximum side of a cell, in metres.
const CELL: [f64; 2] = [1e-4, 0.05];
/// Maximum half side of the box of possible positions, in metres.
const HALF_EXTENT_MAX: f64 = 1.0;
/// Default half side of that box, in metres: the dissertation's.
pub(crate) const HALF_EXTENT: f64 = 0.01;
/// Minimum half side of that box, in metres.
const HALF_EXTENT_MIN: f64 = 1e-4;
/// Minimum half width of a range of rotations, in radians.
const HALF_ANGLE_MIN: f64 = 1e-3;
/// Largest coordinate of that box's centre, in metres.
const CENTER_MAX: f64 = 1e3;

/// A training's geometry with its default filled in, its numbers checked.
pub(crate) fn training(
    request: wire::GeometricTraining,
) -> Result<wire::GeometricTraining, Invalid> {
    let [low, high] = CELL;
    let cell = request.cell.unwrap_or(config(&request).cell);
    let cell = number("/geometric/cell", cell, low, high)?;
    Ok(wire::GeometricTraining { cell: Some(cell), ..request })
}

/// Core's configuration of a training's geometry.
pub(crate) fn config(training: &wire::GeometricTraining) -> GeometricConfig {
    let default = match training.kind {
        GeometricKind::Planar => GeometricConfig::planar(),
        GeometricKind::Solid => GeometricConfig::solid(),
    };
    GeometricConfig { cell: training.cell.unwrap_or(default.cell), ..default }
}

/// The kind of a version's maps.
pub(crate) fn kind(model: &GeometricModel) -> GeometricKind {
    let mut maps = model.maps.iter();
    if maps.all(|map| map.occupancy.shape().is_planar()) {
        GeometricKind::Planar
    } else {
        GeometricKind::Solid
    }
}

/// The report on an object's geometry.
pub(crate) fn report(map: &GeometricMap) -> wire::GeometricReport {
    let shape = map.occupancy.shape();
    let n_force = map.mosaic.as_ref().map_or(0, |mosaic| 2 * mosaic.shape().n_cells());
    wire::GeometricReport {
        kind: kind_of(&map.occupancy),
        cell: shape.cell(),
        n_cells: shape.n().map(count),
        bytes: (shape.n_cells() + n_force) as u64 * size_of::<f32>() as u64,
        has_force: map.mosaic.is_some(),
    }
}

/// An object's map of contact, with the cells of one slice if named.
pub(crate) fn occupancy_map(
    object: &VersionObject,
    map: &GeometricMap,
    slice: Option<u32>,
) -> Result<wire::OccupancyMap, Invalid> {
    let grid = &map.occupancy;
    let prior = (grid.prior() / (1.0 - grid.prior())).ln() as f32;
    let counted = |is: fn(f32, f32) -> bool| {
        count(grid.log_odds().iter().filter(|cell| is(**cell, prior)).count())
    };
    let log_odds = slice.map(|slice| self::slice(grid, slice).map(<[f32]>::to_vec)).transpose()?;
    Ok(wire::OccupancyMap {
        id: object.id,
        name: object.name.clone(),
        kind: kind_of(grid),
        min: grid.shape().min().to_array(),
        cell: grid.shape().cell(),
        n_cells: grid.shape().n().map(count),
        prior: grid.prior(),
        n_occupied: counted(|cell, prior| cell > prior),
        n_free: counted(|cell, prior| cell < prior),
        n_unknown: counted(|cell, prior| cell.total_cmp(&prior).is_eq()),
        has_force: map.mosaic.is_some(),
        log_odds,
    })
}

/// The log-odds of one layer of cells.
fn slice(grid: &OccupancyGrid, slice: u32) -> Result<&[f32], Invalid> {
    let [x, y, _] = grid.shape().n();
    let slice = slice_number(grid, slice)?;
    Ok(&grid.log_odds()[slice * x * y..(slice + 1) * x * y])
}

/// The index of an existing layer of a grid.
pub(crate) fn slice_number(grid: &OccupancyGrid, slice: u32) -> Result<usize, Invalid> {
    let n_slices = grid.shape().n()[2];
    let last = n_slices as u64 - 1;
    super::within("?slice", u64::from(slice), 0, last).map(|slice| slice as usize)
}

fn kind_of(grid: &OccupancyGrid) -> GeometricKind {
    if grid.shape().is_planar() { GeometricKind::Planar } else { GeometricKind::Solid }
}

/// A session's prior over poses with every default filled in, checked against the kind of its
/// maps.
pub(crate) fn pose_prior(
    given: Option<&PosePrior>,
    kind: GeometricKind,
) -> Result<PosePrior, Invalid> {
    match (kind, given) {
        (GeometricKind::Planar, None) => planar(None, None, None, None, None),
        (
            GeometricKind::Planar,
            Some(PosePrior::Planar { plane, center, half_extent, angle, half_angle }),
        ) => planar(*plane, *center, *half_extent, *angle, *half_angle),
        (GeometricKind::Solid, Some(PosePrior::Bounded { pose, half_extents, half_angle })) => {
            bounded(pose, *half_extents, *half_angle)
        }
        (GeometricKind::Solid, None) => Err(Invalid::field(
            "/pose_prior",
            "missing: the version's maps are of solids, expected a prior of kind `bounded` that \
             says about where the object is",
        )),
        (_, Some(PosePrior::Camera { .. })) => Err(Invalid::field(
            "/pose_prior/kind",
            "came `camera`, expected with `surface` only: the methods `geometric…` take `planar` \
             or `bounded`",
        )),
        (GeometricKind::Planar, Some(PosePrior::Bounded { .. })) => Err(Invalid::field(
            "/pose_prior/kind",
            "came `bounded`, but the version's maps are planar: expected `planar`",
        )),
        (GeometricKind::Solid, Some(PosePrior::Planar { .. })) => Err(Invalid::field(
            "/pose_prior/kind",
            "came `planar`, but the version's maps are of solids: expected `bounded`",
        )),
    }
}

fn planar(
    plane: Option<wire::Pose>,
    center: Option<[f64; 2]>,
    half_extent: Option<f64>,
    angle: Option<f64>,
    half_angle: Option<f64>,
) -> Result<PosePrior, Invalid> {
    if let Some(plane) = &plane {
        reading::pose("/pose_prior/plane", plane)?;
    }
    let center = center.unwrap_or_default();
    for (axis, value) in center.into_iter().enumerate() {
        number(&format!("/pose_prior/center/{axis}"), value, -CENTER_MAX, CENTER_MAX)?;
    }
    let half_extent = half_extent.unwrap_or(HALF_EXTENT);
    number("/pose_prior/half_extent", half_extent, HALF_EXTENT_MIN, HALF_EXTENT_MAX)?;
    let angle = number("/pose_prior/angle", angle.unwrap_or(0.0), -2.0 * PI, 2.0 * PI)?;
    Ok(PosePrior::Planar {
        plane: Some(plane.unwrap_or(IDENTITY)),
        center: Some(center),
        half_extent: Some(half_extent),
        angle: Some(angle),
        half_angle: Some(self::half_angle(half_angle.unwrap_or(PI))?),
    })
}

fn bounded(
    pose: &wire::Pose,
    half_extents: [f64; 3],
    half_angle: f64,
) -> Result<PosePrior, Invalid> {
    reading::pose("/pose_prior/pose", pose)?;
    for (axis, value) in half_extents.into_iter().enumerate() {
        let pointer = format!("/pose_prior/half_extents/{axis}");
        number(&pointer, value, HALF_EXTENT_MIN, HALF_EXTENT_MAX)?;
    }
    let half_angle = self::half_angle(half_angle)?;
    Ok(PosePrior::Bounded { pose: *pose, half_extents, half_angle })
}

fn half_angle(found: f64) -> Result<f64, Invalid> {
    // π as printed by other programs is a little more than ours.
    number("/pose_prior/half_angle", found, HALF_ANGLE_MIN, PI + 1e-6).map(|angle| angle.min(PI))
}

const IDENTITY: wire::Pose = wire::Pose { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] };

/// Core's prior over poses from one that was checked and has its defaults.
///
/// # Errors
/// [`Invalid`] if the stored prior is no longer valid.
pub(crate) fn core_prior(prior: &PosePrior) -> Result<CorePrior, Invalid> {
    match prior {
        PosePrior::Planar { plane, center, half_extent, angle, half_angle } => {
            Ok(CorePrior::Planar {
                session_from_plane: reading::pose("/pose_prior/plane", &plane.unwrap_or(IDENTITY))?,
                center: center.unwrap_or_default(),
                half_extent: half_extent.unwrap_or(HALF_EXTENT),
                angle: angle.unwrap_or_default(),
                half_angle: half_angle.unwrap_or(PI),
            })
        }
        PosePrior::Bounded { pose, half_extents, half_angle } => Ok(CorePrior::Bounded {
            session_from_object: reading::pose("/pose_prior/pose", pose)?,
            half_extent: (*half_extents).into(),
            half_angle: *half_angle,
        }),
        PosePrior::Camera { .. } => {
            Err(Invalid::field("/pose_prior/kind", "came `camera`, expected `planar` or `bounded`"))
        }
    }
}

/// Marginals in their wire form.
pub(crate) fn marginals(
    session: Uuid,
    revision: u64,
    object: &VersionObject,
    probability: f64,
    found: &Marginals,
) -> wire::Marginals {
    wire::Marginals {
        session,
        revision: count(revision),
        object: object.id,
        name: object.name.clone(),
        probability,
        axes: found.axes.iter().map(marginal).collect(),
        plane: found.plane.as_ref().map(|plane| wire::PlaneMarginal {
            low: plane.low,
            high: plane.high,
            n: plane.n.map(count),
            probabilities: plane.probabilities.clone(),
        }),
    }
}

fn marginal(found: &AxisMarginal) -> wire::Marginal {
    let is_place = matches!(found.axis, "x" | "y" | "z");
    wire::Marginal {
        axis: found.axis.to_owned(),
        unit: if is_place { AxisUnit::M } else { AxisUnit::Rad },
        low: found.low,
        high: found.high,
        probabilities: found.probabilities.clone(),
    }
}
