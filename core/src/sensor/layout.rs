//! Layouts: taxels with a position, a normal and a size each, on a plane or on a curved skin.
//!
//! Methods compare images, so a layout names the grid on which its presses are drawn and how:
//! taxels near the places of a grid are its image; others are drawn on a plane, by their distances
//! along the skin (`unrolling`). Frame: that of the sensor, metres. Not here: pressing
//! (`palpate_sim::press`).

use glam::{DQuat, DVec3};
use thiserror::Error;

use super::grid::TaxelGrid;
use crate::pose::Pose;
use crate::units::{Beyond, MM, Shown};

/// Maximum number of taxels of a layout. Chosen: a stored sensor then fits one value of the store,
/// 4 KiB. A larger skin is several sensors, one for each patch.
pub const TAXELS_MAX: usize = 80;

/// Largest coordinate of a taxel, metres. Chosen: no patch of a skin is larger.
pub const COORDINATE_MAX: f64 = 500.0 * MM;

/// Smallest distance of two taxels, and the largest distance to the next, metres: the range of a
/// grid's pitch.
const DISTANCE: (f64, f64) = (0.05 * MM, 50.0 * MM);

/// Smallest width of a taxel, metres: that of a grid's taxel.
const WIDTH_MIN: f64 = 0.01 * MM;

/// Largest distance of a taxel from its place in a grid, as a share of the pitch. Chosen: an image
/// then errs by less than the difference between neighbours.
const OFF_GRID_MAX: f64 = 0.25;

/// Angle between normals below which a layout is flat, rad, and distance from the plane as a share
/// of the pitch. Chosen: both are less than a covering shows.
const FLAT: (f64, f64) = (0.05, 0.1);

/// Normals that differ by more than this angle (cosine) are on different sides of a finger: 60°.
/// Chosen: one contact of a convex skin shows no more of it.
pub(super) const SEEN_COSINE: f64 = 0.5;

/// Largest number of rows and of columns on which a curved layout is drawn; odd, so that the
/// contact is in the middle. Chosen: seven pitches from it no press is felt.
const CURVED_SIDE_MAX: usize = 15;

/// One taxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taxel {
    /// Its centre on the covering's free surface, metres.
    pub position: DVec3,
    /// The direction out of the covering there, norm 1 in single precision.
    pub normal: DVec3,
    /// Side of its sensing area, metres.
    pub width: f64,
}

/// How presses of a layout become images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Drawing {
    /// A value of the image is a taxel.
    AsIs,
    /// Taxels are drawn on this plane: `sensor_from_image`.
    OnPlane(Pose),
    /// Taxels are drawn on the plane that touches the skin at the contact.
    AtContact,
}

/// Taxels, and the grid of their images.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    taxels: Vec<Taxel>,
    grid: TaxelGrid,
    drawing: Drawing,
    /// Radius of the skin's curvature, metres; infinite for a flat one.
    radius: f64,
}

/// Error of taxels that are not a layout.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LayoutError {
    /// There are too few or too many.
    #[error("there are {found} taxels, expected 1 to {TAXELS_MAX}")]
    Count {
        /// The given number.
        found: usize,
    },
    /// There are not as many as the grid has places.
    #[error("there are {found} taxels, expected {expected}, one for each place of the grid")]
    PlaceCount {
        /// The given number.
        found: usize,
        /// Places of the grid.
        expected: usize,
    },
    /// A coordinate is not finite or too large.
    #[error("the position of taxel {taxel} is not finite or beyond ±{} m", Shown(COORDINATE_MAX))]
    Position {
        /// The first such taxel.
        taxel: usize,
    },
    /// A normal is not a direction.
    #[error("the normal of taxel {taxel} has norm {}, expected 1 ± 0.01", Beyond(*found, [0.99, 1.01]))]
    Normal {
        /// The first such taxel.
        taxel: usize,
        /// The norm.
        found: f64,
    },
    /// A width is out of range.
    #[error(
        "the width of taxel {taxel} is {} m, expected a finite number from {} to {}",
        Beyond(*found, [WIDTH_MIN, DISTANCE.1]), Shown(WIDTH_MIN), Shown(DISTANCE.1)
    )]
    Width {
        /// The first such taxel.
        taxel: usize,
        /// The given value.
        found: f64,
    },
    /// A taxel is too near to the next, or too far from it.
    #[error(
        "taxel {taxel} is {} m from the nearest other, expected {} to {}",
        Beyond(*found, [DISTANCE.0, DISTANCE.1]), Shown(DISTANCE.0), Shown(DISTANCE.1)
    )]
    Apart {
        /// The first such taxel.
        taxel: usize,
        /// Its distance to the nearest one, metres.
        found: f64,
    },
    /// The layout as a whole faces away from what the sensor approaches.
    #[error(
        "the mean normal of the taxels has z = {}, expected more than 0: +z points out of the \
         sensor, towards the object", Shown(*z)
    )]
    Facing {
        /// The z component of the mean normal.
        z: f64,
    },
    /// A taxel is not where the grid has it.
    #[error(
        "taxel {taxel} is {} m from its place in the grid, expected at most {}: leave `grid` out \
         for taxels that are not on one", Beyond(*found, [*most]), Shown(*most)
    )]
    OffGrid {
        /// The first such taxel.
        taxel: usize,
        /// Its distance, metres.
        found: f64,
        /// The largest permitted distance, metres.
        most: f64,
    },
}

impl LayoutError {
    /// The first invalid taxel, and its property, if the error is one of a single taxel.
    #[must_use]
    pub fn field(&self) -> Option<(usize, &'static str)> {
        match self {
            Self::Position { taxel } | Self::Apart { taxel, .. } | Self::OffGrid { taxel, .. } => {
                Some((*taxel, "position"))
            }
            Self::Normal { taxel, .. } => Some((*taxel, "normal")),
            Self::Width { taxel, .. } => Some((*taxel, "width")),
            Self::Count { .. } | Self::PlaceCount { .. } | Self::Facing { .. } => None,
        }
    }
}

impl Layout {
    /// Taxels anywhere, in the order of the driver's values.
    ///
    /// # Errors
    /// [`LayoutError`] for taxels that are no layout.
    pub fn list(taxels: Vec<Taxel>) -> Result<Self, LayoutError> {
        let taxels = checked(taxels)?;
        let pitch = pitch_of(&taxels);
        let radius = radius_of(&taxels, pitch);
        let width = median(taxels.iter().map(|taxel| taxel.width)).min(pitch);
        let (drawing, [cols, rows]) = match plane_of(&taxels, pitch) {
            Some((plane, sides)) => (Drawing::OnPlane(plane), sides),
            None => (Drawing::AtContact, [curved_side(&taxels, pitch); 2]),
        };
        let grid = TaxelGrid { rows, cols, pitch, taxel_width: width };
        Ok(Self { taxels, grid, drawing, radius })
    }

    /// Taxels near the places of a grid, row by row: as many values as the image has.
    ///
    /// # Errors
    /// [`LayoutError`] for taxels that are no layout, or not near the grid's places.
    pub fn near_grid(taxels: Vec<Taxel>, grid: TaxelGrid) -> Result<Self, LayoutError> {
        let (found, expected) = (taxels.len(), grid.n_taxels());
        if found != expected {
            return Err(LayoutError::PlaceCount { found, expected });
        }
        let taxels = checked(taxels)?;
        let most = OFF_GRID_MAX * grid.pitch;
        for (index, taxel) in taxels.iter().enumerate() {
            let found = taxel.position.distance(place_in(&grid, index));
            let is_turned = taxel.normal.angle_between(DVec3::Z) > FLAT.0;
            if found > most || is_turned {
                return Err(LayoutError::OffGrid { taxel: index, found, most });
            }
        }
        Ok(Self { taxels, grid, drawing: Drawing::AsIs, radius: f64::INFINITY })
    }

    /// The taxels, in the order of the driver's values.
    #[must_use]
    pub fn taxels(&self) -> &[Taxel] {
        &self.taxels
    }

    /// The grid of its images.
    #[must_use]
    pub fn grid(&self) -> &TaxelGrid {
        &self.grid
    }

    /// Whether images have a value for each taxel, in the order of the taxels.
    #[must_use]
    pub fn is_near_grid(&self) -> bool {
        self.drawing == Drawing::AsIs
    }

    /// Radius of the skin's curvature, metres; infinite for a flat one.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The two neighbours that lie most nearly on opposite sides of a taxel, within 1.6 pitches and
    /// at least 120° apart as seen from it; `None` at the rim.
    #[must_use]
    pub fn opposite_neighbours(&self, taxel: usize) -> Option<[usize; 2]> {
        let own = self.taxels[taxel].position;
        let towards = |other: usize| (self.taxels[other].position - own).normalize();
        let is_near = |other: &usize| {
            let apart = self.taxels[*other].position.distance(own);
            *other != taxel && apart < 1.6 * self.grid.pitch
        };
        let near: Vec<usize> = (0..self.taxels.len()).filter(is_near).collect();
        let pairs = near.iter().flat_map(|a| near.iter().map(move |b| [*a, *b]));
        let cosine = |[a, b]: &[usize; 2]| towards(*a).dot(towards(*b));
        pairs.filter(|pair| cosine(pair) < -0.5).min_by(|a, b| cosine(a).total_cmp(&cosine(b)))
    }

    pub(super) fn drawing(&self) -> Drawing {
        self.drawing
    }
}

/// The place of a taxel in a grid.
pub(super) fn place_in(grid: &TaxelGrid, index: usize) -> DVec3 {
    let (x, y) = grid.center(index / grid.cols, index % grid.cols);
    DVec3::new(x, y, 0.0)
}

/// Taxels with numbers in their ranges, and normals of norm 1.
fn checked(mut taxels: Vec<Taxel>) -> Result<Vec<Taxel>, LayoutError> {
    if !(1..=TAXELS_MAX).contains(&taxels.len()) {
        return Err(LayoutError::Count { found: taxels.len() });
    }
    for (index, taxel) in taxels.iter_mut().enumerate() {
        let is_near = taxel.position.abs().max_element() <= COORDINATE_MAX;
        if !(taxel.position.is_finite() && is_near) {
            return Err(LayoutError::Position { taxel: index });
        }
        let found = taxel.normal.length();
        if !((0.99..=1.01).contains(&found) && taxel.normal.is_finite()) {
            return Err(LayoutError::Normal { taxel: index, found });
        }
        if !(WIDTH_MIN..=DISTANCE.1).contains(&taxel.width) {
            return Err(LayoutError::Width { taxel: index, found: taxel.width });
        }
        *taxel = rounded(taxel);
    }
    for (index, found) in nearest(&taxels).enumerate() {
        if !(DISTANCE.0..=DISTANCE.1).contains(&found) {
            return Err(LayoutError::Apart { taxel: index, found });
        }
    }
    let z = mean_normal(&taxels).z;
    if z > 0.0 { Ok(taxels) } else { Err(LayoutError::Facing { z }) }
}

/// The taxel as it is stored, in single precision: within 60 nm.
fn rounded(taxel: &Taxel) -> Taxel {
    let is_unit = (taxel.normal.length() - 1.0).abs() < 1e-6;
    let normal = if is_unit { taxel.normal } else { taxel.normal.normalize() };
    Taxel {
        position: taxel.position.as_vec3().as_dvec3(),
        normal: normal.as_vec3().as_dvec3(),
        width: f64::from(taxel.width as f32),
    }
}

/// The distance of each taxel to the nearest other; of a single taxel its width.
fn nearest(taxels: &[Taxel]) -> impl Iterator<Item = f64> {
    taxels.iter().enumerate().map(move |(index, taxel)| {
        let others = taxels.iter().enumerate().filter(|(other, _)| *other != index);
        let distances = others.map(|(_, other)| taxel.position.distance(other.position));
        let least = distances.fold(f64::INFINITY, f64::min);
        if taxels.len() == 1 { taxel.width.max(DISTANCE.0) } else { least }
    })
}

fn pitch_of(taxels: &[Taxel]) -> f64 {
    median(nearest(taxels))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

pub(super) fn mean_normal(taxels: &[Taxel]) -> DVec3 {
    taxels.iter().map(|taxel| taxel.normal).sum::<DVec3>() / taxels.len() as f64
}

/// The plane of flat taxels (`sensor_from_image`, about the middle of them), and the numbers of
/// columns and rows that cover them; `None` for a curved skin.
fn plane_of(taxels: &[Taxel], pitch: f64) -> Option<(Pose, [usize; 2])> {
    let normal = mean_normal(taxels).normalize();
    let turn = DQuat::from_rotation_arc(DVec3::Z, normal);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for taxel in taxels {
        let at = turn.inverse() * taxel.position;
        (low, high) = (low.min(at), high.max(at));
        if taxel.normal.angle_between(normal) > FLAT.0 {
            return None;
        }
    }
    if high.z - low.z > FLAT.1 * pitch {
        return None;
    }
    let side = |from: f64, to: f64| (((to - from) / pitch).round() as usize + 1).min(128);
    let sides = [side(low.x, high.x), side(low.y, high.y)];
    Some((Pose::from_parts(turn, turn * (0.5 * (low + high))), sides))
}

/// Number of rows and columns that show all that a contact anywhere can press.
fn curved_side(taxels: &[Taxel], pitch: f64) -> usize {
    let seen = |taxel: &Taxel| {
        let others = taxels.iter().filter(|other| other.normal.dot(taxel.normal) > SEEN_COSINE);
        others.map(|other| along_skin(taxel, other)).fold(0.0, f64::max)
    };
    let farthest = taxels.iter().map(seen).fold(0.0, f64::max);
    // A contact is in the middle of what it presses: half of the farthest pair is on either side.
    let half = (0.5 * farthest / pitch).ceil() as usize;
    (2 * half + 1).clamp(3, CURVED_SIDE_MAX)
}

/// Distance of two taxels along a skin of even curvature, metres.
pub(super) fn along_skin(from: &Taxel, to: &Taxel) -> f64 {
    arc(from.position.distance(to.position), from.normal.angle_between(to.normal))
}

/// The arc over a chord whose ends are turned by `angle`.
pub(super) fn arc(chord: f64, angle: f64) -> f64 {
    let half = 0.5 * angle;
    if half < 1e-6 { chord } else { chord * half / half.sin() }
}

/// Radius of curvature by least squares over neighbours, `x_i − x_j = R (n_i − n_j)`, metres.
fn radius_of(taxels: &[Taxel], pitch: f64) -> f64 {
    let (mut over, mut under) = (0.0, 0.0);
    for (index, one) in taxels.iter().enumerate() {
        for other in &taxels[..index] {
            let apart = one.position - other.position;
            if apart.length() <= 2.0 * pitch {
                let turned = one.normal - other.normal;
                over += apart.dot(turned);
                under += turned.length_squared();
            }
        }
    }
    // Flatter than a metre, or hollow, counts as flat.
    if under > 0.0 && over > 0.0 && over < under { over / under } else { f64::INFINITY }
}
