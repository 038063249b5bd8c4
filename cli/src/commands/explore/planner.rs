//! Statistics of the exploration's planner, for people and programs.

use palpate_sim::explore::Statistics;
use serde::Serialize;

/// Statistics of the planner, see [`Statistics`].
#[derive(Debug, Serialize)]
pub(super) struct Planner {
    iterations: usize,
    local_iterations: usize,
    vertices: usize,
    collisions: usize,
    inverse_failures: usize,
    contacts: usize,
    left_alone: usize,
    rejected: usize,
    unreachable: usize,
}

impl From<Statistics> for Planner {
    fn from(statistics: Statistics) -> Self {
        Self {
            iterations: statistics.iterations,
            local_iterations: statistics.local_iterations,
            vertices: statistics.vertices,
            collisions: statistics.collisions,
            inverse_failures: statistics.inverse_failures,
            contacts: statistics.contacts,
            left_alone: statistics.left_alone,
            rejected: statistics.rejected,
            unreachable: statistics.unreachable,
        }
    }
}

impl Planner {
    /// The statistics as a sentence that follows "n readings".
    pub(super) fn words(&self) -> String {
        format!(
            " from {} contacts in {} steps of the planner ({} local); {} times it left alone what it \
             had pressed; {} vertices, {} collisions",
            self.contacts,
            self.iterations,
            self.local_iterations,
            self.left_alone,
            self.vertices,
            self.collisions,
        )
    }
}
