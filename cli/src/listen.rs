//! The address that a server listens on, as people type it.

use std::net::{Ipv4Addr, SocketAddr};

/// Default address of a server.
pub(crate) const DEFAULT_LISTEN: &str = "127.0.0.1:7411";

/// An address to listen on: `127.0.0.1:7411`, `[::1]:7411`, `localhost:7411`, or a port alone.
pub(crate) fn listen_address(text: &str) -> Result<SocketAddr, String> {
    let local = |port: &str| port.parse().ok().map(|port| (Ipv4Addr::LOCALHOST, port).into());
    let address = text.parse().ok();
    let address = address.or_else(|| local(text.strip_prefix("localhost:").unwrap_or(text)));
    address.ok_or_else(|| {
        format!("came {text:?}, expected an address with a port, such as {DEFAULT_LISTEN}")
    })
}
