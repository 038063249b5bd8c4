//! Sample values to store, each field different from every other.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use palpate_core::convention::{PoseConvention, PoseDirection, PositionUnit, QuaternionOrder};
use palpate_core::pose::Pose;
use palpate_core::reading::Looseness;
use palpate_core::reading::point_contact::ContactNumbers;
use palpate_core::sensor::line::{Goodness, Line};
use palpate_core::sensor::response_curve::{ResponseCurve, ResponseCurves};
use palpate_core::sensor::spread_fit::SpreadFit;
use palpate_core::sensor::{
    Calibration, Coupling, CoveringEdge, Estimate, ImageOrder, Layout, Passport, SensorDescription,
    SensorKnowledge, SensorParameters, SpreadKernel, StatedRanges, Taxel, TaxelResponse,
    TaxelState,
};
use palpate_store::calibration::{StoredLines, StoredPassport, StoredSpread};
use palpate_store::catalogue::{Catalogue, Draft, VersionObject};
use palpate_store::database::Database;
use palpate_store::entity::{
    Job, JobState, Labels, Method, Object, ReadingId, Sensor, Session, StoredReading,
};
use palpate_store::error::StoreError;
use palpate_store::journal::{Event, NewEntry};
use palpate_store::mesh::{MeshFormat, MeshInfo, MeshUnit};
use uuid::Uuid;

pub(crate) fn wait<T>(future: impl Future<Output = T>) -> T {
    futures::executor::block_on(future)
}

pub(crate) fn sensor(id: u128) -> Sensor {
    Sensor {
        id: Uuid::from_u128(id),
        name: format!("sensor-{id}"),
        preset: Some("digitacts-6x6".to_owned()),
        description: SensorDescription::digitacts_6x6(),
        knowledge: SensorKnowledge::Measured,
        ranges: StatedRanges::default(),
        labels: Labels::new(),
        used: true,
        created_at_ms: 1_700_000_000_001,
    }
}

/// A fingertip with a list of three taxels.
pub(crate) fn listed_sensor(id: u128) -> Sensor {
    let taxel = |tilt: f64| {
        let normal = DVec3::new(tilt.sin(), 0.0, tilt.cos());
        Taxel { position: 0.008 * (normal - DVec3::Z), normal, width: 0.003 }
    };
    let layout = Some(Arc::new(Layout::list([-0.4, 0.0, 0.4].map(taxel).to_vec()).unwrap()));
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let description = SensorDescription::new(SensorParameters { layout, ..known }).unwrap();
    Sensor { preset: None, description, ..sensor(id) }
}

/// The sensor as records older than schema 5 are read.
pub(crate) fn sheet(sensor: Sensor) -> Sensor {
    Sensor { knowledge: SensorKnowledge::DataSheet, ..sensor }
}

/// A sensor whose coupling, knowledge and ranges all differ from the defaults.
pub(crate) fn coupled_sensor(id: u128) -> Sensor {
    let coupling = Coupling {
        kernel: SpreadKernel::Exponential,
        margin: Some(0.001),
        edge: CoveringEdge::LosesForce,
        cross_talk: 0.12,
        gain_spread: 0.05,
        hysteresis: 0.03,
    };
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let ranges = StatedRanges {
        spread_factor: Some((0.8, 1.2)),
        kernels: Some(vec![SpreadKernel::Exponential]),
        margin: Some((0.0, 0.002)),
        edges: Some(vec![CoveringEdge::ConservesForce, CoveringEdge::LosesForce]),
        cross_talk: Some((0.1, 0.2)),
        stiffness: Some((0.9, 1.1)),
        stiffening: Some((0.0, 0.5)),
    };
    Sensor {
        preset: None,
        description: SensorDescription::new(SensorParameters { coupling, ..known }).unwrap(),
        knowledge: SensorKnowledge::DataSheet,
        ranges,
        ..sensor(id)
    }
}

pub(crate) fn object(id: u128) -> Object {
    Object {
        id: Uuid::from_u128(id),
        name: format!("object-{id}"),
        description: "a mug, Größe 80 mm".to_owned(),
        labels: Labels::new(),
        revision: 3,
        created_at_ms: 1_700_000_000_002,
        updated_at_ms: 1_700_000_000_003,
    }
}

pub(crate) fn job(id: u128) -> Job {
    Job {
        id: Uuid::from_u128(id),
        catalogue: "default".to_owned(),
        request: r#"{"seed":7}"#.to_owned(),
        state: JobState::Running,
        stage: "patches".to_owned(),
        done: 4,
        total: 10,
        cancel_requested: true,
        version: Some(2),
        error: Some("none yet".to_owned()),
        report: None,
        created_at_ms: 1_700_000_000_004,
        started_at_ms: Some(1_700_000_000_005),
        finished_at_ms: None,
    }
}

pub(crate) fn session(id: u128) -> Session {
    Session {
        id: Uuid::from_u128(id),
        catalogue: Uuid::from_u128(70),
        version: 5,
        method: Method::Geometric,
        sensors: vec![Uuid::from_u128(10), Uuid::from_u128(11)],
        frame_id: "base_link".to_owned(),
        prior: vec![(Uuid::from_u128(20), 0.25), (Uuid::from_u128(21), 0.75)],
        seed: 99,
        time_to_live_ms: 3_600_000,
        options: "{}".to_owned(),
        created_at_ms: 1_700_000_000_006,
        closed_at_ms: Some(1_700_000_000_007),
    }
}

pub(crate) fn reading(n_taxels: usize) -> StoredReading {
    let pressures = (0..n_taxels).map(|taxel| Some(taxel as f64 * 100.0).filter(|_| taxel != 3));
    let half = std::f64::consts::FRAC_PI_8;
    StoredReading {
        sensor: Uuid::from_u128(10),
        session_from_sensor: Some(
            Pose::new([0.1, -0.2, 0.3], [0.0, half.sin(), 0.0, half.cos()]).unwrap(),
        ),
        pressures: pressures.collect(),
        stamp_ns: Some(-5),
        calibration: 0,
        feature: None,
        approach: 0.0,
        object_moved: None,
        contact: None,
        shear: None,
    }
}

/// A reading without a pose, with a feature of the client's own.
pub(crate) fn coded_entry(robot: &str, seq: u64) -> NewEntry {
    let feature = Some(vec![0.5, -2.0, 1e-3]);
    let reading = StoredReading { session_from_sensor: None, feature, ..reading(4) };
    NewEntry { event: Event::Reading(reading), ..entry(robot, seq) }
}

/// A reading with a calibration.
pub(crate) fn calibrated_entry(robot: &str, seq: u64, calibration: u32) -> NewEntry {
    let event = Event::Reading(StoredReading { calibration, ..reading(36) });
    NewEntry { event, ..entry(robot, seq) }
}

/// Response lines of 2 × 2 taxels, one of every state, as the first calibration brings them.
pub(crate) fn taxel_lines() -> StoredLines {
    let taxel = |slope, offset, state| {
        let r_squared = 1.0 - offset / 100.0;
        TaxelResponse { line: Line { slope, offset }, r_squared, state }
    };
    let taxels = vec![
        taxel(1.1e7, 1.0, TaxelState::Ok),
        taxel(0.0, 2.0, TaxelState::Dead),
        taxel(4e6, 3.0, TaxelState::CrossWired { answers: 3 }),
        taxel(0.9e7, 4.0, TaxelState::Ok),
    ];
    let target = Line { slope: 1e7, offset: 2.5 };
    let fit = SpreadFit { sigma: 2.7e-3, sigma_in_widths: 1.35, cosine: 0.99, pearson: 0.98 };
    StoredLines {
        since: 1,
        calibration: Calibration::new(target, taxels).unwrap(),
        before: Goodness { r_squared: 0.9, residual: 400.0 },
        after: Goodness { r_squared: 0.999, residual: 20.0 },
        n_presses: 20,
        spread: Some(StoredSpread {
            fit,
            n_presses: 225,
            indenter_diameter: 1e-3,
            covering_thickness: Some(1.016e-3),
        }),
        created_at_ms: 1_700_000_000_012,
    }
}

/// The same with curves: the second and the third taxel are not used and have none.
pub(crate) fn taxel_curves() -> StoredLines {
    let curve = |gain: f64| {
        let knots = [(0.2e-3, 1e3), (0.4e-3, 2.5e3), (0.6e-3, 5e3)];
        ResponseCurve::new(knots.map(|(depth, p)| (depth, gain * p)).to_vec()).unwrap()
    };
    let taxels = vec![Some(curve(1.1)), None, None, Some(curve(0.9))];
    let lines = taxel_lines();
    let curves = ResponseCurves { target: curve(1.0), taxels };
    StoredLines { calibration: lines.calibration.with_curves(curves).unwrap(), ..lines }
}

/// A passport, as the first calibration brings it.
pub(crate) fn passport() -> StoredPassport {
    let estimate = |value, deviation| Estimate { value, deviation };
    StoredPassport {
        since: 1,
        passport: Passport {
            pascals: 1e3,
            convention: PoseConvention {
                unit: PositionUnit::Inch,
                quaternion: QuaternionOrder::Wxyz,
                direction: PoseDirection::SensorFromSession,
            },
            image_order: ImageOrder { cols_reversed: true, ..ImageOrder::default() },
            sent_from_true: Pose::new([0.001, 0.0, -0.004], [0.0, 0.6, 0.0, 0.8]).unwrap(),
            dead: vec![3],
            gain: estimate(1.25, 0.125),
            stiffening: estimate(0.5, 0.25),
            point_spread: estimate(2e-3, 2.5e-4),
            margin: Some(1e-3),
            edge: CoveringEdge::LosesForce,
            is_edge_known: true,
            looseness: 3e-4,
        },
        touched: "reference_ridge".to_owned(),
        object: Some(Uuid::from_u128(20)),
        n_touches: 20,
        residual: (0.25, 0.0625),
        undetermined: vec!["edge".to_owned()],
        created_at_ms: 1_700_000_000_013,
    }
}

pub(crate) fn entry(robot: &str, seq: u64) -> NewEntry {
    NewEntry {
        reading_id: Some(ReadingId { robot: robot.to_owned(), seq }),
        written_by: None,
        received_at_ms: 1_700_000_000_008,
        event: Event::Reading(reading(36)),
    }
}

pub(crate) fn mesh_file(bytes: usize) -> Vec<u8> {
    (0..bytes).map(|place| (place * 31 + place / 256) as u8).collect()
}

pub(crate) fn mesh_info(upload: u128, file: &[u8]) -> MeshInfo {
    let upload = Uuid::from_u128(upload);
    MeshInfo::new(upload, MeshFormat::Ply, MeshUnit::Millimetre, file, 1_700_000_000_009)
}

pub(crate) fn catalogue(id: u128) -> Catalogue {
    Catalogue::new(Uuid::from_u128(id), format!("catalogue-{id}"), 1_700_000_000_010)
}

pub(crate) fn draft(blocks: &[(&str, usize)]) -> Draft {
    let block = |(name, bytes): &(&str, usize)| ((*name).to_owned(), mesh_file(*bytes));
    Draft {
        job: Some(Uuid::from_u128(40)),
        parameters: r#"{"readings":1000}"#.to_owned(),
        objects: vec![VersionObject { id: Uuid::from_u128(20), name: "mug".to_owned() }],
        shared: Vec::new(),
        blocks: blocks.iter().map(block).collect(),
        created_at_ms: 1_700_000_000_011,
    }
}

/// Fills a database with one item of every kind.
pub(crate) fn fill(database: &Database) {
    let file = mesh_file(10_000);
    wait(async {
        database.sensors().create(&sensor(10)).await?;
        database.objects().create(&object(20)).await?;
        database.meshes().put(Uuid::from_u128(20), &mesh_info(30, &file), &file).await?;
        database.training().append(Uuid::from_u128(20), 0, &[entry("a", 1)]).await.unwrap();
        database.jobs().create(&job(40)).await?;
        database.sessions().create(&session(50)).await?;
        let entries = [entry("a", 1), entry("b", 1)];
        database.journal().append(Uuid::from_u128(50), 0, &entries).await.unwrap();
        let catalogues = database.catalogues();
        catalogues.create(&catalogue(70)).await?;
        let draft = draft(&[("postings", 9_000), ("report", 100)]);
        let manifest = catalogues.publish(Uuid::from_u128(70), draft).await?;
        catalogues.switch(manifest.catalogue, manifest.version, None, 12).await?;
        Ok::<(), StoreError>(())
    })
    .unwrap();
}

/// Reads everything that [`fill`] wrote; the error names the first fault.
pub(crate) fn read_all(database: &Database) -> Result<(), String> {
    let text = |error: StoreError| error.to_string();
    let same = |what: &str, same: bool| if same { Ok(()) } else { Err(what.to_owned()) };
    same("sensors", database.sensors().all().map_err(text)? == [sensor(10)])?;
    same("objects", database.objects().all().map_err(text)? == [object(20)])?;
    let named = database.objects().find_by_name("object-20").map_err(text)?;
    same("names", named == Some(object(20)))?;
    let named = database.sensors().find_by_name("sensor-10").map_err(text)?;
    same("names", named == Some(sensor(10)))?;
    let mesh = database.meshes().get(Uuid::from_u128(20)).map_err(text)?;
    same("mesh", mesh.is_some_and(|(_, file)| file == mesh_file(10_000)))?;
    for (journal, owner, expected) in [
        (database.training(), 20, vec![entry("a", 1)]),
        (database.journal(), 50, vec![entry("a", 1), entry("b", 1)]),
    ] {
        let owner = Uuid::from_u128(owner);
        let found = journal.entries(owner, 0, 10).map_err(text)?;
        let events: Vec<_> = found.into_iter().map(|entry| entry.event).collect();
        same("journal", events == vec![Event::Reading(reading(36)); expected.len()])?;
        for (seq, entry) in (0..).zip(&expected) {
            let id = entry.reading_id.as_ref().unwrap();
            same("robots", journal.find(owner, id, entry.written_by).map_err(text)? == Some(seq))?;
        }
    }
    same("jobs", database.jobs().all().map_err(text)? == [job(40)])?;
    same("sessions", database.sessions().all().map_err(text)? == [session(50)])?;
    let catalogues = database.catalogues();
    let found = catalogues.find_by_name("catalogue-70").map_err(text)?.ok_or("no catalogue")?;
    let version = found.current.ok_or("no current version")?;
    let manifest = catalogues.manifest(found.id, version).map_err(text)?;
    let blocks = catalogues.blocks(&manifest).map_err(text)?;
    same("blocks", blocks == draft(&[("postings", 9_000), ("report", 100)]).blocks)
}

/// A reading after a free path of 70 mm, of an object that may have moved.
pub(crate) fn moved_entry(robot: &str, seq: u64) -> NewEntry {
    let object_moved = Some(Looseness { position: 0.002, angle: 0.03 });
    let reading = StoredReading { approach: 0.07, object_moved, ..reading(36) };
    NewEntry { event: Event::Reading(reading), ..entry(robot, seq) }
}

/// A contact without an image, with a normal and a force.
pub(crate) fn contact_entry(robot: &str, seq: u64) -> NewEntry {
    let contact = ContactNumbers {
        touched: true,
        position: [0.1, -0.2, 0.3],
        position_deviation: 0.002,
        normal: Some([0.0, 0.6, 0.8]),
        normal_deviation: Some(0.2),
        force: Some(1.5),
    };
    let reading = StoredReading { session_from_sensor: None, contact: Some(contact), ..reading(0) };
    NewEntry { event: Event::Reading(reading), ..entry(robot, seq) }
}

/// A reading of three-axis taxels, one of them without a value.
pub(crate) fn sheared_entry(robot: &str, seq: u64) -> NewEntry {
    let shear = Some(vec![Some([1.0, -2.0]), None, Some([0.5, 0.0]), Some([0.0, 3.0])]);
    let reading = StoredReading { shear, ..reading(4) };
    NewEntry { event: Event::Reading(reading), ..entry(robot, seq) }
}

/// Copies a folder unchanged, as a `kill -9` would leave it.
pub(crate) fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}
