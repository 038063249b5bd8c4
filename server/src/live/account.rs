//! Accounting of the memory of beliefs: each session adds its own to one total.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The bytes of all beliefs in memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Total(Arc<AtomicUsize>);

/// One session's share of the total, released on drop.
#[derive(Debug)]
pub(super) struct Account {
    total: Total,
    bytes: AtomicUsize,
}

impl Total {
    pub(crate) fn bytes(&self) -> usize {
        self.0.load(Ordering::Relaxed)
    }

    pub(super) fn open(&self, bytes: usize) -> Account {
        let account = Account { total: self.clone(), bytes: AtomicUsize::new(0) };
        account.set(bytes);
        account
    }
}

impl Account {
    /// Sets the number of bytes. Not for concurrent calls.
    pub(super) fn set(&self, bytes: usize) {
        let before = self.bytes.swap(bytes, Ordering::Relaxed);
        if bytes >= before {
            self.total.0.fetch_add(bytes - before, Ordering::Relaxed);
        } else {
            self.total.0.fetch_sub(before - bytes, Ordering::Relaxed);
        }
    }
}

impl Drop for Account {
    fn drop(&mut self) {
        self.set(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_total_is_the_sum_of_all_accounts() {
        let total = Total::default();
        let (a, b) = (total.open(10), total.open(5));
        a.set(7);
        assert_eq!(total.bytes(), 12);
        b.set(50);
        drop(a);
        assert_eq!(total.bytes(), 50);
        drop(b);
        assert_eq!(total.bytes(), 0);
    }
}
