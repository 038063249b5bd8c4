//! Merging of maps whose cells do not coincide: other extents, or object frames of other origins.
//!
//! Readings of two robots give such maps. The other map is interpolated between its cells, so
//! a shift by a part of a cell blurs its evidence by less than a cell. Axes must be parallel.

use glam::DVec3;
use palpate_core::stop::Stop;

use super::grid::{GridShape, MergeError, OccupancyGrid};

/// Fraction of a cell by which coinciding grids may differ.
const TOLERANCE: f64 = 1e-6;

impl OccupancyGrid {
    /// The map of the readings of both maps, over the cells of both, on this map's lattice. A
    /// point here is `point + other_from_this` (metres) in the other's frame. Heeds `stop`.
    ///
    /// # Errors
    /// [`MergeError`] unless cells and priors are equal and both are planar or both solid.
    pub fn merge_shifted(
        &self,
        other: &Self,
        other_from_this: DVec3,
        stop: &Stop,
    ) -> Result<Self, MergeError> {
        let (ours, theirs) = (self.shape(), other.shape());
        let cell = ours.cell();
        let refused = MergeError::Shape { ours: *ours, theirs: *theirs };
        let is_other_size = (cell - theirs.cell()).abs() > TOLERANCE * cell;
        if is_other_size || ours.is_planar() != theirs.is_planar() {
            return Err(refused);
        }
        let shifted = theirs.min() - other_from_this;
        let apart = (shifted - ours.min()).abs().max_element();
        if theirs.n() == ours.n() && apart <= TOLERANCE * cell {
            let same = Self::from_parts(*ours, other.prior(), other.log_odds().to_vec());
            return self.merge(&same.map_err(|_| refused)?);
        }
        let low = ours.min().min(shifted) + TOLERANCE * cell;
        let high = end(ours, ours.min()).max(end(theirs, shifted)) - TOLERANCE * cell;
        let plane = ours.is_planar().then_some(ours.min().z);
        let shape = GridShape::spanning(low, high, cell, plane).map_err(|_| refused)?;
        let [ours, theirs] = [(self, DVec3::ZERO), (other, other_from_this)].map(|(map, shift)| {
            let value = |cell| {
                stop.check();
                map.log_odds_at(shape.center(cell) + shift) as f32
            };
            let values = (0..shape.n_cells()).map(value).collect();
            Self::from_parts(shape, map.prior(), values).map_err(|_| refused)
        });
        ours?.merge(&theirs?)
    }
}

/// The corner with the largest coordinates of a grid that starts at `min`.
fn end(shape: &GridShape, min: DVec3) -> DVec3 {
    min + DVec3::from_array(shape.n().map(|n| n as f64)) * shape.cell()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(min: [f64; 3], n: [usize; 3], values: &[f32]) -> OccupancyGrid {
        let shape = GridShape::new(min.into(), 0.5, n).unwrap();
        OccupancyGrid::from_parts(shape, 0.5, values.to_vec()).unwrap()
    }

    #[test]
    fn coinciding_cells_add_up_exactly() {
        let ours = map([0.0; 3], [2, 1, 2], &[1.0, 2.0, -1.0, 0.5]);
        let theirs = map([1.0, 0.0, 0.0], [2, 1, 2], &[0.25, -2.0, 1.0, 7.9]);
        let merged = ours.merge_shifted(&theirs, DVec3::X, &Stop::never()).unwrap();
        assert_eq!(merged.log_odds(), [1.25, 0.0, 0.0, 8.0]);
        assert_eq!(merged.shape(), ours.shape());
    }

    #[test]
    fn maps_of_other_extents_merge_over_both() {
        // Our cells end at x = 1, theirs begin there, a cell further in their own frame.
        let ours = map([0.0, 0.0, 3.0], [2, 1, 1], &[1.0, 2.0]);
        let theirs = map([1.5, 0.0, 4.0], [1, 2, 1], &[3.0, 4.0]);
        let merged =
            ours.merge_shifted(&theirs, DVec3::new(0.5, 0.0, 0.0), &Stop::never()).unwrap();
        assert_eq!(merged.shape().n(), [3, 2, 1]);
        assert_eq!(merged.shape().min(), DVec3::new(0.0, 0.0, 3.0));
        let expected = [1.0, 2.0, 3.0, 0.0, 0.0, 4.0];
        for (found, expected) in merged.log_odds().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{:?}", merged.log_odds());
        }
    }

    #[test]
    fn half_a_cell_is_interpolated() {
        let ours = map([0.0; 3], [2, 1, 1], &[0.0, 0.0]);
        let theirs = map([0.25, 0.0, 0.0], [2, 1, 1], &[4.0, 2.0]);
        let merged = ours.merge_shifted(&theirs, DVec3::ZERO, &Stop::never()).unwrap();
        // Centres at 0.25, 0.75 and 1.25; theirs are 4 at 0.5 and 2 at 1, 0 beside them.
        assert_eq!(merged.log_odds(), [2.0, 3.0, 1.0]);
    }

    #[test]
    fn other_cells_priors_and_dimensions_are_refused() {
        let ours = map([0.0; 3], [2, 1, 1], &[0.0, 0.0]);
        let solid = map([0.0; 3], [1, 1, 2], &[0.0, 0.0]);
        assert!(matches!(
            ours.merge_shifted(&solid, DVec3::ZERO, &Stop::never()),
            Err(MergeError::Shape { .. })
        ));
        let shape = GridShape::new(DVec3::ZERO, 0.25, [2, 1, 1]).unwrap();
        let fine = OccupancyGrid::from_parts(shape, 0.5, vec![0.0; 2]).unwrap();
        assert!(matches!(
            ours.merge_shifted(&fine, DVec3::ZERO, &Stop::never()),
            Err(MergeError::Shape { .. })
        ));
        let other = OccupancyGrid::from_parts(*ours.shape(), 0.4, vec![0.0; 2]).unwrap();
        assert!(matches!(
            ours.merge_shifted(&other, DVec3::X, &Stop::never()),
            Err(MergeError::Prior { .. })
        ));
    }
}
