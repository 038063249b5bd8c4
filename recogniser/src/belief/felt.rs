//! What a session is given: a press with its sensor, or a contact without an image, as touch and
//! space.

use glam::DVec3;
use palpate_core::reading::point_contact::PointContact;
use palpate_core::reading::{Base, Reading, SensorId};
use palpate_core::sensor::SensorDescription;

use crate::model::appearance::AppearanceSpace;
use crate::observe::press_space::{Miss, PressSpace};
use crate::observe::touch::{Touch, observe_contact, observe_touch};

/// A press with its sensor, or a contact without an image.
#[derive(Clone, Copy)]
pub(super) enum Given<'a> {
    Press(&'a Reading, &'a SensorDescription),
    Contact(&'a PointContact),
}

/// A sensor on a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tool {
    sensor: SensorId,
    robot: Option<u32>,
}

impl Given<'_> {
    /// The tool that pressed; `None` for a contact, which states its own place.
    pub(super) fn tool(&self) -> Option<Tool> {
        let Self::Press(reading, _) = self else { return None };
        let robot = reading.base().map(|base| base.robot);
        Some(Tool { sensor: reading.sensor(), robot })
    }

    /// The touch; `None` for a miss.
    pub(super) fn touch(&self, space: &AppearanceSpace) -> Option<Touch> {
        match self {
            Self::Press(reading, sensor) => observe_touch(reading, sensor, space),
            Self::Contact(contact) => observe_contact(contact),
        }
    }

    /// The robot's base, if its position is uncertain.
    pub(super) fn base(&self) -> Option<Base> {
        match self {
            Self::Press(reading, _) => reading.base(),
            Self::Contact(contact) => contact.base(),
        }
    }

    /// The space that a touch shows.
    pub(super) fn space_of_touch(&self, anchor: DVec3) -> PressSpace {
        match self {
            Self::Press(reading, sensor) => PressSpace::of_touch(reading, sensor, anchor),
            Self::Contact(_) => PressSpace::of_contact(),
        }
    }

    /// The miss, whose space follows once there is an anchor.
    pub(super) fn miss(&self) -> Miss {
        match *self {
            Self::Press(reading, sensor) => {
                Miss::Press { reading: reading.clone(), sensor: sensor.clone() }
            }
            Self::Contact(contact) => Miss::Contact(*contact),
        }
    }
}
