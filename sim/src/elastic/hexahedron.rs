//! The stiffness of a cubic 8-node element of edge 1 and shear modulus 1.
//!
//! Shape functions are trilinear, integrated at 2 × 2 × 2 Gauss points. The volumetric strain
//! is replaced by its mean over the element (mean dilatation, "B-bar"), so that a nearly
//! incompressible material does not lock. Node `n` lies at the corner (n & 1, n >> 1 & 1,
//! n >> 2 & 1); degrees of freedom are node-major: x, y, z of node 0, of node 1, …

/// Degrees of freedom of an element.
pub(super) const N_DEGREES: usize = 24;

/// A matrix over an element's degrees of freedom.
pub(super) type Stiffness = [[f64; N_DEGREES]; N_DEGREES];

/// Derivatives of the 8 shape functions at a point.
type Gradients = [[f64; 3]; 8];

/// The stiffness matrix of an isotropic material.
pub(super) fn stiffness(poisson_ratio: f64) -> Stiffness {
    // Lamé's constants for a shear modulus of 1.
    let lambda = 2.0 * poisson_ratio / (1.0 - 2.0 * poisson_ratio);
    let bulk = lambda + 2.0 / 3.0;
    let points = gauss_points();
    let mut mean = [[0.0; 3]; 8];
    for point in &points {
        for (sum, gradient) in mean.iter_mut().zip(gradients(*point)) {
            (0..3).for_each(|axis| sum[axis] += gradient[axis] / points.len() as f64);
        }
    }
    let mut stiffness = [[0.0; N_DEGREES]; N_DEGREES];
    for point in &points {
        let here = gradients(*point);
        for (row, sums) in stiffness.iter_mut().enumerate() {
            for (col, sum) in sums.iter_mut().enumerate() {
                *sum += shear_energy(&here, row, col) / points.len() as f64;
            }
        }
    }
    for (row, sums) in stiffness.iter_mut().enumerate() {
        for (col, sum) in sums.iter_mut().enumerate() {
            *sum += bulk * mean[row / 3][row % 3] * mean[col / 3][col % 3];
        }
    }
    stiffness
}

/// 2 · (deviatoric strain of `row`) : (deviatoric strain of `col`).
fn shear_energy(gradients: &Gradients, row: usize, col: usize) -> f64 {
    let (a, b) = (gradients[row / 3], gradients[col / 3]);
    let (i, j) = (row % 3, col % 3);
    // ε = ½ (eᵢ aᵀ + a eᵢᵀ): 2 ε : ε' = aᵀb δᵢⱼ + a_j b_i, less a third of both traces.
    let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    let along = if i == j { dot } else { 0.0 };
    along + a[j] * b[i] - 2.0 / 3.0 * a[i] * b[j]
}

fn gauss_points() -> Vec<[f64; 3]> {
    let place = |bit: usize| 0.5 + (bit as f64 - 0.5) / 3f64.sqrt();
    (0..8).map(|n| [place(n & 1), place(n >> 1 & 1), place(n >> 2 & 1)]).collect()
}

fn gradients(at: [f64; 3]) -> Gradients {
    std::array::from_fn(|node| {
        let bit = |axis: usize| node >> axis & 1;
        let value = |axis: usize| if bit(axis) == 1 { at[axis] } else { 1.0 - at[axis] };
        let slope = |axis: usize| if bit(axis) == 1 { 1.0 } else { -1.0 };
        [
            slope(0) * value(1) * value(2),
            value(0) * slope(1) * value(2),
            value(0) * value(1) * slope(2),
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodal displacements of the linear field u = H · x.
    fn linear(h: [[f64; 3]; 3]) -> [f64; N_DEGREES] {
        std::array::from_fn(|degree| {
            let node = degree / 3;
            let at = [node & 1, node >> 1 & 1, node >> 2 & 1].map(|bit| bit as f64);
            (0..3).map(|axis| h[degree % 3][axis] * at[axis]).sum()
        })
    }

    fn energy(stiffness: &Stiffness, u: &[f64; N_DEGREES]) -> f64 {
        let row = |row: &[f64; N_DEGREES]| row.iter().zip(u).map(|(k, u)| k * u).sum::<f64>();
        stiffness.iter().zip(u).map(|(k, u)| u * row(k)).sum::<f64>() / 2.0
    }

    #[test]
    fn uniform_strains_have_the_materials_energy() {
        // ν = 0.25: λ = 1 for μ = 1. Stretch ε along x alone: ½ (λ + 2 μ) ε² = 1.5 ε²; simple
        // shear γ: ½ μ γ²; a rigid rotation: 0. The patch test: uniform strain is exact.
        let stiffness = stiffness(0.25);
        let stretch = linear([[0.1, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
        assert!((energy(&stiffness, &stretch) - 0.015).abs() < 1e-12);
        let shear = linear([[0.0, 0.2, 0.0], [0.0; 3], [0.0; 3]]);
        assert!((energy(&stiffness, &shear) - 0.02).abs() < 1e-12);
        let turn = linear([[0.0, 0.3, 0.0], [-0.3, 0.0, 0.0], [0.0; 3]]);
        assert!(energy(&stiffness, &turn).abs() < 1e-12);
    }

    #[test]
    fn nodal_forces_match_the_stress_of_uniform_strain() {
        // The same stretch: stress λ + 2 μ = 3 along x and λ = 1 across, times 0.1. Four
        // nodes share each unit face: a quarter of the traction each.
        let stiffness = stiffness(0.25);
        let stretch = linear([[0.1, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
        for (degree, row) in stiffness.iter().enumerate() {
            let force: f64 = row.iter().zip(&stretch).map(|(k, u)| k * u).sum();
            let outward = if ((degree / 3) >> (degree % 3)) & 1 == 1 { 0.25 } else { -0.25 };
            let stress = if degree % 3 == 0 { 0.3 } else { 0.1 };
            assert!((force - outward * stress).abs() < 1e-12, "degree {degree}");
        }
    }

    #[test]
    fn a_nearly_incompressible_element_bends_without_locking() {
        // Bending u_x = x z keeps the volume on average: with plain integration its energy
        // grows with the bulk modulus, with the mean dilatation it stays that of the shear.
        let bent = std::array::from_fn(|degree| {
            let node = degree / 3;
            let at = |axis: usize| (node >> axis & 1) as f64 - 0.5;
            if degree % 3 == 0 { at(0) * at(2) } else { 0.0 }
        });
        let (soft, stiff) = (energy(&stiffness(0.3), &bent), energy(&stiffness(0.4999), &bent));
        assert!((stiff / soft - 1.0).abs() < 1e-9, "{soft} and {stiff}");
    }
}
