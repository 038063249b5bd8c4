//! Where webhooks may point: the form of their URLs, and the addresses to which nothing is sent.
//!
//! Names are resolved for every connection, and the addresses found are checked then: a name that
//! changes its address between check and use gains nothing.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

use reqwest::Url;
use thiserror::Error;

use crate::wire::Invalid;

/// Maximum length of a URL, bytes.
const URL_BYTES_MAX: usize = 2048;
/// Services of clouds that answer machines about themselves, outside of the link-local networks.
const METADATA_V4: Ipv4Addr = Ipv4Addr::new(100, 100, 100, 200);
const METADATA_V6: [Ipv6Addr; 2] = [
    Ipv6Addr::new(0xfd00, 0xec2, 0, 0, 0, 0, 0, 0x254),
    Ipv6Addr::new(0xfd20, 0xce, 0, 0, 0, 0, 0, 0x254),
];

/// Reason for which nothing is sent to an address.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub(super) enum Refused {
    /// The address belongs to this machine or a private network.
    #[error(
        "{0} is an address of this machine or of a private network: a server that may send there \
         is started with `--webhook-allow-private`"
    )]
    Private(IpAddr),
    /// The address is never sent to.
    #[error("{0} is a link-local, reserved or metadata address, to which nothing is sent")]
    Never(IpAddr),
}

/// Whether something may be sent to an address.
pub(super) fn check(address: IpAddr, allows_private: bool) -> Result<(), Refused> {
    let kind = match address {
        IpAddr::V4(address) => kind_v4(address),
        IpAddr::V6(address) => kind_v6(address),
    };
    match kind {
        Kind::Public => Ok(()),
        Kind::Private if allows_private => Ok(()),
        Kind::Private => Err(Refused::Private(address)),
        Kind::Never => Err(Refused::Never(address)),
    }
}

/// The URL in a request.
pub(super) fn url(text: &str, allows_private: bool) -> Result<Url, Invalid> {
    let wrong = |detail: String| Invalid::field("/url", detail);
    if text.len() > URL_BYTES_MAX {
        let found = text.len();
        return Err(wrong(format!("{found} bytes came, expected at most {URL_BYTES_MAX}")));
    }
    let url: Url = text.parse().map_err(|error| wrong(format!("it is no URL: {error}")))?;
    match url.scheme() {
        "https" => {}
        "http" if allows_private => {}
        "http" => {
            return Err(wrong(
                "came http, expected https: a server that may send unencrypted, in a network that \
                 you trust, is started with `--webhook-allow-private`"
                    .to_owned(),
            ));
        }
        scheme => return Err(wrong(format!("came the scheme {scheme:?}, expected https"))),
    }
    if !url.username().is_empty() || url.password().is_some() {
        let detail = "a user name or password came: the signature proves who sends";
        return Err(wrong(detail.to_owned()));
    }
    if url.port() == Some(0) {
        return Err(wrong("the port is 0, expected 1 to 65535".to_owned()));
    }
    if url.fragment().is_some() {
        return Err(wrong("a fragment (`#…`) came, which is never sent".to_owned()));
    }
    if let Some(address) = address(&url) {
        check(address, allows_private).map_err(|error| wrong(error.to_string()))?;
    }
    Ok(url)
}

/// The address that a URL states instead of a name.
pub(super) fn address(url: &Url) -> Option<IpAddr> {
    // Addresses of version 6 stand in brackets.
    url.host_str()?.trim_matches(['[', ']']).parse().ok()
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Public,
    Private,
    Never,
}

fn kind_v4(address: Ipv4Addr) -> Kind {
    let [a, b, c, _] = address.octets();
    // Protocol assignments, examples, and relays of 6to4 (RFC 6890).
    let is_special =
        matches!((a, b, c), (192, 0, 0 | 2) | (198, 51, 100) | (203, 0, 113) | (192, 88, 99));
    if is_special || is_metadata(&address) || a == 0 || a >= 224 {
        return Kind::Never;
    }
    // Shared by a provider's customers (RFC 6598), and networks of tests (RFC 2544).
    let is_shared = (a == 100 && b & 0xc0 == 64) || (a == 198 && b & 0xfe == 18);
    match address.is_loopback() || address.is_private() || is_shared {
        true => Kind::Private,
        false => Kind::Public,
    }
}

/// Whether an address is link-local or a cloud's, which answers machines about themselves.
fn is_metadata(address: &Ipv4Addr) -> bool {
    address.is_link_local() || *address == METADATA_V4
}

/// The worst of an address itself and of the addresses of version 4 to which it may lead.
fn kind_v6(address: Ipv6Addr) -> Kind {
    let own = match address.segments() {
        [0, 0, 0, 0, 0, 0, 0, 1] => return Kind::Private,
        // Written in version 6, reached by version 4: mapped, compatible, and translated.
        [0, 0, 0, 0, 0, 0 | 0xffff, ..]
        | [0, 0, 0, 0, 0xffff, 0, ..]
        | [0x64, 0xff9b, 0, 0, 0, 0, ..] => Kind::Public,
        // A translator of the network itself (RFC 8215).
        [0x64, 0xff9b, 1, ..] => Kind::Private,
        _ if METADATA_V6.contains(&address) => Kind::Never,
        [0xfc00..=0xfdff, ..] => Kind::Private,
        // Protocol assignments, with Teredo's tunnels; examples.
        [0x2001, 0..=0x1ff | 0xdb8, ..] | [0x3fff, 0..=0xfff, ..] => Kind::Never,
        // What the internet routes; all else is reserved, link-local or multicast.
        [0x2000..=0x3fff, ..] => Kind::Public,
        _ => Kind::Never,
    };
    embedded(address).into_iter().flatten().map(kind_v4).fold(own, Kind::max)
}

/// The addresses of version 4 that one of version 6 may contain. Not here: the networks of 6rd and
/// of translators with a prefix of their operator's own, which look like any other.
fn embedded(address: Ipv6Addr) -> [Option<Ipv4Addr>; 4] {
    let bytes = address.octets();
    let at = |places: [usize; 4]| Some(Ipv4Addr::from(places.map(|place| bytes[place])));
    let last = at([12, 13, 14, 15]);
    match address.segments() {
        // Mapped, compatible (RFC 4291) and translated (RFC 2765, RFC 6052).
        [0, 0, 0, 0, 0, 0 | 0xffff, ..]
        | [0, 0, 0, 0, 0xffff, 0, ..]
        | [0x64, 0xff9b, 0, 0, 0, 0, ..] => [last, None, None, None],
        // The prefix may have 48, 56, 64 or 96 bits (RFC 6052, section 2.2): only what would be
        // metadata at one of these places counts, since one place is right and the others are not.
        [0x64, 0xff9b, 1, ..] => [[6, 7, 9, 10], [7, 9, 10, 11], [9, 10, 11, 12], [12, 13, 14, 15]]
            .map(|places| at(places).filter(is_metadata)),
        // 6to4 (RFC 3056), which may lead to ISATAP as well.
        [0x2002, ..] => [at([2, 3, 4, 5]), isatap(address).and(last), None, None],
        _ => [isatap(address).and(last), None, None, None],
    }
}

/// Whether the interface of an address is one of ISATAP (RFC 5214), with any of its two bits.
fn isatap(address: Ipv6Addr) -> Option<()> {
    let [.., scope, mark, _, _] = address.segments();
    (scope & !0x0300 == 0 && mark == 0x5efe).then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether an address is sent to: by default, and where private ones are allowed.
    #[track_caller]
    fn checked(address: &str) -> (bool, bool) {
        let address = address.parse().unwrap();
        (check(address, false).is_ok(), check(address, true).is_ok())
    }

    #[test]
    fn public_addresses_are_sent_to() {
        for address in
            ["1.1.1.1", "172.32.0.1", "100.128.0.1", "2606:4700::1111", "64:ff9b::101:101"]
        {
            assert_eq!(checked(address), (true, true), "{address}");
        }
    }

    #[test]
    fn private_addresses_need_to_be_allowed() {
        for address in [
            "127.0.0.1",
            "127.8.9.1",
            "10.1.2.3",
            "172.16.0.1",
            "192.168.1.1",
            "100.64.0.1",
            "198.19.0.1",
            "::1",
            "fd12::1",
            "::ffff:10.0.0.1",
            "64:ff9b::7f00:1",
            "2002:a00:1::1",
            "::127.0.0.1",
        ] {
            assert_eq!(checked(address), (false, true), "{address}");
        }
    }

    #[test]
    fn metadata_and_reserved_addresses_are_never_sent_to() {
        for address in [
            "169.254.169.254",
            "169.254.1.1",
            "0.0.0.0",
            "255.255.255.255",
            "224.0.0.1",
            "240.0.0.1",
            "100.100.100.200",
            "192.0.0.192",
            "::",
            "fe80::1",
            "fec0::1",
            "ff02::1",
            "fd00:ec2::254",
            "::ffff:169.254.169.254",
            "64:ff9b::a9fe:a9fe",
            "2002:a9fe:a9fe::1",
            "2001::1",
            "fd20:ce::254",
            "::ffff:0.0.0.1",
            "::5",
            "::ffff:0:a9fe:a9fe",
            "::5efe:a9fe:a9fe",
            "2001:db8::1",
            "3fff::1",
            "100::1",
            "4000::1",
            "192.0.2.1",
            "203.0.113.9",
        ] {
            assert_eq!(checked(address), (false, false), "{address}");
        }
    }

    /// Ways to write an address of version 4 in one of version 6.
    fn embeddings(inner: Ipv4Addr) -> Vec<(&'static str, Ipv6Addr)> {
        let [a, b, c, d] = inner.octets().map(u128::from);
        let last = u128::from(inner.to_bits());
        let made = [
            ("mapped", 0xffff << 32 | last),
            ("compatible", last),
            ("translated", 0xffff << 48 | last),
            ("NAT64", 0x64_ff9b << 96 | last),
            ("NAT64, /48", 0x64_ff9b_0001 << 80 | a << 72 | b << 64 | c << 48 | d << 40),
            ("NAT64, /56", 0x64_ff9b_0001 << 80 | 7 << 72 | a << 64 | b << 48 | c << 40 | d << 32),
            ("NAT64, /64", 0x64_ff9b_0001_0707 << 64 | last << 24),
            ("NAT64, /96", 0x64_ff9b_0001 << 80 | last),
            ("6to4", 0x2002 << 112 | last << 80 | 1),
            ("ISATAP in 6to4", 0x2002_0101_0101 << 80 | 0x5efe << 32 | last),
        ];
        let prefixes = [0, 0x2001_0470_0001_0001, 0x2606_4700_0000_0001, 0xfd12_0000_0000_0001];
        let isatap = prefixes.into_iter().flat_map(|prefix: u128| {
            [0, 0x0200, 0x0100, 0x0300]
                .map(|bits: u128| ("ISATAP", prefix << 64 | bits << 48 | 0x5efe << 32 | last))
        });
        made.into_iter().chain(isatap).map(|(name, bits)| (name, bits.into())).collect()
    }

    #[test]
    fn no_embedding_leads_where_its_inner_address_may_not() {
        for inner in ["169.254.169.254", "100.100.100.200"] {
            for (name, address) in embeddings(inner.parse().unwrap()) {
                assert_eq!(checked(&address.to_string()), (false, false), "{name}: {address}");
            }
        }
        for inner in ["127.0.0.1", "10.1.2.3", "172.16.9.9", "192.168.1.1", "100.64.0.1"] {
            for (name, address) in embeddings(inner.parse().unwrap()) {
                assert!(!checked(&address.to_string()).0, "{name}: {address}");
            }
        }
        for (name, address) in embeddings(Ipv4Addr::new(1, 1, 1, 1)) {
            let is_local = name.starts_with("NAT64, ") || address.segments()[0] == 0xfd12;
            // Zeros before ISATAP's mark are no prefix that the internet routes.
            let is_never = name == "ISATAP" && address.segments()[0] == 0;
            let expected = (!is_local && !is_never, !is_never);
            assert_eq!(checked(&address.to_string()), expected, "{name}: {address}");
        }
    }

    #[test]
    fn urls_have_a_safe_form() {
        let fine =
            ["https://mes.example/touch?line=3", "https://mes.example:8443", "https://1.1.1.1/"];
        for text in fine {
            assert_eq!(url(text, false).map(|_| ()), Ok(()), "{text}");
        }
        let wrong = [
            "",
            "mes.example",
            "http://mes.example",
            "ftp://mes.example",
            "https://u@mes.example",
            "https://u:p@mes.example",
            "https://mes.example/#x",
            "https://mes.example:0/",
            "https://127.0.0.1/",
            "https://2130706433/",
            "https://0x7f.1/",
            "https://[::1]/",
            "https://[::ffff:10.0.0.1]/",
            "https://169.254.169.254/latest",
            "file:///etc/passwd",
        ];
        for text in wrong {
            let Invalid(errors) = url(text, false).unwrap_err();
            assert_eq!(errors[0].pointer, "/url", "{text}");
        }
        assert!(url(&format!("https://mes.example/{}", "x".repeat(2048)), false).is_err());
        for text in ["http://127.0.0.1:9000/hook", "https://[::1]/", "http://mes.example/"] {
            assert!(url(text, true).is_ok(), "{text}");
        }
        assert!(url("http://169.254.169.254/", true).is_err());
    }
}
