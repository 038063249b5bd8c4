//! A budget: a resource that callers occupy, its total, and the share of one client.
//!
//! A client may hold at most [`SHARE`] times what is still free (the dynamic threshold of
//! Choudhury and Hahne, 1998). One client alone gets three quarters; with `n` greedy clients
//! each gets `3 / (1 + 3 n)` of the total, and that third part of a share stays free for
//! clients that hold nothing yet. Nothing has to be configured for a number of clients.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::client::Client;

/// A client holds at most this many times what is free. Chosen: a fleet behind one key gets
/// three quarters of the server, and four greedy clients leave a thirteenth free.
const SHARE: usize = 3;

/// A resource of which there is a bounded amount.
#[derive(Debug)]
pub(crate) struct Budget {
    total: usize,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    all: usize,
    by_client: HashMap<Client, usize>,
}

/// Why nothing was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Over {
    /// All clients together hold the total.
    Total,
    /// This client holds its share.
    Share,
}

/// A part of a budget; dropping it gives it back.
#[derive(Debug)]
pub(crate) struct Holding {
    budget: Arc<Budget>,
    client: Option<Client>,
    amount: usize,
}

impl Budget {
    pub(crate) fn new(total: usize) -> Arc<Self> {
        Arc::new(Self { total, held: Mutex::default() })
    }

    pub(crate) fn total(&self) -> usize {
        self.total
    }

    /// How much all clients hold.
    pub(crate) fn used(&self) -> usize {
        self.lock().all
    }

    /// Takes `amount` for a client. A caller without an address counts to the total alone.
    pub(crate) fn take(
        self: &Arc<Self>,
        client: Option<Client>,
        amount: usize,
    ) -> Result<Holding, Over> {
        let mut holding = Holding { budget: Arc::clone(self), client, amount: 0 };
        holding.grow_to(amount)?;
        Ok(holding)
    }

    /// Counts `amount` for a client that holds it already, whatever the bounds.
    pub(crate) fn note(self: &Arc<Self>, client: Option<Client>, amount: usize) -> Holding {
        let mut held = self.lock();
        held.all += amount;
        if let Some(client) = client {
            *held.by_client.entry(client).or_default() += amount;
        }
        drop(held);
        Holding { budget: Arc::clone(self), client, amount }
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Holding {
    /// Makes the holding at least `amount`; it stays as it is when there is no room.
    pub(crate) fn grow_to(&mut self, amount: usize) -> Result<(), Over> {
        let Some(more) = amount.checked_sub(self.amount).filter(|more| *more > 0) else {
            return Ok(());
        };
        let total = self.budget.total;
        let mut held = self.budget.lock();
        let all = held.all.checked_add(more).filter(|all| *all <= total).ok_or(Over::Total)?;
        if let Some(client) = self.client {
            let own = held.by_client.get(&client).copied().unwrap_or(0) + more;
            // A first holding is let in wherever there is room.
            if own > more && own > SHARE.saturating_mul(total - all) {
                return Err(Over::Share);
            }
            held.by_client.insert(client, own);
        }
        held.all = all;
        drop(held);
        self.amount = amount;
        Ok(())
    }
}

impl Drop for Holding {
    fn drop(&mut self) {
        let mut held = self.budget.lock();
        held.all -= self.amount;
        let Some(client) = self.client else { return };
        if let Some(own) = held.by_client.get_mut(&client) {
            *own -= self.amount;
            if *own == 0 {
                held.by_client.remove(&client);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(n: u8) -> Option<Client> {
        Some(Client::at([10, 0, 0, n].into()))
    }

    /// How much a client gets, one by one.
    fn fill(budget: &Arc<Budget>, n: u8) -> Vec<Holding> {
        std::iter::from_fn(|| budget.take(client(n), 1).ok()).collect()
    }

    #[test]
    fn greedy_clients_leave_room_for_one_that_holds_nothing() {
        let budget = Budget::new(130);
        let alone = fill(&budget, 0);
        assert_eq!(alone.len(), 97, "three quarters");
        drop(alone);
        let mut greedy: Vec<Vec<Holding>> = (0..4).map(|_| Vec::new()).collect();
        for _ in 0..130 {
            for (n, held) in greedy.iter_mut().enumerate() {
                held.extend(budget.take(client(n as u8), 1));
            }
        }
        assert!(greedy.iter().all(|held| (29..=31).contains(&held.len())), "3 of 13 each");
        assert_eq!(budget.take(client(0), 1).unwrap_err(), Over::Share);
        assert!(budget.take(client(9), 1).is_ok());
        drop(greedy);
        assert_eq!(budget.used(), 0);
        assert!(budget.lock().by_client.is_empty());
    }

    #[test]
    fn a_holding_grows_to_what_fits_and_gives_all_of_it_back() {
        let budget = Budget::new(100);
        let mut holding = budget.take(client(0), 10).unwrap();
        holding.grow_to(40).unwrap();
        holding.grow_to(20).unwrap();
        assert_eq!(budget.used(), 40);
        assert_eq!(holding.grow_to(101).unwrap_err(), Over::Total);
        assert_eq!(budget.used(), 40);
        drop(holding);
        assert_eq!(budget.used(), 0);
    }
}
