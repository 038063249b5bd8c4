//! Stored form of values: an envelope with their kind and schema number.
//!
//! The frozen forms stand beside the types that they store, in files `stored.rs`. A form, a tuple
//! or a struct that ends in `V1`, never changes: golden files hold it; a new field makes a `V2`
//! with the next schema number, and decoding converts any of them to today's type. Payloads are
//! bincode 2.0.1's `legacy` form (fixed-width little-endian, u64 lengths); readings' pressures
//! are raw little-endian f64, NaN for a missing taxel.

use bincode::config::{self, Configuration, Fixint, Limit, LittleEndian};
use bincode::{Decode, Encode};

use crate::envelope::{self, Kind};
use crate::error::RecordError;

/// Schema number of every record that has only one.
pub const SCHEMA: u16 = 1;
/// Maximum length of a bincode payload.
const PAYLOAD_LIMIT: usize = 64 << 20;
const CONFIG: Configuration<LittleEndian, Fixint, Limit<PAYLOAD_LIMIT>> =
    config::legacy().with_limit::<PAYLOAD_LIMIT>();

/// A value with a stored form.
pub trait Record: Sized {
    /// Kind in its envelope.
    const KIND: Kind;
    /// Schema number with which it is written.
    const SCHEMA: u16 = SCHEMA;

    /// Its payload.
    fn to_payload(&self) -> Vec<u8>;

    /// The value of a payload of [`Record::SCHEMA`].
    ///
    /// # Errors
    /// [`RecordError`] when the payload is not such a value.
    fn from_payload(payload: &[u8]) -> Result<Self, RecordError>;

    /// The value of a payload of an earlier schema.
    ///
    /// # Errors
    /// [`RecordError`] when there was no such schema, or the payload is not of it.
    fn from_older(schema: u16, _payload: &[u8]) -> Result<Self, RecordError> {
        Err(RecordError::Schema { found: schema, known: Self::SCHEMA })
    }
}

/// The stored bytes of a value.
pub fn encode<T: Record>(value: &T) -> Vec<u8> {
    envelope::seal(T::KIND, T::SCHEMA, &value.to_payload())
}

/// The value of stored bytes.
///
/// # Errors
/// [`RecordError`] names the damage, or the newer schema.
pub fn decode<T: Record>(bytes: &[u8]) -> Result<T, RecordError> {
    let opened = envelope::open(T::KIND, bytes)?;
    match opened.schema {
        schema if schema == T::SCHEMA => T::from_payload(opened.payload),
        older if older < T::SCHEMA => T::from_older(older, opened.payload),
        found => Err(RecordError::Schema { found, known: T::SCHEMA }),
    }
}

pub(crate) fn write<T: Encode>(stored: &T) -> Vec<u8> {
    bincode::encode_to_vec(stored, CONFIG).expect("the repositories bound what they store")
}

pub(crate) fn read<T: Decode<()>>(payload: &[u8]) -> Result<T, RecordError> {
    let (stored, consumed) = bincode::decode_from_slice(payload, CONFIG)
        .map_err(|error| RecordError::Decode { detail: error.to_string() })?;
    if consumed != payload.len() {
        return Err(RecordError::Trailing { consumed, length: payload.len() });
    }
    Ok(stored)
}

/// Stored form of an id.
pub(crate) type IdV1 = [u8; 16];

/// The id of a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct NameV1 {
    pub(crate) id: IdV1,
}

/// The layout number of the database and its creator.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct LayoutV1 {
    pub(crate) layout: u32,
    pub(crate) made_by: String,
}

/// A record stored without conversion.
pub(crate) trait Plain: Encode + Decode<()> {
    const KIND: Kind;
}

impl Plain for NameV1 {
    const KIND: Kind = Kind::Name;
}

impl Plain for LayoutV1 {
    const KIND: Kind = Kind::Layout;
}

impl<T: Plain> Record for T {
    const KIND: Kind = T::KIND;

    fn to_payload(&self) -> Vec<u8> {
        write(self)
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        read(payload)
    }
}

/// The code of `value`: its index in `all`.
pub(crate) fn code<T: PartialEq>(all: &[T], value: &T) -> u8 {
    let place = all.iter().position(|candidate| candidate == value);
    place.and_then(|place| u8::try_from(place).ok()).expect("all values are listed")
}

pub(crate) fn coded<T: Copy>(all: &[T], field: &'static str, found: u8) -> Result<T, RecordError> {
    all.get(usize::from(found)).copied().ok_or(RecordError::Code { field, found })
}
