//! The map of one object: patches of its surface, with the tables that look them up.

use glam::{DVec3, Vec3};

use super::bend::bends;
use super::facet::Facet;
use super::features::Features;
use super::pair_table::PairTable;
use super::patch::SurfacePatch;
use super::solid::Solid;
use super::voxels::Voxels;
use palpate_core::symmetry::Symmetry;

/// Maximum number of patches of a map: an index fits into two bytes.
pub const PATCHES_MAX: usize = u16::MAX as usize;

/// Least reach of a voxel, in spacings of patches. The width of a patch's kernel along the
/// surface grows with the spacing (`verify::density`), so that the reach grows in proportion: 7
/// mm for 4 mm if the spacing is smaller.
const REACH_SPACINGS: f32 = 1.75;

/// Least edge of a voxel, in spacings of patches.
const EDGE_SPACINGS: f32 = 0.8;

/// Layout of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceLayout {
    /// Edge of a voxel, metres; a minimum.
    pub voxel: f32,
    /// Reach of a voxel, metres; a minimum.
    pub reach: f32,
    /// Patches whose pairs are tabled: the first ones.
    pub pair_patches_max: usize,
    /// Least distance of a tabled pair, metres.
    pub pair_distance_min: f32,
    /// Width of the pairs' distance bins, metres.
    pub pair_distance_edge: f32,
}

impl Default for SurfaceLayout {
    fn default() -> Self {
        Self {
            voxel: 0.003,
            reach: 0.007,
            pair_patches_max: 700,
            pair_distance_min: 0.004,
            pair_distance_edge: 0.002,
        }
    }
}

/// The surface of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMap {
    origin_in_training: DVec3,
    patches: Vec<SurfacePatch>,
    features: Features,
    facets: Vec<Facet>,
    layout: SurfaceLayout,
    spacing: f32,
    radius: f32,
    voxels: Voxels,
    solid: Solid,
    pairs: PairTable,
    symmetry: Symmetry,
}

impl SurfaceMap {
    /// A map of patches (in the order of thinning, at most [`PATCHES_MAX`]), in the object frame
    /// whose origin lies at `origin_in_training` (m) of the training frame; without symmetry.
    #[must_use]
    pub fn new(
        origin_in_training: DVec3,
        patches: Vec<SurfacePatch>,
        layout: SurfaceLayout,
    ) -> Self {
        let places: Vec<(Vec3, Vec3)> =
            patches.iter().map(|patch| (patch.position, patch.normal)).collect();
        let paired = &places[..layout.pair_patches_max.min(places.len())];
        let spacing = spacing(&places);
        // On a large object touches lie far apart, so that the reach is relative to their spacing.
        let reach = layout.reach.max(REACH_SPACINGS * spacing);
        let edge = layout.voxel.max(EDGE_SPACINGS * spacing);
        let voxels = Voxels::build(&places, edge, reach, REACH_SPACINGS);
        let pairs = PairTable::build(paired, layout.pair_distance_min, layout.pair_distance_edge);
        let facets = Facet::all(&patches, &bends(&patches, spacing));
        let features = Features::new(patches.iter().map(|patch| &patch.feature));
        let solid = Solid::of_patches(&patches, spacing, reach);
        Self {
            origin_in_training,
            patches,
            features,
            facets,
            layout,
            spacing,
            radius: radius(&places),
            voxels,
            solid,
            pairs,
            symmetry: Symmetry::NONE,
        }
    }

    /// The map with the symmetry of its object.
    #[must_use]
    pub fn with_symmetry(self, symmetry: Symmetry) -> Self {
        Self { symmetry, ..self }
    }

    /// The symmetry of the object, as far as is known.
    #[must_use]
    pub fn symmetry(&self) -> &Symmetry {
        &self.symmetry
    }

    /// Origin of the object frame in the training frame, metres.
    #[must_use]
    pub fn origin_in_training(&self) -> DVec3 {
        self.origin_in_training
    }

    /// The patches, in the order of thinning.
    #[must_use]
    pub fn patches(&self) -> &[SurfacePatch] {
        &self.patches
    }

    /// Features of the patches.
    #[must_use]
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// The patches in their order, each with the curved surface about it.
    #[must_use]
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// The layout.
    #[must_use]
    pub fn layout(&self) -> SurfaceLayout {
        self.layout
    }

    /// Δ: the spacing of patches, √(area of surface/patches), metres.
    #[must_use]
    pub fn spacing(&self) -> f32 {
        self.spacing
    }

    /// Largest distance of a patch from the middle of their box, metres.
    #[must_use]
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Largest distance of a patch from the object's origin, metres.
    #[must_use]
    pub fn reach(&self) -> f32 {
        self.patches.iter().map(|patch| patch.position.length()).fold(0.0, f32::max)
    }

    /// The voxels, which find the patches near a point.
    #[must_use]
    pub fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// The grid of solid and vacant space.
    #[must_use]
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// The pairs of touches.
    #[must_use]
    pub fn pairs(&self) -> &PairTable {
        &self.pairs
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + size_of_val(self.patches.as_slice())
            + self.features.bytes()
            + size_of_val(self.facets.as_slice())
            + size_of_val(self.symmetry.axes.as_slice())
            + self.voxels.bytes()
            + self.solid.bytes()
            + self.pairs.bytes()
    }
}

/// √(area/touches): estimated as twice the median distance to the nearest touch, its expectation
/// for touches spread at random.
fn spacing(places: &[(Vec3, Vec3)]) -> f32 {
    let nearest = |(index, (position, _)): (usize, &(Vec3, Vec3))| {
        let others = places.iter().enumerate().filter(|(other, _)| *other != index);
        others
            .map(|(_, (other, _))| position.distance_squared(*other))
            .fold(f32::INFINITY, f32::min)
    };
    let mut distances: Vec<f32> = places.iter().enumerate().map(nearest).collect();
    distances.sort_unstable_by(f32::total_cmp);
    let median = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
    if median.is_finite() { 2.0 * median.sqrt() } else { 0.0 }
}

/// Largest distance of a place from the middle of their box.
fn radius(places: &[(Vec3, Vec3)]) -> f32 {
    let low = places.iter().map(|place| place.0).fold(Vec3::INFINITY, Vec3::min);
    let high = places.iter().map(|place| place.0).fold(Vec3::NEG_INFINITY, Vec3::max);
    let middle = 0.5 * (low + high);
    places.iter().map(|place| place.0.distance(middle)).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(x: f32) -> SurfacePatch {
        SurfacePatch {
            position: Vec3::new(x, 0.0, 0.0),
            normal: Vec3::Z,
            direction: Vec3::X,
            elongation: 0.5,
            normal_deviation: 0.1,
            feature: [0; 8],
        }
    }

    #[test]
    fn pairs_are_tabled_among_the_most_wanted_only() {
        let patches: Vec<SurfacePatch> = (0..5).map(|n| patch(0.01 * n as f32)).collect();
        let layout = SurfaceLayout { pair_patches_max: 3, ..SurfaceLayout::default() };
        let map = SurfaceMap::new(DVec3::Y, patches.clone(), layout);
        assert_eq!(map.pairs().len(), 3); // of three: 3 · 2 / 2
        assert_eq!((map.patches(), map.layout()), (patches.as_slice(), layout));
        assert_eq!(map.origin_in_training(), DVec3::Y);
        assert_eq!(
            map.voxels().near(patches[4].position).touches().next(),
            Some(4),
            "looked up all the same"
        );
    }

    #[test]
    fn bytes_count_what_the_map_holds() {
        let patches: Vec<SurfacePatch> = (0..5).map(|n| patch(0.01 * n as f32)).collect();
        let map = SurfaceMap::new(DVec3::ZERO, patches, SurfaceLayout::default());
        // Three vectors of 12 bytes, two numbers of 4 and 8 of 1 make 52 a patch; with the surface
        // about it it is 64 more, and the 8 are there once more in a block for eight.
        let parts = map.voxels().bytes() + map.solid().bytes() + map.pairs().bytes() + 5 * 116 + 64;
        assert_eq!(map.bytes(), parts + size_of::<SurfaceMap>());
        assert!(map.pairs().bytes() >= 10 * 4, "ten pairs of two numbers");
    }
}
