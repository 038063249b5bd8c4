//! Errors of who sends a request, from where, and with which method.

use palpate_schemas::Role;
use palpate_store::access::AccessKey;
use thiserror::Error;

use crate::roles;
use crate::services::keys::error::KeyFault;
use crate::wire;

/// Error of a request's sender.
#[derive(Debug, Error)]
pub(crate) enum AccessError {
    #[error(transparent)]
    Unauthenticated(#[from] KeyFault),
    #[error(
        "the key {:?} has the role {}, expected {}", key.name, role_name(key.role), needed(roles)
    )]
    Forbidden { key: Box<AccessKey>, roles: &'static [Role] },
    #[error("this path exists, but not with this method; the header `Allow` lists which")]
    OtherMethod { allow: String },
    #[error(
        "the request addresses the host {host:?}: a server without keys answers only to its own \
         names, such as 127.0.0.1 or localhost; in a network also to its addresses and to the \
         names that `--host-name` lists"
    )]
    ForeignHost { host: String },
    #[error("pages of {origin} may not use this server: allow them with `--cors-origin {origin}`")]
    ForeignOrigin { origin: String },
}

fn role_name(role: palpate_store::access::Role) -> &'static str {
    roles::name(wire::access::role(role))
}

fn needed(roles: &[Role]) -> String {
    match roles {
        [] => "a role that no key has".to_owned(),
        [only] => format!("the role {}", roles::name(*only)),
        several => format!("one of the roles {}", roles::listed(several)),
    }
}
