//! MessagePack bodies: maps with JSON's names, for robots on slow networks.
//!
//! Numbers may have any width. Unlike JSON it can carry infinities and NaN; the check of
//! readings refuses those.

use std::io::Cursor;

use super::{Admit, Parsed, malformed, pointer, weight, wrong_value};
use crate::refusal::Refusal;
use rmp_serde::decode::Error;

/// The content type of such a body.
pub(crate) const CONTENT_TYPE: &str = "application/msgpack";

/// Maximum nesting of a body; readings are five levels deep.
const DEPTH_MAX: usize = 64;

/// The marker byte that the format never uses.
const NEVER_USED: u8 = 0xc1;

/// Parses MessagePack; the error names an invalid value by a JSON pointer.
pub(crate) fn parse<T: Parsed>(bytes: &[u8], admit: Admit<'_>) -> Result<T, Refusal> {
    let deserializer = || {
        let mut deserializer = rmp_serde::Deserializer::new(Cursor::new(bytes));
        deserializer.set_max_depth(DEPTH_MAX);
        deserializer
    };
    admit(weight::<T, _>(&mut deserializer(), |at, error| refusal(at, &error))?)?;
    let mut deserializer = deserializer();
    let value = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let pointer = pointer(error.path());
        refusal(pointer, &error.into_inner())
    })?;
    match bytes.len() as u64 - deserializer.position() {
        0 => Ok(value),
        n => Err(malformed("MessagePack", String::new(), format!("{n} bytes follow it"))),
    }
}

fn refusal(pointer: String, error: &Error) -> Refusal {
    let detail = error.to_string();
    match error {
        Error::InvalidMarkerRead(_)
        | Error::InvalidDataRead(_)
        | Error::Utf8Error(_)
        | Error::DepthLimitExceeded => malformed("MessagePack", pointer, detail),
        Error::TypeMismatch(marker) if marker.to_u8() == NEVER_USED => {
            malformed("MessagePack", pointer, detail)
        }
        Error::TypeMismatch(_)
        | Error::OutOfRange
        | Error::LengthMismatch(_)
        | Error::Uncategorized(_)
        | Error::Syntax(_) => wrong_value(pointer, detail),
    }
}
