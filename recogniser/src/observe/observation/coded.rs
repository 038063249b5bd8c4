//! An observation as bytes, for work that others do.

use super::{Comparison, Observation};
use crate::coding::{Coded, NotWork};

impl Coded for Comparison {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { softness, density } = self;
        [*softness, *density].put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self { softness: Coded::take(from)?, density: Coded::take(from)? })
    }
}

impl Coded for Observation {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { position, normal, direction, elongation, session_from_sensor, .. } = self;
        let Self { weight, novelty, placement, off_object, steadiness, says, .. } = self;
        let Self { point_loss, feature, sharp, soft, .. } = self;
        [position, normal, direction].into_iter().for_each(|vector| vector.put(to));
        elongation.put(to);
        session_from_sensor.put(to);
        [*weight, *novelty].put(to);
        placement.put(to);
        off_object.put(to);
        steadiness.put(to);
        says.put(to);
        point_loss.put(to);
        feature.put(to);
        sharp.put(to);
        soft.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self {
            position: Coded::take(from)?,
            normal: Coded::take(from)?,
            direction: Coded::take(from)?,
            elongation: Coded::take(from)?,
            session_from_sensor: Coded::take(from)?,
            weight: Coded::take(from)?,
            novelty: Coded::take(from)?,
            placement: Coded::take(from)?,
            off_object: Coded::take(from)?,
            steadiness: Coded::take(from)?,
            says: Coded::take(from)?,
            point_loss: Coded::take(from)?,
            feature: Coded::take(from)?,
            sharp: Coded::take(from)?,
            soft: Coded::take(from)?,
        })
    }
}
