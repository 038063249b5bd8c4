//! Catalogues and the manifests of versions as they are stored.

use bincode::{Decode, Encode};
use uuid::Uuid;

use super::{BlockEntry, Catalogue, Manifest, Switch, VersionObject};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, read, write};

#[derive(Encode, Decode)]
struct CatalogueRecordV1 {
    id: IdV1,
    name: String,
    latest: u32,
    current: Option<u32>,
    revision: u64,
    history: Vec<(u32, u64)>,
    created_at_ms: u64,
}

impl Record for Catalogue {
    const KIND: Kind = Kind::Catalogue;

    fn to_payload(&self) -> Vec<u8> {
        write(&CatalogueRecordV1 {
            id: self.id.into_bytes(),
            name: self.name.clone(),
            latest: self.latest,
            current: self.current,
            revision: self.revision,
            history: self.history.iter().map(|switch| (switch.version, switch.at_ms)).collect(),
            created_at_ms: self.created_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: CatalogueRecordV1 = read(payload)?;
        let switch = |(version, at_ms)| Switch { version, at_ms };
        Ok(Self {
            id: Uuid::from_bytes(stored.id),
            name: stored.name,
            latest: stored.latest,
            current: stored.current,
            revision: stored.revision,
            history: stored.history.into_iter().map(switch).collect(),
            created_at_ms: stored.created_at_ms,
        })
    }
}

#[derive(Encode, Decode)]
struct VersionRecordV1 {
    catalogue: IdV1,
    version: u32,
    job: Option<IdV1>,
    parameters: String,
    objects: Vec<(IdV1, String)>,
    blocks: Vec<(String, [u8; 32], u64)>,
    created_at_ms: u64,
}

impl Record for Manifest {
    const KIND: Kind = Kind::Version;

    fn to_payload(&self) -> Vec<u8> {
        let object = |object: &VersionObject| (object.id.into_bytes(), object.name.clone());
        let block = |block: &BlockEntry| (block.name.clone(), block.hash, block.length);
        write(&VersionRecordV1 {
            catalogue: self.catalogue.into_bytes(),
            version: self.version,
            job: self.job.map(Uuid::into_bytes),
            parameters: self.parameters.clone(),
            objects: self.objects.iter().map(object).collect(),
            blocks: self.blocks.iter().map(block).collect(),
            created_at_ms: self.created_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: VersionRecordV1 = read(payload)?;
        let object = |(id, name)| VersionObject { id: Uuid::from_bytes(id), name };
        let block = |(name, hash, length)| BlockEntry { name, hash, length };
        Ok(Self {
            catalogue: Uuid::from_bytes(stored.catalogue),
            version: stored.version,
            job: stored.job.map(Uuid::from_bytes),
            parameters: stored.parameters,
            objects: stored.objects.into_iter().map(object).collect(),
            blocks: stored.blocks.into_iter().map(block).collect(),
            created_at_ms: stored.created_at_ms,
        })
    }
}
