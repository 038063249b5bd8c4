//! Leases: rights that one process has at a time, until it gives them back or is gone.
//!
//! The process that has a lease renews it. One that could not in time has lost it, and must stop
//! what it did under it. Time is measured by the holder's monotonic clock alone.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use tokio::sync::oneshot;

use super::EngineError;

/// A right that one process has at a time. It is given back when it is dropped.
#[derive(Debug)]
pub struct Lease {
    /// When it ends unless it is renewed; `None` where one process has the whole store.
    ends: Option<Arc<Mutex<Instant>>>,
    _held: Option<oneshot::Sender<()>>,
}

/// A lease that is being taken; `None` when another process has it.
pub type Leasing = Pin<Box<dyn Future<Output = Result<Option<Lease>, EngineError>> + Send>>;

impl Lease {
    /// The lease of a process that has the whole store.
    #[must_use]
    pub fn lasting() -> Self {
        Self { ends: None, _held: None }
    }

    /// A lease that another task renews by moving `ends`. Dropping it drops `held`, which tells
    /// that task to stop.
    pub(crate) fn renewed(ends: Arc<Mutex<Instant>>, held: oneshot::Sender<()>) -> Self {
        Self { ends: Some(ends), _held: Some(held) }
    }

    /// Whether another process may have it by now.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        let ends = self.ends.as_ref();
        ends.is_some_and(|ends| {
            *ends.lock().unwrap_or_else(PoisonError::into_inner) <= Instant::now()
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_lease_that_is_not_renewed_is_lost() {
        assert!(!Lease::lasting().is_lost());
        let ends = Arc::new(Mutex::new(Instant::now() + Duration::from_secs(60)));
        let (held, mut released) = oneshot::channel();
        let lease = Lease::renewed(Arc::clone(&ends), held);
        assert!(!lease.is_lost() && released.try_recv().is_err());
        *ends.lock().unwrap() = Instant::now();
        assert!(lease.is_lost());
        drop(lease);
        assert_eq!(released.try_recv(), Err(oneshot::error::TryRecvError::Closed));
    }
}
