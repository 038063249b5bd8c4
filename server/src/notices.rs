//! Queue of events for webhooks, between the code that raises them and the worker that stores them.
//!
//! Readings, trainings and snapshots add an event and continue, so a webhook delays none of them. A
//! newer event of a session replaces its older one of the same kind, which bounds the queue by the
//! open sessions. Not here: deliveries (`services/webhooks`).

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use palpate_schemas as wire;
use palpate_store::webhook::Notice;
use tokio::sync::Notify;
use uuid::Uuid;

/// Capacity of the queue for snapshots. Chosen: at most four snapshots are made at once.
const SNAPSHOTS_MAX: usize = 64;

/// A decision of a session's stop rule.
#[derive(Clone, Debug)]
pub(crate) struct Decision {
    /// Arrival of the reading after which it decided (ms since 1970).
    pub(crate) at_ms: u64,
    /// The decided object; `None` for "none of these".
    pub(crate) object: Option<Uuid>,
    /// The belief with the likeliest object, and its likeliest pose if it is decided.
    pub(crate) belief: wire::Belief,
}

/// A session that began or ceased to need attention.
#[derive(Clone, Debug)]
pub(crate) struct Alarm {
    /// Since when it does (ms since 1970).
    pub(crate) since_ms: u64,
    pub(crate) attention: wire::Attention,
}

/// The queued events.
#[derive(Debug, Default)]
pub(crate) struct Waiting {
    pub(crate) decisions: BTreeMap<Uuid, Decision>,
    pub(crate) alarms: BTreeMap<Uuid, Alarm>,
    pub(crate) jobs: BTreeMap<Uuid, (u64, wire::WebhookJob)>,
    pub(crate) snapshots: Vec<(u64, wire::WebhookSnapshot)>,
    /// Closed sessions whose announcements can be forgotten.
    pub(crate) gone: Vec<Uuid>,
}

/// The queue, and what was announced of each open session.
#[derive(Debug, Default)]
pub(crate) struct Notices {
    waiting: Mutex<Waiting>,
    announced: Mutex<BTreeMap<Uuid, Notice>>,
    /// Notified of every queued event.
    pub(crate) wake: Notify,
}

impl Notices {
    /// Whether the decision of a session's stop rule differs from the announced one.
    pub(crate) fn is_news(&self, belief: &wire::Belief) -> bool {
        let is_decided = belief.stop.is_some_and(|stop| stop.reached);
        is_decided && self.announced(belief.session).decided != Some(decided(belief))
    }

    /// Queues a decision if the session's newest belief differs from the announced decision.
    pub(crate) fn belief(&self, belief: &wire::Belief, at_ms: u64) {
        if !self.is_news(belief) {
            return;
        }
        let (best, object) = (belief.objects.first(), decided(belief));
        let poses = belief.poses.iter().filter(|pose| Some(pose.object) == object);
        let belief = wire::Belief {
            objects: best.cloned().into_iter().collect(),
            poses: poses.take(1).cloned().collect(),
            ..belief.clone()
        };
        let session = belief.session;
        self.waiting().decisions.insert(session, Decision { at_ms, object, belief });
        self.wake.notify_one();
    }

    /// Queues a change of whether a session needs attention.
    pub(crate) fn attention(&self, session: Uuid, alarm: impl FnOnce() -> Alarm, is_needed: bool) {
        if self.announced(session).needs_attention == is_needed {
            self.waiting().alarms.remove(&session);
            return;
        }
        self.waiting().alarms.insert(session, alarm());
        self.wake.notify_one();
    }

    /// Queues the closed sessions, so that their announcements are forgotten.
    pub(crate) fn leave(&self, is_open: impl Fn(Uuid) -> bool) {
        let mut gone: Vec<Uuid> = self.announcements().keys().copied().collect();
        gone.retain(|session| !is_open(*session));
        if !gone.is_empty() {
            self.waiting().gone = gone;
            self.wake.notify_one();
        }
    }

    /// Queues the end of a training.
    pub(crate) fn job(&self, at_ms: u64, job: wire::WebhookJob) {
        self.waiting().jobs.insert(job.id, (at_ms, job));
        self.wake.notify_one();
    }

    /// Queues the end of a snapshot.
    pub(crate) fn snapshot(&self, at_ms: u64, snapshot: wire::WebhookSnapshot) {
        let mut waiting = self.waiting();
        if waiting.snapshots.len() == SNAPSHOTS_MAX {
            tracing::error!("Dropped the event of a snapshot: {SNAPSHOTS_MAX} others are queued");
            return;
        }
        waiting.snapshots.push((at_ms, snapshot));
        self.wake.notify_one();
    }

    /// Takes all queued events.
    pub(crate) fn take(&self) -> Waiting {
        std::mem::take(&mut *self.waiting())
    }

    /// Queues again the events that could not be stored, except where a newer one came.
    pub(crate) fn put_back(&self, mut old: Waiting) {
        let mut waiting = self.waiting();
        old.decisions.append(&mut waiting.decisions);
        old.alarms.append(&mut waiting.alarms);
        old.jobs.append(&mut waiting.jobs);
        old.snapshots.append(&mut waiting.snapshots);
        old.gone.append(&mut waiting.gone);
        *waiting = old;
    }

    /// What was announced of a session.
    pub(crate) fn announced(&self, session: Uuid) -> Notice {
        let nothing = Notice { session, decided: None, needs_attention: false };
        self.announcements().get(&session).copied().unwrap_or(nothing)
    }

    /// Records what is announced of a session from now on.
    pub(crate) fn set_announced(&self, notice: Notice) {
        self.announcements().insert(notice.session, notice);
    }

    /// Forgets what was announced of a session.
    pub(crate) fn forget(&self, session: Uuid) {
        self.announcements().remove(&session);
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn announcements(&self) -> MutexGuard<'_, BTreeMap<Uuid, Notice>> {
        self.announced.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The likelier of the best object and "none of these"; the object if both are equally likely.
fn decided(belief: &wire::Belief) -> Option<Uuid> {
    let best = belief.objects.first();
    best.filter(|best| best.probability >= belief.unknown).map(|best| best.object)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(id: u128) -> Uuid {
        Uuid::from_u128(id)
    }

    /// A belief in object 7 with a probability; the rest is "none of these".
    fn belief(probability: f64, reached: bool) -> wire::Belief {
        let pose = |object: u128| {
            let pose = wire::Pose { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] };
            wire::PoseHypothesis {
                object: id(object),
                name: "mug".to_owned(),
                weight: 0.5,
                session_from_model: pose,
                pose,
                covariance: vec![0.0; 36],
                symmetry: Vec::new(),
            }
        };
        let name = || "mug".to_owned();
        wire::Belief {
            session: id(1),
            revision: 3,
            n_readings: 3,
            objects: [(7, probability), (8, 0.0)]
                .map(|(object, probability)| wire::ObjectProbability {
                    object: id(object),
                    name: name(),
                    probability,
                })
                .to_vec(),
            unknown: 1.0 - probability,
            stop: Some(wire::StopAdvice { risk: 0.05, found: 0.01, reached }),
            calibrated: true,
            uncalibrated_reason: None,
            entropy_bits: 0.1,
            poses: vec![pose(8), pose(7), pose(7)],
            warnings: Vec::new(),
        }
    }

    #[test]
    fn a_decision_is_noted_until_announced_and_when_it_changes() {
        let notices = Notices::default();
        notices.belief(&belief(0.99, false), 5);
        assert!(notices.take().decisions.is_empty());
        notices.belief(&belief(0.99, true), 5);
        let noted = notices.take().decisions.remove(&id(1)).unwrap();
        assert_eq!((noted.at_ms, noted.object), (5, Some(id(7))));
        assert_eq!(noted.belief.objects.len(), 1);
        assert_eq!(noted.belief.poses.iter().map(|it| it.object).collect::<Vec<_>>(), [id(7)]);
        let notice = |decided| Notice { session: id(1), decided, needs_attention: false };
        notices.set_announced(notice(Some(Some(id(7)))));
        notices.belief(&belief(0.98, true), 6);
        assert!(notices.take().decisions.is_empty(), "the same answer again");
        notices.belief(&belief(0.01, true), 7);
        let noted = notices.take().decisions.remove(&id(1)).unwrap();
        assert_eq!((noted.object, noted.belief.poses.len()), (None, 0));
    }

    #[test]
    fn what_is_put_back_gives_way_to_what_is_newer() {
        let notices = Notices::default();
        notices.belief(&belief(0.99, true), 5);
        let old = notices.take();
        notices.belief(&belief(0.01, true), 7);
        notices.put_back(old);
        let waiting = notices.take();
        assert_eq!((waiting.decisions.len(), waiting.decisions[&id(1)].at_ms), (1, 7));
    }

    #[test]
    fn only_changed_needs_are_noted_and_left_sessions_once() {
        let notices = Notices::default();
        let alarm = || panic!("nothing has changed");
        notices.attention(id(1), alarm, false);
        let notice = Notice { session: id(1), decided: None, needs_attention: true };
        notices.set_announced(notice);
        notices.attention(id(1), || panic!("it needed attention before"), true);
        notices.leave(|session| session == id(1));
        assert!(notices.take().gone.is_empty());
        notices.leave(|_| false);
        assert_eq!(notices.take().gone, [id(1)]);
    }
}
