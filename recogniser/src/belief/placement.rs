//! How loosely a touch is placed: by its robot's base, and by what the object moved since.
//!
//! A base shifts all touches of its robot alike. An object that moves between touches carries
//! earlier ones away from where they were felt: after n moves each is off by √n of them. So an
//! earlier touch is compared with a map less and less closely, and where it may be off by more
//! than the kernel reaches it still lies somewhere about the object, not anywhere.

use palpate_core::reading::{Base, Looseness};

/// Where the object may have moved by as much (m) a touch says half of what it did.
pub(super) const HALF: f32 = 0.01;

/// A map explains touches this far (m) from it.
const REACH: f32 = 0.007;

/// The density of a touch about an object, out of reach: that of one anywhere in the workspace
/// (0.4 m) over that in a cube of 0.1 m.
const ABOUT: f32 = 64.0;

/// A touch so loose (m) is explained a little less well even at its own place; by how much less
/// (ln) for each e-fold of the variance.
const LOOSE: f32 = 0.000_5;
const LOSS: f32 = 1.2;

/// The angles of a touch that the object moved away from are no better known (rad).
const ANGLE_MIN: f64 = 1e-4;

/// Variances of a position (m²) and of an angle (rad²).
pub(super) type Variances = (f32, f32);

/// How loosely a touch is placed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Placement {
    /// Whose robot's base shifts it, when that is not exact.
    base: Option<Base>,
    /// How far the object may have moved since.
    moved: Variances,
}

impl Placement {
    /// By the base of a robot.
    pub(super) fn of_base(base: Option<Base>) -> Self {
        Self { base, moved: (0.0, 0.0) }
    }

    /// The object may have moved so many times since, by so much each time.
    pub(super) fn after(self, moves: usize, motion: &Looseness) -> Self {
        let (position, angle) = variances(motion);
        Self { moved: (moves as f32 * position, moves as f32 * angle), ..self }
    }

    /// Whether it is where it is said to be.
    #[inline]
    pub(super) fn is_exact(&self) -> bool {
        self.base.is_none() && self.moved == (0.0, 0.0)
    }

    fn of_base_alone(&self) -> Variances {
        self.base.map_or((0.0, 0.0), |base| variances(&base.looseness))
    }

    /// By how much positions and normals are off.
    #[inline]
    pub(super) fn variances(&self) -> Variances {
        sum(self.of_base_alone(), self.moved)
    }

    /// The same beside another touch: nothing when one base shifts both and the object rested.
    pub(super) fn variances_to(&self, other: &Self) -> Variances {
        let (moved, before) = (self.moved, other.moved);
        let moved = ((moved.0 - before.0).abs(), (moved.1 - before.1).abs());
        if self.base.map(|base| base.robot) == other.base.map(|base| base.robot) {
            return moved;
        }
        sum(moved, sum(self.of_base_alone(), other.of_base_alone()))
    }

    /// What shifts the touch, the `index`th of the session: its robot's base, as others, or, once
    /// the object may have moved, something of its own.
    pub(super) fn shifted_by(&self, index: usize) -> Option<Base> {
        if self.moved == (0.0, 0.0) {
            return self.base;
        }
        let (position, angle) = self.variances();
        let angle = f64::from(angle).sqrt().max(ANGLE_MIN);
        let looseness = Looseness { position: f64::from(position).sqrt(), angle };
        // Robots are counted from 0 up.
        Some(Base { robot: u32::MAX - index as u32, looseness })
    }

    /// What is left of its weight when the object moves.
    pub(super) fn recency(&self) -> f32 {
        left(self.moved.0, HALF)
    }

    /// The density of the touch on the object out of the kernel's reach, over that of one
    /// anywhere.
    pub(super) fn astray(&self) -> f32 {
        let (position, _) = self.variances();
        if position <= 0.0 {
            return 0.0;
        }
        // About the share of a normal distribution on both sides of this many deviations.
        let reach = REACH / position.sqrt();
        ABOUT * (-0.717 * reach - 0.416 * reach * reach).exp()
    }

    /// How much less well (ln) even its own place explains the touch than an exact one, by its
    /// base, and by the object's motion as well when the session was told of it.
    pub(super) fn loss(&self, is_told: bool) -> f32 {
        let (position, _) = if is_told { self.variances() } else { self.of_base_alone() };
        LOSS * (1.0 + position / (LOOSE * LOOSE)).ln()
    }
}

/// What is left of what was said of a place that may have moved by a variance (m²), when at a
/// deviation of `half` (m) it is half.
pub(super) fn left(variance: f32, half: f32) -> f32 {
    1.0 / (1.0 + variance / (half * half))
}

fn variances(deviations: &Looseness) -> Variances {
    (deviations.position.powi(2) as f32, deviations.angle.powi(2) as f32)
}

fn sum(a: Variances, b: Variances) -> Variances {
    (a.0 + b.0, a.1 + b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTION: Looseness = Looseness { position: 0.003, angle: 0.1 };

    fn base(robot: u32) -> Option<Base> {
        Some(Base { robot, looseness: Looseness { position: 0.004, angle: 0.0 } })
    }

    fn close(found: Variances, expected: Variances) -> bool {
        (found.0 - expected.0).abs() < 1e-9 && (found.1 - expected.1).abs() < 1e-6
    }

    #[test]
    fn moves_and_bases_add_up() {
        let moved = Placement::of_base(base(1)).after(4, &MOTION);
        assert!(close(moved.variances(), (4.0 * 9e-6 + 16e-6, 0.04)));
        // One base shifts both, and both were carried along three times.
        let later = Placement::of_base(base(1)).after(3, &MOTION);
        assert!(close(moved.variances_to(&later), (9e-6, 0.01)));
        let other = Placement::of_base(base(2)).after(3, &MOTION);
        assert!(close(moved.variances_to(&other), (9e-6 + 32e-6, 0.01)));
        assert!(!moved.is_exact() && !Placement::of_base(base(1)).is_exact());
        assert!(Placement::default().after(0, &MOTION).is_exact());
    }

    #[test]
    fn a_touch_before_a_move_is_shifted_by_itself_and_one_after_it_by_its_base() {
        let now = Placement::of_base(base(7));
        assert_eq!(now.shifted_by(3), base(7));
        let before = now.after(1, &MOTION).shifted_by(3).unwrap();
        assert!((before.looseness.position - 0.005).abs() < 1e-8);
        assert_ne!(before.robot, now.after(1, &MOTION).shifted_by(4).unwrap().robot);
        assert_eq!(Placement::default().shifted_by(3), None);
    }

    #[test]
    fn an_exact_touch_loses_nothing_and_a_loose_one_weight_and_sharpness() {
        let exact = Placement::default();
        assert_eq!((exact.recency(), exact.astray(), exact.loss(true)), (1.0, 0.0, 0.0));
        // 10 mm: half of the weight; 0.48 of a normal distribution is beyond 7 mm.
        let far = exact.after(1, &Looseness { position: 0.01, angle: 0.0 });
        assert!((far.recency() - 0.5).abs() < 1e-6);
        assert!((far.astray() / ABOUT - 0.484).abs() < 0.01, "{}", far.astray());
        // 1.2 ln(1 + 20²), which who was not told does not know.
        assert!((far.loss(true) - 7.193).abs() < 0.01 && far.loss(false).abs() < 1e-9);
        assert!(Placement::of_base(base(1)).loss(false) > 4.0);
    }
}
