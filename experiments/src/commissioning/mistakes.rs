//! Mistakes of a set-up: what a robot's driver does to touches before it sends them.

use glam::DQuat;
use palpate_commissioning::commission::{ORDERS, PressureUnit};
use palpate_commissioning::touch::{
    PoseConvention, PoseDirection, PositionUnit, QuaternionOrder, SentTouch,
};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::Stream;
use palpate_core::sensor::{ImageOrder, SensorDescription};
use palpate_core::units::{DEG, MM};

/// Largest errors of a tool centre that are drawn: offset (m) and turn (rad).
const TOOL_OFFSET: f64 = 5.0 * MM;
const TOOL_TURN: f64 = 5.0 * DEG;

/// A kind of mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    PressureUnit,
    PositionUnit,
    Mirror,
    Transposition,
    Rotation,
    QuaternionOrder,
    InvertedPose,
    ToolCenter,
}

impl Kind {
    pub(super) const ALL: [Self; 8] = [
        Self::PressureUnit,
        Self::PositionUnit,
        Self::Mirror,
        Self::Transposition,
        Self::Rotation,
        Self::QuaternionOrder,
        Self::InvertedPose,
        Self::ToolCenter,
    ];

    /// Name of the figure that states how often it is found.
    pub(super) fn figure(self) -> &'static str {
        match self {
            Self::PressureUnit => "found_pressure_unit",
            Self::PositionUnit => "found_position_unit",
            Self::Mirror => "found_mirror",
            Self::Transposition => "found_transposition",
            Self::Rotation => "found_rotation",
            Self::QuaternionOrder => "found_quaternion_order",
            Self::InvertedPose => "found_inverted_pose",
            Self::ToolCenter => "found_tool_center",
        }
    }

    fn is_of_images(self) -> bool {
        matches!(self, Self::Mirror | Self::Transposition | Self::Rotation)
    }
}

/// A set-up as it is, unlike what its description states.
#[derive(Clone, Debug)]
pub(super) struct Mistake {
    pub(super) kinds: Vec<Kind>,
    pub(super) pressure: PressureUnit,
    pub(super) convention: PoseConvention,
    pub(super) order: ImageOrder,
    /// `sent_from_true` sensor.
    pub(super) tool: Pose,
}

impl Mistake {
    /// A set-up with `n` different mistakes; two orders of one image would be a third one.
    pub(super) fn draw(n: usize, stream: &mut Stream) -> Self {
        let mut kinds: Vec<Kind> = Vec::new();
        while kinds.len() < n {
            let kind = Kind::ALL[stream.index(Kind::ALL.len())];
            let is_one_too_many = kind.is_of_images() && kinds.iter().any(|k| k.is_of_images());
            if !kinds.contains(&kind) && !is_one_too_many {
                kinds.push(kind);
            }
        }
        let mut mistake = Self {
            kinds: kinds.clone(),
            pressure: PressureUnit::Pascal,
            convention: PoseConvention::STATED,
            order: ORDERS[0],
            tool: Pose::IDENTITY,
        };
        for kind in kinds {
            mistake.make(kind, stream);
        }
        mistake
    }

    fn make(&mut self, kind: Kind, stream: &mut Stream) {
        // Codes of `ORDERS`: 1 and 2 reverse rows and columns, 4 transposes.
        let mut order = |codes: &[usize]| ORDERS[codes[stream.index(codes.len())]];
        match kind {
            Kind::Mirror => self.order = order(&[1, 2]),
            Kind::Transposition => self.order = order(&[4, 7]),
            Kind::Rotation => self.order = order(&[3, 5, 6]),
            Kind::PressureUnit => {
                let units = [
                    PressureUnit::Kilopascal,
                    PressureUnit::Bar,
                    PressureUnit::Psi,
                    PressureUnit::NewtonPerTaxel,
                    PressureUnit::Counts { bits: 8 },
                ];
                self.pressure = units[stream.index(units.len())];
            }
            Kind::PositionUnit => {
                let units = [PositionUnit::Millimetre, PositionUnit::Inch];
                self.convention.unit = units[stream.index(2)];
            }
            Kind::QuaternionOrder => self.convention.quaternion = QuaternionOrder::Wxyz,
            Kind::InvertedPose => self.convention.direction = PoseDirection::SensorFromSession,
            Kind::ToolCenter => {
                let turn = stream.direction() * stream.uniform(0.0, TOOL_TURN);
                let offset = stream.direction() * stream.uniform(1.0 * MM, TOOL_OFFSET);
                self.tool = Pose::from_parts(DQuat::from_scaled_axis(turn), offset);
            }
        }
    }

    /// A touch as this set-up sends it; the reading's pose is `object_from_sensor`.
    pub(super) fn sent(
        &self,
        reading: &Reading,
        session_from_object: Pose,
        sensor: &SensorDescription,
    ) -> SentTouch {
        let pascals = self.pressure.pascals(sensor);
        let (rows, cols) = (sensor.grid().rows, sensor.grid().cols);
        let unit = |pressure: &f64| Some(pressure / pascals);
        let image: Vec<Option<f64>> = reading.image().pressures.iter().map(unit).collect();
        let pressures = self.order.of_driver(&image, rows, cols);
        let true_pose = session_from_object * reading.session_from_sensor();
        let sent_pose = true_pose * self.tool.inverse();
        let (position, quaternion) = self.convention.write(sent_pose);
        SentTouch { pressures, position, quaternion }
    }
}
