//! Sensors that were commissioned: touches of one reference body tell how a sensor of some world
//! differs from its description and where its tool centre is. Training then presses with what was
//! found, and readings are corrected by it.

use anyhow::Context as _;
use palpate_commissioning::commission::{Setup, commission};
use palpate_commissioning::passport::Passport;
use palpate_commissioning::touch::{PoseConvention, SentTouch};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{SensorDescription, SensorFamily};
use palpate_sim::press::PressSimulator;
use palpate_sim::shapes::reference_body;

use crate::objects::TestObject;
use crate::sensing::Sensing;

/// The reference body that is touched: it has no symmetry.
const BODY: &str = "reference_ridge";

/// Touches of the body.
const TOUCHES: usize = 20;

/// A sensor on a robot, commissioned.
pub(super) struct Commissioned<'a> {
    described: &'a SensorDescription,
    /// `true_from_sent`: what the robot takes for its sensor's pose, seen from the true one.
    true_from_sent: Pose,
    passport: Passport,
}

impl<'a> Commissioned<'a> {
    /// Touches the reference body at an unknown place, with a tool centre that is wrong by
    /// `offset` metres in a random direction.
    pub(super) fn new(
        described: &'a SensorDescription,
        sensing: &Sensing,
        offset: f64,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let mesh = reference_body(BODY).with_context(|| format!("there is no body {BODY}"))?;
        let body = TestObject { name: BODY.to_owned(), mesh };
        let mut stream = Stream::new(seed, Purpose::Commissioning, 0);
        let off = offset * stream.direction();
        let true_from_sent = Pose::from_parts(glam::DQuat::IDENTITY, off);
        let session_from_body =
            Pose::from_parts(stream.rotation(), stream.direction() * stream.uniform(0.2, 0.7));
        let touched = sensing.touch_all(std::slice::from_ref(&body), TOUCHES, seed)?.remove(0);
        let touches: Vec<SentTouch> = touched
            .iter()
            .map(|reading| sent(reading, session_from_body, true_from_sent, described))
            .collect();
        let object = PressSimulator::new(body.mesh, described.clone());
        let setup = Setup { object: &object, session_from_object: None, touches: &touches, seed };
        let passport = Passport::of(&commission(&setup)?, described);
        Ok(Self { described, true_from_sent, passport })
    }

    /// The sensors to train with.
    pub(super) fn family(&self) -> anyhow::Result<SensorFamily> {
        let pressing = self.passport.description(self.described)?;
        let open = self.passport.ranges(self.described);
        Ok(SensorFamily::measured(self.described.clone(), pressing, &open))
    }

    /// Readings, with `object_from_sensor` as pose, as they count: sent by the robot and
    /// corrected by the passport.
    pub(super) fn corrected(&self, readings: &[Vec<Reading>]) -> anyhow::Result<Vec<Vec<Reading>>> {
        let one = |reading: &Reading| {
            let touch = sent(reading, Pose::IDENTITY, self.true_from_sent, self.described);
            let SentTouch { pressures, position, quaternion } =
                self.passport.corrected(&touch, self.described);
            let pose = PoseConvention::STATED.read(position, quaternion);
            Reading::new(SensorId(0), self.described, &pressures, pose)
                .context("a corrected image fits its sensor")
        };
        readings.iter().map(|of_object| of_object.iter().map(one).collect()).collect()
    }
}

/// A touch as the robot sends it.
fn sent(
    reading: &Reading,
    session_from_object: Pose,
    true_from_sent: Pose,
    sensor: &SensorDescription,
) -> SentTouch {
    let (rows, cols) = (sensor.grid().rows, sensor.grid().cols);
    let image: Vec<Option<f64>> = reading
        .image()
        .pressures
        .iter()
        .zip(reading.missing())
        .map(|(pressure, is_missing)| (!is_missing).then_some(*pressure))
        .collect();
    let pressures = sensor.parameters().image_order.of_driver(&image, rows, cols);
    let sent = session_from_object * reading.session_from_sensor() * true_from_sent;
    let (position, quaternion) = PoseConvention::STATED.write(sent);
    SentTouch { pressures, position, quaternion }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::generated;
    use palpate_core::sensor::{Coupling, SensorParameters};
    use palpate_core::units::MM;
    use palpate_sim::shapes::LARGEST_DIMENSION;

    #[test]
    fn a_commissioned_sensor_sends_nearly_true_poses() {
        let described = SensorDescription::digitacts_6x6();
        let coupling = Coupling { margin: Some(0.0), ..Coupling::default() };
        let built = SensorParameters { coupling, ..described.parameters().clone() };
        let sensing = Sensing::with(SensorDescription::new(built).unwrap());
        let sensor = Commissioned::new(&described, &sensing, 3.0 * MM, 102).unwrap();
        let hammer = generated(&["hammer"], LARGEST_DIMENSION).unwrap();
        let felt = sensing.touch_all(&hammer, 5, 103).unwrap();
        let corrected = sensor.corrected(&felt).unwrap();
        for (felt, corrected) in felt[0].iter().zip(&corrected[0]) {
            let (is, was) = (corrected.session_from_sensor(), felt.session_from_sensor());
            assert!(is.distance_to(&was) < 0.7 * MM, "{} mm", is.distance_to(&was) / MM);
            let sent = was * sensor.true_from_sent;
            assert!(sent.distance_to(&was) > 2.9 * MM);
        }
        let mut stream = Stream::new(1, Purpose::SensorFamily, 0);
        let drawn = sensor.family().unwrap().draw(&mut stream);
        let margin = drawn.parameters().coupling.margin.unwrap();
        assert!(margin <= described.grid().pitch, "the covering ends with the array: {margin}");
    }
}
