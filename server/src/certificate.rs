//! The end of a certificate, for a metric: the one field of X.509 that an operator must watch.
//!
//! Source: RFC 5280, section 4.1. Everything else of a certificate is rustls' matter; a certificate
//! of another form has no known end.

use jiff::civil::DateTime;
use jiff::tz::TimeZone;
use rustls::pki_types::CertificateDer;

const SEQUENCE: u8 = 0x30;
const UTC_TIME: u8 = 0x17;
const GENERALIZED_TIME: u8 = 0x18;
/// The tag of the optional version, which comes first.
const VERSION: u8 = 0xa0;

/// The earliest end of the certificates of a chain, in seconds since 1970.
pub(crate) fn expiry(chain: &[CertificateDer<'_>]) -> Option<i64> {
    chain.iter().map(|certificate| end(certificate)).collect::<Option<Vec<_>>>()?.into_iter().min()
}

/// The time `notAfter` of a certificate.
fn end(der: &[u8]) -> Option<i64> {
    let (certificate, _) = of(SEQUENCE, der)?;
    let (mut fields, _) = of(SEQUENCE, certificate)?;
    if fields.first() == Some(&VERSION) {
        fields = element(fields)?.2;
    }
    // Serial number, algorithm of the signature, issuer.
    for _ in 0..3 {
        fields = element(fields)?.2;
    }
    let (validity, _) = of(SEQUENCE, fields)?;
    let (_, _, not_after) = element(validity)?;
    let (tag, text, _) = element(not_after)?;
    time(tag, std::str::from_utf8(text).ok()?)
}

/// A time in one of the two forms that RFC 5280 allows.
fn time(tag: u8, text: &str) -> Option<i64> {
    let n_digits = match tag {
        UTC_TIME => 2,
        GENERALIZED_TIME => 4,
        _ => return None,
    };
    let digits = text.strip_suffix('Z').filter(|text| text.bytes().all(|b| b.is_ascii_digit()))?;
    if digits.len() != n_digits + 10 {
        return None;
    }
    let (year, rest) = digits.split_at(n_digits);
    let year: i16 = year.parse().ok()?;
    // Two digits mean 1950 to 2049.
    let year = match (tag, year) {
        (UTC_TIME, 50..) => 1900 + year,
        (UTC_TIME, _) => 2000 + year,
        _ => year,
    };
    let part = |idx: usize| rest[2 * idx..2 * idx + 2].parse::<i8>().ok();
    let at = DateTime::new(year, part(0)?, part(1)?, part(2)?, part(3)?, part(4)?, 0).ok()?;
    Some(at.to_zoned(TimeZone::UTC).ok()?.timestamp().as_second())
}

/// The content of the first element, which has this tag, and the bytes after it.
fn of(tag: u8, bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    element(bytes).filter(|(found, _, _)| *found == tag).map(|(_, content, rest)| (content, rest))
}

/// Tag and content of the first element of DER, and the bytes after it.
fn element(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&tag, rest) = bytes.split_first()?;
    let (&first, rest) = rest.split_first()?;
    let n_more = usize::from(first & 0x7f);
    let (length, rest) = match first {
        0..=0x7f => (n_more, rest),
        0x81..=0x84 => {
            let (length, rest) = rest.split_at_checked(n_more)?;
            (length.iter().fold(0, |sum, byte| sum << 8 | usize::from(*byte)), rest)
        }
        _ => return None,
    };
    let (content, rest) = rest.split_at_checked(length)?;
    Some((tag, content, rest))
}

#[cfg(test)]
mod tests {
    use rcgen::{CertificateParams, KeyPair, date_time_ymd};

    use super::*;

    /// A certificate that ends at the begin of a day.
    fn until(year: i32, month: u8, day: u8) -> CertificateDer<'static> {
        let mut params = CertificateParams::new(vec!["palpate.lab".to_owned()]).unwrap();
        params.not_after = date_time_ymd(year, month, day);
        params.self_signed(&KeyPair::generate().unwrap()).unwrap().der().clone()
    }

    #[test]
    fn the_earliest_end_of_a_chain_is_found() {
        // 2040-01-02: 70 years with 17 leap days, and a day, after 1970. 2060-03-01: 90 years with
        // 22 leap days, and 31 + 29 days; its year has four digits.
        let (near, far) = ((70 * 365 + 17 + 1) * 86_400, (90 * 365 + 22 + 60) * 86_400);
        assert_eq!(expiry(&[until(2040, 1, 2)]), Some(near));
        assert_eq!(expiry(&[until(2060, 3, 1)]), Some(far));
        assert_eq!(expiry(&[until(2060, 3, 1), until(2040, 1, 2)]), Some(near));
    }

    #[test]
    fn bytes_that_are_no_certificate_have_no_end() {
        let whole = until(2040, 1, 2).to_vec();
        for n_bytes in 0..whole.len() {
            assert_eq!(end(&whole[..n_bytes]), None, "{n_bytes} bytes");
        }
        for (tag, text) in [
            (UTC_TIME, "400102000000"),
            (UTC_TIME, "401302000000Z"),
            (4, "x"),
            (GENERALIZED_TIME, "2040010200000éZ"),
        ] {
            assert_eq!(time(tag, text), None, "{text}");
        }
        assert_eq!(time(UTC_TIME, "700101000000Z"), Some(0));
        assert_eq!(expiry(&[]), None);
    }
}
