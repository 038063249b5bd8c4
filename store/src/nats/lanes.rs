//! Lanes: commits that share a unit run one after the other, in the order of their arrival;
//! others run at the same time.

use std::collections::{HashMap, VecDeque};

use futures::channel::oneshot;

use super::plan::{Work, units};
use crate::engine::CommitError;

/// A commit with its answer.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) work: Work,
    pub(super) answer: oneshot::Sender<Result<(), CommitError>>,
}

/// A job that has its lanes.
#[derive(Debug)]
pub(super) struct Admitted {
    pub(super) job: Job,
    pub(super) units: Vec<Vec<u8>>,
}

/// Commits that run or wait.
#[derive(Debug, Default)]
pub(super) struct Lanes {
    /// For each unit the numbers of its jobs; the first one runs or waits for another unit.
    queues: HashMap<Vec<u8>, VecDeque<u64>>,
    waiting: HashMap<u64, Waiting>,
    next: u64,
    n_jobs: usize,
}

#[derive(Debug)]
struct Waiting {
    admitted: Admitted,
    /// Number of its units in whose queues it is not the first.
    n_behind: usize,
}

impl Lanes {
    /// Number of jobs that run or wait.
    pub(super) fn len(&self) -> usize {
        self.n_jobs
    }

    /// Queues a job; returns it if it may run now.
    pub(super) fn enter(&mut self, job: Job) -> Option<Admitted> {
        let (units, number) = (units(&job.work), self.next);
        self.next += 1;
        self.n_jobs += 1;
        let mut n_behind = 0;
        for unit in &units {
            let queue = self.queues.entry(unit.clone()).or_default();
            n_behind += usize::from(!queue.is_empty());
            queue.push_back(number);
        }
        let admitted = Admitted { job, units };
        if n_behind == 0 {
            return Some(admitted);
        }
        self.waiting.insert(number, Waiting { admitted, n_behind });
        None
    }

    /// Ends a job; returns those that may run now.
    pub(super) fn leave(&mut self, units: &[Vec<u8>]) -> Vec<Admitted> {
        self.n_jobs -= 1;
        let mut ready = Vec::new();
        for unit in units {
            let Some(queue) = self.queues.get_mut(unit) else { continue };
            queue.pop_front();
            let Some(&next) = queue.front() else {
                self.queues.remove(unit);
                continue;
            };
            let Some(waiting) = self.waiting.get_mut(&next) else { continue };
            waiting.n_behind -= 1;
            if waiting.n_behind == 0 {
                ready.extend(self.waiting.remove(&next).map(|waiting| waiting.admitted));
            }
        }
        ready
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Commit, Pending};

    fn job(keys: &[&str]) -> Job {
        let commit = keys.iter().fold(Commit::new(), |commit, key| commit.remove((*key).into()));
        let work = Work { commit, compacts: Vec::new() };
        Job { work, answer: Pending::channel().0 }
    }

    fn keys(admitted: &[Admitted]) -> Vec<String> {
        let keys = admitted.iter().flat_map(|admitted| &admitted.units);
        keys.map(|key| String::from_utf8_lossy(key).into_owned()).collect()
    }

    #[test]
    fn jobs_of_one_unit_run_in_order_and_others_at_once() {
        let mut lanes = Lanes::default();
        let first = lanes.enter(job(&["a"])).expect("nothing else runs");
        let other = lanes.enter(job(&["b"])).expect("another unit");
        assert!(lanes.enter(job(&["a", "b", "c"])).is_none());
        assert!(lanes.enter(job(&["c"])).is_none(), "it stays behind the one before");
        assert!(lanes.leave(&first.units).is_empty(), "b is still in use");
        let both = lanes.leave(&other.units);
        assert_eq!(keys(&both), ["a", "b", "c"]);
        let last = lanes.leave(&both[0].units);
        assert_eq!(keys(&last), ["c"]);
        assert_eq!(lanes.len(), 1);
        assert!(lanes.leave(&last[0].units).is_empty());
        assert!(lanes.queues.is_empty() && lanes.waiting.is_empty() && lanes.len() == 0);
    }
}
