//! Conventions in which the seven numbers of a pose may be meant.
//!
//! The API expects `session_from_sensor` in metres with quaternions x, y, z, w. Not here: finding
//! out which convention a driver uses.

use glam::{DQuat, DVec3};

use crate::pose::Pose;
use crate::units::{INCH, MM};

/// Unit of sent positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PositionUnit {
    /// Metres, as the API expects.
    Metre,
    /// Millimetres.
    Millimetre,
    /// Inches.
    Inch,
}

impl PositionUnit {
    /// Every unit.
    pub const ALL: [Self; 3] = [Self::Metre, Self::Millimetre, Self::Inch];

    /// Metres in one unit.
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => MM,
            Self::Inch => INCH,
        }
    }
}

/// Order of a sent quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuaternionOrder {
    /// x, y, z, w, as the API expects.
    Xyzw,
    /// w, x, y, z.
    Wxyz,
}

/// Frames between which a sent pose maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseDirection {
    /// `session_from_sensor`, as the API expects.
    SessionFromSensor,
    /// `sensor_from_session`: the inverse.
    SensorFromSession,
}

/// Meaning of the seven numbers of a sent pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoseConvention {
    /// Unit of the position.
    pub unit: PositionUnit,
    /// Order of the quaternion.
    pub quaternion: QuaternionOrder,
    /// Direction of the pose.
    pub direction: PoseDirection,
}

impl PoseConvention {
    /// The convention of the API.
    pub const STATED: Self = Self {
        unit: PositionUnit::Metre,
        quaternion: QuaternionOrder::Xyzw,
        direction: PoseDirection::SessionFromSensor,
    };

    /// Every convention, [`Self::STATED`] first.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut all = Vec::with_capacity(12);
        for direction in [PoseDirection::SessionFromSensor, PoseDirection::SensorFromSession] {
            for quaternion in [QuaternionOrder::Xyzw, QuaternionOrder::Wxyz] {
                for unit in PositionUnit::ALL {
                    all.push(Self { unit, quaternion, direction });
                }
            }
        }
        all
    }

    /// `session_from_sensor` of numbers sent in this convention, metres.
    #[must_use]
    pub fn read(&self, position: [f64; 3], quaternion: [f64; 4]) -> Pose {
        let [a, b, c, d] = quaternion;
        let rotation = match self.quaternion {
            QuaternionOrder::Xyzw => DQuat::from_xyzw(a, b, c, d),
            QuaternionOrder::Wxyz => DQuat::from_xyzw(b, c, d, a),
        };
        let position = DVec3::from_array(position) * self.unit.metres();
        let pose = Pose::from_parts(rotation, position);
        match self.direction {
            PoseDirection::SessionFromSensor => pose,
            PoseDirection::SensorFromSession => pose.inverse(),
        }
    }

    /// The inverse of [`Self::read`]: position and quaternion as sent in this convention.
    #[must_use]
    pub fn write(&self, session_from_sensor: Pose) -> ([f64; 3], [f64; 4]) {
        let pose = match self.direction {
            PoseDirection::SessionFromSensor => session_from_sensor,
            PoseDirection::SensorFromSession => session_from_sensor.inverse(),
        };
        let [x, y, z, w] = pose.rotation.to_array();
        let quaternion = match self.quaternion {
            QuaternionOrder::Xyzw => [x, y, z, w],
            QuaternionOrder::Wxyz => [w, x, y, z],
        };
        ((pose.translation / self.unit.metres()).to_array(), quaternion)
    }
}

#[cfg(test)]
mod tests {
    use crate::rng::{Purpose, Stream};

    use super::*;

    #[test]
    fn every_convention_reads_what_it_writes() {
        let mut stream = Stream::new(1, Purpose::ObjectPose, 0);
        for convention in PoseConvention::all() {
            let pose = Pose::from_parts(stream.rotation(), 0.3 * stream.direction());
            let (position, quaternion) = convention.write(pose);
            let read = convention.read(position, quaternion);
            assert!(read.distance_to(&pose) < 1e-12 && read.angle_to(&pose) < 1e-7);
        }
        assert_eq!(PoseConvention::all()[0], PoseConvention::STATED);
        assert_eq!(PoseConvention::all().len(), 12);
    }

    #[test]
    fn inches_w_first_and_inverted_are_undone_by_hand() {
        let meant = PoseConvention {
            unit: PositionUnit::Inch,
            quaternion: QuaternionOrder::Wxyz,
            direction: PoseDirection::SensorFromSession,
        };
        // No rotation, one inch along x: the inverse lies one inch the other way.
        let pose = meant.read([1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]);
        assert!((pose.translation.x + 0.0254).abs() < 1e-15);
        assert!(pose.angle_to(&Pose::IDENTITY) < 1e-12);
    }
}
