//! Whose turn it is: the waiting pieces of work, those at work, and the time that each client has
//! spent.
//!
//! A waiting piece of the client that has spent least is taken first. A piece that has worked for
//! a slice is *spent*: its seat goes to the next waiting piece, and it shares the rest of the
//! threads with other spent pieces. These go on in turns of a tick, the client first that has
//! spent least and of one client the piece that has worked least. A piece out of turn waits at its
//! next [`Stop::check`]; one that does not check works on at the lowest priority, and the kernel
//! divides the cores between it and others.

use std::collections::{HashMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use palpate_core::stop::Stop;

use super::sharing::{Helpers, Sharing};
use super::urgency::{LONG_NICE, Size, Thread, Urgency};
use crate::client::Client;

/// Time that a piece works before others get its seat. Chosen: with a [`TICK`] 50 ms, many times
/// what a reading takes.
const SLICE: Duration = Duration::from_millis(40);
/// Interval at which slices end.
const TICK: Duration = Duration::from_millis(10);
/// Most time by which a client's account may exceed the smallest one. It bounds how long the
/// client's next short work waits. Chosen: a few times the slices of all cores.
const DEBT_MAX: Duration = Duration::from_secs(1);
/// Most pieces of one urgency that are shared out at once. Chosen: each has as many threads of its
/// own as there are cores, so more pieces would cost memory and switches and end no sooner.
const SHARED_MAX: usize = 4;

/// A piece of work.
pub(super) struct Piece {
    pub(super) client: Option<Client>,
    pub(super) size: Size,
    /// Holds the piece while others have their turn.
    pub(super) pause: Stop,
    pub(super) work: Box<dyn FnOnce() + Send>,
}

/// A piece that a thread has taken.
pub(super) struct Taken {
    pub(super) id: u64,
    pub(super) work: Box<dyn FnOnce() + Send>,
    /// Whether it is shared out to other threads.
    pub(super) shares: bool,
}

/// A seat at the waiting pieces of an urgency.
pub(super) type Seat = (Urgency, usize);

/// The turns of all work.
pub(super) struct Turns {
    n_threads: usize,
    state: Mutex<State>,
    /// For the seats of each urgency: a piece waits.
    came: [Condvar; 3],
    /// A piece is at work.
    began: Condvar,
}

#[derive(Default)]
struct State {
    waiting: [VecDeque<Piece>; 3],
    /// Time at which the last piece was taken while others waited, or the first of these arrived.
    waiting_since: [Option<Instant>; 3],
    at_work: Vec<AtWork>,
    accounts: HashMap<Option<Client>, Account>,
    idle: [Vec<Sharing>; 3],
    n_taken: u64,
    is_closed: bool,
}

/// What a client has spent, and its number of pieces that wait or are at work.
#[derive(Default)]
struct Account {
    spent: Duration,
    n_pieces: usize,
}

/// A piece at work.
struct AtWork {
    id: u64,
    seat: Seat,
    client: Option<Client>,
    size: Size,
    pause: Stop,
    thread: Thread,
    /// The threads to which it is shared out.
    helpers: Helpers,
    worked: Duration,
    /// Time up to which it has been charged.
    charged: Instant,
    is_spent: bool,
}

impl State {
    fn push(&mut self, urgency: Urgency, piece: Piece) {
        // A client that comes back has no claim from the time when it had no work.
        let active = self.accounts.values().filter(|account| account.n_pieces > 0);
        let floor = active.map(|account| account.spent).min();
        let is_ahead = |account: &Account| floor.is_some_and(|floor| account.spent > floor);
        self.accounts.retain(|_, account| account.n_pieces > 0 || is_ahead(account));
        let account = self.accounts.entry(piece.client).or_default();
        let floor = floor.unwrap_or_default();
        account.spent = account.spent.clamp(floor, floor + DEBT_MAX);
        account.n_pieces += 1;
        self.waiting_since[urgency as usize].get_or_insert_with(Instant::now);
        self.waiting[urgency as usize].push_back(piece);
    }

    fn spent(&self, client: Option<Client>) -> Duration {
        self.accounts.get(&client).map_or(Duration::ZERO, |account| account.spent)
    }

    /// Charges the pieces at work with the time since they were charged last.
    fn charge(&mut self) {
        let now = Instant::now();
        for piece in &mut self.at_work {
            let more = now.saturating_duration_since(piece.charged);
            piece.charged = now;
            if piece.pause.is_waiting() {
                continue;
            }
            piece.worked += more;
            if let Some(account) = self.accounts.get_mut(&piece.client) {
                account.spent += more;
            }
        }
    }

    fn take(&mut self, seat: Seat, thread: Thread, n_threads: usize) -> Option<Taken> {
        let urgency = seat.0;
        let n_heavy = self.at_work.iter().filter(|piece| piece.size == Size::Heavy).count();
        if self.waiting[urgency as usize].is_empty() {
            return None;
        }
        self.charge();
        let waiting = self.waiting[urgency as usize].iter().enumerate();
        let fits = waiting.filter(|(_, piece)| piece.size != Size::Heavy || n_heavy < n_threads);
        let (index, _) = fits.min_by_key(|(at, piece)| (self.spent(piece.client), *at))?;
        let Piece { client, size, pause, work } = self.waiting[urgency as usize].remove(index)?;
        let is_empty = self.waiting[urgency as usize].is_empty();
        self.waiting_since[urgency as usize] = (!is_empty).then(Instant::now);
        let n_beside = self.at_work.iter().filter(|piece| piece.seat.0 == urgency).count();
        self.n_taken += 1;
        let id = self.n_taken;
        self.at_work.push(AtWork {
            id,
            seat,
            client,
            size,
            pause,
            thread,
            helpers: Helpers::default(),
            worked: Duration::ZERO,
            charged: Instant::now(),
            is_spent: false,
        });
        let shares = size != Size::Small && n_beside + 1 < n_threads.min(SHARED_MAX + 1);
        Some(Taken { id, work, shares })
    }

    /// Ends the slices that are over: their seats.
    fn end_slices(&mut self) -> Vec<Seat> {
        let over = self.at_work.iter_mut().filter(|p| !p.is_spent && p.worked >= SLICE);
        let end = |piece: &mut AtWork| {
            piece.is_spent = true;
            piece.thread.give_way(LONG_NICE);
            piece.helpers.give_way(LONG_NICE);
            piece.seat
        };
        over.map(end).collect()
    }

    /// Lets as many spent pieces go on as there are threads, and holds the others.
    fn share_out(&mut self, n_threads: usize) {
        let mut spent: HashMap<Option<Client>, Duration> = HashMap::new();
        let mut left: Vec<usize> = Vec::new();
        for (index, piece) in self.at_work.iter().enumerate().filter(|(_, p)| p.is_spent) {
            left.push(index);
            spent.insert(piece.client, self.spent(piece.client));
        }
        let mut chosen = Vec::with_capacity(n_threads);
        while chosen.len() < n_threads {
            let rank = |index: usize| {
                let piece = &self.at_work[index];
                (spent.get(&piece.client).copied().unwrap_or_default(), piece.worked, piece.id)
            };
            let least = (0..left.len()).min_by_key(|place| rank(left[*place]));
            let Some(least) = least.map(|place| left.swap_remove(place)) else { break };
            if let Some(spent) = spent.get_mut(&self.at_work[least].client) {
                *spent += TICK;
            }
            chosen.push(least);
        }
        // Two pieces may have one pause; then the one that goes on decides.
        left.into_iter().for_each(|index| self.at_work[index].pause.hold());
        chosen.into_iter().for_each(|index| self.at_work[index].pause.release());
    }
}

impl Turns {
    pub(super) fn new(n_threads: usize) -> Self {
        Self { n_threads, state: Mutex::default(), came: Default::default(), began: Condvar::new() }
    }

    /// Number of threads of each urgency.
    pub(super) fn n_threads(&self) -> usize {
        self.n_threads
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn push(&self, urgency: Urgency, piece: Piece) {
        self.lock().push(urgency, piece);
        self.came[urgency as usize].notify_one();
    }

    /// Waits for the next piece for a seat; `None` when no more can come.
    pub(super) fn take(&self, seat: Seat, thread: Thread) -> Option<Taken> {
        let mut state = self.lock();
        loop {
            if let Some(taken) = state.take(seat, thread, self.n_threads) {
                self.began.notify_one();
                return Some(taken);
            }
            if state.is_closed && state.waiting[seat.0 as usize].is_empty() {
                return None;
            }
            let came = &self.came[seat.0 as usize];
            state = came.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Idle threads to share a piece of this urgency out to.
    pub(super) fn idle(&self, urgency: Urgency) -> Option<Sharing> {
        self.lock().idle[urgency as usize].pop()
    }

    /// Records to which threads a piece is shared out.
    pub(super) fn lend(&self, id: u64, helpers: &Helpers) {
        let mut state = self.lock();
        if let Some(piece) = state.at_work.iter_mut().find(|piece| piece.id == id) {
            piece.helpers = helpers.clone();
        }
    }

    /// Ends a piece; false if its thread has lost its seat. Then `sharing` ends, too.
    pub(super) fn done(&self, id: u64, sharing: Option<Sharing>) -> bool {
        let mut state = self.lock();
        state.charge();
        let Some(index) = state.at_work.iter().position(|piece| piece.id == id) else {
            return true;
        };
        let piece = state.at_work.swap_remove(index);
        piece.pause.release();
        if let Some(account) = state.accounts.get_mut(&piece.client) {
            account.n_pieces -= 1;
        }
        if piece.size == Size::Heavy {
            self.came.iter().for_each(Condvar::notify_all);
        }
        if !piece.is_spent {
            state.idle[piece.seat.0 as usize].extend(sharing);
        }
        !piece.is_spent
    }

    /// Waits for a tick while pieces are at work, ends slices, adds their seats to those that are
    /// `vacant`, and shares the threads out to spent pieces; false when no more work can come.
    pub(super) fn next_tick(&self, vacant: &mut Vec<Seat>) -> bool {
        let mut state = self.lock();
        while state.at_work.is_empty() && vacant.is_empty() && !state.is_closed {
            state = self.began.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if !state.is_closed {
            let waited = self.began.wait_timeout_while(state, TICK, |state| !state.is_closed);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        if state.is_closed {
            state.at_work.iter().for_each(|piece| piece.pause.release());
            return false;
        }
        state.charge();
        vacant.extend(state.end_slices());
        state.share_out(self.n_threads);
        true
    }

    /// Releases waiting threads after the last piece.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.came.iter().for_each(Condvar::notify_all);
        self.began.notify_all();
    }

    /// Time for which work has been waiting without any being taken.
    pub(super) fn stalled(&self, urgency: Urgency) -> Duration {
        let since = self.lock().waiting_since[urgency as usize];
        since.map_or(Duration::ZERO, |since| since.elapsed())
    }
}

#[cfg(test)]
mod tests;
