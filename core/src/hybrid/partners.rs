//! Which earlier touches a new one is paired with.

use glam::Vec3;

use super::sighting::Sighting;

/// Where two bases may be so far apart (m) a pair of theirs is worth half of one of a single base.
const SHARP: f32 = 0.002;

/// The `n` earlier touches whose pair with the newest, the last, fixes a pose best: a long way
/// off, and with a normal that is not along the way.
pub(super) fn partners(touches: &[Sighting], n: usize) -> Vec<usize> {
    let [earlier @ .., newest] = touches else { return Vec::new() };
    let rate = |(index, touch): (usize, &Sighting)| {
        let offset = newest.position - touch.position;
        let distance = offset.length();
        let axis = offset / distance.max(1e-6);
        let across = |normal: Vec3| normal.cross(axis).length();
        let fixed = across(newest.normal).max(across(touch.normal));
        // A pair of two bases says less.
        let (position, _) = newest.looseness_to(touch);
        let sharp = SHARP / (SHARP + position.sqrt());
        (distance.min(0.05) * (0.1 + fixed) * sharp, index)
    };
    let mut rated: Vec<(f32, usize)> = earlier.iter().enumerate().map(rate).collect();
    rated.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    rated.into_iter().take(n).map(|(_, index)| index).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::hybrid::test_support::{places, seen};
    use crate::pose::Pose;
    use crate::surface::Touch;

    #[test]
    fn partners_are_far_and_face_across_the_way() {
        let at = |x: f64, normal: DVec3| {
            let position = DVec3::new(x, 0.0, 0.0);
            seen(&Touch { position, normal, ..places(1, 0).remove(0) }, &Pose::IDENTITY)
        };
        // 10 mm across: 0.010 · 1.1; 30 mm along: 0.030 · 0.1; 80 mm counts as 50: 0.050 · 1.1.
        let touches = [at(0.010, DVec3::Z), at(0.030, DVec3::X), at(0.080, DVec3::Y)];
        let newest = at(0.0, DVec3::X);
        let all = [touches.as_slice(), &[newest]].concat();
        assert_eq!(partners(&all, 2), [2, 0]);
        assert_eq!(partners(&all, 9), [2, 0, 1]);
        assert_eq!(partners(&all[..1], 2), [0; 0]);
    }
}
