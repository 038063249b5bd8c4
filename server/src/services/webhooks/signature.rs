//! Secrets and signatures of Standard Webhooks: `whsec_` and base64; `v1,` and the base64 of
//! HMAC-SHA256 over `id.timestamp.body`.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ring::hmac::{HMAC_SHA256, Key, sign};

use crate::wire::Invalid;

const PREFIX: &str = "whsec_";
/// Number of bytes of a drawn secret.
const DRAWN_BYTES: usize = 32;
/// Permitted numbers of bytes of a given one.
const BYTES: std::ops::RangeInclusive<usize> = 16..=64;

/// A new secret.
pub(super) fn draw() -> Result<Vec<u8>, getrandom::Error> {
    let mut secret = vec![0; DRAWN_BYTES];
    getrandom::fill(&mut secret)?;
    Ok(secret)
}

/// A secret as it is shown once.
pub(super) fn shown(secret: &[u8]) -> String {
    format!("{PREFIX}{}", STANDARD.encode(secret))
}

/// The secret in a request. The message does not repeat it.
pub(super) fn parse(text: &str) -> Result<Vec<u8>, Invalid> {
    let expected = "expected `whsec_` and 16 to 64 random bytes in base64";
    let wrong = |found: &str| Invalid::field("/secret", format!("{found} came, {expected}"));
    let encoded = text.strip_prefix(PREFIX).ok_or_else(|| wrong("another form"))?;
    let secret = STANDARD.decode(encoded).map_err(|_| wrong("no base64"))?;
    match BYTES.contains(&secret.len()) {
        true => Ok(secret),
        false => Err(wrong(&format!("{} bytes", secret.len()))),
    }
}

/// The header `webhook-signature` of a message, with a signature by each secret.
pub(super) fn signatures<'a>(
    secrets: impl IntoIterator<Item = &'a [u8]>,
    id: &str,
    timestamp_s: u64,
    body: &str,
) -> String {
    let message = format!("{id}.{timestamp_s}.{body}");
    let signature = |secret: &[u8]| {
        let tag = sign(&Key::new(HMAC_SHA256, secret), message.as_bytes());
        format!("v1,{}", STANDARD.encode(tag))
    };
    secrets.into_iter().map(signature).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_signature_of_the_standard_s_example_is_its_own() {
        // The example of the libraries at standardwebhooks.com.
        let secret = parse("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").unwrap();
        let (id, body) = ("msg_p5jXN8AQM9LWM0D4loKWxJek", r#"{"test": 2432232314}"#);
        let expected = "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=";
        assert_eq!(signatures([&secret[..]], id, 1_614_265_330, body), expected);
        let two = signatures([&secret[..], b"another secret"], id, 1_614_265_330, body);
        assert_eq!(two.split(' ').next(), Some(expected));
        assert_eq!(two.split(' ').count(), 2);
    }

    #[test]
    fn secrets_are_shown_as_they_are_given() {
        let drawn = draw().unwrap();
        assert_eq!((parse(&shown(&drawn)), drawn.len()), (Ok(drawn.clone()), 32));
        for wrong in
            ["", "whsec_", "whsec_abc", "whsec_AAAA", "sec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"]
        {
            let Invalid(errors) = parse(wrong).unwrap_err();
            assert_eq!(errors[0].pointer, "/secret", "{wrong}");
        }
        assert!(parse(&shown(&[7; 16])).is_ok() && parse(&shown(&[7; 15])).is_err());
        assert!(parse(&shown(&[7; 64])).is_ok() && parse(&shown(&[7; 65])).is_err());
    }
}
