//! Catalogues and the manifests of versions as they are stored.

use std::collections::BTreeMap;

use uuid::Uuid;

use super::{BlockEntry, Catalogue, Manifest, Switch, VersionObject};
use crate::entity::Labels;
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, read, write};

/// Id, name, latest and current version, revision, history of versions and times, time of
/// creation. Aliases and labels follow in schema 2.
type CatalogueRecordV1 = (IdV1, String, u32, Option<u32>, u64, Vec<(u32, u64)>, u64);

fn catalogue(stored: CatalogueRecordV1) -> Catalogue {
    let (id, name, latest, current, revision, history, created_at_ms) = stored;
    let switch = |(version, at_ms)| Switch { version, at_ms };
    let history = history.into_iter().map(switch).collect();
    let new = Catalogue::new(Uuid::from_bytes(id), name, created_at_ms);
    Catalogue { latest, current, revision, history, ..new }
}

impl Record for Catalogue {
    const KIND: Kind = Kind::Catalogue;
    const SCHEMA: u16 = 2;

    fn to_payload(&self) -> Vec<u8> {
        let Self { id, name, latest, current, aliases, labels, revision, history, created_at_ms } =
            self;
        let history = history.iter().map(|switch| (switch.version, switch.at_ms));
        let history: Vec<(u32, u64)> = history.collect();
        let known = (id.as_bytes(), name, latest, current, revision, history, created_at_ms);
        write(&(known, aliases, labels))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (known, aliases, labels): (CatalogueRecordV1, BTreeMap<String, u32>, Labels) =
            read(payload)?;
        Ok(Self { aliases, labels, ..catalogue(known) })
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        match schema {
            1 => Ok(catalogue(read(payload)?)),
            found => Err(RecordError::Schema { found, known: Self::SCHEMA }),
        }
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
