//! The keys that robots' names belong to, as they are stored.

use bincode::{Decode, Encode};
use uuid::Uuid;

use super::RobotHolder;
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, read, write};

#[derive(Encode, Decode)]
struct RobotHolderRecordV1 {
    robot: String,
    key: IdV1,
    since_ms: u64,
}

impl Record for RobotHolder {
    const KIND: Kind = Kind::RobotHolder;

    fn to_payload(&self) -> Vec<u8> {
        write(&RobotHolderRecordV1 {
            robot: self.robot.clone(),
            key: self.key.into_bytes(),
            since_ms: self.since_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let RobotHolderRecordV1 { robot, key, since_ms } = read(payload)?;
        Ok(Self { robot, key: Uuid::from_bytes(key), since_ms })
    }
}
