//! Frames of a line: the messages that a question or an answer is sent in.
//!
//! A frame is a form (1 byte), a kind (1), the question's id (16), its number and the number of
//! frames (4 each, little-endian), and a piece of the content. Frames of one message arrive in
//! their order, or the message is dropped.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use uuid::Uuid;

use crate::engine::line::{LineError, MESSAGE_BYTES_MAX};

const FORM: u8 = 1;
/// Bytes of a frame before its content.
pub(super) const HEAD_BYTES: usize = 26;
/// Number of messages that may be incomplete at a time. Chosen: more than servers ask at once.
const INCOMPLETE_MAX: usize = 256;
/// Bytes of all incomplete messages together. Chosen: room for four of the longest.
const INCOMPLETE_BYTES_MAX: usize = 4 * MESSAGE_BYTES_MAX;
/// Time after which an incomplete message is dropped. Chosen: frames follow each other at once.
const COMPLETE_WITHIN: Duration = Duration::from_secs(10);

/// What a frame is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Question,
    /// The question has arrived and waits for its answer.
    Taken,
    Answer,
    /// The question was refused since too many wait.
    Busy,
    /// The answer is longer than a message may be; the content is its length, 8 bytes.
    TooLarge,
}

const KINDS: [Kind; 5] = [Kind::Question, Kind::Taken, Kind::Answer, Kind::Busy, Kind::TooLarge];

/// A frame that was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Frame<'bytes> {
    pub(super) kind: Kind,
    pub(super) id: Uuid,
    number: u32,
    n_frames: u32,
    content: &'bytes [u8],
}

impl<'bytes> Frame<'bytes> {
    /// The frame of a message's bytes; `None` for anything else.
    pub(super) fn parse(bytes: &'bytes [u8]) -> Option<Self> {
        let (head, content) = bytes.split_first_chunk::<HEAD_BYTES>()?;
        let number = |at: usize| {
            let four = head.get(at..at + 4)?;
            Some(u32::from_le_bytes(four.try_into().ok()?))
        };
        let kind = *KINDS.get(usize::from(head[1]))?;
        let id = Uuid::from_slice(&head[2..18]).ok()?;
        let (number, n_frames) = (number(18)?, number(22)?);
        let is_valid = head[0] == FORM && number < n_frames;
        is_valid.then_some(Self { kind, id, number, n_frames, content })
    }

    /// The length that a frame of kind [`Kind::TooLarge`] states.
    pub(super) fn length(&self) -> usize {
        let length =
            self.content.first_chunk().map_or(u64::MAX, |eight| u64::from_le_bytes(*eight));
        usize::try_from(length).unwrap_or(usize::MAX)
    }
}

/// The frames of a message, each of at most `frame_bytes_max` bytes.
pub(super) fn frames(
    kind: Kind,
    id: Uuid,
    content: &[u8],
    frame_bytes_max: usize,
) -> Result<Vec<Vec<u8>>, LineError> {
    if content.len() > MESSAGE_BYTES_MAX {
        return Err(LineError::TooLarge { found: content.len(), max: MESSAGE_BYTES_MAX });
    }
    let piece_bytes = frame_bytes_max.saturating_sub(HEAD_BYTES).max(1);
    let pieces: Vec<&[u8]> = match content.is_empty() {
        true => vec![content],
        false => content.chunks(piece_bytes).collect(),
    };
    let n_frames = pieces.len() as u32;
    let frame = |(number, piece): (u32, &&[u8])| {
        let mut frame = Vec::with_capacity(HEAD_BYTES + piece.len());
        frame.push(FORM);
        frame.push(KINDS.iter().position(|known| *known == kind).unwrap_or(0) as u8);
        frame.extend_from_slice(id.as_bytes());
        frame.extend_from_slice(&number.to_le_bytes());
        frame.extend_from_slice(&n_frames.to_le_bytes());
        frame.extend_from_slice(piece);
        frame
    };
    Ok((0..).zip(&pieces).map(frame).collect())
}

/// Messages of which some frames have arrived.
#[derive(Debug, Default)]
pub(super) struct Gathering {
    incomplete: BTreeMap<Uuid, Incomplete>,
    bytes: usize,
}

#[derive(Debug)]
struct Incomplete {
    since: Instant,
    next: u32,
    content: Vec<u8>,
}

impl Gathering {
    /// Adds a frame; the content of its message when this was the last one.
    pub(super) fn add(&mut self, frame: &Frame<'_>, now: Instant) -> Option<Vec<u8>> {
        let mut one = match self.remove(frame.id) {
            Some(one) => one,
            None => Incomplete { since: now, next: 0, content: Vec::new() },
        };
        let length = one.content.len() + frame.content.len();
        if one.next != frame.number || length > MESSAGE_BYTES_MAX {
            return None;
        }
        one.content.extend_from_slice(frame.content);
        one.next += 1;
        if one.next == frame.n_frames {
            return Some(one.content);
        }
        self.tidy(now);
        if self.incomplete.len() < INCOMPLETE_MAX && self.bytes + length <= INCOMPLETE_BYTES_MAX {
            self.bytes += length;
            self.incomplete.insert(frame.id, one);
        }
        None
    }

    fn remove(&mut self, id: Uuid) -> Option<Incomplete> {
        let one = self.incomplete.remove(&id)?;
        self.bytes -= one.content.len();
        Some(one)
    }

    /// Drops messages whose rest does not come.
    fn tidy(&mut self, now: Instant) {
        let is_late = |one: &Incomplete| now.duration_since(one.since) > COMPLETE_WITHIN;
        let late: Vec<Uuid> =
            self.incomplete.iter().filter(|(_, one)| is_late(one)).map(|(id, _)| *id).collect();
        for id in late {
            self.remove(id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gathered(gathering: &mut Gathering, frames: &[Vec<u8>], now: Instant) -> Vec<Vec<u8>> {
        let frame = |bytes: &Vec<u8>| {
            let frame = Frame::parse(bytes).expect("it is a frame");
            gathering.add(&frame, now)
        };
        frames.iter().filter_map(frame).collect()
    }

    #[test]
    fn a_message_is_whole_after_its_last_frame() {
        let (id, now) = (Uuid::from_u128(7), Instant::now());
        let content: Vec<u8> = (0..1000_u32).map(|n| n as u8).collect();
        for (length, n_frames) in [(0, 1), (1, 1), (74, 1), (75, 2), (1000, 14)] {
            let content = &content[..length];
            let sent = frames(Kind::Answer, id, content, 100).unwrap();
            assert_eq!(sent.len(), n_frames);
            assert!(sent.iter().all(|frame| frame.len() <= 100));
            let mut gathering = Gathering::default();
            assert_eq!(gathered(&mut gathering, &sent, now), [content]);
            assert_eq!((gathering.bytes, gathering.incomplete.len()), (0, 0));
        }
    }

    #[test]
    fn messages_between_each_other_are_kept_apart() {
        let now = Instant::now();
        let sent = |id| frames(Kind::Question, Uuid::from_u128(id), &[id as u8; 150], 100).unwrap();
        let (one, two) = (sent(1), sent(2));
        let mixed = [&one[0], &two[0], &two[1], &one[1]].map(Clone::clone);
        let whole = gathered(&mut Gathering::default(), &mixed, now);
        // The third frame of each is still missing.
        assert_eq!(whole, Vec::<Vec<u8>>::new());
        let mixed = [&one[0], &two[0], &two[1], &one[1], &one[2], &two[2]].map(Clone::clone);
        let whole = gathered(&mut Gathering::default(), &mixed, now);
        assert_eq!(whole, [vec![1; 150], vec![2; 150]]);
    }

    #[test]
    fn a_message_with_a_gap_or_without_an_end_is_dropped() {
        let now = Instant::now();
        let sent = frames(Kind::Question, Uuid::from_u128(1), &[1; 250], 100).unwrap();
        let mut gathering = Gathering::default();
        assert!(gathered(&mut gathering, &[sent[0].clone(), sent[2].clone()], now).is_empty());
        assert_eq!(gathering.bytes, 0, "the gap dropped it");
        gathered(&mut gathering, &sent[..2], now);
        assert_eq!(gathering.bytes, 148);
        let other = frames(Kind::Question, Uuid::from_u128(2), &[2; 150], 100).unwrap();
        gathered(&mut gathering, &other[..1], now + 2 * COMPLETE_WITHIN);
        assert_eq!((gathering.bytes, gathering.incomplete.len()), (74, 1), "only the new one");
    }

    #[test]
    fn too_long_messages_and_other_bytes_are_refused() {
        let long = vec![0; MESSAGE_BYTES_MAX + 1];
        let error = frames(Kind::Question, Uuid::nil(), &long, 1 << 20).unwrap_err();
        let (found, max) = (MESSAGE_BYTES_MAX + 1, MESSAGE_BYTES_MAX);
        assert_eq!(error, LineError::TooLarge { found, max });
        let good = frames(Kind::Taken, Uuid::nil(), &[], 100).unwrap().remove(0);
        assert!(Frame::parse(&good).is_some());
        for cut in 0..good.len() {
            assert_eq!(Frame::parse(&good[..cut]), None, "{cut} bytes");
        }
        for (at, byte) in [(0, 2), (1, KINDS.len() as u8), (18, 1), (22, 0)] {
            let mut wrong = good.clone();
            wrong[at] = byte;
            assert_eq!(Frame::parse(&wrong), None, "byte {at} is {byte}");
        }
    }
}
