//! Mistakes of a set-up: what a robot's driver does to touches before it sends them.

use glam::DQuat;
use palpate_core::convention::{PoseConvention, PoseDirection, PositionUnit, QuaternionOrder};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::Stream;
use palpate_core::sensor::{ImageOrder, SensorDescription};
use palpate_core::units::{DEG, MM};

use crate::commission::{ORDERS, PressureUnit};
use crate::touch::SentTouch;

/// Largest errors of a tool centre that are drawn: offset (m) and turn (rad).
const TOOL_OFFSET: f64 = 5.0 * MM;
const TOOL_TURN: f64 = 5.0 * DEG;

/// A kind of mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Pressures in another unit.
    PressureUnit,
    /// Positions in another unit.
    PositionUnit,
    /// Images with reversed rows or columns.
    Mirror,
    /// Transposed images.
    Transposition,
    /// Rotated images.
    Rotation,
    /// Quaternions with w first.
    QuaternionOrder,
    /// Inverted poses.
    InvertedPose,
    /// A tool centre that is off by a few millimetres and degrees.
    ToolCenter,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 8] = [
        Self::PressureUnit,
        Self::PositionUnit,
        Self::Mirror,
        Self::Transposition,
        Self::Rotation,
        Self::QuaternionOrder,
        Self::InvertedPose,
        Self::ToolCenter,
    ];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PressureUnit => "pressure-unit",
            Self::PositionUnit => "position-unit",
            Self::Mirror => "mirror",
            Self::Transposition => "transposition",
            Self::Rotation => "rotation",
            Self::QuaternionOrder => "quaternion-order",
            Self::InvertedPose => "inverted-pose",
            Self::ToolCenter => "tool-center",
        }
    }

    fn is_of_images(self) -> bool {
        matches!(self, Self::Mirror | Self::Transposition | Self::Rotation)
    }
}

/// A set-up as it is, unlike what its description states.
#[derive(Clone, Debug)]
pub struct Mistake {
    /// What is wrong.
    pub kinds: Vec<Kind>,
    /// Unit of the pressures.
    pub pressure: PressureUnit,
    /// Convention of the poses.
    pub convention: PoseConvention,
    /// Order of the images.
    pub order: ImageOrder,
    /// `sent_from_true` sensor.
    pub tool: Pose,
}

impl Mistake {
    /// A set-up without a mistake.
    #[must_use]
    pub fn none() -> Self {
        Self {
            kinds: Vec::new(),
            pressure: PressureUnit::Pascal,
            convention: PoseConvention::STATED,
            order: ORDERS[0],
            tool: Pose::IDENTITY,
        }
    }

    /// A set-up with `n` different mistakes; two orders of one image would be a third one.
    #[must_use]
    pub fn draw(n: usize, stream: &mut Stream) -> Self {
        let mut kinds: Vec<Kind> = Vec::new();
        while kinds.len() < n {
            let kind = Kind::ALL[stream.index(Kind::ALL.len())];
            let is_one_too_many = kind.is_of_images() && kinds.iter().any(|k| k.is_of_images());
            if !kinds.contains(&kind) && !is_one_too_many {
                kinds.push(kind);
            }
        }
        Self::of(&kinds, stream)
    }

    /// A set-up with these mistakes, their sizes drawn.
    #[must_use]
    pub fn of(kinds: &[Kind], stream: &mut Stream) -> Self {
        let mut mistake = Self { kinds: kinds.to_vec(), ..Self::none() };
        for kind in kinds {
            mistake.make(*kind, stream);
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
    #[must_use]
    pub fn sent(
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
