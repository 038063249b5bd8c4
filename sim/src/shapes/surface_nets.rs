//! Meshes of the zero level of a field: one vertex for each patch of surface in a grid's cell.
//!
//! Dual to marching cubes (Nielson 2004): every grid edge that crosses the surface becomes a
//! quadrangle between the four cells around it. A cell that several patches pass through has
//! a vertex for each, found by walking its faces. Where a face is ambiguous its inside
//! corners are kept apart, in both cells alike; they are joined where that would make one
//! edge serve four quadrangles (Wenger 2013), so that the result is a closed manifold.

use std::collections::BTreeMap;

use glam::{DVec3, IVec3};
use rayon::prelude::*;

/// The twelve edges of a cell as pairs of corners; corner bits are x, y, z.
const EDGES: [[usize; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];
/// The corners of a cell's faces, in order around each.
const FACES: [[usize; 4]; 6] =
    [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];
/// No patch crosses this edge.
const NONE: u8 = u8::MAX;

/// Samples of a field on a grid.
struct Grid {
    low: DVec3,
    cell: f64,
    size: IVec3,
    values: Vec<f64>,
}

impl Grid {
    fn index(&self, corner: IVec3) -> usize {
        ((corner.z * self.size.y + corner.y) * self.size.x + corner.x) as usize
    }

    fn place(&self, corner: IVec3) -> DVec3 {
        self.low + self.cell * corner.as_dvec3()
    }

    fn corner(cell: IVec3, corner: usize) -> IVec3 {
        cell + IVec3::new(corner as i32 & 1, corner as i32 >> 1 & 1, corner as i32 >> 2)
    }

    /// The values at a cell's corners.
    fn corners(&self, cell: IVec3) -> [f64; 8] {
        std::array::from_fn(|corner| self.values[self.index(Self::corner(cell, corner))])
    }
}

/// Vertices and outward triangles of the level where `field` (negative inside) is zero.
///
/// The grid covers `low` to `high`, which must hold the whole body, in cells of side `cell`.
pub(crate) fn mesh(
    field: impl Fn(DVec3) -> f64 + Sync,
    low: DVec3,
    high: DVec3,
    cell: f64,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let grid = sampled(field, low, high, cell);
    let patches = Patches::new(&grid);
    let mut vertices = Vec::new();
    // Index of the first patch's vertex of every cell.
    let mut first_vertex = vec![u32::MAX; grid.values.len()];
    let cells = grid.size - 1;
    for z in 0..cells.z {
        for y in 0..cells.y {
            for x in 0..cells.x {
                let cell = IVec3::new(x, y, z);
                let values = grid.corners(cell);
                let of_edge = &patches.of(&grid, cell);
                if of_edge.iter().all(|patch| *patch == NONE) {
                    continue;
                }
                first_vertex[grid.index(cell)] = vertices.len() as u32;
                push_vertices(&grid, cell, &values, of_edge, &mut vertices);
            }
        }
    }
    let triangles = quadrangles(&grid, &patches, &first_vertex, &vertices);
    (vertices, triangles)
}

fn sampled(field: impl Fn(DVec3) -> f64 + Sync, low: DVec3, high: DVec3, cell: f64) -> Grid {
    let size = ((high - low) / cell).ceil().as_ivec3() + 1;
    let mut grid = Grid { low, cell, size, values: Vec::new() };
    let n_layer = (size.x * size.y) as usize;
    let mut values = vec![0.0; n_layer * size.z as usize];
    values.par_chunks_mut(n_layer).enumerate().for_each(|(z, layer)| {
        for (idx, value) in layer.iter_mut().enumerate() {
            let (x, y) = (idx as i32 % size.x, idx as i32 / size.x);
            *value = field(grid.place(IVec3::new(x, y, z as i32)));
        }
    });
    grid.values = values;
    grid
}

fn inside_bits(values: &[f64; 8]) -> usize {
    (0..8).filter(|corner| values[*corner] < 0.0).map(|corner| 1 << corner).sum()
}

/// The patch that each edge of a cell belongs to.
struct Patches {
    /// For every pattern of inside corners, with all inside corners kept apart.
    apart: Vec<[u8; 12]>,
    /// For the few cells that need it, by index: the faces (as bits) on which inside corners
    /// are joined.
    joined: BTreeMap<usize, u8>,
}

impl Patches {
    fn new(grid: &Grid) -> Self {
        let apart: Vec<[u8; 12]> = (0..256).map(|inside| patches_of(inside, 0)).collect();
        let mut joined = BTreeMap::new();
        // Whether a cell's patch runs through an ambiguous face twice.
        let passes_twice = |cell: IVec3, face: usize| {
            let inside = inside_bits(&grid.corners(cell));
            let corners = FACES[face];
            let alternates = (0..4).all(|side| {
                (inside >> corners[side] & 1) != (inside >> corners[(side + 1) % 4] & 1)
            });
            let patch = |side| apart[inside][edge_between(corners[side], corners[(side + 1) % 4])];
            alternates && (1..4).all(|side| patch(side) == patch(0))
        };
        let cells = grid.size - 1;
        for z in 0..cells.z {
            for y in 0..cells.y {
                for x in 0..cells.x {
                    let cell = IVec3::new(x, y, z);
                    for axis in 0..3 {
                        let next = cell + IVec3::AXES[axis];
                        let (high, low) = (2 * axis + 1, 2 * axis);
                        let inner = next[axis] < cells[axis];
                        if inner && passes_twice(cell, high) && passes_twice(next, low) {
                            *joined.entry(grid.index(cell)).or_insert(0) |= 1 << high;
                            *joined.entry(grid.index(next)).or_insert(0) |= 1 << low;
                        }
                    }
                }
            }
        }
        Self { apart, joined }
    }

    fn of(&self, grid: &Grid, cell: IVec3) -> [u8; 12] {
        let inside = inside_bits(&grid.corners(cell));
        match self.joined.get(&grid.index(cell)) {
            Some(faces) => patches_of(inside, *faces),
            None => self.apart[inside],
        }
    }
}

/// The edge between two neighbouring corners.
fn edge_between(a: usize, b: usize) -> usize {
    EDGES.iter().position(|edge| *edge == [a.min(b), a.max(b)]).unwrap_or(0)
}

/// The patches of a cell whose inside corners are joined on the faces `joined` (bits).
fn patches_of(inside: usize, joined: u8) -> [u8; 12] {
    let is_inside = |corner: usize| inside >> corner & 1 == 1;
    let mut patch: [u8; 12] = std::array::from_fn(|edge| {
        let [a, b] = EDGES[edge];
        if is_inside(a) == is_inside(b) { NONE } else { edge as u8 }
    });
    let mut join = |a: usize, b: usize| {
        let (keep, drop) = (patch[a].min(patch[b]), patch[a].max(patch[b]));
        patch.iter_mut().filter(|label| **label == drop).for_each(|label| *label = keep);
    };
    for (face_idx, face) in FACES.into_iter().enumerate() {
        let edges: [usize; 4] =
            std::array::from_fn(|side| edge_between(face[side], face[(side + 1) % 4]));
        let crossing: Vec<usize> = (0..4)
            .filter(|side| is_inside(face[*side]) != is_inside(face[(side + 1) % 4]))
            .collect();
        match crossing.as_slice() {
            [a, b] => join(edges[*a], edges[*b]),
            [_, _, _, _] => {
                // Each kept corner's two edges belong together.
                let kept_inside = joined >> face_idx & 1 == 0;
                for corner in (0..4).filter(|corner| is_inside(face[*corner]) == kept_inside) {
                    join(edges[corner], edges[(corner + 3) % 4]);
                }
            }
            _ => {}
        }
    }
    // Number the patches 0, 1, …
    let mut labels: Vec<u8> = patch.iter().copied().filter(|label| *label != NONE).collect();
    labels.sort_unstable();
    labels.dedup();
    patch.map(|label| labels.iter().position(|known| *known == label).map_or(NONE, |at| at as u8))
}

/// Adds a cell's vertices: the mean of each patch's crossings.
fn push_vertices(
    grid: &Grid,
    cell: IVec3,
    values: &[f64; 8],
    of_edge: &[u8; 12],
    vertices: &mut Vec<DVec3>,
) {
    let n_patches = of_edge.iter().filter(|patch| **patch != NONE).max().map_or(0, |last| last + 1);
    for patch in 0..n_patches {
        let (mut sum, mut n) = (DVec3::ZERO, 0.0);
        for (edge, _) in of_edge.iter().enumerate().filter(|(_, of)| **of == patch) {
            let [a, b] = EDGES[edge];
            let along = values[a] / (values[a] - values[b]);
            let place = |corner| grid.place(Grid::corner(cell, corner));
            sum += place(a).lerp(place(b), along);
            n += 1.0;
        }
        vertices.push(sum / n);
    }
}

/// Two triangles for every grid edge that crosses the surface.
fn quadrangles(
    grid: &Grid,
    patches: &Patches,
    first_vertex: &[u32],
    vertices: &[DVec3],
) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    // The cells around an edge along each axis, in order around it, and the edge's number in
    // each cell.
    let around = [
        [
            (IVec3::new(0, 0, 0), 0),
            (IVec3::new(0, -1, 0), 1),
            (IVec3::new(0, -1, -1), 3),
            (IVec3::new(0, 0, -1), 2),
        ],
        [
            (IVec3::new(0, 0, 0), 4),
            (IVec3::new(0, 0, -1), 6),
            (IVec3::new(-1, 0, -1), 7),
            (IVec3::new(-1, 0, 0), 5),
        ],
        [
            (IVec3::new(0, 0, 0), 8),
            (IVec3::new(-1, 0, 0), 9),
            (IVec3::new(-1, -1, 0), 11),
            (IVec3::new(0, -1, 0), 10),
        ],
    ];
    for z in 1..grid.size.z - 1 {
        for y in 1..grid.size.y - 1 {
            for x in 1..grid.size.x - 1 {
                let corner = IVec3::new(x, y, z);
                let here_inside = grid.values[grid.index(corner)] < 0.0;
                for (axis, cells) in around.iter().enumerate() {
                    let next = corner + IVec3::AXES[axis];
                    if here_inside == (grid.values[grid.index(next)] < 0.0) {
                        continue;
                    }
                    let quadrangle = cells.map(|(offset, edge)| {
                        let cell = corner + offset;
                        let patch = patches.of(grid, cell)[edge];
                        first_vertex[grid.index(cell)] + u32::from(patch)
                    });
                    push_quadrangle(quadrangle, here_inside, vertices, &mut triangles);
                }
            }
        }
    }
    triangles
}

/// Cuts a quadrangle along its shorter diagonal; `outward` is the orientation of its order.
fn push_quadrangle(
    mut corners: [u32; 4],
    outward: bool,
    vertices: &[DVec3],
    triangles: &mut Vec<[u32; 3]>,
) {
    if !outward {
        corners.reverse();
    }
    let [a, b, c, d] = corners;
    let length =
        |from: u32, to: u32| vertices[from as usize].distance_squared(vertices[to as usize]);
    if length(a, c) <= length(b, d) {
        triangles.extend([[a, b, c], [a, c, d]]);
    } else {
        triangles.extend([[b, c, d], [b, d, a]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    fn meshed(field: impl Fn(DVec3) -> f64 + Sync) -> Mesh {
        let (vertices, triangles) = mesh(field, DVec3::splat(-12.0), DVec3::splat(12.0), 0.8);
        Mesh::new(vertices, triangles).unwrap()
    }

    #[test]
    fn a_ball_is_closed_outward_and_has_its_volume() {
        let ball = meshed(|at| at.length() - 10.0);
        assert!(ball.is_watertight());
        // 4/3 π 10³ = 4188.8; chords lie inside.
        assert!((ball.signed_volume() / 4188.8 - 1.0).abs() < 0.01, "{}", ball.signed_volume());
    }

    #[test]
    fn bodies_that_touch_at_edges_and_corners_stay_closed() {
        // Checkers of balls meet in ambiguous faces.
        let lattice = meshed(|at| {
            let waves = (at * 1.7).x.sin() * (at * 1.7).y.sin() * (at * 1.7).z.sin();
            (0.02 - waves).max(at.length() - 10.0)
        });
        assert!(lattice.is_watertight());
    }
}
