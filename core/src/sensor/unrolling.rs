//! Unrolling: the image of a press by taxels that are not on a grid.
//!
//! Values are drawn on a plane: that of a flat layout, or for a curved skin the one that touches it
//! at the centre of pressure, with distances measured along the skin. So a fingertip that touches
//! with its side gives the image and the pose of the patch that touched. Drawing between taxels
//! loses detail; [`Layout::resampling_loss`] says how much.

use glam::{DQuat, DVec2, DVec3};

use super::layout::{Drawing, Layout, SEEN_COSINE, Taxel, along_skin, arc, mean_normal, place_in};
use crate::pose::Pose;

/// Share of the largest pressure above which a taxel belongs to the contact. Source: section 5.4.2.
const CONTACT_SHARE: f64 = 0.5;

/// Standard deviation of the weights with which a place of the image takes values of taxels, in
/// pitches. Chosen: a taxel at the place itself has 98 % of the weight on a square layout, and one
/// half-way between two has half of each.
const WEIGHT_DEVIATION: f64 = 0.3;

/// Distance of a place from the nearest taxel beyond which it is not on the skin, in pitches.
/// Chosen: within a square of four taxels no place is further from one.
const REACH: f64 = 1.0;

/// Deviation of the contact with which the loss is measured, in pitches. Chosen: the smallest that
/// taxels can show.
const CONTACT_DEVIATION: f64 = 1.0;

/// A press drawn as an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Unrolled {
    /// Row-major on the layout's grid; `None` where all taxels about are missing, 0 where there is
    /// no skin.
    pub image: Vec<Option<f64>>,
    /// The pose of the image: z = 0 is the skin in its middle, +z out of it.
    pub sensor_from_image: Pose,
}

impl Layout {
    /// The image of values in the order of the taxels. A press whose values are all at most
    /// `floor` is one of nothing; a curved skin shows it on the plane of its middle.
    ///
    /// # Panics
    /// When there is not a value a taxel.
    #[must_use]
    pub fn unroll(&self, values: &[Option<f64>], floor: f64) -> Unrolled {
        assert_eq!(values.len(), self.taxels().len(), "a layout has a value a taxel");
        let plane = match self.drawing() {
            Drawing::AsIs => {
                return Unrolled { image: values.to_vec(), sensor_from_image: Pose::IDENTITY };
            }
            Drawing::OnPlane(plane) => plane,
            Drawing::AtContact => self.plane_at_contact(values, floor),
        };
        let places = self.on_plane(&plane);
        let value = |index: usize| {
            let place = place_in(self.grid(), index).truncate();
            self.drawn(&places, values, place)
        };
        let image = (0..self.grid().n_taxels()).map(value).collect();
        Unrolled { image, sensor_from_image: plane }
    }

    /// What drawing on a grid loses of a contact of a pitch's deviation: root mean square of what
    /// taxels read less what the image has at their places, over that of what they read.
    #[must_use]
    pub fn resampling_loss(&self) -> f64 {
        let (mut lost, mut whole) = (0.0, 0.0);
        let reach = 2.0 * (CONTACT_DEVIATION * self.grid().pitch).powi(2);
        for center in self.taxels() {
            let read = |taxel: &Taxel| (-along_skin(center, taxel).powi(2) / reach).exp();
            let values: Vec<Option<f64>> = self.taxels().iter().map(|t| Some(read(t))).collect();
            let drawn = self.unroll(&values, 0.0);
            let places = self.on_plane(&drawn.sensor_from_image);
            for (value, (index, place)) in values.iter().zip(places.iter().enumerate()) {
                let (Some(place), value) = (place, value.unwrap_or(0.0)) else { continue };
                let shown = match self.drawing() {
                    // The image has the value at the grid's place instead of the taxel's own.
                    Drawing::AsIs => {
                        let own = place_in(self.grid(), index).distance(center.position);
                        (-own.powi(2) / reach).exp()
                    }
                    _ => self.shown(&drawn.image, *place),
                };
                lost += (value - shown).powi(2);
                whole += value * value;
            }
        }
        (lost / whole).sqrt()
    }

    /// The plane that touches the skin at the centre of pressure, or in the middle of the skin.
    fn plane_at_contact(&self, values: &[Option<f64>], floor: f64) -> Pose {
        let largest = values.iter().flatten().copied().fold(0.0, f64::max);
        let pressed = |value: &Option<f64>| {
            let value = value.unwrap_or(0.0);
            if largest > floor { (value - CONTACT_SHARE * largest).max(0.0) } else { 0.0 }
        };
        let weights: Vec<f64> = values.iter().map(pressed).collect();
        let total: f64 = weights.iter().sum();
        let all = self.taxels();
        if total <= 0.0 {
            return plane_about(all, &vec![1.0; all.len()], self.radius());
        }
        // Of a skin pressed on both sides, the side that is pressed more.
        let most = (0..all.len()).max_by(|a, b| weights[*a].total_cmp(&weights[*b])).unwrap_or(0);
        let seen = |index: usize| all[index].normal.dot(all[most].normal) > SEEN_COSINE;
        let weights: Vec<f64> =
            (0..all.len()).map(|index| if seen(index) { weights[index] } else { 0.0 }).collect();
        plane_about(all, &weights, self.radius())
    }

    /// Places of the taxels on a plane, metres, by their distance along the skin; `None` for those
    /// of another side.
    fn on_plane(&self, sensor_from_image: &Pose) -> Vec<Option<DVec2>> {
        let normal = sensor_from_image.turn(DVec3::Z);
        let image_from_sensor = sensor_from_image.inverse();
        let place = |taxel: &Taxel| {
            if taxel.normal.dot(normal) <= SEEN_COSINE {
                return None;
            }
            let off = image_from_sensor * taxel.position;
            let along = arc(off.length(), taxel.normal.angle_between(normal));
            Some(along * off.truncate().normalize_or_zero())
        };
        self.taxels().iter().map(place).collect()
    }

    /// The value at a place of the image.
    fn drawn(&self, places: &[Option<DVec2>], values: &[Option<f64>], at: DVec2) -> Option<f64> {
        let pitch = self.grid().pitch;
        let (mut sum, mut weight) = (0.0, 0.0);
        let mut is_skin = false;
        for (place, value) in places.iter().zip(values) {
            let Some(place) = place else { continue };
            let apart = place.distance(at) / pitch;
            if apart > 3.0 * REACH {
                continue;
            }
            is_skin |= apart <= REACH;
            if let Some(value) = value
                && apart <= 1.5 * REACH
            {
                let w = weight_at(apart);
                sum += w * value;
                weight += w;
            }
        }
        match (is_skin, weight > 0.0) {
            (false, _) => Some(0.0),
            (true, true) => Some(sum / weight),
            (true, false) => None,
        }
    }

    /// The value that an image shows at a place.
    fn shown(&self, image: &[Option<f64>], at: DVec2) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (index, value) in image.iter().enumerate() {
            let place = place_in(self.grid(), index).truncate();
            let w = weight_at(place.distance(at) / self.grid().pitch);
            sum += w * value.unwrap_or(0.0);
            weight += w;
        }
        if weight > 0.0 { sum / weight } else { 0.0 }
    }
}

fn weight_at(apart: f64) -> f64 {
    (-0.5 * (apart / WEIGHT_DEVIATION).powi(2)).exp()
}

/// The plane that touches a skin in the weighted middle of taxels.
fn plane_about(taxels: &[Taxel], weights: &[f64], radius: f64) -> Pose {
    let total: f64 = weights.iter().sum();
    let mean = |of: &dyn Fn(&Taxel) -> DVec3| {
        taxels.iter().zip(weights).map(|(taxel, w)| *w * of(taxel)).sum::<DVec3>() / total
    };
    let (middle, tilted) = (mean(&|taxel| taxel.position), mean(&|taxel| taxel.normal));
    let normal = tilted.normalize_or(mean_normal(taxels).normalize_or(DVec3::Z));
    // The mean of points of a sphere lies below it, by what the mean of their normals lacks to 1.
    let sunk = if radius.is_finite() { radius * (1.0 - tilted.length()).max(0.0) } else { 0.0 };
    Pose::from_parts(DQuat::from_rotation_arc(DVec3::Z, normal), middle + sunk * normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::grid::TaxelGrid;
    use crate::units::MM;

    /// `n` rings of taxels on a half sphere of radius 8 mm about (0, 0, −8 mm).
    fn dome(n: usize) -> Layout {
        let mut taxels = Vec::new();
        for ring in 0..n {
            let (tilt, count) = (ring as f64 * 0.4, if ring == 0 { 1 } else { 6 * ring });
            for index in 0..count {
                let turn = std::f64::consts::TAU * index as f64 / count as f64;
                let normal =
                    DVec3::new(tilt.sin() * turn.cos(), tilt.sin() * turn.sin(), tilt.cos());
                let position = 8.0 * MM * (normal - DVec3::Z);
                taxels.push(Taxel { position, normal, width: 2.0 * MM });
            }
        }
        Layout::list(taxels).unwrap()
    }

    fn pressed_about(layout: &Layout, normal: DVec3) -> Vec<Option<f64>> {
        let value =
            |taxel: &Taxel| Some(1e4 * (-(taxel.normal - normal).length_squared() * 8.0).exp());
        layout.taxels().iter().map(value).collect()
    }

    #[test]
    fn a_contact_on_the_side_is_seen_from_there() {
        let layout = dome(4);
        assert!((layout.radius() - 8.0 * MM).abs() < 1e-9, "{}", layout.radius());
        for tilt in [0.0, 0.3, 0.6_f64] {
            let normal = DVec3::new(tilt.sin(), 0.0, tilt.cos());
            let drawn = layout.unroll(&pressed_about(&layout, normal), 100.0);
            let facing = drawn.sensor_from_image.turn(DVec3::Z);
            assert!(facing.angle_between(normal) < 0.1, "{tilt}: {facing}");
            let on_skin = 8.0 * MM * (facing - DVec3::Z);
            assert!(drawn.sensor_from_image.translation.distance(on_skin) < 0.15 * MM);
            let image: Vec<f64> = drawn.image.iter().map(|value| value.unwrap()).collect();
            let most = (0..image.len()).max_by(|a, b| image[*a].total_cmp(&image[*b])).unwrap();
            let place = place_in(layout.grid(), most);
            assert!(place.length() <= 1.5 * layout.grid().pitch, "{tilt}: {place}");
        }
    }

    #[test]
    fn a_press_of_nothing_is_seen_from_the_middle() {
        let layout = dome(3);
        let drawn = layout.unroll(&vec![Some(50.0); layout.taxels().len()], 100.0);
        assert!(drawn.sensor_from_image.turn(DVec3::Z).angle_between(DVec3::Z) < 1e-9);
    }

    #[test]
    fn a_square_list_is_its_own_image() {
        let grid = TaxelGrid { rows: 3, cols: 4, pitch: 2.0 * MM, taxel_width: 1.8 * MM };
        let taxel = |index| Taxel {
            position: place_in(&grid, index) + DVec3::new(3.0 * MM, 0.0, 0.0),
            normal: DVec3::Z,
            width: 1.8 * MM,
        };
        let layout = Layout::list((0..12).map(taxel).collect()).unwrap();
        assert_eq!((layout.grid().rows, layout.grid().cols), (3, 4));
        let values: Vec<Option<f64>> = (0..12).map(|n| Some(f64::from(n * n))).collect();
        let drawn = layout.unroll(&values, 0.0);
        assert!(drawn.sensor_from_image.translation.distance(DVec3::X * 3.0 * MM) < 1e-8);
        for (value, shown) in values.iter().zip(&drawn.image) {
            assert!((value.unwrap() - shown.unwrap()).abs() < 2.0, "{value:?} {shown:?}");
        }
        assert!(layout.resampling_loss() < 0.03, "{}", layout.resampling_loss());
    }

    #[test]
    fn what_a_coarser_drawing_loses_is_stated() {
        // Taxels of a hexagonal layout are up to half a pitch from the places of a square grid.
        let at = |index: usize| {
            let (row, col) = (index / 5, index % 5);
            let shift = if row % 2 == 1 { 0.5 } else { 0.0 };
            DVec3::new(col as f64 + shift, row as f64 * 0.75_f64.sqrt(), 0.0) * 2.0 * MM
        };
        let taxel = |index| Taxel { position: at(index), normal: DVec3::Z, width: 1.0 * MM };
        let hexagonal = Layout::list((0..25).map(taxel).collect()).unwrap();
        let loss = hexagonal.resampling_loss();
        assert!((0.03..0.3).contains(&loss), "{loss}");
    }

    #[test]
    fn missing_taxels_leave_a_gap_only_without_neighbours() {
        let layout = dome(3);
        let mut values = pressed_about(&layout, DVec3::Z);
        values[1] = None;
        let drawn = layout.unroll(&values, 100.0);
        assert!(drawn.image.iter().all(Option::is_some), "neighbours fill one");
        values[..7].fill(None);
        let drawn = layout.unroll(&values, 100.0);
        assert!(drawn.image.iter().any(Option::is_none), "nothing fills the middle");
    }

    #[test]
    fn beyond_the_rim_there_is_no_skin() {
        let layout = dome(3);
        let rim = DVec3::new(0.8_f64.sin(), 0.0, 0.8_f64.cos());
        let all = vec![Some(1e3); layout.taxels().len()];
        let pressed = pressed_about(&layout, rim);
        let values: Vec<Option<f64>> =
            all.iter().zip(&pressed).map(|(a, b)| Some(a.unwrap() + b.unwrap())).collect();
        let drawn = layout.unroll(&values, 100.0);
        let off_skin = drawn.image.iter().filter(|value| **value == Some(0.0)).count();
        assert!((1..drawn.image.len() / 2).contains(&off_skin), "{off_skin}");
    }
}
