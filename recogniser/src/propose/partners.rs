//! Partners: the earlier touches with which a new one is paired, and the order of the pairs.
//!
//! Beyond the dissertation, which notes that not all pairs have to be used (section 5.6.5). A
//! pair that is rare on the objects proposes few poses and costs little to look up.

use glam::Vec3;

use super::effort::Effort;
use crate::observe::observation::{Observation, Says};
use crate::options::SurfaceOptions;

/// Deviation (m) between two touches that halves the worth of their pair.
const SHARP: f32 = 0.002;

/// Distance (m) beyond which a longer pair determines a pose no better.
const FAR: f32 = 0.05;

/// Worth of a pair whose normals both lie along its axis, beside 1 for one at right angles.
const ALONG: f32 = 0.1;

/// The `n` earlier touches whose pair with the newest one (the last) determines a pose best:
/// distant, and with a normal that is not along the axis.
pub(crate) fn partners(touches: &[Observation], n: usize) -> Vec<usize> {
    let [earlier @ .., newest] = touches else { return Vec::new() };
    let rate = |(index, touch): (usize, &Observation)| {
        let offset = newest.position - touch.position;
        let distance = offset.length();
        let axis = offset / distance.max(1e-6);
        let across = |normal: Vec3| normal.cross(axis).length();
        let fixed = across(newest.normal).max(across(touch.normal));
        // A pair from two robots with inexact bases is less informative.
        let (position, _) = newest.looseness_to(touch);
        let sharp = SHARP / (SHARP + position.sqrt());
        // One of two touches of a place is partner enough.
        (distance.min(FAR) * (ALONG + fixed) * sharp * touch.novelty, index)
    };
    // A pair without both normals says nothing.
    let has_normal = |touch: &Observation| touch.says != Says::Position;
    let paired = earlier.iter().enumerate().filter(|(_, touch)| has_normal(touch));
    let mut rated: Vec<(f32, usize)> = paired.filter(|_| has_normal(newest)).map(rate).collect();
    rated.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    rated.into_iter().take(n).map(|(_, index)| index).collect()
}

/// An earlier touch with which the newest is paired.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Partner {
    /// Index among the touches.
    pub(crate) index: usize,
    /// The effort of the pair.
    pub(crate) effort: Effort,
}

/// The partners in the order of their lookup. `shares` has for each the share of an object's
/// pairs with about the observed geometry (catalogue mean), if known: then the rarest pair comes
/// first, and the list ends where the budget of stored pairs
/// ([`ManyBudget::visited_in_all`](crate::options::ManyBudget::visited_in_all)) is spent, but
/// has at least one partner.
pub(crate) fn in_turn(
    partners: &[usize],
    shares: Option<&[f32]>,
    n_touches: usize,
    options: &SurfaceOptions,
) -> Vec<Partner> {
    let Some(shares) = shares else {
        let effort = Effort::new(options, None, n_touches);
        return partners.iter().map(|index| Partner { index: *index, effort }).collect();
    };
    let shares = shares.iter().copied();
    let mut rarest: Vec<(f32, usize)> = shares.zip(partners.iter().copied()).collect();
    // A stable sort: among equally rare pairs the better partner comes first.
    rarest.sort_by(|a, b| a.0.total_cmp(&b.0));
    let many = &options.budget.many;
    let (mut asked, mut visited) = (Vec::with_capacity(rarest.len()), 0.0);
    for (share, index) in rarest {
        let effort = Effort::new(options, Some(share), n_touches);
        // n patches have about n² pairs.
        visited += (effort.patches.min(many.paired) as f32).powi(2) * share;
        if !asked.is_empty() && visited > many.visited_in_all as f32 {
            break;
        }
        asked.push(Partner { index, effort });
    }
    asked
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::observe::touch::Touch;
    use crate::test_support::{places, seen};
    use palpate_core::pose::Pose;

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

    #[test]
    fn rare_pairs_come_first_until_the_budget_is_spent() {
        let options = SurfaceOptions::default();
        let asked = |shares: Option<&[f32]>, n_touches| -> Vec<(usize, usize)> {
            let asked = in_turn(&[5, 3, 4, 1], shares, n_touches, &options);
            asked.iter().map(|partner| (partner.index, partner.effort.patches)).collect()
        };
        // 0.1 % of 400² are 160 pairs; 3 % are 1,200 of 200 patches, 12 % of 100.
        let mixed = asked(Some(&[0.03, 0.001, 0.12, 0.001]), 6);
        assert_eq!(mixed, [(3, 400), (1, 400), (5, 200), (4, 100)]);
        // A fourth pair of 1,200 is more than 3,600 in all.
        assert_eq!(asked(Some(&[0.12; 4]), 6), [(5, 100), (3, 100), (4, 100)]);
        // The first pair of a session is looked up regardless of its cost, and so are all pairs
        // in a small catalogue.
        assert_eq!(asked(Some(&[0.5]), 2), [(5, usize::MAX)]);
        assert_eq!(asked(None, 6).len(), 4);
    }
}
