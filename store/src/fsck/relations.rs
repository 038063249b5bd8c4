//! References between records: journals and their heads, versions and blocks, names and ids.

use std::collections::{BTreeMap, BTreeSet};

use uuid::Uuid;

use super::records::{Whole, damage, space, words};
use super::{Finding, Report, Severity};
use crate::catalogue::Manifest;
use crate::journal::{Event, StoredHead};
use crate::key::{self, Space};
use crate::mesh::MeshInfo;
use crate::sensor_day::SensorDay;

/// What is known of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum File {
    Damaged,
    /// Its hash.
    Whole([u8; 32]),
    /// Its length; it was not read.
    Unread(u64),
}

/// The facts kept of the visited records.
#[derive(Default)]
pub(super) struct Relations {
    /// Lengths of journals by the letter of their entries and owner.
    heads: BTreeMap<(u8, Uuid), u64>,
    /// Number of entries of a session that its head counts as withdrawn.
    n_retracted: BTreeMap<Uuid, u64>,
    /// Number of entries without a gap.
    entries: BTreeMap<(u8, Uuid), u64>,
    /// Readings withdrawn by entries, and those with a record of it.
    withdrawn: BTreeSet<(Uuid, u64)>,
    retractions: BTreeSet<(Uuid, u64)>,
    sensors: BTreeSet<Uuid>,
    sessions: BTreeSet<Uuid>,
    objects: BTreeSet<Uuid>,
    /// Present blocks: their lengths, `None` if damaged.
    blocks: BTreeMap<[u8; 32], Option<u64>>,
    named_blocks: BTreeSet<[u8; 32]>,
    files: BTreeMap<Vec<u8>, File>,
    /// Names by kind and text, and the names of items.
    names: BTreeMap<Vec<u8>, Uuid>,
    used_names: BTreeSet<Vec<u8>>,
    named: Vec<(Vec<u8>, Uuid)>,
    catalogues: BTreeMap<Uuid, u32>,
    versions: BTreeSet<(Uuid, u32)>,
    calibrations: BTreeMap<Uuid, u64>,
    /// Keys of days, by sensor.
    days: BTreeMap<Uuid, Vec<Vec<u8>>>,
    /// Keys of damaged records.
    damaged: BTreeSet<Vec<u8>>,
}

impl Relations {
    pub(super) fn leftover(&mut self, key: &[u8], fault: String, report: &mut Report) {
        if report.leftovers.last().is_some_and(|last| last == key) {
            return;
        }
        let (space, _, _) = space(key[0]);
        let means = "nothing; `palpate fsck --collect` removes it";
        let key_words = words(key);
        report.add(Finding { severity: Severity::Leftover, space, key: key_words, fault, means });
        report.leftovers.push(key.to_vec());
    }

    /// Notes a damaged record.
    pub(super) fn damaged(&mut self, key: &[u8], _fault: &str) {
        self.damaged.insert(key.to_vec());
        match key[0] {
            b'b' => {
                self.blocks.insert(hash_of(key), None);
            }
            b'f' => {
                self.files.insert(key.to_vec(), File::Damaged);
            }
            b't' | b'r' => self.entry(key),
            b'x' => {
                self.retractions.insert((id_of(key), number_of(key)));
            }
            b's' => {
                self.sensors.insert(id_of(key));
            }
            b'o' => {
                self.objects.insert(id_of(key));
            }
            b'e' => {
                self.sessions.insert(id_of(key));
            }
            _ => {}
        }
    }

    /// Notes an undamaged record, and faults of its position.
    pub(super) fn record(&mut self, key: &[u8], whole: Whole, report: &mut Report) {
        let id = if key.len() >= 17 { id_of(key) } else { Uuid::nil() };
        let is_misplaced = match whole {
            Whole::Layout(layout) => {
                report.layout = Some(layout.layout);
                false
            }
            Whole::Sensor(sensor) => {
                self.sensors.insert(id);
                self.thing(Space::Sensor, sensor.id, id, &sensor.name)
            }
            Whole::Object(object) => {
                self.objects.insert(id);
                self.thing(Space::Object, object.id, id, &object.name)
            }
            Whole::Catalogue(catalogue) => {
                self.catalogues.insert(id, catalogue.latest);
                self.thing(Space::Catalogue, catalogue.id, id, &catalogue.name)
            }
            Whole::Name(name) => {
                self.names.insert(key.to_vec(), Uuid::from_bytes(name.id));
                false
            }
            Whole::Session(session) => {
                self.sessions.insert(id);
                session.id != id
            }
            Whole::Head(head) => {
                self.head(key[0], id, &head);
                false
            }
            Whole::Entry(entry) => {
                self.entry(key);
                if let (b'r', Event::Retraction { seq }) = (key[0], &entry.event) {
                    self.withdrawn.insert((id, *seq));
                }
                entry.seq != number_of(key)
            }
            Whole::Retraction(retraction) => {
                self.retractions.insert((id, number_of(key)));
                let length = self.heads.get(&(b'r', id)).copied();
                length.is_some_and(|length| retraction.seq >= length)
            }
            Whole::Robot(robot) => {
                let entries = if key[0] == b'u' { b't' } else { b'r' };
                let length = self.heads.get(&(entries, id)).copied();
                length.is_some_and(|length| robot.seq >= length)
            }
            Whole::Raw(hash, length) => self.raw(key, hash, length),
            Whole::Unread(length) => self.unread(key, length),
            Whole::Mesh(mesh) => {
                self.mesh(key, id, &mesh, report);
                false
            }
            Whole::Version(manifest) => {
                self.version(key, &manifest, report);
                manifest.catalogue != id || u64::from(manifest.version) != number_of(key)
            }
            Whole::Calibration(calibration) => {
                let before = self.calibrations.insert(id, number_of(key)).unwrap_or(0);
                if before + 1 != number_of(key) {
                    report.add(damage(key, format!("number {} is missing", before + 1)));
                }
                calibration.sensor != id || u64::from(calibration.number) != number_of(key)
            }
            Whole::SensorDay(found) => self.day(key, id, &found),
            Whole::Holding => {
                if !self.is_there(key) {
                    self.leftover(key, "what it counts was removed".to_owned(), report);
                }
                false
            }
            Whole::Alone | Whole::Other => false,
        };
        if is_misplaced {
            report.add(damage(key, "it lies where another one belongs".to_owned()));
        }
    }

    /// Notes a day of a sensor; whether it is misplaced.
    fn day(&mut self, key: &[u8], sensor: Uuid, found: &SensorDay) -> bool {
        self.days.entry(sensor).or_default().push(key.to_vec());
        found.sensor != sensor || u64::from(found.day.day) != number_of(key)
    }

    /// Notes the head of a journal.
    fn head(&mut self, space: u8, id: Uuid, head: &StoredHead) {
        self.heads.insert((space.to_ascii_lowercase(), id), head.length());
        if let (b'R', StoredHead::Whole(head)) = (space, head) {
            self.n_retracted.insert(id, head.n_retracted);
        }
    }

    /// Whether the thing of a holding exists. Holdings come after all things in the order of keys.
    fn is_there(&self, key: &[u8]) -> bool {
        let id = id_of(&key[1..]);
        match key.get(1) {
            Some(b'e') => self.sessions.contains(&id),
            Some(b'o' | b't' | b'f') => self.objects.contains(&id),
            Some(b's') => self.sensors.contains(&id),
            Some(b'c' | b'v') => self.catalogues.contains_key(&id),
            _ => true,
        }
    }

    fn thing(&mut self, kind: Space, found: Uuid, place: Uuid, name: &str) -> bool {
        self.named.push((key::name(kind, name), place));
        found != place
    }

    fn entry(&mut self, key: &[u8]) {
        let seen = self.entries.entry((key[0], id_of(key))).or_default();
        if number_of(key) == *seen {
            *seen += 1;
        }
    }

    fn raw(&mut self, key: &[u8], hash: [u8; 32], length: u64) -> bool {
        if key[0] == b'f' {
            self.files.insert(key.to_vec(), File::Whole(hash));
            return false;
        }
        let is_its_own = hash_of(key) == hash;
        self.blocks.insert(hash_of(key), is_its_own.then_some(length));
        !is_its_own
    }

    fn unread(&mut self, key: &[u8], length: u64) -> bool {
        match key[0] {
            b'f' => drop(self.files.insert(key.to_vec(), File::Unread(length))),
            b'b' => drop(self.blocks.insert(hash_of(key), Some(length))),
            _ => {}
        }
        false
    }

    fn mesh(&mut self, key: &[u8], object: Uuid, mesh: &MeshInfo, report: &mut Report) {
        let file = key::nested(Space::MeshFile, object, mesh.upload);
        let is_whole = match self.files.remove(&file) {
            Some(File::Whole(hash)) => hash == mesh.hash,
            Some(File::Unread(length)) => length == mesh.length,
            Some(File::Damaged) | None => false,
        };
        if !is_whole {
            report.add(damage(key, "its file is missing or damaged".to_owned()));
        }
    }

    fn version(&mut self, key: &[u8], manifest: &Manifest, report: &mut Report) {
        self.versions.insert((manifest.catalogue, manifest.version));
        for block in &manifest.blocks {
            self.named_blocks.insert(block.hash);
            let fault = match self.blocks.get(&block.hash) {
                Some(Some(length)) if *length == block.length => continue,
                Some(_) => format!("its block {} is damaged", block.name),
                None => format!("its block {} is missing", block.name),
            };
            report.damaged_versions.push((manifest.catalogue, manifest.version, fault.clone()));
            report.add(damage(key, fault));
        }
    }

    /// Checks the relations that are known only after the last record.
    pub(super) fn end(mut self, report: &mut Report) {
        self.end_journals(report);
        for (session, counted) in &self.n_retracted {
            let of_session = (*session, 0)..=(*session, u64::MAX);
            let found = self.withdrawn.range(of_session).count() as u64;
            if found != *counted {
                let fault = format!("it counts {counted} withdrawn entries, there are {found}");
                report.add(damage(&key::id(Space::JournalHead, *session), fault));
            }
        }
        for (session, seq) in self.withdrawn.difference(&self.retractions) {
            let key = key::numbered(Space::JournalRetraction, *session, *seq);
            report.add(damage(&key, "it is missing".to_owned()));
        }
        for (catalogue, latest) in &self.catalogues {
            for version in (1..=*latest).filter(|n| !self.versions.contains(&(*catalogue, *n))) {
                let key = key::numbered(Space::Version, *catalogue, u64::from(version));
                if !self.damaged.contains(&key) {
                    report.add(damage(&key, "it is missing".to_owned()));
                }
                let fault = "its manifest is missing or damaged".to_owned();
                report.damaged_versions.push((*catalogue, version, fault));
            }
        }
        for (name, id) in std::mem::take(&mut self.named) {
            if self.names.get(&name) != Some(&id) && !self.damaged.contains(&name) {
                report.add(damage(&name, format!("it does not lead to {id}")));
            }
            self.used_names.insert(name);
        }
        let stray: Vec<Vec<u8>> =
            self.names.keys().filter(|name| !self.used_names.contains(*name)).cloned().collect();
        for name in stray {
            report.add(damage(&name, "nothing has this name: what had it is missing".to_owned()));
        }
        let unnamed: Vec<[u8; 32]> =
            self.blocks.keys().filter(|hash| !self.named_blocks.contains(*hash)).copied().collect();
        for hash in unnamed {
            let key = key::hash(Space::Block, &hash);
            self.leftover(&key, "no version names it".to_owned(), report);
        }
        for (sensor, keys) in std::mem::take(&mut self.days) {
            let is_gone = !self.sensors.contains(&sensor);
            for key in keys.iter().filter(|_| is_gone) {
                self.leftover(key, "its sensor was removed".to_owned(), report);
            }
        }
        for key in std::mem::take(&mut self.files).into_keys() {
            self.leftover(&key, "no mesh names it".to_owned(), report);
        }
    }

    fn end_journals(&mut self, report: &mut Report) {
        let owners: BTreeSet<(u8, Uuid)> =
            self.heads.keys().chain(self.entries.keys()).copied().collect();
        for (letter, owner) in owners {
            let (head, entries) = match letter {
                b't' => (Space::TrainingHead, Space::Training),
                _ => (Space::JournalHead, Space::Journal),
            };
            let lives = match entries {
                Space::Training => self.objects.contains(&owner),
                _ => self.sessions.contains(&owner),
            };
            let length = self.heads.get(&(letter, owner)).copied();
            let seen = self.entries.get(&(letter, owner)).copied().unwrap_or(0);
            let head_key = key::id(head, owner);
            match length {
                _ if !lives => {
                    // Remains of an interrupted removal.
                    for space in [head, entries] {
                        let key = key::id(space, owner);
                        self.leftover(&key, "its owner was removed".to_owned(), report);
                    }
                }
                Some(length) if seen < length => {
                    let key = key::numbered(entries, owner, seen);
                    report.add(damage(&key, format!("it is missing, of {length}")));
                }
                Some(length) if seen > length => {
                    let fault = format!("it counts {length} entries, there are {seen}");
                    report.add(damage(&head_key, fault));
                }
                None if !self.damaged.contains(&head_key) => {
                    report.add(damage(&head_key, format!("it is missing, {seen} entries are not")));
                }
                _ => {}
            }
        }
    }
}

fn id_of(key: &[u8]) -> Uuid {
    let bytes = key.get(1..17).and_then(|bytes| <[u8; 16]>::try_from(bytes).ok());
    Uuid::from_bytes(bytes.unwrap_or_default())
}

fn number_of(key: &[u8]) -> u64 {
    let bytes = key.get(17..25).and_then(|bytes| <[u8; 8]>::try_from(bytes).ok());
    u64::from_be_bytes(bytes.unwrap_or_default())
}

fn hash_of(key: &[u8]) -> [u8; 32] {
    key.get(1..33).and_then(|bytes| bytes.try_into().ok()).unwrap_or_default()
}
