//! The stage of a belief: the kind of evidence that it rests on (equation R17).

/// Kind of the evidence of the objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Stage {
    /// Nothing but the prior.
    #[default]
    Prior,
    /// The appearance of one touch.
    Appearance,
    /// The density of a pair.
    Pair,
    /// Scored poses.
    Poses,
}

impl Stage {
    const ALL: [Self; 4] = [Self::Prior, Self::Appearance, Self::Pair, Self::Poses];

    /// Index among the calibrated stages; `None` for the prior.
    pub(crate) fn calibrated(self) -> Option<usize> {
        match self {
            Self::Prior => None,
            Self::Appearance => Some(0),
            Self::Pair => Some(1),
            Self::Poses => Some(2),
        }
    }

    /// Its number in a checkpoint.
    pub(crate) fn number(self) -> usize {
        self as usize
    }

    /// The stage with this number in a checkpoint.
    pub(crate) fn from_number(number: usize) -> Option<Self> {
        Self::ALL.get(number).copied()
    }
}
