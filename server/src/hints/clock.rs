//! Warning about a robot whose clock was set back.

use palpate_schemas::{Warning, WarningCode};

/// Two readings of a robot whose stamps and numbers disagree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SetBack {
    pub(crate) robot: String,
    /// Number of the reading with the earlier stamp.
    pub(crate) later: u64,
    /// Smaller number of the reading with the later stamp.
    pub(crate) before: u64,
}

/// The warning at `pointer`; empty for a session as a whole.
pub(crate) fn of_clock(found: &SetBack, pointer: String) -> Warning {
    let SetBack { robot, later, before } = found;
    let detail = format!(
        "reading {later} of robot {robot:?} is stamped before its reading {before}: touches are \
         ordered by stamp, so these count in another order than they were sent; was the clock set, \
         or the simulation begun again? Send stamps that only go forward, or none"
    );
    Warning { code: WarningCode::StampsBackwards, pointer, detail }
}
