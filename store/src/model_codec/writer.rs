//! Writer of a block: little-endian numbers one after the other.

pub(super) fn put_counts(block: &mut Vec<u8>, counts: &[u32]) {
    block.extend(counts.iter().flat_map(|count| count.to_le_bytes()));
}

pub(super) fn put_floats(block: &mut Vec<u8>, values: &[f64]) {
    block.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

pub(super) fn put_singles(block: &mut Vec<u8>, values: &[f32]) {
    block.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}
