//! Catalogues and the manifests of versions as they are stored.

use uuid::Uuid;

use super::{BlockEntry, Catalogue, Manifest, Switch, VersionObject};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, read, write};

impl Record for Catalogue {
    const KIND: Kind = Kind::Catalogue;

    fn to_payload(&self) -> Vec<u8> {
        let Self { id, name, latest, current, revision, history, created_at_ms } = self;
        let history: Vec<(u32, u64)> =
            history.iter().map(|switch| (switch.version, switch.at_ms)).collect();
        write(&(id.as_bytes(), name, latest, current, revision, history, created_at_ms))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (id, name, latest, current, revision, history, created_at_ms) = read(payload)?;
        let history: Vec<(u32, u64)> = history;
        let switch = |(version, at_ms)| Switch { version, at_ms };
        let (id, history) = (Uuid::from_bytes(id), history.into_iter().map(switch).collect());
        Ok(Self { id, name, latest, current, revision, history, created_at_ms })
    }
}

impl Record for Manifest {
    const KIND: Kind = Kind::Version;

    fn to_payload(&self) -> Vec<u8> {
        let Self { catalogue, version, job, parameters, objects, blocks, created_at_ms } = self;
        let objects: Vec<(&IdV1, &String)> =
            objects.iter().map(|object| (object.id.as_bytes(), &object.name)).collect();
        let blocks: Vec<(&String, [u8; 32], u64)> =
            blocks.iter().map(|block| (&block.name, block.hash, block.length)).collect();
        let (catalogue, job) = (catalogue.as_bytes(), job.map(Uuid::into_bytes));
        write(&(catalogue, version, job, parameters, objects, blocks, created_at_ms))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (catalogue, version, job, parameters, objects, blocks, created_at_ms) = read(payload)?;
        let objects: Vec<(IdV1, String)> = objects;
        let blocks: Vec<(String, [u8; 32], u64)> = blocks;
        let job: Option<IdV1> = job;
        let object = |(id, name)| VersionObject { id: Uuid::from_bytes(id), name };
        let block = |(name, hash, length)| BlockEntry { name, hash, length };
        Ok(Self {
            catalogue: Uuid::from_bytes(catalogue),
            version,
            job: job.map(Uuid::from_bytes),
            parameters,
            objects: objects.into_iter().map(object).collect(),
            blocks: blocks.into_iter().map(block).collect(),
            created_at_ms,
        })
    }
}
