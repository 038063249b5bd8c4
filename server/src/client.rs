//! The client of a request: its key, or its address without a key.
//!
//! Limits shared by clients (`rate`, `budget`) count by client.

use std::net::{IpAddr, Ipv6Addr};

use uuid::Uuid;

/// Length of a network that is one client: a host may choose any address in it.
const IPV6_PREFIX_BITS: u32 = 64;

/// A client with a share of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Client {
    /// The holder of a key.
    Key(Uuid),
    /// An address; in IPv6 a network of 64 bits.
    Address(IpAddr),
}

impl Client {
    /// The client at an address.
    pub(crate) fn at(address: IpAddr) -> Self {
        Self::Address(match address.to_canonical() {
            IpAddr::V6(address) => {
                let host_bits = 128 - IPV6_PREFIX_BITS;
                IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() >> host_bits << host_bits))
            }
            v4 => v4,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_is_one_client_at_any_address_of_its_prefix() {
        let at = |text: &str| Client::at(text.parse().unwrap());
        assert_eq!(at("2001:db8:1:2:3::4"), at("2001:db8:1:2:ffff::1"));
        assert_ne!(at("2001:db8:1:2::4"), at("2001:db8:1:3::4"));
        assert_eq!(at("::ffff:10.0.0.1"), at("10.0.0.1"));
        assert_ne!(at("10.0.0.1"), at("10.0.0.2"));
    }
}
