//! The contact classifier: touching, free and unknown taxels of a press.
//!
//! Source: section 3.2.2, equation 3.3; the resolution for weak presses is in
//! `docs/equations.md`. Not here: the threshold of Algorithm 2 (`contact`), which serves the
//! normal of a press and counts only its strong half.

use palpate_core::reading::{Reading, TactileImage};
use palpate_core::units::KPA;

/// T of equation 3.3, Pa.
pub const CONTACT_THRESHOLD: f64 = 2.0 * KPA;

/// Fraction of the largest pressure above which a taxel may touch (equation 3.3).
pub const MAX_SHARE: f64 = 0.3;

/// Contact class of a taxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactClass {
    /// The taxel touches something.
    InContact = 0,
    /// The taxel is free.
    NoContact = 1,
    /// The taxel is ambiguous.
    Unknown = 2,
}

/// Classification of a press below the threshold everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WeakPress {
    /// Every taxel is free: the press was in free space.
    #[default]
    Free,
    /// As printed, equation 3.3 taxel by taxel: taxels above 0.3 of the largest pressure are
    /// unknown, and so is every taxel of a press of zeros.
    AsPrinted,
}

/// Classifies every taxel of a press. `threshold` is T in Pa; the result has the order of the
/// image. Ties are unknown; a press below the threshold everywhere is free everywhere.
///
/// Source: equation 3.3.
#[must_use]
pub fn classify(image: &TactileImage, threshold: f64) -> Vec<ContactClass> {
    classify_with(image, threshold, WeakPress::Free)
}

/// [`classify`] with a choice for weak presses.
#[must_use]
pub fn classify_with(image: &TactileImage, threshold: f64, weak: WeakPress) -> Vec<ContactClass> {
    let max = image.max();
    if weak == WeakPress::Free && max < threshold {
        return vec![ContactClass::NoContact; image.pressures.len()];
    }
    let share = MAX_SHARE * max;
    let class = |pressure: &f64| {
        if *pressure > threshold && *pressure > share {
            ContactClass::InContact
        } else if *pressure < threshold && *pressure < share {
            ContactClass::NoContact
        } else {
            ContactClass::Unknown
        }
    };
    image.pressures.iter().map(class).collect()
}

/// [`classify_with`] for a reading, whose missing taxels are unknown.
#[must_use]
pub fn classify_reading(reading: &Reading, threshold: f64, weak: WeakPress) -> Vec<ContactClass> {
    let mut classes = classify_with(reading.image(), threshold, weak);
    for (class, missing) in classes.iter_mut().zip(reading.missing()) {
        if *missing {
            *class = ContactClass::Unknown;
        }
    }
    classes
}

#[cfg(test)]
mod tests {
    use ContactClass::{InContact, NoContact, Unknown};

    use super::*;

    fn row(pressures: &[f64]) -> TactileImage {
        TactileImage { rows: 1, cols: pressures.len(), pressures: pressures.to_vec() }
    }

    #[track_caller]
    fn check(pressures: &[f64], expected: &[ContactClass]) {
        assert_eq!(classify(&row(pressures), 2_000.0), expected);
    }

    #[test]
    fn contact_and_its_absence_each_need_both_conditions() {
        // Largest 10 kPa: the limit of the fraction is 3 kPa.
        check(&[10e3, 3.5e3, 2.5e3, 1.5e3], &[InContact, InContact, Unknown, NoContact]);
        // Largest 4 kPa: the limit is 1.2 kPa, below the threshold.
        check(&[4e3, 1.5e3, 1.0e3], &[InContact, Unknown, NoContact]);
    }

    #[test]
    fn ties_are_unknown() {
        check(&[10e3, 3e3, 2e3], &[InContact, Unknown, Unknown]);
    }

    #[test]
    fn a_weak_press_is_free_everywhere_unless_as_printed() {
        check(&[0.0, 1_900.0], &[NoContact, NoContact]);
        check(&[0.0, 0.0], &[NoContact, NoContact]);
        let printed = |p: &[f64]| classify_with(&row(p), 2_000.0, WeakPress::AsPrinted);
        assert_eq!(printed(&[0.0, 1_900.0]), [NoContact, Unknown]);
        assert_eq!(printed(&[0.0, 0.0]), [Unknown, Unknown]);
    }
}
