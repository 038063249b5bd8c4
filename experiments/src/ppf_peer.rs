//! A peer on the same touches: OpenCV contrib's `ppf_match_3d` and its ICP.
//!
//! Both learn each object from the same training touches (point and normal), and get the same
//! test touches. The surface recogniser also gets the images; a further row leaves appearance
//! out. The peer is a script (`tests/peers/ppf_opencv.py`) that reads the touches from a folder
//! and writes the objects that it named; without its module its exit code says so, and its rows
//! are left out. Time is wall time of one core for naming an object after a number of touches:
//! for the surface recogniser the sum over the touches.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context as _, bail};
use clap::Args;
use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::units::{DEG, MM};
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::observe::touch::observe_touch;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::arguments::{ObjectSet, TouchSet, count};
use crate::disturbance::Disturbance;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects;
use crate::played::{Played, PoseError, Step};
use crate::report::{Outcome, Progress, Report};
use crate::sensing::Sensing;
use crate::statistics::{mean, median};
use crate::trained::train_surface;

/// The script's exit code when its module is missing.
const MODULE_MISSING: i32 = 3;

/// Arguments of `ppf-peer`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct PpfPeer {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// A Python with opencv-contrib-python. It is no part of the figures.
    #[arg(long, default_value = "python3", value_name = "PATH")]
    #[serde(skip)]
    pub python: PathBuf,
    /// The script of the peer.
    #[arg(long, default_value = "tests/peers/ppf_opencv.py", value_name = "PATH")]
    #[serde(skip)]
    pub script: PathBuf,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object.
    #[arg(long, default_value_t = 5, value_parser = count)]
    pub trials: usize,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
    /// Numbers of touches, ascending, after which both answer.
    #[arg(long, default_values_t = [5, 10, 20], value_delimiter = ',', value_parser = count)]
    pub counts: Vec<usize>,
}

/// A method's answer after one of the counts.
struct Named {
    count: usize,
    object: usize,
    named: usize,
    error: Option<PoseError>,
    ms: f64,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, training fails, or the peer's script breaks off
/// for another reason than its missing module.
pub fn run(config: &PpfPeer, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = config.objects.load()?;
    progress("touching objects", 0, 1);
    let preset = Sensing::with(config.touches.sensor.clone());
    let train = preset.touch_all(&objects, config.touches.train_readings, 2 * config.seed)?;
    let test = preset.touch_all(&objects, config.touches.test_readings, 2 * config.seed + 1)?;
    let symmetries = objects::symmetries(&objects);
    let surface = SurfaceConfig::default();
    let model = train_surface(&train, &symmetries, &config.touches.sensor, &surface, config.seed)?;
    let sessions = Sessions {
        sensor: &config.touches.sensor,
        test: &test,
        symmetries: &symmetries,
        seed: config.seed,
        readings: config.counts.iter().copied().max().unwrap_or(0),
        threads: 1,
        disturbance: Disturbance::None,
    };
    let n = objects.len();
    let mut found = Vec::new();
    let mut blind = SurfaceOptions::default();
    // At these scales all appearances are alike.
    (blind.scale.appearance, blind.scale.appearance_of_pose) = (1e6, 1e6);
    for (method, options) in [("surface", SurfaceOptions::default()), ("surface_blind", blind)] {
        let surface = Recogniser::Surface { model: model.clone(), options };
        let played = sessions.play(&surface, n, config.trials * n, progress)?;
        found.push((method, of_ours(config, &played)));
    }
    progress("the peer", 0, 1);
    match ask_peer(config, &model, &sessions, n)? {
        Some(named) => found.push(("ppf_match_3d", named)),
        None => report.labelled(
            &[
                ("method", "ppf_match_3d"),
                ("left_out", "its module is missing: pip install opencv-contrib-python-headless"),
            ],
            (),
        ),
    }
    let mut lines: [Vec<Line>; 2] = [Vec::new(), Vec::new()];
    for (method, named) in &found {
        let [right, time] = report_method(&mut report, config, method, named);
        lines[0].push(Line { name: (*method).to_owned(), points: right });
        lines[1].push(Line { name: (*method).to_owned(), points: time });
    }
    let [right, time] = lines;
    let panel = |title: &str, y: &str, lines| Panel {
        title: title.to_owned(),
        x: "touches".to_owned(),
        y: y.to_owned(),
        lines,
    };
    let panels = [
        panel("recognised", "share right", right),
        panel("time to name, log10", "log10 of 1 + mean ms", time),
    ];
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

fn of_ours(config: &PpfPeer, played: &Played) -> Vec<Named> {
    let of = |step: &Step| {
        let same = |other: &&Step| other.object == step.object && other.trial == step.trial;
        let so_far = played.steps.iter().filter(same).filter(|o| o.readings <= step.readings);
        Named {
            count: step.readings,
            object: step.object,
            named: step.named,
            error: step.error,
            ms: so_far.map(|other| other.wall_ms).sum(),
        }
    };
    played.steps.iter().filter(|step| config.counts.contains(&step.readings)).map(of).collect()
}

/// Writes the touches, runs the script and reads the objects that it named; `None` without its
/// module.
fn ask_peer(
    config: &PpfPeer,
    model: &SurfaceModel,
    sessions: &Sessions<'_>,
    n_objects: usize,
) -> anyhow::Result<Option<Vec<Named>>> {
    static RUNS: AtomicU64 = AtomicU64::new(0);
    let run = RUNS.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("palpate-ppf-{}-{run}", std::process::id()));
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot create folder {}", folder.display()))?;
    let asked = write_touches(config, model, sessions, n_objects, &folder)
        .and_then(|()| run_script(config, &folder))
        .and_then(|ran| if ran { read_named(sessions, &folder).map(Some) } else { Ok(None) });
    let removed = std::fs::remove_dir_all(&folder);
    let asked = asked?;
    removed.with_context(|| format!("cannot remove folder {}", folder.display()))?;
    Ok(asked)
}

/// `models.csv`: object, point and normal a line; `scenes.csv`: object, trial, point, normal.
/// Millimetres.
fn write_touches(
    config: &PpfPeer,
    model: &SurfaceModel,
    sessions: &Sessions<'_>,
    n_objects: usize,
    folder: &Path,
) -> anyhow::Result<()> {
    let (mut models, mut scenes) = (String::new(), String::new());
    let numbers = |point: DVec3, normal: DVec3| {
        let [point, normal] = [point / MM, normal].map(|v| v.to_array());
        point.into_iter().chain(normal).map(|v| format!(",{v:.6}")).collect::<String>()
    };
    for (object, map) in model.maps().iter().enumerate() {
        for patch in map.patches() {
            let place = numbers(patch.position.as_dvec3(), patch.normal.as_dvec3());
            writeln!(models, "{object}{place}")?;
        }
    }
    for done in 0..config.trials * n_objects {
        let (object, trial) = (done % n_objects, done / n_objects);
        for heard in sessions.presented(object, trial) {
            let touch = observe_touch(&heard.reading, &config.touches.sensor, &model.space)
                .context("a converged touch touches")?;
            writeln!(scenes, "{object},{trial}{}", numbers(touch.position, touch.normal))?;
        }
    }
    for (name, text) in [("models.csv", models), ("scenes.csv", scenes)] {
        std::fs::write(folder.join(name), text)
            .with_context(|| format!("cannot write {name} to {}", folder.display()))?;
    }
    Ok(())
}

fn run_script(config: &PpfPeer, folder: &Path) -> anyhow::Result<bool> {
    let counts = config.counts.iter().map(usize::to_string);
    let status = Command::new(&config.python)
        .arg(&config.script)
        .arg(folder)
        .args(counts)
        .status()
        .with_context(|| format!("cannot run {}", config.python.display()))?;
    match status.code() {
        Some(0) => Ok(true),
        Some(MODULE_MISSING) => Ok(false),
        _ => bail!("{} ended with {status}", config.script.display()),
    }
}

/// `named.csv`: object, trial, touches, the object named, milliseconds, then
/// `session_from_object` as millimetres and a quaternion x, y, z, w.
fn read_named(sessions: &Sessions<'_>, folder: &Path) -> anyhow::Result<Vec<Named>> {
    let file = folder.join("named.csv");
    let text = std::fs::read_to_string(&file)
        .with_context(|| format!("cannot read {}", file.display()))?;
    text.lines().map(|line| named_in(sessions, line)).collect()
}

fn named_in(sessions: &Sessions<'_>, line: &str) -> anyhow::Result<Named> {
    let values: Vec<f64> = line
        .split(',')
        .map(|value| value.parse().with_context(|| format!("{value} is not a number")))
        .collect::<anyhow::Result<_>>()?;
    let [object, trial, count, named, ms, x, y, z, qx, qy, qz, qw] = values[..] else {
        bail!("the peer wrote {} values in a line, expected 12", values.len());
    };
    let [object, trial, count, named] = [object, trial, count, named].map(|v| v as usize);
    anyhow::ensure!(object < sessions.test.len(), "the peer speaks of object {object}");
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw).normalize();
    let found = Pose::from_parts(rotation, DVec3::new(x, y, z) * MM);
    let error = (named == object).then(|| sessions.error(object, trial, &found));
    Ok(Named { count, object, named, error, ms })
}

#[derive(Serialize)]
struct Answers {
    touches: usize,
    trials: usize,
    accuracy: f64,
    position_error_mm_median: f64,
    angle_error_deg_median: f64,
    ms_to_name_mean: f64,
}

/// Adds rows and figures of a method; returns its points of accuracy and of time.
fn report_method(
    report: &mut Report,
    config: &PpfPeer,
    method: &str,
    named: &[Named],
) -> [Vec<(f64, f64)>; 2] {
    let mut points: [Vec<(f64, f64)>; 2] = [Vec::new(), Vec::new()];
    for count in &config.counts {
        let own = || named.iter().filter(|one| one.count == *count);
        let right = |one: &Named| f64::from(u8::from(one.named == one.object));
        let accuracy = mean(&own().map(right).collect::<Vec<_>>());
        let ms = mean(&own().map(|one| one.ms).collect::<Vec<_>>());
        let error = |of: fn(&PoseError) -> f64| {
            median(&own().filter_map(|one| one.error.as_ref().map(of)).collect::<Vec<_>>())
        };
        let moved = error(|e| e.translation / MM);
        report.labelled(
            &[("method", method)],
            Answers {
                touches: *count,
                trials: own().count(),
                accuracy,
                position_error_mm_median: moved,
                angle_error_deg_median: error(|e| e.angle / DEG),
                ms_to_name_mean: ms,
            },
        );
        report.summarise(&format!("{method}_accuracy_at_{count}"), accuracy);
        report.summarise(&format!("{method}_ms_at_{count}"), ms);
        report.summarise(&format!("{method}_position_error_mm_median_at_{count}"), moved);
        points[0].push((*count as f64, accuracy));
        points[1].push((*count as f64, (1.0 + ms).log10()));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    /// A small run. The peer is a shell script with this text; every object is learnt from
    /// `train_readings` touches.
    fn small(name: &str, script: &str, train_readings: usize) -> anyhow::Result<Outcome> {
        let path = std::env::temp_dir().join(format!("palpate-{name}-{}.sh", std::process::id()));
        std::fs::write(&path, script).unwrap();
        let config = PpfPeer {
            python: PathBuf::from("sh"),
            script: path.clone(),
            seed: 101,
            trials: 1,
            touches: TouchSet { train_readings, test_readings: 10, ..defaults() },
            counts: vec![3, 6],
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ());
        std::fs::remove_file(path).unwrap();
        outcome
    }

    #[test]
    fn a_peer_answers_the_same_touches_and_is_reported() {
        // It gets 10 × 150 training and 10 × 6 test touches of 7 and 8 values, and always names
        // the first object, after 20 ms, at an arbitrary pose.
        let script = "test $(wc -l < $1/models.csv) = 1500 && test $(wc -l < $1/scenes.csv) = 60 \
            && test $(head -1 $1/scenes.csv | tr ',' '\\n' | wc -l) = 8 || exit 1\n\
            for object in 0 1 2 3 4 5 6 7 8 9; do for n in $2 $3; do \
            echo $object,0,$n,0,20,0,0,0,0,0,0,1; done; done > $1/named.csv";
        let outcome = small("ppf-names", script, 150).unwrap();
        let summary = &outcome.report.summary;
        assert!((summary["ppf_match_3d_accuracy_at_6"] - 0.1).abs() < 1e-12, "{summary:?}");
        assert!((summary["ppf_match_3d_ms_at_3"] - 20.0).abs() < 1e-12);
        // Objects are up to 200 mm from the origin along each axis.
        assert!((1.0..350.0).contains(&summary["ppf_match_3d_position_error_mm_median_at_3"]));
        assert!(summary["surface_accuracy_at_6"] >= 0.7, "{summary:?}");
        assert!(summary["surface_ms_at_6"] > summary["surface_ms_at_3"]);
    }

    #[test]
    fn a_peer_without_its_module_is_left_out() {
        let outcome = small("ppf-missing", "exit 3", 60).unwrap();
        let rows = &outcome.report.rows;
        assert!(rows.iter().any(|row| row.get("left_out").is_some()), "{rows:?}");
        assert!(!outcome.report.summary.contains_key("ppf_match_3d_accuracy_at_6"));
        let error = small("ppf-fails", "exit 1", 60).err().unwrap().to_string();
        assert!(error.contains("ended with exit status: 1"), "{error}");
    }
}
