//! What members say to each other, as bytes: who they are, questions about blocks, and answers.
//!
//! Little-endian, after a form number. Bytes of another member are checked like those of a
//! stranger: lengths beyond the end are refused, and nothing is allocated before.

use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Form of all messages; members of another form do not understand each other.
const FORM: u8 = 1;

/// What a member tells all others every second.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Hello {
    /// Id of its process, under which it takes questions.
    pub(crate) member: Uuid,
    /// Id of its data folder.
    pub(crate) place: Uuid,
    /// Time of its start, milliseconds since 1970.
    pub(crate) since_ms: u64,
    /// Hash of its program and its processor's abilities: others may compute other last bits.
    pub(crate) program: String,
    /// Whether it stops.
    pub(crate) is_leaving: bool,
    /// The versions that it uses, or holds blocks of.
    pub(crate) versions: Vec<HeldVersion>,
}

/// A version at a member.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct HeldVersion {
    pub(crate) catalogue: Uuid,
    pub(crate) version: u32,
    /// Number of blocks in all.
    pub(crate) n_blocks: u32,
    /// Whether sessions of this member use the version.
    pub(crate) is_used: bool,
    /// The blocks in its memory.
    pub(crate) held: Vec<u32>,
}

/// A question about blocks of one version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Question {
    pub(crate) catalogue: Uuid,
    pub(crate) version: u32,
    /// Blocks, and the request to each.
    pub(crate) items: Vec<(u32, Vec<u8>)>,
}

/// What a member says to one request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Reply {
    /// The block's answer.
    Answer(Vec<u8>),
    /// It cannot hold the block: no room, or no such version.
    NotHeld,
    /// It does not understand the request.
    NotUnderstood,
    /// It has too much to do.
    Overloaded,
}

impl Hello {
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let json = serde_json::to_vec(self).expect("ids, numbers and strings can be written");
        [&[FORM][..], &json].concat()
    }

    /// `None` for bytes that are no hello of this form.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        serde_json::from_slice(bytes.strip_prefix(&[FORM])?).ok()
    }
}

impl Question {
    /// `None` for bytes that are no question of this form.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(&[FORM])?;
        let catalogue = Uuid::from_slice(take(&mut rest, 16)?).ok()?;
        let version = number(&mut rest)?;
        let n = number(&mut rest)?;
        let mut items = Vec::new();
        for _ in 0..n {
            items.push((number(&mut rest)?, bytes_of(&mut rest)?.to_vec()));
        }
        rest.is_empty().then_some(Self { catalogue, version, items })
    }
}

/// A question about blocks of one version: the blocks, and the request to each.
pub(super) fn question((catalogue, version): (Uuid, u32), items: &[(u32, &[u8])]) -> Vec<u8> {
    let length: usize = items.iter().map(|(_, request)| 8 + request.len()).sum();
    let mut bytes = Vec::with_capacity(25 + length);
    bytes.push(FORM);
    bytes.extend_from_slice(catalogue.as_bytes());
    put(&mut bytes, version);
    put(&mut bytes, items.len() as u32);
    for (block, request) in items {
        put(&mut bytes, *block);
        put_bytes(&mut bytes, request);
    }
    bytes
}

/// The answer to a question: a reply to each of its requests, in their order.
pub(crate) fn answer(replies: &[Reply]) -> Vec<u8> {
    let mut bytes = vec![FORM];
    put(&mut bytes, replies.len() as u32);
    for reply in replies {
        let (kind, content) = match reply {
            Reply::Answer(content) => (0, &content[..]),
            Reply::NotHeld => (1, &[][..]),
            Reply::NotUnderstood => (2, &[][..]),
            Reply::Overloaded => (3, &[][..]),
        };
        bytes.push(kind);
        put_bytes(&mut bytes, content);
    }
    bytes
}

/// The replies of an answer to `n` requests; `None` for other bytes.
pub(crate) fn replies(bytes: &[u8], n: usize) -> Option<Vec<Reply>> {
    let mut rest = bytes.strip_prefix(&[FORM])?;
    if number(&mut rest)? as usize != n {
        return None;
    }
    let mut replies = Vec::new();
    for _ in 0..n {
        let kind = take(&mut rest, 1)?.first().copied()?;
        let content = bytes_of(&mut rest)?;
        replies.push(match kind {
            0 => Reply::Answer(content.to_vec()),
            1 => Reply::NotHeld,
            2 => Reply::NotUnderstood,
            3 => Reply::Overloaded,
            _ => return None,
        });
    }
    rest.is_empty().then_some(replies)
}

fn put(bytes: &mut Vec<u8>, number: u32) {
    bytes.extend_from_slice(&number.to_le_bytes());
}

fn put_bytes(bytes: &mut Vec<u8>, content: &[u8]) {
    put(bytes, content.len() as u32);
    bytes.extend_from_slice(content);
}

fn take<'bytes>(rest: &mut &'bytes [u8], n: usize) -> Option<&'bytes [u8]> {
    let (taken, left) = rest.split_at_checked(n)?;
    *rest = left;
    Some(taken)
}

fn number(rest: &mut &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(take(rest, 4)?.try_into().ok()?))
}

fn bytes_of<'bytes>(rest: &mut &'bytes [u8]) -> Option<&'bytes [u8]> {
    let length = number(rest)?;
    take(rest, length as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked() -> Question {
        let items = vec![(0, b"touch".to_vec()), (7, Vec::new())];
        Question { catalogue: Uuid::from_u128(5), version: 3, items }
    }

    fn to_bytes(asked: &Question) -> Vec<u8> {
        let items: Vec<(u32, &[u8])> = asked.items.iter().map(|(n, r)| (*n, &r[..])).collect();
        question((asked.catalogue, asked.version), &items)
    }

    #[test]
    fn questions_and_answers_are_read_as_written() {
        assert_eq!(Question::from_bytes(&to_bytes(&asked())), Some(asked()));
        let all = [
            Reply::Answer(b"score".to_vec()),
            Reply::NotHeld,
            Reply::NotUnderstood,
            Reply::Overloaded,
        ];
        assert_eq!(replies(&answer(&all), 4), Some(all.to_vec()));
        assert_eq!(replies(&answer(&all), 3), None, "of another question");
    }

    #[test]
    fn a_hello_is_read_as_written() {
        let version = HeldVersion {
            catalogue: Uuid::nil(),
            version: 1,
            n_blocks: 3,
            is_used: true,
            held: vec![2],
        };
        let hello = Hello {
            member: Uuid::from_u128(1),
            place: Uuid::from_u128(2),
            since_ms: 3,
            program: "p".to_owned(),
            is_leaving: false,
            versions: vec![version],
        };
        assert_eq!(Hello::from_bytes(&hello.to_bytes()), Some(hello));
        assert_eq!(Hello::from_bytes(b""), None);
        assert_eq!(Hello::from_bytes(b"\x02{}"), None);
    }

    #[test]
    fn cut_and_changed_bytes_are_refused_without_a_panic() {
        let (asked, told) = (to_bytes(&asked()), answer(&[Reply::Answer(vec![1; 9])]));
        for cut in 0..asked.len() {
            assert_eq!(Question::from_bytes(&asked[..cut]), None, "{cut} bytes");
        }
        for cut in 0..told.len() {
            assert_eq!(replies(&told[..cut], 1), None, "{cut} bytes");
        }
        for at in 0..asked.len() {
            let mut huge = asked.clone();
            huge[at] = 0xff;
            // Ids and contents may be any bytes; nothing else is allowed to be read back.
            if let Some(read) = Question::from_bytes(&huge) {
                assert_eq!(to_bytes(&read), huge);
            }
        }
    }
}
