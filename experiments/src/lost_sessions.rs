//! What the oracle columns share: the causes of wrong sessions, and what counts as near the truth.

/// Rivals of the true object that get finer maps: those with the most evidence. Chosen.
pub const RIVALS: usize = 2;

/// Distance (m) and angle (rad) within which a pose is near the true one: refinement should find
/// it. Chosen.
pub const NEAR: (f64, f64) = (0.012, 0.44);

/// What lost a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// From the true pose the object wins, the search left no pose near it, and the object is on
    /// no list of candidates.
    Retrieval,
    /// From the true pose the object wins, and the search left no pose near it.
    Proposal,
    /// The same, and it left one.
    Refinement,
    /// The object wins on maps of four times as many touches.
    Map,
    /// It wins on the meshes.
    Mesh,
    /// Another object has more evidence, whatever the map.
    Likelihood,
    /// Only the evidence of "none of these" stands above the object.
    Background,
    /// The object loses on the catalogue's maps, and finer ones were not tried.
    Open,
}

impl Cause {
    /// The causes where no session can end with "none of these".
    pub const AMONG_OBJECTS: [Self; 7] = [
        Self::Retrieval,
        Self::Proposal,
        Self::Refinement,
        Self::Map,
        Self::Mesh,
        Self::Likelihood,
        Self::Open,
    ];

    /// The causes with "none of these", in catalogues without lists of candidates.
    pub const ALL: [Self; 7] = [
        Self::Proposal,
        Self::Refinement,
        Self::Map,
        Self::Mesh,
        Self::Likelihood,
        Self::Background,
        Self::Open,
    ];

    /// Its name in rows and keys.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Retrieval => "retrieval",
            Self::Proposal => "proposal",
            Self::Refinement => "refinement",
            Self::Map => "map",
            Self::Mesh => "mesh",
            Self::Likelihood => "likelihood",
            Self::Background => "background",
            Self::Open => "open",
        }
    }
}
