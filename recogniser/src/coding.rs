//! Coding: values as bytes, exact, for work that others do.
//!
//! Numbers are little-endian; floats keep every bit. Reading allocates no more than a constant times
//! the bytes that it was given, and refuses what writing does not produce.

use bytes::{Buf, BufMut, TryGetError};
use glam::{DQuat, DVec3, Mat3, Quat, Vec3};
use nalgebra::Matrix6;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::{Base, Looseness};
use palpate_core::symmetry::{AxisOrder, Symmetry, SymmetryAxis};
use thiserror::Error;

/// Bytes are not work, or results of work, of this version.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("these bytes are not work on parts of a catalogue, or are of another version")]
pub struct NotWork;

impl From<TryGetError> for NotWork {
    fn from(_too_short: TryGetError) -> Self {
        Self
    }
}

/// A value as bytes. Law: `take` of what `put` wrote is the same value, bit for bit.
pub(crate) trait Coded: Sized {
    /// Appends the value, at least one byte.
    fn put(&self, to: &mut Vec<u8>);

    /// Reads the value and removes it.
    fn take(from: &mut &[u8]) -> Result<Self, NotWork>;
}

/// Appends values of a list without their number.
pub(crate) fn put_all<'a, T: Coded + 'a>(of: impl IntoIterator<Item = &'a T>, to: &mut Vec<u8>) {
    of.into_iter().for_each(|value| value.put(to));
}

/// Reads an array.
fn array<T: Coded + Copy, const N: usize>(blank: T, from: &mut &[u8]) -> Result<[T; N], NotWork> {
    let mut all = [blank; N];
    for value in &mut all {
        *value = T::take(from)?;
    }
    Ok(all)
}

impl Coded for u8 {
    fn put(&self, to: &mut Vec<u8>) {
        to.put_u8(*self);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(from.try_get_u8()?)
    }
}

impl Coded for u32 {
    fn put(&self, to: &mut Vec<u8>) {
        to.put_u32_le(*self);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(from.try_get_u32_le()?)
    }
}

impl Coded for usize {
    fn put(&self, to: &mut Vec<u8>) {
        to.put_u64_le(*self as u64);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Self::try_from(from.try_get_u64_le()?).map_err(|_too_large| NotWork)
    }
}

impl Coded for f32 {
    fn put(&self, to: &mut Vec<u8>) {
        to.put_f32_le(*self);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(from.try_get_f32_le()?)
    }
}

impl Coded for f64 {
    fn put(&self, to: &mut Vec<u8>) {
        to.put_f64_le(*self);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(from.try_get_f64_le()?)
    }
}

impl Coded for bool {
    fn put(&self, to: &mut Vec<u8>) {
        to.put_u8((*self).into());
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        match from.try_get_u8()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(NotWork),
        }
    }
}

impl<T: Coded> Coded for Option<T> {
    fn put(&self, to: &mut Vec<u8>) {
        self.is_some().put(to);
        put_all(self, to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        bool::take(from)?.then(|| T::take(from)).transpose()
    }
}

impl<T: Coded> Coded for Vec<T> {
    fn put(&self, to: &mut Vec<u8>) {
        (self.len() as u32).put(to);
        put_all(self, to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let n = u32::take(from)? as usize;
        // A value is at least one byte.
        if n > from.len() {
            return Err(NotWork);
        }
        (0..n).map(|_| T::take(from)).collect()
    }
}

impl<T: Coded, U: Coded> Coded for (T, U) {
    fn put(&self, to: &mut Vec<u8>) {
        self.0.put(to);
        self.1.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok((T::take(from)?, U::take(from)?))
    }
}

impl<const N: usize> Coded for [f32; N] {
    fn put(&self, to: &mut Vec<u8>) {
        put_all(self, to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        array(0.0, from)
    }
}

impl<const N: usize> Coded for [f64; N] {
    fn put(&self, to: &mut Vec<u8>) {
        put_all(self, to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        array(0.0, from)
    }
}

impl Coded for Vec3 {
    fn put(&self, to: &mut Vec<u8>) {
        self.to_array().put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self::from_array(Coded::take(from)?))
    }
}

impl Coded for Quat {
    fn put(&self, to: &mut Vec<u8>) {
        self.to_array().put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self::from_array(Coded::take(from)?))
    }
}

impl Coded for Mat3 {
    fn put(&self, to: &mut Vec<u8>) {
        self.to_cols_array().put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self::from_cols_array(&Coded::take(from)?))
    }
}

impl Coded for DVec3 {
    fn put(&self, to: &mut Vec<u8>) {
        self.to_array().put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self::from_array(Coded::take(from)?))
    }
}

impl Coded for Matrix6<f64> {
    fn put(&self, to: &mut Vec<u8>) {
        put_all(self.iter(), to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self::from_column_slice(&<[f64; 36]>::take(from)?))
    }
}

impl Coded for ObjectIdx {
    fn put(&self, to: &mut Vec<u8>) {
        self.0.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self(Coded::take(from)?))
    }
}

impl Coded for Pose {
    fn put(&self, to: &mut Vec<u8>) {
        self.rotation.to_array().put(to);
        self.translation.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let rotation = DQuat::from_array(Coded::take(from)?);
        Ok(Self { rotation, translation: Coded::take(from)? })
    }
}

impl Coded for Looseness {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { position, angle } = self;
        [*position, *angle].put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self { position: Coded::take(from)?, angle: Coded::take(from)? })
    }
}

impl Coded for Base {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { robot, looseness } = self;
        robot.put(to);
        looseness.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self { robot: Coded::take(from)?, looseness: Coded::take(from)? })
    }
}

impl Coded for SymmetryAxis {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { point, direction, order } = self;
        point.put(to);
        direction.put(to);
        // An axis of order 0 or 1 is none.
        match order {
            AxisOrder::Finite(n) => n.put(to),
            AxisOrder::Continuous => 0u8.put(to),
        }
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let (point, direction) = Coded::take(from)?;
        let order = match u8::take(from)? {
            0 => AxisOrder::Continuous,
            n => AxisOrder::Finite(n),
        };
        Ok(Self { point, direction, order })
    }
}

impl Coded for Symmetry {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { center, axes } = self;
        center.put(to);
        axes.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self { center: Coded::take(from)?, axes: Coded::take(from)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_every_bit() {
        let values = vec![-0.0f32, f32::NAN, f32::INFINITY, 1e-42, 0.1];
        let mut bytes = Vec::new();
        values.put(&mut bytes);
        let found = Vec::<f32>::take(&mut bytes.as_slice()).unwrap();
        let bits = |all: &[f32]| all.iter().map(|x| x.to_bits()).collect::<Vec<u32>>();
        assert_eq!(bits(&found), bits(&values));
    }

    #[test]
    fn a_list_longer_than_its_bytes_is_refused() {
        let mut bytes = Vec::new();
        u32::MAX.put(&mut bytes);
        bytes.extend([0; 64]);
        assert_eq!(Vec::<Vec3>::take(&mut bytes.as_slice()), Err(NotWork));
        assert_eq!(bool::take(&mut [7u8].as_slice()), Err(NotWork));
        assert_eq!(f64::take(&mut [7u8; 7].as_slice()), Err(NotWork));
    }
}
