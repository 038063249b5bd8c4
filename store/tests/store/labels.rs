//! What has labels, aliases and reports: frozen bytes of schema 2 of objects, jobs and catalogues,
//! and of schema 4 of sensors, which are only read (`golden/labelled_v1.txt`).

use std::collections::BTreeMap;

use palpate_store::catalogue::Catalogue;
use palpate_store::entity::{Job, Labels, Object, Sensor};
use uuid::Uuid;

use crate::bytes::{current_of, is_labelled, is_sensor, thawed};
use crate::samples;

const GOLDEN: &str = include_str!("golden/labelled_v1.txt");

fn labels() -> Labels {
    [("site", "Oslo"), ("shift", "night")].map(|(key, value)| (key.into(), value.into())).into()
}

fn object() -> Object {
    Object { labels: labels(), ..samples::object(20) }
}

fn job() -> Job {
    Job { report: Some(r#"{"n_sessions":3}"#.to_owned()), ..samples::job(40) }
}

fn catalogue() -> Catalogue {
    let aliases = BTreeMap::from([("candidate".to_owned(), 7)]);
    Catalogue { labels: labels(), aliases, ..samples::catalogue(70) }
}

fn sensors() -> [Sensor; 2] {
    [samples::coupled_sensor(10), samples::listed_sensor(11)]
        .map(|sensor| Sensor { labels: labels(), ..sensor })
}

#[test]
fn written_labels_equal_the_frozen_bytes_and_are_read() {
    let current = current_of(&[], async |database| {
        database.objects().create(&object()).await.unwrap();
        database.jobs().create(&job()).await.unwrap();
        database.catalogues().create(&catalogue()).await.unwrap();
    });
    let lines: Vec<&str> = current.lines().filter(|line| is_labelled(line)).collect();
    let frozen: Vec<&str> = GOLDEN.lines().filter(|line| !is_sensor(line)).collect();
    assert_eq!(lines, frozen, "{lines:#?}");
    let database = thawed(GOLDEN);
    assert_eq!(database.sensors().all().unwrap(), sensors());
    assert_eq!(database.objects().all().unwrap(), [object()]);
    assert_eq!(database.jobs().all().unwrap(), [job()]);
    assert_eq!(database.catalogues().get(Uuid::from_u128(70)).unwrap(), catalogue());
}
