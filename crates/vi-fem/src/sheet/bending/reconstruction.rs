//! Computes from hinge angles alone how the normal at the midpoint of each edge divides the angle of its hinge.
//!
//! Let w be the height of the sheet over a tangent plane. In Morley's plate the unknowns of a triangle are the values
//! of w at its corners and the slopes ∂w/∂m at the midpoints of its edges. The curvature is κ = Σ 2 φᵢ/hᵢ mᵢ ⊗ mᵢ,
//! where φᵢ is the rotation from the flat facet to the slope at edge i, hᵢ the height over that edge and mᵢ its
//! outward normal. Across an inner edge φ₁ + φ₂ = θ, the angle of the hinge. Only the division of θ into φ₁ and φ₂ is
//! unknown. This file takes it from the angles at the five edges of the two triangles such that it is exact for every
//! quadratic w: for a constant curvature, θ and φ₁ are known linear functions of it, and five angles determine the
//! curvature by least squares.
//!
//! The states of the sheet are thus a subspace of Morley's states with single-valued slopes. Hence the method is
//! coercive and consistent as Morley's plate is, and complete for quadratics. It converges on unstructured meshes at
//! Morley's orders (Lascaux & Lesaint 1975; Shi 1990) with positions as the only degrees of freedom.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::hinges::{Hinge, Opposite};
use super::sheet::BentSheet;

/// A linear function of a curvature, by its coefficients for (κ_tt, κ_mm, κ_tm) in the frame of an edge.
type Functional = Vector3<f64>;

/// The rotation φ at one edge of a triangle, as Σ coefficient × (θ − θ̄) over hinges. It is positive in the sense of
/// the triangle's own normal. `None` at a free edge.
pub(super) type Turn = Option<Vec<(u32, f64)>>;

/// Returns the rotations at the three edges of every triangle.
pub(super) fn turns(sheet: &BentSheet, hinges: &[Hinge]) -> Vec<[Turn; 3]> {
    let rows = Rows::new(sheet, hinges);
    let mut turns: Vec<[Turn; 3]> = vec![[const { None }; 3]; sheet.surface.triangles.len()];
    for (index, hinge) in hinges.iter().enumerate() {
        if !hinge.is_single {
            continue;
        }
        let (one, k) = hinge.first;
        match hinge.opposite {
            Opposite::Held(_) | Opposite::Mirror(_) => {
                turns[one as usize][usize::from(k)] = Some(vec![(index as u32, 1.0)])
            }
            Opposite::Node(_, (two, far_k)) => {
                let (share, division) = rows.division(index);
                let mut near = vec![(index as u32, share)];
                near.extend(&division);
                let sense = if is_reversed(sheet, hinge) { -1.0 } else { 1.0 };
                let mut far = vec![(index as u32, sense * (1.0 - share))];
                far.extend(division.iter().map(|&(other, c)| (other, -sense * c)));
                turns[one as usize][usize::from(k)] = Some(near);
                turns[two as usize][usize::from(far_k)] = Some(far);
            }
        }
    }
    turns
}

/// Returns whether the second triangle of a hinge has the opposite orientation.
fn is_reversed(sheet: &BentSheet, hinge: &Hinge) -> bool {
    match hinge.opposite {
        Opposite::Node(_, two) => sheet.surface.around(two.0, two.1)[1] == hinge.nodes[0],
        Opposite::Held(_) | Opposite::Mirror(_) => false,
    }
}

/// Returns φ₁ as a function of a constant curvature.
fn first_turn(hinge: &Hinge) -> Functional {
    let ([height, _], [foot, _]) = (hinge.heights, hinge.feet);
    let along = 0.5 * (foot * foot - 0.25 * hinge.length.powi(2)) / height;
    Vector3::new(along, 0.5 * height, -foot)
}

/// Returns θ = φ₁ + φ₂ as a function of a constant curvature; φ₁ alone if the second triangle is a support.
fn angle(hinge: &Hinge) -> Functional {
    let first = first_turn(hinge);
    if hinge.opposite.is_support() {
        return first;
    }
    let ([_, height], [_, foot]) = (hinge.heights, hinge.feet);
    let along = 0.5 * (foot * foot - 0.25 * hinge.length.powi(2)) / height;
    first + Vector3::new(along, 0.5 * height, foot)
}

/// Tangent t (in the orientation of the triangle) and outward normal m of an edge, in the plane of the triangle.
type EdgeFrame = [[f64; 2]; 2];

struct Rows<'a> {
    sheet: &'a BentSheet<'a>,
    hinges: &'a [Hinge],
    /// The hinge at each edge of each triangle, if the edge has only one.
    at: Vec<[Option<u32>; 3]>,
    frames: Vec<[EdgeFrame; 3]>,
}

impl<'a> Rows<'a> {
    fn new(sheet: &'a BentSheet, hinges: &'a [Hinge]) -> Self {
        let count = sheet.surface.triangles.len();
        let mut at = vec![[None; 3]; count];
        for (index, hinge) in hinges.iter().enumerate().filter(|(_, hinge)| hinge.is_single) {
            at[hinge.first.0 as usize][usize::from(hinge.first.1)] = Some(index as u32);
            if let Opposite::Node(_, (two, k)) = hinge.opposite {
                at[two as usize][usize::from(k)] = Some(index as u32);
            }
        }
        let frames = (0..count).map(|triangle| edge_frames(&sheet.plane(triangle))).collect();
        Self { sheet, hinges, at, frames }
    }

    /// Returns the angle at edge k of a triangle as a function of a curvature in the frame of its edge `seen`:
    /// (hinge, sign of its angle in the triangle's orientation, function).
    fn row(&self, triangle: u32, k: usize, seen: usize) -> Option<(u32, f64, Functional)> {
        let index = self.at[triangle as usize][k]?;
        let hinge = &self.hinges[index as usize];
        let mut function = angle(hinge);
        let is_second = hinge.first != (triangle, k as u8);
        let mut sign = 1.0;
        if is_second && is_reversed(self.sheet, hinge) {
            // Seen from the other side, m and the normal change sign and t does not.
            sign = -1.0;
            function[2] = -function[2];
        }
        let [t, m] = self.frames[triangle as usize][k];
        let [seen_t, seen_m] = self.frames[triangle as usize][seen];
        let of = |a: [f64; 2], b: [f64; 2]| {
            // Evaluate the function at the curvature ½(a ⊗ b + b ⊗ a).
            let part = |u: [f64; 2], v: [f64; 2]| {
                let (ua, ub) = (u[0] * a[0] + u[1] * a[1], u[0] * b[0] + u[1] * b[1]);
                let (va, vb) = (v[0] * a[0] + v[1] * a[1], v[0] * b[0] + v[1] * b[1]);
                0.5 * (ua * vb + ub * va)
            };
            function[0] * part(t, t) + function[1] * part(m, m) + function[2] * part(t, m)
        };
        let seen_function = Vector3::new(of(seen_t, seen_t), of(seen_m, seen_m), 2.0 * of(seen_t, seen_m));
        Some((index, sign, seen_function))
    }

    /// Returns the factor α of θ and the coefficients of the other angles in φ₁ = α θ + Σ c_f θ_f.
    fn division(&self, index: usize) -> (f64, Vec<(u32, f64)>) {
        let hinge = &self.hinges[index];
        let Opposite::Node(_, (two, far_k)) = hinge.opposite else { return (1.0, Vec::new()) };
        let (one, near_k) = (hinge.first.0, usize::from(hinge.first.1));
        let far_k = usize::from(far_k);
        // The vector (κ_tt, κ_mm, √2 κ_tm) has the norm of the tensor.
        let scale = Vector3::new(1.0, 1.0, std::f64::consts::FRAC_1_SQRT_2);
        let mut rows: Vec<(u32, f64, Functional)> = (0..3).filter_map(|k| self.row(one, k, near_k)).collect();
        let is_reversed = is_reversed(self.sheet, hinge);
        let others = (0..3).filter(|&k| k != far_k).filter_map(|k| self.row(two, k, far_k));
        rows.extend(others.map(|(other, sign, mut function)| {
            if is_reversed {
                function[2] = -function[2];
            }
            (other, if is_reversed { -sign } else { sign }, function)
        }));
        let (mut first, total) =
            (first_turn(hinge).component_mul(&scale), angle(hinge).component_mul(&scale));
        let share = first.dot(&total) / total.dot(&total);
        first -= share * total;
        // Divide angles by lengths, so that all rows have equal weight.
        let mut matrix = SMatrix::<f64, 5, 3>::zeros();
        let mut weights = [0.0; 5];
        for (row, (other, _, function)) in rows.iter().enumerate() {
            let heights = self.hinges[*other as usize].heights;
            weights[row] = 2.0 / (heights[0] + heights[1]);
            matrix.set_row(row, &(weights[row] * function.component_mul(&scale)).transpose());
        }
        let solution = matrix * pseudo_inverse(matrix.transpose() * matrix) * first;
        let coefficients = rows
            .iter()
            .enumerate()
            .map(|(row, &(other, sign, _))| (other, sign * weights[row] * solution[row]))
            .collect();
        (share, coefficients)
    }
}

/// Returns the inverse of a positive semidefinite matrix on the directions that the angles determine well.
fn pseudo_inverse(matrix: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = matrix.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|value| if value > 1e-3 * largest { 1.0 / value } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// Returns the frames of the three edges of a triangle in its plane.
pub(super) fn edge_frames(p: &[[f64; 2]; 3]) -> [EdgeFrame; 3] {
    [0, 1, 2].map(|k| {
        let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
        let e = [b[0] - a[0], b[1] - a[1]];
        let length = e[0].hypot(e[1]);
        let t = [e[0] / length, e[1] / length];
        [t, [t[1], -t[0]]]
    })
}
