//! Messages in the stream: writes of one commit to one unit; `docs/formats.md` draws their bytes.

use std::ops::Range;

use uuid::Uuid;

use crate::engine::{KEY_BYTES_MAX, VALUE_BYTES_MAX};

/// The first byte of a message; another form gets another number.
const FORM: u8 = 1;
/// Flag of a message before which the unit is emptied.
const WHOLE: u8 = 1;
/// Bytes of a message around its unit's id and its writes.
pub(super) const FRAME_BYTES: usize = 1 + 1 + 16 + 2 + 2 + 2 + 4 + 4;
/// Bytes of a write around its key and value.
pub(super) const WRITE_BYTES: usize = 4;

/// A write: a key and its new value, `None` to remove it.
pub(super) type Write = (Vec<u8>, Option<Vec<u8>>);

/// A message of the stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Message {
    /// The commit to which it belongs.
    pub(super) commit: Uuid,
    /// Its place in the commit, from 0.
    pub(super) part: u16,
    /// Number of messages of the commit.
    pub(super) n_parts: u16,
    /// The unit's id.
    pub(super) unit: Vec<u8>,
    /// Whether the unit has no other keys than those that follow.
    pub(super) is_whole: bool,
    pub(super) writes: Vec<Write>,
}

/// The bytes of a message.
///
/// Keys, values, units and the number of writes are within the bounds of an engine's commit.
pub(super) fn encode(message: &Message) -> Vec<u8> {
    let mut bytes = vec![FORM, if message.is_whole { WHOLE } else { 0 }];
    bytes.extend_from_slice(message.commit.as_bytes());
    bytes.extend_from_slice(&message.part.to_le_bytes());
    bytes.extend_from_slice(&message.n_parts.to_le_bytes());
    bytes.extend_from_slice(&short(message.unit.len()));
    bytes.extend_from_slice(&message.unit);
    let n_writes = u32::try_from(message.writes.len()).unwrap_or(u32::MAX);
    bytes.extend_from_slice(&n_writes.to_le_bytes());
    for (key, value) in &message.writes {
        bytes.extend_from_slice(&short(key.len()));
        bytes.extend_from_slice(key);
        bytes.extend_from_slice(&short(value.as_ref().map_or(0, |value| value.len() + 1)));
        bytes.extend_from_slice(value.as_deref().unwrap_or_default());
    }
    let sum = crc32fast::hash(&bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
    bytes
}

fn short(length: usize) -> [u8; 2] {
    u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes()
}

/// The message of some bytes; an error names the fault.
pub(super) fn decode(bytes: &[u8]) -> Result<Message, &'static str> {
    let (body, sum) = bytes.split_last_chunk::<4>().ok_or("it is too short")?;
    if body.first() != Some(&FORM) {
        return Err("it has a form that this version does not know");
    }
    if crc32fast::hash(body) != u32::from_le_bytes(*sum) {
        return Err("its checksum is wrong");
    }
    let mut reader = Reader(body);
    let [_, flags] = reader.array()?;
    let commit = Uuid::from_bytes(reader.array()?);
    let part = u16::from_le_bytes(reader.array()?);
    let n_parts = u16::from_le_bytes(reader.array()?);
    if part >= n_parts {
        return Err("its part is beyond their number");
    }
    let unit = reader.vector(1..KEY_BYTES_MAX + 1)?;
    let n_writes = u32::from_le_bytes(reader.array()?);
    let mut writes = Vec::new();
    for _ in 0..n_writes {
        let key = reader.vector(1..KEY_BYTES_MAX + 1)?;
        let length = usize::from(u16::from_le_bytes(reader.array()?));
        let value = match length.checked_sub(1) {
            None => None,
            Some(length) if length <= VALUE_BYTES_MAX => Some(reader.take(length)?.to_vec()),
            Some(_) => return Err("a value is too long"),
        };
        writes.push((key, value));
    }
    if !reader.0.is_empty() {
        return Err("something follows its end");
    }
    Ok(Message { commit, part, n_parts, unit, is_whole: flags & WHOLE != 0, writes })
}

/// The bytes that are still to be read.
struct Reader<'bytes>(&'bytes [u8]);

impl<'bytes> Reader<'bytes> {
    fn take(&mut self, length: usize) -> Result<&'bytes [u8], &'static str> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or("it is cut off")?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], &'static str> {
        Ok(self.take(N)?.try_into().expect("it has been cut to this length"))
    }

    fn vector(&mut self, lengths: Range<usize>) -> Result<Vec<u8>, &'static str> {
        let length = usize::from(u16::from_le_bytes(self.array()?));
        if !lengths.contains(&length) {
            return Err("a key has a length that none has");
        }
        Ok(self.take(length)?.to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Message {
        Message {
            commit: Uuid::from_u128(0x0102),
            part: 1,
            n_parts: 3,
            unit: b"s0123456789abcdef".to_vec(),
            is_whole: true,
            writes: vec![
                (b"s0123456789abcdef".to_vec(), Some(vec![7; 4096])),
                (b"s0123456789abcdef\0\0\0\x01".to_vec(), None),
                (b"s0123456789abcdef\0\0\0\x02".to_vec(), Some(Vec::new())),
            ],
        }
    }

    #[test]
    fn a_message_reads_back() {
        let message = sample();
        let bytes = encode(&message);
        assert_eq!(decode(&bytes), Ok(message.clone()));
        let writes = message.writes.iter();
        let content =
            writes.map(|(key, value)| WRITE_BYTES + key.len() + value.as_ref().map_or(0, Vec::len));
        assert_eq!(bytes.len(), FRAME_BYTES + message.unit.len() + content.sum::<usize>());
    }

    #[test]
    fn a_flipped_bit_and_a_missing_end_are_detected() {
        let bytes = encode(&Message { writes: vec![(b"k".to_vec(), None)], ..sample() });
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(decode(&flipped).is_err(), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} bytes");
        }
    }
}
