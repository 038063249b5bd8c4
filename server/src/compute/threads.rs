//! The threads that compute: each has a seat of its urgency and takes pieces in turn.
//!
//! A piece that has used up its slice keeps the thread, which then ends with it; another thread
//! takes the seat.

use std::io;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use rayon::ThreadPoolBuilder;

use super::sharing::Sharing;
use super::turns::{Seat, Taken, Turns};
use super::urgency::{Thread, Urgency};

/// Interval at which a thread that the system refused is tried again. Chosen: many ticks, and short
/// for work that waits.
const RETRY_EVERY: Duration = Duration::from_secs(1);

/// Starts the threads that take pieces in turn, and the one that ends their slices.
pub(super) fn start(turns: &Arc<Turns>) -> io::Result<()> {
    for urgency in Urgency::ALL {
        for seat in 0..turns.n_threads() {
            take_seat(turns, urgency, seat)?;
        }
    }
    let turns = Arc::clone(turns);
    let ticking = move || {
        let (mut vacant, mut refused) = (Vec::new(), Refused::default());
        while turns.next_tick(&mut vacant) {
            let take = |(urgency, seat)| take_seat(&turns, urgency, seat);
            refused.fill(&mut vacant, Instant::now(), take);
        }
    };
    thread::Builder::new().name("compute-turns".to_owned()).spawn(ticking).map(drop)
}

/// The vacant seats, first in their list, for which the system has refused a thread.
#[derive(Default)]
struct Refused {
    n: usize,
    retry_at: Option<Instant>,
}

impl Refused {
    /// Removes the seats that `take` fills: new ones at once, refused ones every [`RETRY_EVERY`].
    fn fill(
        &mut self,
        vacant: &mut Vec<Seat>,
        now: Instant,
        mut take: impl FnMut(Seat) -> io::Result<()>,
    ) {
        let is_due = self.retry_at.is_none_or(|at| at <= now);
        let mut index = 0;
        vacant.retain(|seat| {
            let is_new = index >= self.n;
            index += 1;
            if !is_new && !is_due {
                return true;
            }
            let taken = take(*seat);
            if let Err(error) = &taken
                && is_new
            {
                tracing::warn!(%error, "No thread takes over from long work: {error}");
            }
            taken.is_err()
        });
        if is_due {
            self.retry_at = (!vacant.is_empty()).then(|| now + RETRY_EVERY);
        }
        self.n = vacant.len();
    }
}

/// Starts a thread that takes pieces. It is a `rayon` pool by itself, so that what the work would
/// share out stays on it.
fn take_seat(turns: &Arc<Turns>, urgency: Urgency, seat: usize) -> io::Result<()> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(1)
        .thread_name(move |_| format!("{}-{seat}", urgency.threads()))
        .build()
        .map_err(io::Error::other)?;
    let turns = Arc::clone(turns);
    pool.spawn(move || {
        let thread = Thread::current();
        thread.give_way(urgency.nice());
        while let Some(Taken { id, work, shares }) = turns.take((urgency, seat), thread) {
            let sharing = if shares { sharing(&turns, urgency) } else { None };
            match &sharing {
                None => work(),
                Some(sharing) => {
                    turns.lend(id, &sharing.helpers);
                    sharing.pool.install(work);
                }
            }
            if !turns.done(id, sharing) {
                break;
            }
        }
    });
    Ok(())
}

fn sharing(turns: &Turns, urgency: Urgency) -> Option<Sharing> {
    let started = || Sharing::start(turns.n_threads(), urgency);
    let sharing = turns.idle(urgency).map_or_else(started, Ok);
    let sharing = sharing
        .inspect_err(|error| tracing::warn!(%error, "A piece of work is not shared out: {error}"));
    sharing.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_thread_is_tried_again_once_a_second() {
        let begin = Instant::now();
        let (mut vacant, mut refused) = (vec![(Urgency::Reading, 0)], Refused::default());
        let mut n_tried = 0;
        let mut tick = |ms: u64, is_possible: bool, vacant: &mut Vec<Seat>| {
            refused.fill(vacant, begin + Duration::from_millis(ms), |_| {
                n_tried += 1;
                if is_possible { Ok(()) } else { Err(io::ErrorKind::WouldBlock.into()) }
            });
            n_tried
        };
        assert_eq!(tick(0, false, &mut vacant), 1);
        (1..100).for_each(|n| assert_eq!(tick(10 * n, false, &mut vacant), 1));
        assert_eq!(tick(1000, false, &mut vacant), 2);
        vacant.push((Urgency::Long, 1));
        assert_eq!(tick(1010, true, &mut vacant), 3, "a new one at once");
        assert_eq!(vacant, [(Urgency::Reading, 0)]);
        assert_eq!((tick(2000, true, &mut vacant), vacant.len()), (4, 0));
        vacant.push((Urgency::Reading, 0));
        assert_eq!((tick(2010, true, &mut vacant), vacant.len()), (5, 0));
    }
}
