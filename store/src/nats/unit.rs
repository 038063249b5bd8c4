//! Units: groups of keys that JetStream orders and compares as one subject.
//!
//! A unit is a record with its pieces and, for sessions and for the training readings of an
//! object, everything under the id: its journal, its robots' numbers, its holdings. An append to
//! a journal is therefore one message. The unit's id is the prefix of its keys, or the whole key.

use uuid::Uuid;

use crate::key::Space;

/// Unit of the lease of a whole store, and first part of those of named leases; no commit has
/// keys that begin with 0.
pub(super) const LEASE: &[u8] = b"\0lease";

/// Length of the key of a record of a space; `None` if it varies.
fn record_bytes(letter: u8) -> Option<usize> {
    match letter {
        b's' | b'o' | b'j' | b'c' | b'a' | b'N' | b'W' | b'm' => Some(17),
        b'e' | b'R' | b'r' | b'w' | b'x' | b'T' | b't' | b'u' => Some(17),
        b'v' | b'k' | b'i' => Some(25),
        b'b' | b'f' | b'D' => Some(33),
        b'l' | b'd' | b'q' => Some(9),
        _ => None,
    }
}

/// Whether a unit is content: large, written once, and named by its hash or by its upload.
pub(super) fn is_content(id: &[u8]) -> bool {
    id.first().is_some_and(|letter| {
        (*letter == Space::Block as u8 || *letter == Space::MeshFile as u8)
            && record_bytes(*letter) == Some(id.len())
    })
}

/// Whether the unit of a key may be content.
pub(super) fn may_be_content(key: &[u8]) -> bool {
    matches!(key.first(), Some(letter)
        if *letter == Space::Block as u8 || *letter == Space::MeshFile as u8)
}

/// The unit, without keys, that orders the commits of an API key that has little left of its quota.
pub(super) fn quota(key: Uuid) -> Vec<u8> {
    [&b"\0quota"[..], key.as_bytes()].concat()
}

/// The id of the unit to which a key belongs.
pub(super) fn of(key: &[u8]) -> Vec<u8> {
    let owned = |space: Space, id: &[u8]| [&[space as u8], id].concat();
    match key {
        [b'z', b'e', rest @ ..] if rest.len() >= 16 => owned(Space::Session, &rest[..16]),
        [b'z', b't', rest @ ..] if rest.len() >= 16 => owned(Space::Training, &rest[..16]),
        [b'e' | b'R' | b'r' | b'w' | b'x', rest @ ..] if rest.len() >= 16 => {
            owned(Space::Session, &rest[..16])
        }
        [b'T' | b't' | b'u', rest @ ..] if rest.len() >= 16 => owned(Space::Training, &rest[..16]),
        [letter, ..] => match record_bytes(*letter) {
            Some(length) if key.len() >= length => key[..length].to_vec(),
            _ => key.to_vec(),
        },
        [] => Vec::new(),
    }
}

/// The keys of a unit.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Keys {
    /// One key.
    One(Vec<u8>),
    /// All keys with one of these prefixes.
    Under(Vec<Vec<u8>>),
}

/// The keys of the unit `id`.
pub(super) fn keys(id: &[u8]) -> Keys {
    let under = |letters: &[&[u8]]| {
        Keys::Under(letters.iter().map(|letter| [letter, &id[1..]].concat()).collect())
    };
    match id {
        [b'e', rest @ ..] if rest.len() == 16 => under(&[b"e", b"R", b"r", b"w", b"x", b"ze"]),
        [b't', rest @ ..] if rest.len() == 16 => under(&[b"T", b"t", b"u", b"zt"]),
        [letter, ..] if record_bytes(*letter) == Some(id.len()) => Keys::Under(vec![id.to_vec()]),
        _ => Keys::One(id.to_vec()),
    }
}

/// The subject of a unit: the stream's name, the space's letter, the rest of the id in hex.
pub(super) fn subject(stream: &str, id: &[u8]) -> String {
    let mut subject = String::with_capacity(stream.len() + 4 + 2 * id.len());
    subject.push_str(stream);
    subject.push('.');
    push_words(&mut subject, id);
    subject
}

/// A unit's id in words: the space's letter, and the rest in hex.
pub(super) fn words(id: &[u8]) -> String {
    let mut words = String::with_capacity(2 + 2 * id.len());
    push_words(&mut words, id);
    words
}

fn push_words(subject: &mut String, id: &[u8]) {
    match id.first() {
        Some(letter) if letter.is_ascii_alphanumeric() => subject.push(char::from(*letter)),
        Some(letter) => push_hex(subject, *letter),
        None => {}
    }
    subject.push('.');
    match id.get(1..) {
        None | Some([]) => subject.push('-'),
        Some(rest) => rest.iter().for_each(|byte| push_hex(subject, *byte)),
    }
}

fn push_hex(text: &mut String, byte: u8) {
    const DIGITS: [char; 16] =
        ['0', '1', '2', '3', '4', '5', '6', '7', '8', '9', 'a', 'b', 'c', 'd', 'e', 'f'];
    text.push(DIGITS[usize::from(byte >> 4)]);
    text.push(DIGITS[usize::from(byte & 15)]);
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;
    use crate::key;

    #[test]
    fn everything_of_a_session_is_one_unit() {
        let session = Uuid::from_u128(7);
        let id = key::id(Space::Session, session);
        let holding = [&b"z"[..], &id, &[9; 16]].concat();
        for key in [
            id.clone(),
            key::piece(&id, 1),
            key::id(Space::JournalHead, session),
            key::numbered(Space::Journal, session, 3),
            key::robot(Space::JournalRobot, session, "arm", 3, None),
            key::numbered(Space::JournalRetraction, session, 3),
            holding,
        ] {
            assert_eq!(of(&key), id, "{key:?}");
            let Keys::Under(prefixes) = keys(&id) else { panic!("a session has many keys") };
            assert!(prefixes.iter().any(|prefix| key.starts_with(prefix)), "{key:?}");
        }
    }

    #[test]
    fn pieces_are_in_the_unit_of_their_record() {
        let version = key::numbered(Space::Version, Uuid::from_u128(7), 2);
        assert_eq!(of(&key::piece(&version, 5)), version);
        assert_eq!(keys(&version), Keys::Under(vec![version.clone()]));
        let name = key::name(Space::Sensor, "left");
        assert_eq!(of(&name), name);
        assert_eq!(keys(&name), Keys::One(name));
        assert_eq!(keys(b"a/1"), Keys::One(b"a/1".to_vec()));
    }

    #[test]
    fn subjects_differ_and_have_only_allowed_characters() {
        let ids: [&[u8]; 6] = [b"!", b"a", b"a!", b"n.*> ", b"\xff\x00", b"A"];
        let subjects: Vec<_> = ids.iter().map(|id| subject("palpate", id)).collect();
        assert_eq!(subjects[..3], ["palpate.21.-", "palpate.a.-", "palpate.a.21"]);
        let distinct: std::collections::BTreeSet<_> = subjects.iter().collect();
        assert_eq!(distinct.len(), ids.len());
        for subject in &subjects {
            assert!(subject.chars().all(|c| c.is_ascii_alphanumeric() || ".-".contains(c)));
        }
    }
}
