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
const METADATA_V4: [Ipv4Addr; 2] =
    [Ipv4Addr::new(100, 100, 100, 200), Ipv4Addr::new(192, 0, 0, 192)];
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

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Public,
    Private,
    Never,
}

fn kind_v4(address: Ipv4Addr) -> Kind {
    let [a, b, ..] = address.octets();
    let is_metadata = METADATA_V4.contains(&address);
    if is_metadata || address.is_link_local() || a == 0 || a >= 224 {
        return Kind::Never;
    }
    // Shared by a provider's customers (RFC 6598), and networks of tests (RFC 2544).
    let is_shared = (a == 100 && b & 0xc0 == 64) || (a == 198 && b & 0xfe == 18);
    match address.is_loopback() || address.is_private() || is_shared {
        true => Kind::Private,
        false => Kind::Public,
    }
}

fn kind_v6(address: Ipv6Addr) -> Kind {
    if address.is_loopback() {
        return Kind::Private;
    }
    if let Some(inner) = embedded(address) {
        return kind_v4(inner);
    }
    let [first, second, ..] = address.segments();
    // Unspecified, multicast, link-local, site-local, and tunnels (Teredo) to anywhere.
    let is_never = address.is_unspecified()
        || first >> 8 == 0xff
        || first & 0xff80 == 0xfe80
        || (first, second) == (0x2001, 0)
        || METADATA_V6.contains(&address);
    match (is_never, first & 0xfe00 == 0xfc00) {
        (true, _) => Kind::Never,
        (false, true) => Kind::Private,
        (false, false) => Kind::Public,
    }
}

/// The address of version 4 to which one of version 6 leads: mapped, compatible, translated
/// (NAT64) or 6to4.
fn embedded(address: Ipv6Addr) -> Option<Ipv4Addr> {
    let bytes = address.octets();
    let at =
        |from: usize| Ipv4Addr::new(bytes[from], bytes[from + 1], bytes[from + 2], bytes[from + 3]);
    match address.segments() {
        [0, 0, 0, 0, 0, 0 | 0xffff, ..] | [0, 0, 0, 0, 0xffff, 0, ..] => Some(at(12)),
        [0x64, 0xff9b, 0 | 1, ..] => Some(at(12)),
        [0x2002, ..] => Some(at(2)),
        _ => None,
    }
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
        ] {
            assert_eq!(checked(address), (false, false), "{address}");
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
