//! Appends to a journal: the commit of new entries, and what they claim to be the only one of.
//!
//! A claim is a record that must be absent before: a robot's own number, or the withdrawal of
//! an entry. A failed claim names the entry that has it.

use std::collections::HashMap;

use uuid::Uuid;

use super::{
    AppendError, Entry, Event, Head, Journal, JournalRetractionV1, JournalRobotV1, NewEntry,
    ROBOT_BYTES_MAX, StoredHead,
};
use crate::engine::{Commit, Expected};
use crate::entity::ReadingId;
use crate::error::{StoreError, conflict};
use crate::key;
use crate::pieces;
use crate::record;

/// A unique property that a new entry claims.
enum Claim<'entry> {
    /// A robot's number, among those of an API key.
    Robot(&'entry ReadingId, Option<Uuid>),
    Retraction(u64),
}

/// A claim in its stored form.
struct StoredClaim<'entry> {
    claim: Claim<'entry>,
    key: Vec<u8>,
    record: Vec<u8>,
}

impl Journal {
    /// Appends entries from number `expected` on; durable when it returns.
    ///
    /// # Errors
    /// [`AppendError`]; nothing was written, unless the engine itself failed.
    pub async fn append(
        &self,
        owner: Uuid,
        expected: u64,
        entries: &[NewEntry],
    ) -> Result<(), AppendError> {
        let (commit, claims) = self.append_commit(owner, expected, entries)?;
        match self.engine.commit(commit).await.map_err(conflict) {
            Ok(()) => Ok(()),
            Err(Ok(0)) => Err(AppendError::Sequence { expected, found: self.len(owner)? }),
            Err(Ok(expectation)) => Err(self.taken(owner, &claims[expectation - 1], expected)?),
            Err(Err(error)) => Err(error.into()),
        }
    }

    /// The reason for which a claim of an append from `expected` on failed.
    fn taken(
        &self,
        owner: Uuid,
        claim: &Claim<'_>,
        expected: u64,
    ) -> Result<AppendError, StoreError> {
        Ok(match claim {
            Claim::Robot(id, key) => {
                let at = self.find(owner, id, *key)?.unwrap_or(expected);
                AppendError::Repeated { robot: id.robot.clone(), seq: id.seq, at }
            }
            Claim::Retraction(seq) => {
                let at = self.retraction(owner, *seq)?.unwrap_or(expected);
                AppendError::Retracted { seq: *seq, at }
            }
        })
    }

    fn append_commit<'entries>(
        &self,
        owner: Uuid,
        expected: u64,
        entries: &'entries [NewEntry],
    ) -> Result<(Commit, Vec<Claim<'entries>>), AppendError> {
        let key = key::id(self.spaces.head, owner);
        let (before, head) = match self.stored_head(owner)? {
            None => (Expected::Absent, Head::default()),
            Some((bytes, head)) => (Expected::Value(bytes), self.whole(owner, head)?),
        };
        if head.length != expected {
            return Err(AppendError::Sequence { expected, found: head.length });
        }
        let mut commit = Commit::new().expect(key.clone(), before);
        if !entries.is_empty() {
            let head = entries.iter().fold(head, Head::after);
            commit = commit.put(key, record::encode(&StoredHead::Whole(head)));
        }
        let mut claims = Vec::new();
        let mut taken: HashMap<Vec<u8>, u64> = HashMap::new();
        for (seq, entry) in (expected..).zip(entries) {
            let key = key::numbered(self.spaces.entries, owner, seq);
            let NewEntry { reading_id, received_at_ms, event, written_by } = entry.clone();
            let numbered = Entry { seq, reading_id, received_at_ms, event, written_by };
            commit = pieces::put(commit, &key, &record::encode(&numbered), None);
            let Some(found) = self.claim(owner, seq, entry)? else { continue };
            let StoredClaim { claim, key, record } = found;
            if let Some(at) = taken.insert(key.clone(), seq) {
                return Err(self.taken(owner, &claim, at)?);
            }
            commit = commit.expect(key.clone(), Expected::Absent).put(key, record);
            claims.push(claim);
        }
        Ok((commit, claims))
    }

    /// The unique property that entry `seq` claims: its key and its record.
    fn claim<'entry>(
        &self,
        owner: Uuid,
        seq: u64,
        entry: &'entry NewEntry,
    ) -> Result<Option<StoredClaim<'entry>>, AppendError> {
        if let (Event::Retraction { seq: withdrawn }, Some(space)) =
            (&entry.event, self.spaces.retractions)
        {
            let key = key::numbered(space, owner, *withdrawn);
            let record = record::encode(&JournalRetractionV1 { seq });
            let claim = Claim::Retraction(*withdrawn);
            return Ok(Some(StoredClaim { claim, key, record }));
        }
        let Some(id) = &entry.reading_id else { return Ok(None) };
        if id.robot.len() > ROBOT_BYTES_MAX {
            return Err(AppendError::RobotLength { found: id.robot.len() });
        }
        let key = key::robot(self.spaces.robots, owner, &id.robot, id.seq, entry.written_by);
        let record = record::encode(&JournalRobotV1 { seq });
        Ok(Some(StoredClaim { claim: Claim::Robot(id, entry.written_by), key, record }))
    }
}
