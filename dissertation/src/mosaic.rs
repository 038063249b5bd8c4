//! The force mosaic: the expected pressure of a planar press at each position of an object.
//!
//! Section 3.2.1 mentions a tactile mosaic in the force domain before it binarises it; this
//! keeps the force. A cell holds the mean pressure at unit press amplitude and the deviation
//! of single readings. Frame: the object's, in the grid's plane.

pub mod face;
mod kernel;
pub mod learn;
pub mod press_fit;
pub mod screen;
pub mod tile;
mod variance;

use crate::occupancy::{GridError, GridShape};

/// Mean pressure and its deviation in every cell of a planar grid.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceMosaic {
    shape: GridShape,
    pressure: Vec<f32>,
    deviation: Vec<f32>,
}

impl ForceMosaic {
    /// A mosaic from its parts: mean pressures and their standard deviations in Pa, in the
    /// grid's order. A cell that no press has reached has an infinite deviation.
    ///
    /// # Errors
    /// [`GridError`] for a grid of several layers, or values that do not fit its cells: finite
    /// pressures, deviations above 0.
    pub fn from_parts(
        shape: GridShape,
        pressure: Vec<f32>,
        deviation: Vec<f32>,
    ) -> Result<Self, GridError> {
        let [x, y, z] = shape.n();
        if z != 1 {
            return Err(GridError::Count { x, y, z });
        }
        let valid = pressure.iter().all(|value| value.is_finite())
            && deviation.iter().all(|value| *value > 0.0);
        let expected = shape.n_cells();
        if pressure.len() != expected || deviation.len() != expected || !valid {
            return Err(GridError::Values { expected, found: pressure.len() });
        }
        Ok(Self { shape, pressure, deviation })
    }

    /// Position of the cells.
    #[must_use]
    pub fn shape(&self) -> &GridShape {
        &self.shape
    }

    /// Mean pressures, Pa.
    #[must_use]
    pub fn pressure(&self) -> &[f32] {
        &self.pressure
    }

    /// Standard deviations of a single reading, Pa; infinite for unmapped cells.
    #[must_use]
    pub fn deviation(&self) -> &[f32] {
        &self.deviation
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn only_planar_grids_with_fitting_values_make_a_mosaic() {
        let plane = GridShape::new(DVec3::ZERO, 1.0, [2, 1, 1]).unwrap();
        let solid = GridShape::new(DVec3::ZERO, 1.0, [1, 1, 2]).unwrap();
        let make = |shape, deviation| ForceMosaic::from_parts(shape, vec![1.0; 2], deviation);
        assert!(make(plane, vec![1.0, f32::INFINITY]).is_ok());
        assert!(make(solid, vec![1.0; 2]).is_err());
        assert!(make(plane, vec![1.0, 0.0]).is_err());
        assert!(make(plane, vec![1.0]).is_err());
    }
}
