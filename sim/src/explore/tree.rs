//! The planner's tree: configurations of the arm joined by free motions.
//!
//! The root is the initial configuration. Every edge was checked when it was made; after the
//! object has moved, an edge counts only once it has been checked again.

use glam::DVec3;

use crate::arm::Configuration;

/// A configuration of the tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Vertex {
    /// The arm's angles.
    pub configuration: Configuration,
    /// Position of the sensor, metres in the session frame.
    pub position: DVec3,
    /// The vertex at the start of the motion; `None` at the root.
    pub parent: Option<usize>,
    /// The epoch in which the path from the root was last checked, and the result.
    checked: (u32, bool),
}

/// All vertices; parents come before their children.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    vertices: Vec<Vertex>,
    /// Number of the object's moves.
    epoch: u32,
}

impl Tree {
    pub(super) fn new(configuration: Configuration, position: DVec3) -> Self {
        let root = Vertex { configuration, position, parent: None, checked: (0, true) };
        Self { vertices: vec![root], epoch: 0 }
    }

    /// The vertices, the root first.
    #[must_use]
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// Adds a configuration that a free motion reaches from `parent`.
    pub(super) fn add(
        &mut self,
        configuration: Configuration,
        position: DVec3,
        parent: usize,
    ) -> usize {
        let checked = (self.epoch, true);
        self.vertices.push(Vertex { configuration, position, parent: Some(parent), checked });
        self.vertices.len() - 1
    }

    /// The vertex whose sensor is nearest to `target`, among those not known to be cut off.
    ///
    /// The root is cut off only if the object has moved onto it.
    fn nearest(&self, target: DVec3) -> Option<usize> {
        let open = |vertex: &Vertex| vertex.checked != (self.epoch, false);
        let distance = |vertex: &Vertex| vertex.position.distance_squared(target);
        let vertices = self.vertices.iter().enumerate().filter(|(_, vertex)| open(vertex));
        vertices
            .min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)))
            .map(|(vertex, _)| vertex)
    }

    /// The vertex nearest to `target` that the arm can reach from the root; `is_free` returns
    /// whether the motion between two configurations touches nothing.
    pub(super) fn nearest_open(
        &mut self,
        target: DVec3,
        mut is_free: impl FnMut(&Configuration, &Configuration) -> bool,
    ) -> Option<usize> {
        loop {
            let vertex = self.nearest(target)?;
            if self.is_open(vertex, &mut is_free) {
                return Some(vertex);
            }
        }
    }

    /// Whether the path from the root to a vertex is free; checks edges not checked since the
    /// object moved.
    pub(super) fn is_open(
        &mut self,
        vertex: usize,
        mut is_free: impl FnMut(&Configuration, &Configuration) -> bool,
    ) -> bool {
        let mut way = Vec::new();
        let mut at = Some(vertex);
        while let Some(idx) = at.filter(|idx| self.vertices[*idx].checked.0 != self.epoch) {
            way.push(idx);
            at = self.vertices[idx].parent;
        }
        let mut open = at.is_none_or(|idx| self.vertices[idx].checked.1);
        for idx in way.into_iter().rev() {
            // The root has no motion of its own: its own position must be free.
            let to = &self.vertices[idx].configuration;
            let from = self.vertices[idx].parent.map_or(to, |up| &self.vertices[up].configuration);
            open = open && is_free(from, to);
            self.vertices[idx].checked = (self.epoch, open);
        }
        open
    }

    /// Invalidates all checks after the object has moved.
    pub(super) fn forget_checks(&mut self) {
        self.epoch += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::{Arm, ArmConfig};

    /// A root at x = 0 with a chain of vertices at x = 1, 2, 3 and a branch at y = 1.
    fn tree() -> Tree {
        let configuration = Arm::new(ArmConfig::around(0.1, 4)).unwrap().initial();
        let mut tree = Tree::new(configuration.clone(), DVec3::ZERO);
        for step in 1..=3 {
            tree.add(configuration.clone(), f64::from(step) * DVec3::X, step as usize - 1);
        }
        tree.add(configuration, DVec3::Y, 0);
        tree
    }

    #[test]
    fn the_nearest_sensor_is_chosen() {
        let mut tree = tree();
        let mut nearest = |x: f64, y: f64| tree.nearest_open(DVec3::new(x, y, 0.0), |_, _| false);
        // Nothing is checked again while the object rests.
        assert_eq!(nearest(2.2, 0.1), Some(2));
        assert_eq!(nearest(9.0, 0.0), Some(3));
        assert_eq!(nearest(0.1, 0.8), Some(4));
    }

    #[test]
    fn a_blocked_motion_cuts_off_vertices_until_the_object_moves() {
        let mut tree = tree();
        tree.forget_checks();
        let mut checked = 0;
        // Checked are the root, then 1, then 2: the third motion, to vertex 2, is blocked.
        let nearest = tree.nearest_open(3.0 * DVec3::X, |_, _| {
            checked += 1;
            checked != 3
        });
        assert_eq!((nearest, checked), (Some(1), 3));
        assert_eq!(tree.nearest_open(2.0 * DVec3::X, |_, _| true), Some(1));
        tree.forget_checks();
        assert_eq!(tree.nearest_open(3.0 * DVec3::X, |_, _| true), Some(3));
    }
}
