//! Messages in the stream: writes of one commit to one unit; `docs/formats.md` draws their bytes.

use std::ops::Range;

use uuid::Uuid;

use crate::engine::{KEY_BYTES_MAX, VALUE_BYTES_MAX};

/// The first byte of a message that has all its values; another form gets another number.
const FORM: u8 = 1;
/// The first byte of a message some of whose values are in objects of the bucket.
const FORM_WITH_OBJECTS: u8 = 2;
/// Flag of a message before which the unit is emptied.
const WHOLE: u8 = 1;
/// Flag of a message whose keys begin with the unit's id, which they leave out.
const UNDER: u8 = 2;
/// Bytes of a message around its unit's id and its writes.
pub(super) const FRAME_BYTES: usize = 1 + 1 + 16 + 2 + 2 + 2 + 4 + 4;
/// Bytes of a write around its key and value.
pub(super) const WRITE_BYTES: usize = 4;

/// Bytes of a value in an object, in a message: the object's place and the offset.
pub(super) const PART_BYTES: usize = 2 + 4;
/// Bytes of an object's description in a message.
pub(super) const OBJECT_BYTES: usize = 16 + 2 + 4 + 32;

/// A write: a key and its new value, `None` to remove it.
pub(super) type Write = (Vec<u8>, Option<Value>);

/// What identifies an object: the commit that put it, and its number in the commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct ObjectId {
    pub(super) commit: Uuid,
    pub(super) number: u16,
}

/// An object as messages describe it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Described {
    pub(super) id: ObjectId,
    /// Length in bytes.
    pub(super) length: u32,
    /// BLAKE3 hash of its bytes.
    pub(super) hash: [u8; 32],
}

/// A value within an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) object: Described,
    /// Offset of the value in the object.
    pub(super) at: u32,
    pub(super) length: u16,
}

/// A value, and where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Value {
    /// In the message.
    Here(Vec<u8>),
    /// In an object.
    There(Part),
}

impl Value {
    /// Length of the value.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Here(bytes) => bytes.len(),
            Self::There(part) => usize::from(part.length),
        }
    }
}

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
    let objects = objects(message);
    let form = if objects.is_empty() { FORM } else { FORM_WITH_OBJECTS };
    let unit = &message.unit;
    let is_under =
        form == FORM_WITH_OBJECTS && message.writes.iter().all(|(key, _)| key.starts_with(unit));
    let flags = u8::from(message.is_whole) * WHOLE + u8::from(is_under) * UNDER;
    let mut bytes = vec![form, flags];
    bytes.extend_from_slice(message.commit.as_bytes());
    bytes.extend_from_slice(&message.part.to_le_bytes());
    bytes.extend_from_slice(&message.n_parts.to_le_bytes());
    bytes.extend_from_slice(&short(unit.len()));
    bytes.extend_from_slice(unit);
    if form == FORM_WITH_OBJECTS {
        bytes.extend_from_slice(&short(objects.len()));
        for object in &objects {
            bytes.extend_from_slice(object.id.commit.as_bytes());
            bytes.extend_from_slice(&object.id.number.to_le_bytes());
            bytes.extend_from_slice(&object.length.to_le_bytes());
            bytes.extend_from_slice(&object.hash);
        }
    }
    let n_writes = u32::try_from(message.writes.len()).unwrap_or(u32::MAX);
    bytes.extend_from_slice(&n_writes.to_le_bytes());
    for (key, value) in &message.writes {
        let key = if is_under { &key[unit.len()..] } else { &key[..] };
        bytes.extend_from_slice(&short(key.len()));
        bytes.extend_from_slice(key);
        bytes.extend_from_slice(&short(value.as_ref().map_or(0, |value| value.len() + 1)));
        let place = match value {
            Some(Value::There(part)) => {
                objects.iter().position(|object| object.id == part.object.id).map_or(0, |at| at + 1)
            }
            Some(Value::Here(_)) | None => 0,
        };
        if form == FORM_WITH_OBJECTS {
            bytes.extend_from_slice(&short(place));
        }
        match value {
            Some(Value::Here(value)) => bytes.extend_from_slice(value),
            Some(Value::There(part)) => bytes.extend_from_slice(&part.at.to_le_bytes()),
            None => {}
        }
    }
    let sum = crc32fast::hash(&bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
    bytes
}

/// The objects that a message names, each once.
fn objects(message: &Message) -> Vec<Described> {
    let mut objects: Vec<Described> = Vec::new();
    for (_, value) in &message.writes {
        if let Some(Value::There(part)) = value
            && !objects.iter().rev().any(|object| object.id == part.object.id)
        {
            objects.push(part.object);
        }
    }
    objects
}

fn short(length: usize) -> [u8; 2] {
    u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes()
}

/// The message of some bytes; an error names the fault.
pub(super) fn decode(bytes: &[u8]) -> Result<Message, &'static str> {
    let (body, sum) = bytes.split_last_chunk::<4>().ok_or("it is too short")?;
    let has_objects = match body.first() {
        Some(&FORM) => false,
        Some(&FORM_WITH_OBJECTS) => true,
        _ => return Err("it has a form that this version does not know"),
    };
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
    let objects = if has_objects { reader.objects()? } else { Vec::new() };
    let under = if has_objects && flags & UNDER != 0 { &unit[..] } else { &[] };
    let n_writes = u32::from_le_bytes(reader.array()?);
    let mut writes = Vec::new();
    for _ in 0..n_writes {
        let rest = reader.vector(usize::from(under.is_empty())..KEY_BYTES_MAX + 1 - under.len())?;
        let key = [under, &rest].concat();
        let length = u16::from_le_bytes(reader.array()?).checked_sub(1);
        if length.is_some_and(|length| usize::from(length) > VALUE_BYTES_MAX) {
            return Err("a value is too long");
        }
        let place = if has_objects { u16::from_le_bytes(reader.array()?) } else { 0 };
        let value = match (length, usize::from(place).checked_sub(1)) {
            (None, None) => None,
            (None, Some(_)) => return Err("a removed value is in an object"),
            (Some(length), None) => Some(Value::Here(reader.take(usize::from(length))?.to_vec())),
            (Some(length), Some(place)) => {
                let object = *objects.get(place).ok_or("a value is in an object without a name")?;
                let at = u32::from_le_bytes(reader.array()?);
                if u64::from(at) + u64::from(length) > u64::from(object.length) {
                    return Err("a value is beyond the end of its object");
                }
                Some(Value::There(Part { object, at, length }))
            }
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

    fn objects(&mut self) -> Result<Vec<Described>, &'static str> {
        let n_objects = u16::from_le_bytes(self.array()?);
        let mut objects = Vec::new();
        for _ in 0..n_objects {
            let commit = Uuid::from_bytes(self.array()?);
            let id = ObjectId { commit, number: u16::from_le_bytes(self.array()?) };
            let length = u32::from_le_bytes(self.array()?);
            objects.push(Described { id, length, hash: self.array()? });
        }
        Ok(objects)
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
                (b"s0123456789abcdef".to_vec(), Some(Value::Here(vec![7; 4096]))),
                (b"s0123456789abcdef\0\0\0\x01".to_vec(), None),
                (b"s0123456789abcdef\0\0\0\x02".to_vec(), Some(Value::Here(Vec::new()))),
            ],
        }
    }

    /// A message with values in two objects, in itself, and removed.
    fn with_objects() -> Message {
        let part = |number, at| {
            let id = ObjectId { commit: Uuid::from_u128(0x0304), number };
            let object = Described { id, length: 9000, hash: [number as u8; 32] };
            Some(Value::There(Part { object, at, length: 4096 }))
        };
        let mut message = sample();
        let keys = (3..6u8).map(|piece| [b"s0123456789abcdef\0\0\0", &[piece][..]].concat());
        let values = [part(0, 0), part(1, 4904), part(0, 4096)];
        message.writes.extend(keys.zip(values));
        message
    }

    #[test]
    fn a_message_reads_back() {
        let message = sample();
        let bytes = encode(&message);
        assert_eq!(bytes[0], FORM);
        assert_eq!(decode(&bytes), Ok(message.clone()));
        let writes = message.writes.iter();
        let content = writes
            .map(|(key, value)| WRITE_BYTES + key.len() + value.as_ref().map_or(0, Value::len));
        assert_eq!(bytes.len(), FRAME_BYTES + message.unit.len() + content.sum::<usize>());
    }

    #[test]
    fn a_message_with_objects_reads_back() {
        let message = with_objects();
        let bytes = encode(&message);
        assert_eq!(bytes[0], FORM_WITH_OBJECTS);
        assert_eq!(decode(&bytes), Ok(message.clone()));
        // Its keys leave the unit's id out: six times 17 bytes less.
        let there = 3 * (PART_BYTES + WRITE_BYTES + 4) + 2 * OBJECT_BYTES;
        let here = 3 * (2 + WRITE_BYTES) + 2 * 4 + 4096;
        assert_eq!(bytes.len(), FRAME_BYTES + message.unit.len() + 2 + there + here);
        let mut foreign = message;
        foreign.writes.push((b"z".to_vec(), Some(Value::Here(vec![1]))));
        assert_eq!(decode(&encode(&foreign)), Ok(foreign));
    }

    #[test]
    fn the_bytes_of_a_message_with_objects_are_frozen() {
        let id = ObjectId { commit: Uuid::from_u128(1), number: 2 };
        let object = Described { id, length: 5, hash: [9; 32] };
        let value = Some(Value::There(Part { object, at: 3, length: 2 }));
        let (commit, unit) = (Uuid::from_u128(7), b"b".to_vec());
        let writes = vec![(b"bx".to_vec(), value)];
        let bytes = encode(&Message { commit, part: 0, n_parts: 1, unit, is_whole: false, writes });
        let mut expected = vec![2, 2];
        expected.extend_from_slice(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7]);
        expected.extend_from_slice(&[0, 0, 1, 0, 1, 0, b'b', 1, 0]);
        expected.extend_from_slice(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]);
        expected.extend_from_slice(&[2, 0, 5, 0, 0, 0]);
        expected.extend_from_slice(&[9; 32]);
        expected.extend_from_slice(&[1, 0, 0, 0, 1, 0, b'x', 3, 0, 1, 0, 3, 0, 0, 0]);
        assert_eq!(bytes[..bytes.len() - 4], expected);
    }

    #[test]
    fn a_value_outside_of_its_object_is_refused() {
        let mut message = with_objects();
        for (_, value) in &mut message.writes {
            if let Some(Value::There(part)) = value {
                part.object.length = 8000;
            }
        }
        assert_eq!(decode(&encode(&message)), Err("a value is beyond the end of its object"));
    }

    #[test]
    fn a_flipped_bit_and_a_missing_end_are_detected() {
        for message in [sample(), with_objects()] {
            let writes = message.writes.into_iter().rev().take(1).collect();
            let bytes = encode(&Message { writes, ..sample() });
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
}
