//! A key as it is sent: `palpate_`, the key's id, `_`, 256 random bits; digits hexadecimal.
//!
//! The prefix lets scanners of repositories and logs find keys that leaked; the id says which
//! one to revoke. The bits come from the operating system.

use std::fmt::Write as _;

use uuid::Uuid;

const PREFIX: &str = "palpate_";
/// Bytes of the random part.
const SECRET_BYTES: usize = 32;
/// Digits of an id.
const ID_DIGITS: usize = 32;

/// A key as it was sent: which one it claims to be, and the proof.
pub(super) struct Presented {
    pub(super) id: Uuid,
    pub(super) hash: [u8; 32],
}

/// A new secret for the key `id`: as it is sent, and the hash to keep.
///
/// # Errors
/// The operating system's, when it has no random bits.
pub(super) fn draw(id: Uuid) -> Result<(String, [u8; 32]), getrandom::Error> {
    let mut secret = [0; SECRET_BYTES];
    getrandom::fill(&mut secret)?;
    let mut sent = format!("{PREFIX}{}_", id.simple());
    for byte in secret {
        write!(sent, "{byte:02x}").expect("a string takes everything");
    }
    Ok((sent, hash(&secret)))
}

/// The key in the text of a bearer token, if the text is written like one.
pub(super) fn parse(sent: &str) -> Option<Presented> {
    let (id, secret) = sent.strip_prefix(PREFIX)?.split_once('_')?;
    if id.len() != ID_DIGITS || secret.len() != 2 * SECRET_BYTES {
        return None;
    }
    let mut bytes = [0; SECRET_BYTES];
    for (byte, digits) in bytes.iter_mut().zip(secret.as_bytes().chunks(2)) {
        *byte = 16 * digit(digits[0])? + digit(digits[1])?;
    }
    Some(Presented { id: Uuid::try_parse(id).ok()?, hash: hash(&bytes) })
}

fn hash(secret: &[u8; SECRET_BYTES]) -> [u8; 32] {
    *blake3::hash(secret).as_bytes()
}

fn digit(byte: u8) -> Option<u8> {
    match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_drawn_is_understood_and_never_drawn_twice() {
        let id = Uuid::from_u128(7);
        let (sent, hash) = draw(id).unwrap();
        let presented = parse(&sent).unwrap();
        assert_eq!((presented.id, presented.hash), (id, hash));
        assert_eq!(sent.len(), 8 + 32 + 1 + 64);
        assert_ne!(draw(id).unwrap().0, sent);
    }

    #[test]
    fn what_is_not_written_like_a_key_is_none() {
        let (sent, _) = draw(Uuid::from_u128(7)).unwrap();
        let upper = sent.to_uppercase().replace("PALPATE", "palpate");
        for wrong in
            ["", "palpate_", "palpate__", &sent[..104], &format!("{sent}0"), &sent[1..], &upper]
        {
            assert!(parse(wrong).is_none(), "{wrong}");
        }
        assert!(parse(&sent.replace("palpate_", "palpate_é")).is_none());
    }
}
