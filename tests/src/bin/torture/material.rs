//! Contents of the requests: touches of simulated boxes, meshes, indentations.

use std::ops::ControlFlow;

use anyhow::Context;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_sim::indent::indentation_run;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use serde_json::{Value, json};

/// Number of touches of each object to choose from.
const TOUCHES: usize = 120;

/// The objects that sessions recognise, with their edges in millimetres.
pub(crate) const TRAINED: [(&str, [f64; 3]); 2] =
    [("cube", [40.0, 40.0, 40.0]), ("bar", [80.0, 20.0, 20.0])];

/// Contents of all requests.
pub(crate) struct Material {
    /// Touches of each trained object in their wire form, without robot and seq.
    pub(crate) touches: Vec<Vec<Value>>,
    /// A calibration run of a sensor.
    pub(crate) indentations: Value,
}

impl Material {
    pub(crate) fn new() -> anyhow::Result<Self> {
        let touches: anyhow::Result<Vec<_>> =
            TRAINED.iter().map(|(_, size)| touches_of(*size)).collect();
        let run = indentation_run(&SensorDescription::digitacts_6x6(), 3);
        let response: Vec<Value> = run
            .response
            .iter()
            .map(|press| {
                json!({"row": press.taxel / 6, "col": press.taxel % 6, "depth": press.depth,
                    "pressures": press.pressures})
            })
            .collect();
        Ok(Self { touches: touches?, indentations: json!({ "response": response }) })
    }
}

/// A box as an OFF file in millimetres; `padding` makes the file longer without changing the box.
pub(crate) fn off_box([x, y, z]: [f64; 3], padding: usize) -> String {
    let mut file = String::from("OFF\n");
    for line in 0..padding {
        file += &format!("# {line}: nothing but room\n");
    }
    file += "8 6 0\n";
    for corner in 0..8 {
        let at = |bit: usize, edge: f64| if corner & bit == 0 { -edge / 2.0 } else { edge / 2.0 };
        file += &format!("{} {} {}\n", at(1, x), at(2, y), at(4, z));
    }
    file + "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n"
}

fn touches_of(size: [f64; 3]) -> anyhow::Result<Vec<Value>> {
    let mesh = Mesh::from_bytes(MeshFormat::Off, off_box(size, 0).as_bytes(), 1e-3)
        .context("the box is no mesh")?;
    let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    let config = SamplerConfig::for_simulator(&simulator);
    let mut go_on = |_, _| ControlFlow::Continue(());
    let readings = sample(&simulator, SensorId(1), TOUCHES, 77, &config, &mut go_on)
        .context("the box cannot be touched")?;
    let axis = glam::DVec3::new(0.3, -0.5, 0.8).normalize();
    let rotation = glam::DQuat::from_axis_angle(axis, 0.7);
    let session_from_object = Pose::from_parts(rotation, glam::DVec3::new(0.2, 0.1, 0.3));
    Ok(readings.iter().map(|reading| wire(&reading.moved_by(session_from_object))).collect())
}

fn wire(reading: &Reading) -> Value {
    let pose = reading.session_from_sensor();
    json!({
        "sensor": "digitacts-6x6",
        "pose": {
            "position": pose.translation.to_array(),
            "orientation": pose.rotation.to_array(),
        },
        "image": reading.image().pressures,
    })
}
