//! Simulated touches of cables: cylinders under sensors of the preset's family.

use anyhow::{Context as _, ensure};
use glam::{DQuat, DVec2, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{Preset, SensorFamily, SensorKnowledge};
use palpate_core::units::{DEG, MM};
use palpate_sim::mesh::Mesh;
use palpate_sim::press::PressSimulator;
use rayon::prelude::*;

use super::{Edge, RealEdges, shares};

/// Half the length of a simulated cable, metres.
const HALF_LENGTH: f64 = 60.0 * MM;
/// Flat sides of a simulated cable.
const N_SIDES: usize = 48;
/// Simulated touches of cables, by sensors of the preset's family.
pub(super) fn simulate(config: &RealEdges) -> anyhow::Result<Vec<Edge>> {
    let preset = Preset::named("contactile-papillarray-3x3").context("the preset is missing")?;
    let (described, ranges) = (preset.description, preset.ranges);
    let family = SensorFamily::within(described, SensorKnowledge::DataSheet, &ranges);
    let cable = |number: usize| {
        let mut stream = Stream::new(config.seed, Purpose::SensorFamily, number as u64);
        let sensor = family.draw(&mut stream);
        let depth_max = 0.9 * sensor.parameters().covering_thickness;
        let radius = stream.uniform(1.0 * MM, 8.0 * MM);
        let simulator = PressSimulator::new(cylinder(radius)?, sensor);
        let mut touches = Vec::new();
        for _ in 0..config.presses {
            let offset = stream.uniform(-14.0 * MM, 14.0 * MM);
            let angle = stream.uniform(-60.0 * DEG, 60.0 * DEG);
            let height = radius - stream.uniform(0.1, 1.0) * depth_max;
            // The cable is along the object's y; the sensor looks down on it, turned and shifted.
            let turned =
                DQuat::from_rotation_x(std::f64::consts::PI) * DQuat::from_rotation_z(angle);
            let pose = Pose::from_parts(turned, DVec3::new(offset, 0.0, height));
            let pressures = simulator.pressures(&simulator.press(pose), &mut stream);
            // In the sensor's frame the cable is where the object's y axis is.
            let in_sensor = pose.inverse();
            let (along, middle) = (in_sensor.turn(DVec3::Y), in_sensor * DVec3::ZERO);
            touches.extend(edge(&pressures, middle.truncate(), along.truncate()));
        }
        Ok(touches)
    };
    let found: anyhow::Result<Vec<Vec<Edge>>> =
        (0..config.cables).into_par_iter().map(cable).collect();
    let found: Vec<Edge> = found?.into_iter().flatten().collect();
    ensure!(found.len() >= config.neighbours, "no cable was felt in simulation");
    Ok(found)
}

/// A touch of a line through a point in the sensor's plane; `None` if nothing was felt.
fn edge(pressures: &[f64], middle: DVec2, along: DVec2) -> Option<Edge> {
    let along = if along.y < 0.0 { -along } else { along };
    let across = DVec2::new(along.y, -along.x);
    let shares = shares(pressures)?;
    Some(Edge { shares, offset: middle.dot(across), angle: along.x.atan2(along.y) })
}

/// A cable along y about the origin.
fn cylinder(radius: f64) -> anyhow::Result<Mesh> {
    let mut vertices = vec![DVec3::new(0.0, -HALF_LENGTH, 0.0), DVec3::new(0.0, HALF_LENGTH, 0.0)];
    for side in 0..N_SIDES {
        let turn = std::f64::consts::TAU * side as f64 / N_SIDES as f64;
        for end in [-HALF_LENGTH, HALF_LENGTH] {
            vertices.push(DVec3::new(radius * turn.cos(), end, radius * turn.sin()));
        }
    }
    let at = |side: usize, end: usize| (2 + 2 * (side % N_SIDES) + end) as u32;
    let faces = |side: usize| {
        [
            [at(side, 0), at(side + 1, 0), at(side, 1)],
            [at(side, 1), at(side + 1, 0), at(side + 1, 1)],
            [0, at(side + 1, 0), at(side, 0)],
            [1, at(side, 1), at(side + 1, 1)],
        ]
    };
    Ok(Mesh::new(vertices, (0..N_SIDES).flat_map(faces).collect())?)
}
