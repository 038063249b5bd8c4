//! Where a cable lies under a real array of pillars, from one touch, learnt in simulation.
//!
//! Data: a Contactile PapillArray pressed on cables, nine forces a touch and labels of the cable's
//! offset and direction, not part of this project. The preset's family of sensors presses
//! cylinders in simulation at any offset, direction, radius and depth; a touch takes the mean of
//! the simulated touches whose images are most alike. What the files do not say, the order of the
//! pillars and how the offset is measured, is chosen on a part of the touches and judged on the
//! others. The same touches are also judged without any training, by centre and second moments of
//! the pressure, and by the mean label.

mod simulated;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::Args;
use glam::DVec2;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::ImageOrder;
use palpate_core::units::{DEG, MM};
use palpate_sim::plot::{Line, Panel, svg};
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::count;
use crate::report::{Outcome, Progress, Report};
use crate::statistics::{mean, median};
use simulated::simulate;

/// Pillars of the array.
const N: usize = 9;
/// Rows and columns of the array.
const SIDE: usize = 3;
/// Least force of a touch that is used, newton: fainter ones show no line.
const FORCE_MIN: f64 = 1.0;
/// Share of the touches on which conventions are chosen.
const CHOOSING: f64 = 0.1;

/// Arguments of `real-edges`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct RealEdges {
    /// The folder of recorded touches.
    #[arg(long, value_name = "DIR")]
    pub data: PathBuf,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Simulated cables, each pressed by a sensor of its own.
    #[arg(long, default_value_t = 100, value_parser = count)]
    pub cables: usize,
    /// Presses of each.
    #[arg(long, default_value_t = 60, value_parser = count)]
    pub presses: usize,
    /// Simulated touches that a real one is compared with.
    #[arg(long, default_value_t = 15, value_parser = count)]
    pub neighbours: usize,
}

/// A touch: shares of the force on each pillar, and where the cable lies.
#[derive(Clone, Copy, Debug)]
struct Edge {
    shares: [f64; N],
    /// Distance of the cable from the middle of the array, or along its x axis, metres.
    offset: f64,
    /// Angle of the cable to the array's y axis, rad.
    angle: f64,
}

/// How labels and images of the files are to be read.
#[derive(Clone, Copy, Debug)]
struct Convention {
    order: ImageOrder,
    /// Whether an offset is the place where the cable crosses the x axis, and not its distance.
    is_crossing: bool,
}

/// Errors on all touches of a file.
#[derive(Serialize)]
struct Row {
    touches: usize,
    offset_mm_median: f64,
    angle_deg_median: f64,
    offset_mm_of_moments: f64,
    angle_deg_of_moments: f64,
    offset_mm_of_mean: f64,
    angle_deg_of_mean: f64,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When the files cannot be read.
pub fn run(config: &RealEdges, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    progress("simulated touches", 0, 1);
    let simulated = simulate(config)?;
    let mut lines = Vec::new();
    for file in ["cable_pose_3_cable_with_forces", "cam_pose_not_mirrored"] {
        progress(file, 0, 1);
        let (touches, n_faint) = load(&config.data.join(format!("{file}.csv")))?;
        let mut order: Vec<usize> = (0..touches.len()).collect();
        let mut stream = Stream::new(config.seed, Purpose::ReadingChoice, 0);
        let mut shuffled = Vec::with_capacity(order.len());
        while !order.is_empty() {
            shuffled.push(touches[order.swap_remove(stream.index(order.len()))]);
        }
        let n_choosing = (CHOOSING * shuffled.len() as f64).ceil() as usize;
        let (choosing, judged) = shuffled.split_at(n_choosing);
        ensure!(!judged.is_empty(), "{file} has {} usable touches", shuffled.len());
        let convention = choose(config, &simulated, choosing);
        let known = read_as(&simulated, convention);
        let found: Vec<(f64, f64)> =
            judged.par_iter().map(|touch| recall(&known, touch, config.neighbours)).collect();
        let by_moments: Vec<(f64, f64)> =
            judged.iter().map(|touch| moments(touch, convention)).collect();
        let row = row(judged, &found, &by_moments);
        for (key, value) in [
            ("offset_mm", row.offset_mm_median),
            ("angle_deg", row.angle_deg_median),
            ("offset_mm_moments", row.offset_mm_of_moments),
            ("angle_deg_moments", row.angle_deg_of_moments),
            ("offset_mm_mean", row.offset_mm_of_mean),
            ("angle_deg_mean", row.angle_deg_of_mean),
            ("faint", n_faint as f64),
        ] {
            report.summarise(&format!("{key}_{file}"), value);
        }
        let order = format!("{:?}, crossing: {}", convention.order, convention.is_crossing);
        report.labelled(&[("file", file), ("convention", &order)], row);
        let points = judged.iter().zip(&found);
        let points = points.map(|(touch, (offset, _))| (touch.offset / MM, offset / MM));
        let mut points: Vec<(f64, f64)> = points.collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        lines.push(Line { name: file.to_owned(), points });
    }
    let (x, y) = ("labelled offset, mm".to_owned(), "found offset, mm".to_owned());
    let panel = Panel { title: "offset of a cable from one touch".to_owned(), x, y, lines };
    Ok(Outcome { report, plot: svg(&[panel]), pictures: Vec::new() })
}

/// Each pillar's share of the force.
fn shares(forces: &[f64]) -> Option<[f64; N]> {
    let total: f64 = forces.iter().map(|force| force.max(0.0)).sum();
    let share = |at: usize| forces[at].max(0.0) / total;
    (total > 0.0).then(|| std::array::from_fn(share))
}

/// Touches of a file (offsets in mm and angles in degrees there), and how many were too faint.
fn load(path: &Path) -> anyhow::Result<(Vec<Edge>, usize)> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| {
        let found = names.iter().position(|known| *known == name);
        found.with_context(|| format!("{} has no column {name}", path.display()))
    };
    let pillars: Vec<usize> =
        (0..N).map(|pillar| column(&format!("pil{pillar}_fz"))).collect::<anyhow::Result<_>>()?;
    let (position, angle) = (column("position")?, column("angle")?);
    let (mut touches, mut n_faint) = (Vec::new(), 0);
    for (number, line) in lines.enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let value = |column: usize| -> anyhow::Result<f64> {
            let cell = cells.get(column).context("a value is missing")?;
            cell.trim().parse().with_context(|| format!("{cell:?} is not a number"))
        };
        let touch = || -> anyhow::Result<Option<Edge>> {
            let forces: Vec<f64> =
                pillars.iter().map(|pillar| value(*pillar)).collect::<anyhow::Result<_>>()?;
            let is_faint = forces.iter().map(|force| force.max(0.0)).sum::<f64>() < FORCE_MIN;
            let shares = shares(&forces).filter(|_| !is_faint);
            let (offset, angle) = (value(position)? * MM, value(angle)? * DEG);
            Ok(shares.map(|shares| Edge { shares, offset, angle }))
        };
        match touch().with_context(|| format!("{}, line {}", path.display(), number + 2))? {
            Some(touch) => touches.push(touch),
            None => n_faint += 1,
        }
    }
    Ok((touches, n_faint))
}

fn conventions() -> impl Iterator<Item = Convention> {
    (0..16).map(|bits| Convention {
        order: ImageOrder {
            transposed: bits & 1 != 0,
            rows_reversed: bits & 2 != 0,
            cols_reversed: bits & 4 != 0,
        },
        is_crossing: bits & 8 != 0,
    })
}

/// Simulated touches as the file would have them.
fn read_as(simulated: &[Edge], convention: Convention) -> Vec<Edge> {
    let one = |touch: &Edge| {
        let sent = convention.order.of_driver(&touch.shares, SIDE, SIDE);
        let shares = std::array::from_fn(|at| sent[at]);
        let scale = if convention.is_crossing { 1.0 / touch.angle.cos() } else { 1.0 };
        Edge { shares, offset: scale * touch.offset, angle: touch.angle }
    };
    simulated.iter().map(one).collect()
}

/// The convention that explains these touches best.
fn choose(config: &RealEdges, simulated: &[Edge], touches: &[Edge]) -> Convention {
    let misfit = |convention: &Convention| {
        let known = read_as(simulated, *convention);
        let off = |touch: &Edge| {
            let (offset, angle) = recall(&known, touch, config.neighbours);
            (offset - touch.offset).abs() / MM + (angle - touch.angle).abs() / (5.0 * DEG)
        };
        mean(&touches.par_iter().map(off).collect::<Vec<_>>())
    };
    let all: Vec<Convention> = conventions().collect();
    let misfits: Vec<f64> = all.iter().map(misfit).collect();
    let best = (0..all.len()).min_by(|a, b| misfits[*a].total_cmp(&misfits[*b]));
    all[best.unwrap_or(0)]
}

/// Offset and angle of the simulated touches most like one.
fn recall(known: &[Edge], touch: &Edge, neighbours: usize) -> (f64, f64) {
    let apart = |other: &Edge| -> f64 {
        let pairs = other.shares.iter().zip(&touch.shares);
        // Roots of shares: Hellinger's distance.
        pairs.map(|(a, b)| (a.sqrt() - b.sqrt()).powi(2)).sum()
    };
    let mut nearest: Vec<(f64, usize)> =
        known.iter().enumerate().map(|(at, other)| (apart(other), at)).collect();
    let n = neighbours.min(nearest.len());
    nearest.select_nth_unstable_by(n - 1, |a, b| a.0.total_cmp(&b.0));
    let of = |value: &dyn Fn(&Edge) -> f64| {
        mean(&nearest[..n].iter().map(|(_, at)| value(&known[*at])).collect::<Vec<_>>())
    };
    (of(&|edge| edge.offset), of(&|edge| edge.angle))
}

/// Offset and angle from the centre and the second moments of the pressure.
fn moments(touch: &Edge, convention: Convention) -> (f64, f64) {
    let image = convention.order.row_major(&touch.shares, SIDE, SIDE);
    // The preset's distance of pillars.
    let pitch = 7.0 * MM;
    let place = |at: usize| DVec2::new((at % SIDE) as f64 - 1.0, (at / SIDE) as f64 - 1.0) * pitch;
    let center: DVec2 = (0..N).map(|at| image[at] * place(at)).sum();
    let (mut along, mut across) = (0.0, 0.0);
    for (at, share) in image.iter().enumerate() {
        let off = place(at) - center;
        along += share * (off.y * off.y - off.x * off.x);
        across += share * 2.0 * off.x * off.y;
    }
    let angle = 0.5 * across.atan2(along);
    let offset = center.x * angle.cos() - center.y * angle.sin();
    (if convention.is_crossing { offset / angle.cos() } else { offset }, angle)
}

fn row(judged: &[Edge], found: &[(f64, f64)], by_moments: &[(f64, f64)]) -> Row {
    let errors = |of: &[(f64, f64)], is_angle: bool| {
        let error = |(touch, (offset, angle)): (&Edge, &(f64, f64))| {
            if is_angle {
                (angle - touch.angle).abs() / DEG
            } else {
                (offset - touch.offset).abs() / MM
            }
        };
        median(&judged.iter().zip(of).map(error).collect::<Vec<_>>())
    };
    let means = (
        mean(&judged.iter().map(|touch| touch.offset).collect::<Vec<_>>()),
        mean(&judged.iter().map(|touch| touch.angle).collect::<Vec<_>>()),
    );
    let constant = vec![means; judged.len()];
    Row {
        touches: judged.len(),
        offset_mm_median: errors(found, false),
        angle_deg_median: errors(found, true),
        offset_mm_of_moments: errors(by_moments, false),
        angle_deg_of_moments: errors(by_moments, true),
        offset_mm_of_mean: errors(&constant, false),
        angle_deg_of_mean: errors(&constant, true),
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;

    #[test]
    fn touches_of_simulated_cables_are_recalled() {
        // A file of simulated touches, with another order of the pillars.
        let plain: RealEdges = defaults_with_data();
        let config = RealEdges { cables: 30, presses: 30, ..plain };
        let other = RealEdges { seed: 2, cables: 10, ..config.clone() };
        let order = ImageOrder { transposed: false, rows_reversed: true, cols_reversed: false };
        let felt = read_as(&simulate(&other).unwrap(), Convention { order, is_crossing: false });
        let mut text = (0..N).fold(String::new(), |mut text, pillar| {
            write!(text, "pil{pillar}_fz,").unwrap();
            text
        });
        text += "position,angle\n";
        for touch in &felt {
            touch.shares.iter().for_each(|share| write!(text, "{},", 10.0 * share).unwrap());
            writeln!(text, "{},{}", touch.offset / MM, touch.angle / DEG).unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        for file in ["cable_pose_3_cable_with_forces", "cam_pose_not_mirrored"] {
            std::fs::write(folder.path().join(format!("{file}.csv")), &text).unwrap();
        }
        let config = RealEdges { data: folder.path().to_owned(), ..config };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let figure = |key: &str| outcome.report.summary[&format!("{key}_cam_pose_not_mirrored")];
        assert!(
            figure("offset_mm") < 0.5 * figure("offset_mm_mean"),
            "{:?}",
            outcome.report.summary
        );
        assert!(
            figure("angle_deg") < 0.5 * figure("angle_deg_mean"),
            "{:?}",
            outcome.report.summary
        );
    }

    fn defaults_with_data() -> RealEdges {
        let data = PathBuf::new();
        RealEdges { data, seed: 1, cables: 100, presses: 60, neighbours: 15 }
    }

    #[test]
    fn a_file_without_a_column_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("touches.csv");
        std::fs::write(&path, "pil0_fz,position,angle\n1,2,3\n").unwrap();
        let error = format!("{:#}", load(&path).unwrap_err());
        assert!(error.contains("no column pil1_fz"), "{error}");
    }
}
