//! Stored form of the keys that own robots' names.

use uuid::Uuid;

use super::RobotHolder;
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{Record, read, write};

impl Record for RobotHolder {
    const KIND: Kind = Kind::RobotHolder;

    fn to_payload(&self) -> Vec<u8> {
        write(&(&self.robot, self.key.as_bytes(), self.since_ms))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (robot, key, since_ms) = read(payload)?;
        Ok(Self { robot, key: Uuid::from_bytes(key), since_ms })
    }
}
