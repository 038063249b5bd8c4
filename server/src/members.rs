//! The servers of one cluster that divide the objects of catalogues among them.
//!
//! Each tells the others every second who it is and which blocks it has in memory (`words`), and
//! keeps a roster of those that are alive. Which of them hold a block follows from the roster
//! (`placing`); questions go to all of them at once (`asking`). Not here: what a block is, how it is
//! read, and what the questions are (`services::catalogues`).

mod asking;
mod placing;
mod roster;
mod words;

use std::collections::HashMap;
use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use palpate_store::database::Database;
use palpate_store::engine::EngineError;
use palpate_store::engine::line::{LineError, Question as Asked, Speaker};
use palpate_store::private;
use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot};
use uuid::Uuid;

use crate::clock::now_ms;
use crate::config::Dividing;
use crate::program::program;
use asking::{Pace, Request, gather};
pub(crate) use placing::Block;
use placing::{Seat, holders};
use roster::Roster;
use words::Hello;
pub(crate) use words::{HeldVersion, Question, Reply, answer};

/// File in the data folder with the id that determines a member's blocks.
const PLACE_FILE: &str = "member";
/// Time in which a block that did not answer is not asked again. Chosen: otherwise each session
/// would wait for it as long as the first.
const UNANSWERED_FOR: Duration = Duration::from_secs(2);

/// Rounds of questions; a new one begins when members were lost meanwhile. Chosen: two servers may
/// die within one reading.
const ROUNDS_MAX: usize = 3;

/// This server among the others.
pub(crate) struct Members {
    own: Seat,
    since_ms: u64,
    program: String,
    dividing: Dividing,
    roster: Mutex<Roster>,
    /// Blocks that did not answer lately.
    unanswered: Mutex<HashMap<Block, Instant>>,
    speaker: Arc<dyn Speaker>,
    runtime: Handle,
}

/// What others say to this server.
pub(crate) struct Heard {
    pub(crate) told: mpsc::Receiver<Vec<u8>>,
    pub(crate) questions: mpsc::Receiver<Asked>,
}

/// Answers of other members that are on their way.
#[derive(Debug)]
pub(crate) struct Answers {
    n: usize,
    answers: oneshot::Receiver<Vec<Option<Vec<u8>>>>,
}

impl Answers {
    /// Blocks the thread, which must not be one of the runtime, until all have answered or are
    /// given up. One result per request, in their order.
    pub(crate) fn wait(self) -> Vec<Option<Vec<u8>>> {
        let nothing = || (0..self.n).map(|_| None).collect();
        if self.n == 0 {
            return Vec::new();
        }
        self.answers.blocking_recv().unwrap_or_else(|_| nothing())
    }
}

/// A member, as operators see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Member {
    pub(crate) id: Uuid,
    pub(crate) since_ms: u64,
    pub(crate) is_self: bool,
    pub(crate) versions: Vec<HeldVersion>,
}

impl Members {
    /// Joins the servers of a store; `None` where no other server can share it.
    pub(crate) async fn join(
        store: &Database,
        dividing: Dividing,
        data: &Path,
    ) -> Result<Option<(Arc<Self>, Heard)>, EngineError> {
        let member = Uuid::now_v7();
        let Some(line) = store.line(member).await? else { return Ok(None) };
        let own = Seat { place: place(data), member };
        // A program that cannot read itself is equal to no other.
        let program = program().map_or_else(|| member.to_string(), |hash| hex(&hash));
        let members = Self {
            own,
            since_ms: now_ms(),
            roster: Mutex::new(Roster::new(own, program.clone())),
            program,
            dividing,
            unanswered: Mutex::default(),
            speaker: line.speaker,
            runtime: Handle::current(),
        };
        let heard = Heard { told: line.told, questions: line.questions };
        Ok(Some((Arc::new(members), heard)))
    }

    /// Number of members that hold each block.
    pub(crate) fn copies(&self) -> usize {
        self.dividing.copies
    }

    fn roster(&self) -> MutexGuard<'_, Roster> {
        self.roster.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn unanswered(&self) -> MutexGuard<'_, HashMap<Block, Instant>> {
        self.unanswered.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells all what this member has. `is_leaving`: it stops.
    pub(crate) async fn tell(
        &self,
        versions: Vec<HeldVersion>,
        is_leaving: bool,
    ) -> Result<(), LineError> {
        let Seat { place, member } = self.own;
        let (since_ms, program) = (self.since_ms, self.program.clone());
        let hello = Hello { member, place, since_ms, program, is_leaving, versions };
        self.speaker.tell(hello.to_bytes()).await
    }

    /// Takes what a server told all; whether the members that are alive changed.
    pub(crate) fn hear(&self, bytes: &[u8]) -> bool {
        let Some(hello) = Hello::from_bytes(bytes) else { return false };
        let (member, is_leaving) = (hello.member, hello.is_leaving);
        let has_changed = self.roster().hear(hello, Instant::now());
        if has_changed {
            let what = if is_leaving { "left" } else { "joined" };
            tracing::info!(member.id = %member, "Member {member} {what}");
        }
        has_changed
    }

    /// The members that should hold a block, this one included.
    fn holders(&self, block: &Block) -> Vec<Uuid> {
        let seats = self.roster().seats(Instant::now());
        holders(block, &seats, self.dividing.copies)
    }

    /// Whether this member is one of those that hold a block.
    pub(crate) fn is_own(&self, block: &Block) -> bool {
        self.holders(block).contains(&self.own.member)
    }

    /// Whether other members should hold a block, and all of them have it in memory.
    pub(crate) fn is_held_by_holders(&self, block: &Block) -> bool {
        let having = self.roster().holding(block, Instant::now());
        let others = self.holders(block).into_iter().filter(|member| *member != self.own.member);
        let mut others = others.peekable();
        others.peek().is_some() && others.all(|member| having.contains(&member))
    }

    /// Whether another member has a block in memory.
    pub(crate) fn is_held_elsewhere(&self, block: &Block) -> bool {
        !self.roster().holding(block, Instant::now()).is_empty()
    }

    /// The versions that sessions of other members use, with their numbers of blocks.
    pub(crate) fn used_elsewhere(&self) -> Vec<(Uuid, u32, u32)> {
        let roster = self.roster();
        let all = roster.alive(Instant::now()).flat_map(|hello| &hello.versions);
        let used = all.filter(|version| version.is_used);
        let mut used: Vec<_> = used.map(|v| (v.catalogue, v.version, v.n_blocks)).collect();
        used.sort_unstable();
        used.dedup();
        used
    }

    /// The members to ask for a block, in turn: those that should hold it and have it in memory,
    /// others that have it, and last those that must load it.
    fn candidates(&self, block: &Block) -> VecDeque<Uuid> {
        let holders = self.holders(block);
        let having = self.roster().holding(block, Instant::now());
        let (ready, absent): (Vec<Uuid>, Vec<Uuid>) =
            holders.iter().partition(|member| having.contains(member));
        let spare = having.into_iter().filter(|member| !holders.contains(member));
        let all = ready.into_iter().chain(spare).chain(absent);
        all.filter(|member| *member != self.own.member).collect()
    }

    /// Begins to ask the other members for blocks of a version. `within`: for all answers, unless
    /// the usual time.
    pub(crate) fn ask(
        self: &Arc<Self>,
        version: (Uuid, u32),
        requests: Vec<(u32, Vec<u8>)>,
        within: Option<Duration>,
    ) -> Answers {
        let n = requests.len();
        let (done, answers) = oneshot::channel();
        if n > 0 {
            let members = Arc::clone(self);
            self.runtime.spawn(async move {
                // The asker may have gone.
                let _ = done.send(members.gathered(version, requests, within).await);
            });
        }
        Answers { n, answers }
    }

    async fn gathered(
        &self,
        version: (Uuid, u32),
        requests: Vec<(u32, Vec<u8>)>,
        within: Option<Duration>,
    ) -> Vec<Option<Vec<u8>>> {
        let block = |number| Block { catalogue: version.0, version: version.1, number };
        let requests: Vec<(u32, Arc<Vec<u8>>)> =
            requests.into_iter().map(|(number, bytes)| (number, Arc::new(bytes))).collect();
        let mut answers: Vec<Option<Vec<u8>>> = requests.iter().map(|_| None).collect();
        let end = Instant::now() + within.unwrap_or(self.dividing.within);
        let (n_lost, is_patient) = (AtomicUsize::new(0), within.is_some());
        let lost = |member| {
            if self.roster().lose(member) {
                n_lost.fetch_add(1, Ordering::Relaxed);
                tracing::info!(member.id = %member, "Member {member} no longer listens");
            }
        };
        let mut missing: Vec<usize> = (0..requests.len())
            .filter(|place| is_patient || !self.is_unanswered(&block(requests[*place].0)))
            .collect();
        // The blocks of a member that is lost belong to others from then on.
        for _ in 0..ROUNDS_MAX {
            let request = |place: &usize| {
                let (number, bytes) = &requests[*place];
                let (block, candidates) = (*number, self.candidates(&block(*number)));
                Request { block, bytes: Arc::clone(bytes), candidates }
            };
            let some = missing.iter().map(request).collect();
            let pace = Pace::usual(end.saturating_duration_since(Instant::now()));
            let found = gather(&*self.speaker, version, some, pace, lost).await;
            for (place, answer) in missing.iter().zip(found) {
                answers[*place] = answer;
            }
            missing.retain(|place| answers[*place].is_none());
            if missing.is_empty() || n_lost.swap(0, Ordering::Relaxed) == 0 {
                break;
            }
        }
        let now = Instant::now();
        let mut unanswered = self.unanswered();
        for ((number, _), answer) in requests.iter().zip(&answers) {
            match answer {
                Some(_) => drop(unanswered.remove(&block(*number))),
                None => {
                    unanswered.entry(block(*number)).or_insert(now);
                }
            }
        }
        drop(unanswered);
        answers
    }

    /// Whether a block did not answer a moment ago.
    fn is_unanswered(&self, block: &Block) -> bool {
        let mut unanswered = self.unanswered();
        unanswered.retain(|_, at| at.elapsed() < UNANSWERED_FOR);
        unanswered.contains_key(block)
    }

    /// All members that are alive, this one with its `versions` first.
    pub(crate) fn all(&self, versions: Vec<HeldVersion>) -> Vec<Member> {
        let (id, since_ms) = (self.own.member, self.since_ms);
        let own = Member { id, since_ms, is_self: true, versions };
        let roster = self.roster();
        let other = |hello: &Hello| Member {
            id: hello.member,
            since_ms: hello.since_ms,
            is_self: false,
            versions: hello.versions.clone(),
        };
        std::iter::once(own).chain(roster.alive(Instant::now()).map(other)).collect()
    }

    /// Number of members that are alive and run another program, which are not asked.
    pub(crate) fn n_foreign(&self) -> usize {
        self.roster().n_foreign(Instant::now())
    }
}

/// The id of the data folder, made if it is missing.
fn place(data: &Path) -> Uuid {
    let path = data.join(PLACE_FILE);
    let known = std::fs::read_to_string(&path).ok();
    if let Some(known) = known.and_then(|text| Uuid::try_parse(text.trim()).ok()) {
        return known;
    }
    let new = Uuid::now_v7();
    let kept = private::create_folder(data).and_then(|()| std::fs::write(&path, new.to_string()));
    if let Err(error) = kept {
        // It gets other blocks after the next start.
        tracing::warn!("Cannot keep this member's id in {}: {error}", path.display());
    }
    new
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_keeps_its_id() {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        let first = place(&data);
        assert_eq!(place(&data), first);
        std::fs::write(data.join(PLACE_FILE), "damaged").unwrap();
        let second = place(&data);
        assert_ne!(second, first);
        assert_eq!(place(&data), second);
    }
}
