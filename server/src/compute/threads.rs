//! The threads that compute: each has a seat of its urgency and takes pieces in turn.
//!
//! A piece that has used up its slice keeps the thread, which then ends with it; another thread
//! takes the seat.

use std::io;
use std::sync::Arc;
use std::thread;

use rayon::ThreadPoolBuilder;

use super::sharing::Sharing;
use super::turns::{Taken, Turns};
use super::urgency::{Thread, Urgency};

/// Starts the threads that take pieces in turn, and the one that ends their slices.
pub(super) fn start(turns: &Arc<Turns>) -> io::Result<()> {
    for urgency in Urgency::ALL {
        for seat in 0..turns.n_threads() {
            take_seat(turns, urgency, seat)?;
        }
    }
    let turns = Arc::clone(turns);
    let ticking = move || {
        let mut vacant = Vec::new();
        while turns.next_tick(&mut vacant) {
            vacant.retain(|(urgency, seat)| {
                let taken = take_seat(&turns, *urgency, *seat);
                let taken = taken.inspect_err(|error| {
                    tracing::warn!(%error, "No thread takes over from long work: {error}");
                });
                taken.is_err()
            });
        }
    };
    thread::Builder::new().name("compute-turns".to_owned()).spawn(ticking).map(drop)
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
