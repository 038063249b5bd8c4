//! The watch over the open sessions: it counts those that need attention for the metrics, and
//! forms beliefs that no client asked for, so that every session is judged and its webhook events
//! are raised.

use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_schemas::AttentionLevel;
use tokio::sync::watch;
use uuid::Uuid;

use super::fleet::OpenSession;
use super::{SessionError, Sessions, is_idle};
use crate::cause::Cause;
use crate::clock::{now_ms, pause};
use crate::notices::Alarm;
use crate::wire::session::{options, part};

/// Least interval between looks.
const LOOK_EVERY: Duration = Duration::from_secs(5);
/// Pause after a look in multiples of its time: one part in twenty of a thread with ten thousand
/// sessions.
const PAUSE_PER_LOOK: u32 = 19;
/// Time without a change after which a belief that nobody asked for is formed. Chosen: a robot that
/// posts with `belief=none` has ended its burst.
const QUIET_MS: u64 = 3_000;
/// Number of beliefs formed between two looks. Chosen: metrics stay fresh after a restart with
/// many sessions.
const RECALLED_PER_LOOK: usize = 64;

impl Sessions {
    /// Watches over the open sessions until the server stops.
    pub(crate) async fn keep_watch(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        loop {
            let begun = Instant::now();
            let sessions = Arc::clone(&self);
            let looked = tokio::task::spawn_blocking(move || sessions.look()).await;
            let took = begun.elapsed();
            match looked {
                Ok(Ok(behind)) => {
                    for id in behind {
                        if *stopping.borrow() {
                            return;
                        }
                        if let Err(error) = self.recall(id).await {
                            tracing::debug!(session.id = %id,
                                "Cannot form the belief of session {id} yet: {error}");
                        }
                    }
                }
                Ok(Err(error)) => {
                    tracing::error!("Cannot look which sessions need attention: {error}");
                }
                Err(error) => {
                    tracing::error!("Looking which sessions need attention failed: {error}");
                }
            }
            if !pause(LOOK_EVERY.max(PAUSE_PER_LOOK * took), &mut stopping).await {
                return;
            }
        }
    }

    /// Counts the sessions by the attention that they need. Returns those whose newest beliefs
    /// are to be formed, newest change first. Blocks.
    fn look(&self) -> Result<Vec<Uuid>, Cause> {
        let now = now_ms();
        self.tools.traces.retain(|id| self.open.contains(id));
        let open = self.open_now(now)?;
        measure(&open);
        self.note_attention(&open);
        let is_behind = |one: &&OpenSession| {
            let known = u64::from(self.tools.traces.revision(one.session.id));
            let is_new = known == 0 || one.status.changed_at_ms.saturating_add(QUIET_MS) <= now;
            one.is_cheap && one.status.n_readings > 0 && known < one.status.length && is_new
        };
        let mut behind: Vec<&OpenSession> = open.iter().filter(is_behind).collect();
        behind.sort_unstable_by_key(|one| std::cmp::Reverse(one.status.changed_at_ms));
        Ok(behind.iter().take(RECALLED_PER_LOOK).map(|one| one.session.id).collect())
    }

    /// Queues the webhook events of sessions that began or ceased to need attention. Skips a session
    /// whose newest belief is not formed yet.
    fn note_attention(&self, open: &[OpenSession]) {
        let notices = &self.tools.notices;
        notices.leave(|id| self.open.contains(id));
        for one in open {
            let id = one.session.id;
            if u64::from(self.tools.traces.revision(id)) < one.status.length {
                continue;
            }
            let since_ms = one.judgement.since_ms;
            let alarm = || Alarm { since_ms, attention: one.attention() };
            notices.attention(id, alarm, one.is_needed);
        }
    }

    /// Forms the newest beliefs of a session.
    async fn recall(self: &Arc<Self>, id: Uuid) -> Result<(), SessionError> {
        let session = self.find(&id.to_string())?;
        let method = options(&session).method;
        let was_live = self.live.contains_key(&id);
        let _turn = self.recalling.lock().await;
        // Held, so that what follows finds it loaded. No session is evicted for it.
        let part = part(method);
        let _model = self.catalogues.load(session.catalogue, session.version, part).await?;
        let live = self.live(id).await?;
        let recalled = live.recall().await;
        drop(live);
        if !was_live {
            self.live.remove_if(&id, |_, live| is_idle(live));
        }
        Ok(recalled?)
    }
}

/// Updates the numbers of sessions by the attention that they need.
fn measure(open: &[OpenSession]) {
    let levels = [
        ("surprising", AttentionLevel::Surprising),
        ("stuck", AttentionLevel::Stuck),
        ("working", AttentionLevel::Working),
        ("waiting", AttentionLevel::Waiting),
        ("sure", AttentionLevel::Sure),
    ];
    for (name, level) in levels {
        let n = open.iter().filter(|one| one.judgement.level == level).count();
        metrics::gauge!("palpate_sessions_by_attention", "level" => name).set(n as f64);
    }
    let n_needed = open.iter().filter(|one| one.is_needed).count();
    metrics::gauge!("palpate_sessions_needing_attention").set(n_needed as f64);
}
