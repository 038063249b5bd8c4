//! Sensors that were commissioned: touches of one reference body tell how a sensor of some world
//! differs from its description and where its tool centre is. Training then presses with what was
//! found, and readings are corrected by it.

use anyhow::Context as _;
use glam::DQuat;
use palpate_commissioning::commission::{Setup, commission};
use palpate_commissioning::mistakes::Mistake;
use palpate_commissioning::passport::passport;
use palpate_commissioning::touch::SentTouch;
use palpate_core::convention::PoseConvention;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::correction::Correction;
use palpate_core::sensor::{SensorDescription, SensorFamily, SensorKnowledge, StatedRanges};
use palpate_core::stop::Stop;
use palpate_sim::press::PressSimulator;
use palpate_sim::shapes::reference_body;

use super::drake::Drake;
use super::worlds::World;
use crate::objects::TestObject;

/// The reference body that is touched: it has no symmetry.
const BODY: &str = "reference_ridge";

/// Touches of the body.
const TOUCHES: usize = 20;

/// The reference body as an object.
fn body() -> anyhow::Result<TestObject> {
    let mesh = reference_body(BODY).with_context(|| format!("there is no body {BODY}"))?;
    Ok(TestObject { name: BODY.to_owned(), mesh })
}

/// Touches of the reference body in a world.
pub(super) fn touches(world: &World, drake: &Drake, seed: u64) -> anyhow::Result<Vec<Reading>> {
    Ok(world.touch_all(drake, &[body()?], TOUCHES, seed)?.remove(0))
}

/// A sensor on a robot, commissioned.
pub(super) struct Commissioned {
    /// The error of the robot's tool centre.
    mistake: Mistake,
    /// The sensor as it was measured, by which readings are interpreted.
    pub(super) measured: SensorDescription,
    ranges: StatedRanges,
    correction: Correction,
}

impl Commissioned {
    /// Commissions by [`touches`] of the reference body at an unknown place, with a tool centre
    /// that is wrong by `offset` metres in a random direction.
    pub(super) fn new(
        described: &SensorDescription,
        touched: &[Reading],
        offset: f64,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let mut stream = Stream::new(seed, Purpose::Commissioning, 0);
        let tool = Pose::from_parts(DQuat::IDENTITY, -offset * stream.direction());
        let mistake = Mistake { tool, ..Mistake::none() };
        let session_from_body =
            Pose::from_parts(stream.rotation(), stream.direction() * stream.uniform(0.2, 0.7));
        let sent = |reading| mistake.sent(reading, session_from_body, described);
        let touches: Vec<SentTouch> = touched.iter().map(sent).collect();
        let object = PressSimulator::new(body()?.mesh, described.clone());
        let setup = Setup {
            object: &object,
            session_from_object: None,
            touches: &touches,
            seed,
            stop: &Stop::never(),
        };
        let found = passport(&commission(&setup)?, described);
        let (measured, ranges) = (found.description(described)?, found.ranges(described));
        let correction = Correction { passport: Some(found), ..Correction::default() };
        Ok(Self { mistake, measured, ranges, correction })
    }

    /// The sensors to train with.
    pub(super) fn family(&self) -> SensorFamily {
        let level = SensorKnowledge::DataSheet;
        SensorFamily::within(self.measured.clone(), level, &self.ranges)
    }

    /// Readings, with `object_from_sensor` as pose, as they count: sent by the robot and
    /// corrected by the passport.
    pub(super) fn corrected(&self, readings: &[Vec<Reading>]) -> anyhow::Result<Vec<Vec<Reading>>> {
        let one = |reading: &Reading| {
            let sent = self.mistake.sent(reading, Pose::IDENTITY, &self.measured);
            let pose = PoseConvention::STATED.read(sent.position, sent.quaternion);
            let (sensor, image) = (&self.measured, &sent.pressures);
            Reading::corrected(SensorId(0), sensor, &self.correction, image, pose)
                .context("a corrected image fits its sensor")
        };
        readings.iter().map(|of_object| of_object.iter().map(one).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::generated;
    use crate::sensing::Sensing;
    use palpate_core::sensor::{Coupling, SensorParameters};
    use palpate_core::units::MM;
    use palpate_sim::shapes::LARGEST_DIMENSION;

    #[test]
    fn a_commissioned_sensor_sends_nearly_true_poses() {
        let described = SensorDescription::digitacts_6x6();
        let coupling = Coupling { margin: Some(0.0), ..Coupling::default() };
        let built = SensorParameters { coupling, ..described.parameters().clone() };
        let sensing = Sensing::with(SensorDescription::new(built).unwrap());
        let touched = sensing.touch_all(&[body().unwrap()], TOUCHES, 102).unwrap().remove(0);
        let sensor = Commissioned::new(&described, &touched, 3.0 * MM, 102).unwrap();
        let hammer = generated(&["hammer"], LARGEST_DIMENSION).unwrap();
        let felt = sensing.touch_all(&hammer, 5, 103).unwrap();
        let corrected = sensor.corrected(&felt).unwrap();
        for (felt, corrected) in felt[0].iter().zip(&corrected[0]) {
            let (is, was) = (corrected.session_from_sensor(), felt.session_from_sensor());
            assert!(is.distance_to(&was) < 0.7 * MM, "{} mm", is.distance_to(&was) / MM);
            let sent = was * sensor.mistake.tool.inverse();
            assert!(sent.distance_to(&was) > 2.9 * MM);
        }
        let mut stream = Stream::new(1, Purpose::SensorFamily, 0);
        let drawn = sensor.family().draw(&mut stream);
        let margin = drawn.parameters().coupling.margin.unwrap();
        assert!(margin <= described.grid().pitch, "the covering ends with the array: {margin}");
    }
}
