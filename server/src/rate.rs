//! Rate limit of each client, by its key or, without keys, its address.
//!
//! Limits of the whole server (`admission`, `compute`) protect it from all clients together;
//! this one protects clients from each other. It is off unless the operator sets it.

use std::num::NonZeroU32;
use std::time::Duration;

use governor::clock::{Clock, DefaultClock};
use governor::middleware::StateInformationMiddleware;
use governor::state::keyed::DashMapStateStore;
use governor::{Quota, RateLimiter};

use crate::client::Client;
use crate::limits::Bound;

/// Number of remembered clients above which quiet ones are forgotten.
const CLIENTS_REMEMBERED: usize = 10_000;

/// The shares of all clients.
pub(crate) struct Rates {
    limiter: Limiter,
    per_second: NonZeroU32,
    clock: DefaultClock,
}

type Limiter =
    RateLimiter<Client, DashMapStateStore<Client>, DefaultClock, StateInformationMiddleware>;

impl Rates {
    /// `per_second` requests per second each; a quiet client may send as many at once.
    pub(crate) fn new(per_second: NonZeroU32) -> Self {
        let limiter = RateLimiter::dashmap(Quota::per_second(per_second)).with_middleware();
        Self { limiter, per_second, clock: DefaultClock::default() }
    }

    /// Takes one request from a client's share: the number left, or the time to wait.
    pub(crate) fn take(&self, client: Client) -> Result<u32, Duration> {
        if self.limiter.len() > CLIENTS_REMEMBERED {
            self.limiter.retain_recent();
        }
        match self.limiter.check_key(&client) {
            Ok(state) => Ok(state.remaining_burst_capacity()),
            Err(early) => Err(early.wait_time_from(self.clock.now())),
        }
    }

    /// The limit as reported to a client.
    pub(crate) fn bound(&self, left: u32, reset: Duration) -> Bound {
        Bound {
            name: "requests",
            unit: "requests",
            limit: u64::from(self.per_second.get()),
            window: Some(Duration::from_secs(1)),
            left: u64::from(left),
            reset,
        }
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn each_client_has_its_own_share() {
        let rates = Rates::new(NonZeroU32::new(3).unwrap());
        let [a, b] = [1, 2].map(|n| Client::Key(Uuid::from_u128(n)));
        assert_eq!([rates.take(a), rates.take(a), rates.take(a)], [Ok(2), Ok(1), Ok(0)]);
        let wait = rates.take(a).unwrap_err();
        assert!(wait > Duration::ZERO && wait <= Duration::from_millis(334), "{wait:?}");
        assert_eq!(rates.take(b), Ok(2));
    }
}
