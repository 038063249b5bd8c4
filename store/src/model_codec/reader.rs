//! Reader of a block's numbers in order; allocates nothing beyond the block's length.

use super::{CodecError, FORM};

/// Reads a block's parts in order.
pub(super) struct Reader<'block> {
    block: &'block [u8],
    at: usize,
}

impl<'block> Reader<'block> {
    /// Starts after the form number, which must be the common one.
    pub(super) fn new(block: &'block [u8]) -> Result<Self, CodecError> {
        Ok(Self::of_forms(block, FORM)?.0)
    }

    /// Starts after the form number and returns it: any up to `newest`.
    pub(super) fn of_forms(block: &'block [u8], newest: u32) -> Result<(Self, u32), CodecError> {
        let mut reader = Self { block, at: 0 };
        match reader.number()? {
            form if (FORM..=newest).contains(&form) => Ok((reader, form)),
            found => Err(CodecError::Form { found, newest }),
        }
    }

    pub(super) fn take(&mut self, n: usize, bytes_each: usize) -> Result<&'block [u8], CodecError> {
        let length = n.saturating_mul(bytes_each);
        let expected = self.at.saturating_add(length);
        let taken = self
            .block
            .get(self.at..expected)
            .ok_or(CodecError::Length { expected, found: self.block.len() })?;
        self.at = expected;
        Ok(taken)
    }

    fn number(&mut self) -> Result<u32, CodecError> {
        let bytes = self.take(1, 4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    pub(super) fn count(
        &mut self,
        field: &'static str,
        low: u32,
        high: u32,
    ) -> Result<usize, CodecError> {
        match self.number()? {
            found if (low..=high).contains(&found) => Ok(found as usize),
            found => Err(CodecError::Count { field, found, low, high }),
        }
    }

    pub(super) fn floats(&mut self, field: &'static str, n: usize) -> Result<Vec<f64>, CodecError> {
        let bytes = self.take(n, 8)?.as_chunks::<8>().0;
        let values: Vec<f64> = bytes.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        match values.iter().find(|value| !value.is_finite()) {
            Some(found) => Err(CodecError::Finite { field, found: *found }),
            None => Ok(values),
        }
    }

    /// Reads `n` numbers of 32 bits; the caller checks their values.
    pub(super) fn singles(&mut self, n: usize) -> Result<Vec<f32>, CodecError> {
        let bytes = self.take(n, 4)?.as_chunks::<4>().0;
        Ok(bytes.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
    }

    pub(super) fn end(&self) -> Result<(), CodecError> {
        if self.at == self.block.len() {
            return Ok(());
        }
        Err(CodecError::Length { expected: self.at, found: self.block.len() })
    }
}
