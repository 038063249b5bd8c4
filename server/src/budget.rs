//! A budget: the total of a resource that callers occupy, and the share of one client.
//!
//! A client may hold at most [`SHARE`] times the free amount (the dynamic threshold of
//! Choudhury and Hahne, 1998). One client alone gets three quarters; with `n` greedy clients
//! each gets `3 / (1 + 3 n)` of the total, and a third of a share stays free for new clients.
//! It needs no configuration for the number of clients.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use thiserror::Error;

use crate::client::Client;

/// Largest multiple of the free amount that a client may hold. Chosen: a fleet behind one key
/// gets three quarters of the server, and four greedy clients leave a thirteenth free.
const SHARE: usize = 3;

/// A limited resource.
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

/// Reason of a refusal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Over {
    /// All clients together hold the total.
    Total,
    /// This client holds its share.
    Share,
}

/// Refusal of a client that holds its share of a budget.
#[derive(Clone, Copy, Debug, Error)]
#[error(
    "this client holds its share of the server's {name}: all clients hold {used} of {total} \
     {unit}, and one client at most three times what is free"
)]
pub(crate) struct ShareFull {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) used: usize,
    pub(crate) total: usize,
}

/// A part of a budget, released on drop.
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

    /// The amount held by all clients.
    pub(crate) fn used(&self) -> usize {
        self.lock().all
    }

    /// Takes `amount` for a client. A caller without an address counts towards the total alone.
    pub(crate) fn take(
        self: &Arc<Self>,
        client: Option<Client>,
        amount: usize,
    ) -> Result<Holding, Over> {
        let mut holding = Holding { budget: Arc::clone(self), client, amount: 0 };
        holding.grow_to(amount)?;
        Ok(holding)
    }

    /// Registers `amount` that a client holds already, regardless of limits.
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
    /// Grows the holding to at least `amount`; it stays unchanged when there is no space.
    pub(crate) fn grow_to(&mut self, amount: usize) -> Result<(), Over> {
        let Some(more) = amount.checked_sub(self.amount).filter(|more| *more > 0) else {
            return Ok(());
        };
        let total = self.budget.total;
        let mut held = self.budget.lock();
        let all = held.all.checked_add(more).filter(|all| *all <= total).ok_or(Over::Total)?;
        if let Some(client) = self.client {
            let own = held.by_client.get(&client).copied().unwrap_or(0) + more;
            // A first holding is granted wherever there is space.
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

    /// The amounts that a client gets, one by one.
    fn fill(budget: &Arc<Budget>, n: u8) -> Vec<Holding> {
        std::iter::from_fn(|| budget.take(client(n), 1).ok()).collect()
    }

    #[test]
    fn greedy_clients_leave_space_for_a_new_one() {
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
    fn a_holding_grows_within_the_budget_and_releases_all() {
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
