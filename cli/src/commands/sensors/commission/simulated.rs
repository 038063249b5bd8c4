//! Simulated touches of a known object by a driver with mistakes: no robot is needed to see how
//! commissioning goes.

use std::ops::ControlFlow;

use anyhow::Context as _;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use palpate_client::Client;
use palpate_client::schemas::{CommissioningReading, MeshFormat, Pose as WirePose, Sensor};
use palpate_commissioning::mistakes::{Kind, Mistake};
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{SensorFamily, SensorKnowledge};
use palpate_sim::mesh::{self, Mesh};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes;

use super::Touched;
use crate::commands::calibrate;

/// Parser of a mistake's name.
pub(super) fn mistake_kind() -> impl TypedValueParser<Value = Kind> {
    let named = |name: String| Kind::ALL.into_iter().find(|kind| kind.name() == name);
    PossibleValuesParser::new(Kind::ALL.map(Kind::name))
        .try_map(move |name| named(name).ok_or("is not a mistake"))
}

/// The mesh of the touched thing, metres.
pub(super) async fn mesh(client: &Client, touched: &Touched) -> anyhow::Result<Mesh> {
    let name = match touched {
        Touched::Body(body) => {
            let mesh = shapes::reference_body(&format!("reference_{}", body.name()));
            return mesh.context("the reference body is not known to this command");
        }
        Touched::Object(name) => name,
    };
    let info = client.object(name).await?.mesh;
    let info = info.with_context(|| format!("the object {name} has no mesh to touch"))?;
    let file = client.mesh(name).await?;
    let format = match info.format {
        MeshFormat::Stl => mesh::MeshFormat::Stl,
        MeshFormat::Obj => mesh::MeshFormat::Obj,
        MeshFormat::Ply => mesh::MeshFormat::Ply,
        MeshFormat::Off => mesh::MeshFormat::Off,
        MeshFormat::Glb => mesh::MeshFormat::Glb,
        MeshFormat::ThreeMf => mesh::MeshFormat::ThreeMf,
    };
    Ok(Mesh::from_bytes(format, &file, info.unit.metres())?)
}

/// Touches by a sensor of the family of a data sheet, as a driver with these mistakes sends them.
pub(super) fn touches(
    mesh: Mesh,
    sensor: &Sensor,
    mistakes: &[Kind],
    n: usize,
    seed: u64,
) -> anyhow::Result<Vec<CommissioningReading>> {
    let mut stream = Stream::new(seed, Purpose::Commissioning, 3);
    let description = calibrate::description(sensor)?;
    let family = SensorFamily::new(description.clone(), SensorKnowledge::DataSheet);
    let described = PressSimulator::new(mesh, description);
    let built = described.with_sensor(family.draw(&mut stream), &mut stream);
    let config = SamplerConfig::for_simulator(&built);
    let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let readings = sample(&built, SensorId(0), n, stream.bits(), &config, &mut go_on)?;
    let session_from_object =
        Pose::from_parts(stream.rotation(), stream.direction() * stream.uniform(0.2, 0.7));
    let mistake = Mistake::of(mistakes, &mut stream);
    let one = |reading| {
        let sent = mistake.sent(reading, session_from_object, described.sensor());
        let pose = WirePose { position: sent.position, orientation: sent.quaternion };
        CommissioningReading { image: sent.pressures, pose }
    };
    Ok(readings.iter().map(one).collect())
}
