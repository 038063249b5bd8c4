//! A key as it is sent: `palpate_`, the key's id, `_`, 256 random bits; digits hexadecimal.
//!
//! The prefix lets scanners of repositories and logs find leaked keys; the id says which one
//! to revoke. The bits come from the operating system.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::str::FromStr;

use thiserror::Error;
use uuid::Uuid;

const PREFIX: &str = "palpate_";
/// Number of bytes of the random part.
const SECRET_BYTES: usize = 32;
/// Number of digits of an id.
const ID_DIGITS: usize = 32;
/// Length of a key as it is sent.
const SENT_BYTES: usize = PREFIX.len() + ID_DIGITS + 1 + 2 * SECRET_BYTES;
/// Replacement of a redacted key.
const REDACTED: &str = "palpate_(a key)";

/// A key as received: the claimed id, and the proof.
pub(crate) struct Presented {
    pub(crate) id: Uuid,
    pub(crate) hash: [u8; 32],
}

/// Fewest different bytes, and fewest different steps between neighbours, of a secret that may be
/// random. Derived: 32 random bytes repeat an earlier one about twice; 17 repetitions happen once in
/// 10^15 secrets, while counted and repeated digits give fewer values.
const DIFFERENT_MIN: usize = 16;

/// A key that an operator has chosen. Parsed from the text as it is sent; only its hash is kept.
#[derive(Clone, Debug)]
pub struct ChosenKey {
    pub(crate) id: Uuid,
    pub(crate) hash: [u8; 32],
}

/// Fault of a chosen key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ChosenKeyError {
    /// The text has another form.
    #[error(
        "expected `palpate_`, 32 hexadecimal digits, `_` and 64 hexadecimal digits, in lower case"
    )]
    Form,
    /// The secret is too regular to be random.
    #[error("the secret of the key is too regular, expected 64 random hexadecimal digits")]
    Regular,
}

impl FromStr for ChosenKey {
    type Err = ChosenKeyError;

    fn from_str(text: &str) -> Result<Self, ChosenKeyError> {
        let sent = text.trim();
        let Presented { id, hash } = parse(sent).ok_or(ChosenKeyError::Form)?;
        let digits = sent.as_bytes()[SENT_BYTES - 2 * SECRET_BYTES..].chunks(2);
        let bytes: Vec<u8> = digits
            .map(|digits| Some(16 * digit(digits[0])? + digit(digits[1])?))
            .collect::<Option<_>>()
            .ok_or(ChosenKeyError::Form)?;
        let values: BTreeSet<u8> = bytes.iter().copied().collect();
        let steps: BTreeSet<u8> = bytes.windows(2).map(|two| two[1].wrapping_sub(two[0])).collect();
        if values.len() < DIFFERENT_MIN || steps.len() < DIFFERENT_MIN {
            return Err(ChosenKeyError::Regular);
        }
        Ok(Self { id, hash })
    }
}

/// A new secret for the key `id`: as it is sent, and the hash to keep.
///
/// # Errors
/// The operating system's, when it has no random bits.
pub(crate) fn draw(id: Uuid) -> Result<(String, [u8; 32]), getrandom::Error> {
    let mut secret = [0; SECRET_BYTES];
    getrandom::fill(&mut secret)?;
    let mut sent = format!("{PREFIX}{}_", id.simple());
    for byte in secret {
        write!(sent, "{byte:02x}").expect("a string takes everything");
    }
    Ok((sent, hash(&secret)))
}

/// The key in the text of a bearer token, if the text has the form of one.
pub(crate) fn parse(sent: &str) -> Option<Presented> {
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

/// The text with the secret part of any key in it removed. A request that contains a secret
/// by mistake is answered and logged without it.
pub(crate) fn redacted(text: &str) -> Cow<'_, str> {
    let Some(mut at) = find(text, 0) else { return Cow::Borrowed(text) };
    let (mut shown, mut from) = (String::with_capacity(text.len()), 0);
    loop {
        shown.push_str(&text[from..at]);
        shown.push_str(REDACTED);
        from = at + SENT_BYTES;
        match find(text, from) {
            Some(next) => at = next,
            None => break,
        }
    }
    shown.push_str(&text[from..]);
    Cow::Owned(shown)
}

/// Whether a text contains the form of a key.
pub(crate) fn is_in(text: &str) -> bool {
    find(text, 0).is_some()
}

/// Start of the first text in the form of a key, from a byte on.
fn find(text: &str, from: usize) -> Option<usize> {
    let candidates = text[from..].match_indices(PREFIX).map(|(at, _)| from + at);
    let is_hex = |part: &[u8]| part.iter().all(u8::is_ascii_hexdigit);
    candidates.into_iter().find(|at| {
        let Some(sent) = text.as_bytes().get(*at..at + SENT_BYTES) else { return false };
        let (id, secret) = sent[PREFIX.len()..].split_at(ID_DIGITS);
        is_hex(id) && secret[0] == b'_' && is_hex(&secret[1..])
    })
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
    fn drawn_secrets_parse_and_are_unique() {
        let id = Uuid::from_u128(7);
        let (sent, hash) = draw(id).unwrap();
        let presented = parse(&sent).unwrap();
        assert_eq!((presented.id, presented.hash), (id, hash));
        assert_eq!(sent.len(), 8 + 32 + 1 + 64);
        assert_ne!(draw(id).unwrap().0, sent);
    }

    #[test]
    fn keys_in_a_text_are_redacted() {
        let (sent, _) = draw(Uuid::from_u128(7)).unwrap();
        let text = format!("/v1/é/{sent}/x{sent}{}/palpate_{sent}", sent.to_uppercase());
        let upper = sent.to_uppercase();
        let expected =
            format!("/v1/é/palpate_(a key)/xpalpate_(a key){upper}/palpate_palpate_(a key)");
        assert_eq!(redacted(&text), expected);
        assert!(is_in(&text) && !is_in(&expected));
        for fine in ["", "palpate_", "/v1/keys/arm-3", &sent[..104]] {
            assert_eq!(redacted(fine), fine);
        }
    }

    #[test]
    fn chosen_keys_are_random_keys_of_the_usual_form() {
        for _ in 0..1000 {
            let (sent, hash) = draw(Uuid::now_v7()).unwrap();
            assert_eq!(format!(" {sent}\n").parse::<ChosenKey>().unwrap().hash, hash);
        }
        let (sent, _) = draw(Uuid::from_u128(7)).unwrap();
        let fault = |text: &str| text.parse::<ChosenKey>().unwrap_err();
        for wrong in ["", "secret", &sent[..104], &format!("{sent} {sent}")] {
            assert_eq!(fault(wrong), ChosenKeyError::Form, "{wrong}");
        }
        let counted: String = (0..32).map(|byte| format!("{byte:02x}")).collect();
        for regular in ["00".repeat(32), "0123456789abcdef".repeat(4), counted] {
            let key = format!("{}{regular}", &sent[..41]);
            assert_eq!(fault(&key), ChosenKeyError::Regular, "{key}");
        }
    }

    #[test]
    fn texts_of_another_form_are_not_keys() {
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
