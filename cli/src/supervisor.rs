//! The server's dealings with the process that supervises it: notices to systemd (`Type=notify`),
//! its watchdog, and the order to stop.
//!
//! Without `NOTIFY_SOCKET` and `WATCHDOG_USEC` in the environment nothing is sent.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

#[cfg(unix)]
use tokio::signal::unix::{Signal, SignalKind, signal};

/// Number of questions of the server to itself within the time of the watchdog: one that fails, for
/// example on a busy machine, is repeated in time.
const ASKED_WITHIN: u32 = 3;

/// Number of the signal of a file that grows over its limit (Linux, macOS and the BSDs).
#[cfg(unix)]
const SIGXFSZ: i32 = 25;

/// A message to systemd.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Notice {
    /// The server answers requests.
    Ready,
    /// The server has answered itself.
    Answers,
    /// The server was told to stop.
    Stopping,
}

/// Sends a notice to systemd, if it waits for one.
#[cfg(unix)]
pub(crate) fn tell(notice: Notice) {
    use sd_notify::NotifyState;
    let state = match notice {
        Notice::Ready => NotifyState::Ready,
        Notice::Answers => NotifyState::Watchdog,
        Notice::Stopping => NotifyState::Stopping,
    };
    if let Err(error) = sd_notify::notify(&[state]) {
        tracing::warn!(%error, "Cannot notify systemd ({notice:?}): {error}");
    }
}

/// There is no systemd.
#[cfg(not(unix))]
pub(crate) fn tell(_: Notice) {}

/// The time within which the watchdog expects a notice, if there is a watchdog.
#[cfg(unix)]
fn expected_within() -> Option<Duration> {
    sd_notify::watchdog_enabled()
}

/// There is no watchdog.
#[cfg(not(unix))]
fn expected_within() -> Option<Duration> {
    None
}

/// Asks the server for `/livez` through its own socket, each time by a new connection, and notifies
/// the watchdog of every answer. Returns at once without a watchdog.
///
/// # Errors
/// When there is no client for this.
pub(crate) async fn watch(scheme: &str, listening: SocketAddr) -> anyhow::Result<()> {
    let Some(within) = expected_within() else { return Ok(()) };
    let url = format!("{scheme}://{}/livez", reachable(listening));
    let every = within / ASKED_WITHIN;
    // Keep a provider that is already installed.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let client = reqwest::Client::builder()
        .no_proxy()
        .pool_max_idle_per_host(0)
        .timeout(every)
        // The certificate names the machine as clients know it, not this address. Nothing secret is
        // sent, and the answer decides only about a restart.
        .tls_danger_accept_invalid_certs(true)
        .build()?;
    let mut rounds = tokio::time::interval(every);
    rounds.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        rounds.tick().await;
        match client.get(&url).send().await.and_then(reqwest::Response::error_for_status) {
            Ok(_) => tell(Notice::Answers),
            Err(error) => {
                tracing::error!(%error, "The server does not answer itself: systemd restarts it");
            }
        }
    }
}

/// The address at which this machine reaches a listener.
fn reachable(listening: SocketAddr) -> SocketAddr {
    let ip = match listening.ip() {
        ip if !ip.is_unspecified() => ip,
        IpAddr::V4(_) => IpAddr::V4(Ipv4Addr::LOCALHOST),
        IpAddr::V6(_) => IpAddr::V6(Ipv6Addr::LOCALHOST),
    };
    SocketAddr::new(ip, listening.port())
}

/// The signals that usually end a process, which no longer end it by themselves: Ctrl-C, SIGTERM,
/// SIGQUIT, and SIGHUP (its terminal was closed) unless it may have been started to survive that.
/// SIGXFSZ does not end it either: a write over the limit on file sizes (`ulimit -f`) is an error
/// like one on a full disk.
#[cfg(unix)]
pub(crate) struct Signals(Vec<Signal>);

#[cfg(unix)]
impl Signals {
    /// Listens from now on.
    ///
    /// # Errors
    /// The operating system's error.
    pub(crate) fn listen() -> io::Result<Self> {
        let _ignored = signal(SignalKind::from_raw(SIGXFSZ))?;
        let ending = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::quit()];
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let hang_up = (!survives_hang_up(&status)).then(SignalKind::hangup);
        Ok(Self(ending.into_iter().chain(hang_up).map(signal).collect::<io::Result<_>>()?))
    }

    /// Waits for the first of them.
    pub(crate) async fn told_to_stop(&mut self) {
        let received = self.0.iter_mut().map(|signal| Box::pin(signal.recv()));
        futures::future::select_all(received).await;
    }
}

/// Whether SIGHUP is ignored from the start, as by `nohup`, by the status of the process (Linux).
/// `true` where the system does not say: SIGHUP then has the effect that it had at the start.
#[cfg(unix)]
fn survives_hang_up(status: &str) -> bool {
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // Bit 0 is signal 1.
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_none_or(|mask| mask & 1 == 1)
}

/// Ctrl-C, which no longer ends the process by itself.
#[cfg(windows)]
pub(crate) struct Signals(tokio::signal::windows::CtrlC);

#[cfg(windows)]
impl Signals {
    /// Listens from now on.
    ///
    /// # Errors
    /// The operating system's error.
    pub(crate) fn listen() -> io::Result<Self> {
        tokio::signal::windows::ctrl_c().map(Self)
    }

    /// Waits for it.
    pub(crate) async fn told_to_stop(&mut self) {
        self.0.recv().await;
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_ignores_hang_ups_survives_them() {
        let status = |mask: &str| format!("Name:\tpalpate\nSigIgn:\t{mask}\nSigCgt:\t0\n");
        assert!(survives_hang_up(&status("0000000000001001")));
        assert!(!survives_hang_up(&status("0000000000001000")));
        assert!(survives_hang_up(""), "a system that does not say");
    }
}
