//! Placement: uncertainty of a touch's place from its robot's base and from motion of the object.
//!
//! A base shifts all touches of its robot alike. An object that moves between touches displaces
//! earlier ones: after n moves the deviation is √n times that of one move. An earlier touch is
//! therefore compared with a map with a growing variance, and one out of the kernel's reach
//! still lies about the object, not anywhere (equation R14).

use std::f64::consts::FRAC_1_SQRT_2;

use libm::erf;
use palpate_core::reading::{Base, Looseness};

/// Distance (m) of the shortest pair of touches that a map stores: ℓ₀ of equation R2.
const SHORTEST: f32 = 0.004;

/// Deviation (m) of an observed distance: σ_ℓ of equations R2 and R9.
const DEVIATION: f32 = 0.001;

/// Deviation of the object's motion that halves the weight of a touch, metres.
pub(crate) const HALF: f32 = 0.01;

/// Reach of the kernel of a touch, metres.
const REACH: f32 = 0.007;

/// Density of a touch about an object: that of a workspace of 0.4 m over that of a cube of 0.1 m.
const ABOUT: f32 = 64.0;

/// Deviation of the position (m) at which a touch loses ln 2 of [`loose_loss`](Placement::loss).
const LOOSE: f32 = 0.000_5;

/// Least deviation of the angle of a touch after motion of the object, rad.
const ANGLE_MIN: f64 = 1e-4;

/// Coefficients of ln of the two-sided tail of a normal distribution: −0.717 x − 0.416 x².
const TAIL: [f32; 2] = [0.717, 0.416];

/// Variances of a position (m²) and of an angle (rad²).
pub(crate) type Variances = (f32, f32);

/// Uncertainty of a touch's place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Placement {
    /// Base of the robot, unless it is exact.
    base: Option<Base>,
    /// Variances of the object's motion since the touch.
    moved: Variances,
    /// Variance (m²) of the position by the sensor itself: that of a contact without an image, or of
    /// a loose sensor.
    own: f32,
}

impl Placement {
    /// The placement by the base of a robot.
    pub(crate) fn on_base(self, base: Option<Base>) -> Self {
        Self { base, ..self }
    }

    /// The placement of a touch whose position has this deviation (m) of its own: a contact without
    /// an image, or a press by a sensor whose passport says that poses are loose.
    pub(crate) fn of_own(self, deviation: f64) -> Self {
        Self { own: deviation.powi(2) as f32, ..self }
    }

    /// Variance (m²) of the position by the sensor itself.
    #[inline]
    pub(crate) fn own(&self) -> f32 {
        self.own
    }

    /// Placement after `moves` moves of the object by `motion` each. Equation R14a of
    /// docs/recogniser.md.
    pub(crate) fn after(self, moves: usize, motion: &Looseness) -> Self {
        let (position, angle) = variances(motion);
        Self { moved: (moves as f32 * position, moves as f32 * angle), ..self }
    }

    /// Whether the stated place of the touch is exact.
    #[inline]
    pub(crate) fn is_exact(&self) -> bool {
        self.base.is_none() && self.moved == (0.0, 0.0) && self.own <= 0.0
    }

    fn of_base_alone(&self) -> Variances {
        self.base.map_or((0.0, 0.0), |base| variances(&base.looseness))
    }

    /// Variances of positions and normals from base, motion and the sensor itself.
    #[inline]
    pub(crate) fn variances(&self) -> Variances {
        let (position, angle) = self.shifting();
        (position + self.own, angle)
    }

    /// Variances from base and motion, which shift more than one touch or the object.
    #[inline]
    pub(crate) fn shifting(&self) -> Variances {
        sum(self.of_base_alone(), self.moved)
    }

    /// Variances relative to another touch: zero if one base shifts both and the object rested.
    pub(crate) fn variances_to(&self, other: &Self) -> Variances {
        let (moved, before) = (self.moved, other.moved);
        let moved = ((moved.0 - before.0).abs(), (moved.1 - before.1).abs());
        let moved = sum(moved, (self.own + other.own, 0.0));
        if self.base.map(|base| base.robot) == other.base.map(|base| base.robot) {
            return moved;
        }
        sum(moved, sum(self.of_base_alone(), other.of_base_alone()))
    }

    /// [`Self::variances_to`] from bases and motion alone.
    pub(crate) fn shifting_to(&self, other: &Self) -> Variances {
        let without_own = |placement: &Self| Self { own: 0.0, ..*placement };
        without_own(self).variances_to(&without_own(other))
    }

    /// Cause of the shift of the touch.
    pub(crate) fn shifted_by(&self) -> Shift {
        if self.moved == (0.0, 0.0) {
            return self.base.map_or(Shift::None, |base| Shift::Base(base.robot, base.looseness));
        }
        let (position, angle) = self.shifting();
        let angle = f64::from(angle).sqrt().max(ANGLE_MIN);
        Shift::Motion(Looseness { position: f64::from(position).sqrt(), angle })
    }

    /// Factor on the touch's weight after the object's motion. Part of equation R14.
    pub(crate) fn recency(&self) -> f32 {
        kept(self.moved.0, HALF)
    }

    /// Off-object density: that of the touch on the object but out of the kernel's reach, over
    /// that of one anywhere. Part of equation R14.
    pub(crate) fn off_object_density(&self) -> f32 {
        let (position, _) = self.variances();
        if position <= 0.0 {
            return 0.0;
        }
        let reach = REACH / position.sqrt();
        ABOUT * (-TAIL[0] * reach - TAIL[1] * reach * reach).exp()
    }

    /// Loss of score (ln) against an exactly placed touch, even at its own place: by its base,
    /// and by the object's motion if it was announced. `per_fold` is the loss for each e-fold of
    /// the variance. Part of equation R13.
    pub(crate) fn loss(&self, is_announced: bool, per_fold: f32) -> f32 {
        let (position, _) = if is_announced { self.shifting() } else { self.of_base_alone() };
        per_fold * (1.0 + position / (LOOSE * LOOSE)).ln()
    }
}

/// Cause of a shift between the stated and the true place of a touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shift {
    /// No shift.
    None,
    /// The base of a robot (its number), which shifts all touches of that robot.
    Base(u32, Looseness),
    /// The object's motion since the touch, and its base; it shifts only this touch.
    Motion(Looseness),
}

/// Share of the weight kept at this variance (m²) of the position; ½ at a deviation of `half` (m).
pub(crate) fn kept(variance: f32, half: f32) -> f32 {
    1.0 / (1.0 + variance / (half * half))
}

fn variances(deviations: &Looseness) -> Variances {
    (deviations.position.powi(2) as f32, deviations.angle.powi(2) as f32)
}

fn sum(a: Variances, b: Variances) -> Variances {
    (a.0 + b.0, a.1 + b.1)
}

/// Probability that two touches `distance` (m) apart are of two places that a map tells apart.
/// Equation R2 of docs/recogniser.md.
pub(super) fn apart_by(distance: f32) -> f32 {
    let deviations = (distance - SHORTEST) / DEVIATION;
    (0.5 * (1.0 + erf(f64::from(deviations) * FRAC_1_SQRT_2))) as f32
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
        let moved = Placement::default().on_base(base(1)).after(4, &MOTION);
        assert!(close(moved.variances(), (4.0 * 9e-6 + 16e-6, 0.04)));
        // One base shifts both, and three moves displaced both.
        let later = Placement::default().on_base(base(1)).after(3, &MOTION);
        assert!(close(moved.variances_to(&later), (9e-6, 0.01)));
        let other = Placement::default().on_base(base(2)).after(3, &MOTION);
        assert!(close(moved.variances_to(&other), (9e-6 + 32e-6, 0.01)));
        let loose = moved.of_own(0.002);
        assert!(close(loose.variances_to(&later), (9e-6 + 4e-6, 0.01)));
        assert!(close(loose.shifting_to(&later), (9e-6, 0.01)));
        assert!(!moved.is_exact() && !Placement::default().on_base(base(1)).is_exact());
        assert!(Placement::default().after(0, &MOTION).is_exact());
    }

    #[test]
    fn motion_shifts_one_touch_and_a_base_all_of_its_robot() {
        let now = Placement::default().on_base(base(7));
        let looseness = Looseness { position: 0.004, angle: 0.0 };
        assert_eq!(now.shifted_by(), Shift::Base(7, looseness));
        let Shift::Motion(before) = now.after(1, &MOTION).shifted_by() else { panic!() };
        assert!((before.position - 0.005).abs() < 1e-8);
        assert_eq!(Placement::default().shifted_by(), Shift::None);
    }

    #[test]
    fn a_loose_touch_loses_weight_and_sharpness() {
        let exact = Placement::default();
        assert_eq!(
            (exact.recency(), exact.off_object_density(), exact.loss(true, 1.2)),
            (1.0, 0.0, 0.0)
        );
        // 10 mm: half of the weight; 0.48 of a normal distribution is beyond 7 mm.
        let far = exact.after(1, &Looseness { position: 0.01, angle: 0.0 });
        assert!((far.recency() - 0.5).abs() < 1e-6);
        let share = far.off_object_density() / ABOUT;
        assert!((share - 0.484).abs() < 0.01, "{share}");
        // 1.2 ln(1 + 20²), unless the motion was not announced.
        assert!((far.loss(true, 1.2) - 7.193).abs() < 0.01 && far.loss(false, 1.2).abs() < 1e-9);
        assert!(Placement::default().on_base(base(1)).loss(false, 1.2) > 4.0);
    }
}
