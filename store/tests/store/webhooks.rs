//! Tests of webhooks and their deliveries: frozen bytes (`golden/webhooks_v1.txt`, deliveries of
//! schema 2 in `golden/webhooks_v2.txt`), laws on both engines, and what a restoration keeps.

use std::sync::Arc;

use palpate_store::database::Database;
use palpate_store::engine::Engine;
use palpate_store::fsck;
use palpate_store::memory::MemoryEngine;
use palpate_store::webhook::{
    Attempt, Deliveries, Delivery, DeliveryState, EventKind, Notice, PreviousKey, Webhook,
};
use tempfile::TempDir;
use uuid::Uuid;

use crate::bytes::{lines, thawed};
use crate::samples::wait;

const GOLDEN_V1: &str = include_str!("golden/webhooks_v1.txt");
const GOLDEN: &str = include_str!("golden/webhooks_v2.txt");

fn id(id: u128) -> Uuid {
    Uuid::from_u128(id)
}

pub(crate) fn webhook(n: u128) -> Webhook {
    Webhook {
        id: id(n),
        url: "https://mes.example/touch".to_owned(),
        description: "night shift".to_owned(),
        events: vec![EventKind::SessionDecided, EventKind::SnapshotFailed],
        secret: vec![1, 2, 3],
        previous: Some(PreviousKey { secret: vec![4, 5], until_ms: 9 }),
        is_enabled: false,
        disabled_because: Some("gone".to_owned()),
        created_at_ms: 10,
        updated_at_ms: 11,
        since_ms: 12,
        failing_since_ms: Some(13),
    }
}

pub(crate) fn delivery(hook: u128, event: u128) -> Delivery {
    let attempt = Attempt { at_ms: 22, took_ms: 7, status: Some(500), error: Some("500".into()) };
    Delivery {
        webhook: id(hook),
        event: id(event),
        kind: EventKind::TrainingFinished,
        caused_by: Some(id(hook + 5)),
        body: "{}".to_owned(),
        created_at_ms: 21,
        state: DeliveryState::Failed,
        n_failed: 1,
        next_at_ms: Some(23),
        attempts: vec![attempt],
    }
}

pub(crate) fn notice(session: u128) -> Notice {
    Notice { session: id(session), decided: Some(Some(id(20))), needs_attention: true }
}

pub(crate) fn all(deliveries: &Deliveries) -> Vec<Delivery> {
    let mut found = Vec::new();
    deliveries.each(|delivery| found.push(delivery)).unwrap();
    found
}

fn check(law: impl Fn(&Database)) {
    law(&Database::in_memory());
    let folder = TempDir::new().unwrap();
    law(&Database::with_engine(Arc::new(crate::engines::open(&folder))).unwrap());
}

#[test]
fn written_webhooks_equal_the_frozen_bytes_and_are_read() {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    let unknown = Notice { decided: Some(None), needs_attention: false, ..notice(51) };
    wait(async {
        database.webhooks().create(&webhook(90)).await.unwrap();
        let deliveries = database.deliveries();
        deliveries.add(&[delivery(90, 91)], &[], Some(&notice(50))).await.unwrap();
        deliveries.add(&[], &[], Some(&unknown)).await.unwrap();
    });
    assert_eq!(lines(&*engine), GOLDEN, "\n{}", lines(&*engine));
    let report = fsck::check(&*engine).unwrap();
    assert_eq!(report.findings, [], "{report:?}");
    let database = thawed(GOLDEN);
    assert_eq!(database.webhooks().all().unwrap(), [webhook(90)]);
    assert_eq!(all(&database.deliveries()), [delivery(90, 91)]);
    assert_eq!(database.deliveries().notices().unwrap(), [notice(50), unknown]);
    let before = Delivery { caused_by: None, ..delivery(90, 91) };
    assert_eq!(all(&thawed(GOLDEN_V1).deliveries()), [before]);
}

#[test]
fn deliveries_are_added_with_their_notice_and_make_room() {
    check(|database| {
        let deliveries = database.deliveries();
        // A body of several pieces leaves none behind.
        let long = Delivery { body: "x".repeat(10_000), ..delivery(90, 1) };
        wait(deliveries.add(&[long.clone(), delivery(91, 1)], &[], None)).unwrap();
        assert_eq!(deliveries.find(id(90), id(1)).unwrap(), Some(long));
        let surplus = [(id(90), id(1)), (id(90), id(77))];
        wait(deliveries.add(&[delivery(90, 2)], &surplus, Some(&notice(50)))).unwrap();
        assert_eq!(all(&deliveries), [delivery(90, 2), delivery(91, 1)]);
        assert_eq!(deliveries.notices().unwrap(), [notice(50)]);
        wait(deliveries.forget(&[id(50), id(51)])).unwrap();
        assert_eq!(deliveries.notices().unwrap(), []);
    });
}

#[test]
fn all_deliveries_are_read_piece_by_piece() {
    check(|database| {
        // Every third has several pieces, and there are more than one read takes.
        let body = |event: u128| "x".repeat(if event.is_multiple_of(3) { 9_000 } else { 2 });
        let made = |event| Delivery { body: body(event), ..delivery(90 + event % 2, event) };
        let mut expected: Vec<Delivery> = (1..=200).map(made).collect();
        wait(database.deliveries().add(&expected, &[], None)).unwrap();
        expected.sort_by_key(|one| (one.webhook, one.event));
        assert_eq!(all(&database.deliveries()), expected);
    });
}

#[test]
fn updates_replace_and_do_not_revive_what_was_removed() {
    check(|database| {
        let deliveries = database.deliveries();
        let long = Delivery { body: "x".repeat(10_000), ..delivery(90, 1) };
        wait(deliveries.add(&[long, delivery(91, 1)], &[], None)).unwrap();
        let state = DeliveryState::Delivered;
        let done = Delivery { state, next_at_ms: None, ..delivery(90, 1) };
        assert!(wait(deliveries.update(&done)).unwrap());
        assert_eq!(all(&deliveries), [done, delivery(91, 1)]);
        wait(deliveries.remove_all(id(90))).unwrap();
        assert!(!wait(deliveries.update(&delivery(90, 1))).unwrap());
        assert_eq!(all(&deliveries), [delivery(91, 1)]);
    });
}
