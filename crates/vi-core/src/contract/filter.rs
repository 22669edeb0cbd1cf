//! The filtered inverse mass W = P(M⁻¹L) M⁻¹, with which a body's highest frequencies are lower, so that explicit
//! steps may be longer.
//!
//! M is the lumped mass. L is a weighted graph Laplacian of the nodes, (L v)_a = Σ_b w_ab (v_a − v_b), with the same
//! weights for all axes. P is a polynomial with P(0) = 1. W is symmetric, and positive because P is positive on the
//! whole real line. The kinetic energy ½ pᵀW p therefore gives a Hamiltonian system, to which every splitting of kicks and
//! drifts applies:
//! - a uniform velocity is unchanged (L v = 0), so linear momentum is Σ p = Σ m q̇, and free fall is exact;
//! - W has one number per pair of nodes, so Σ q̇ × p = Σ_ab W_ab p_b × p_a = 0 and drifts conserve Σ q × p.
//!
//! P makes λ P(λ) as small as possible on the spectrum 0 … Λ of M⁻¹L. Among polynomials of degree 2 this is
//! λ P(λ) = (T₃(c) − T₃(c − (c + 1) λ/Λ)) Λ / ((c + 1) T₃'(c)) with Chebyshev's polynomial T₃ and c = 1, of height Λ/9. There P
//! has a zero. c = 1.05 keeps P above .03, for a height of Λ/8.45. On waves of low λ, P ≈ 1 − 2.52 λ/Λ: Λ grows with
//! the inverse square of the size of elements, so the error of a given wave falls with this square.
//!
//! Leapfrog steps with a polynomial of K in place of L need more forces per step (Gilbert & Joly, 2008; Carle, Hochbruck
//! & Sturm, SIAM J. Numer. Anal. 58, 2020). L costs no force.

use crate::contract::coordinates::Coordinates;
use crate::contract::inertia::solve_mass;
use crate::contract::patch::Padded;

/// c of the polynomial. P1 n8: 1.02, 1.05 and 1.1 allow steps 2.29, 2.25 and 2.18 times as long, with errors of 6.7e-3,
/// 6.4e-3 and 6.1e-3.
const DAMPING: f64 = 1.05;

/// A weighted link w_ab between the nodes a and b: L v has w_ab (v_a − v_b) at a, and the opposite at b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// The nodes a and b.
    pub nodes: [u32; 2],
    /// w_ab, N/m.
    pub weight: f64,
}

/// W of points in space. Products take and give one padded vector per node, with zeros at prescribed coordinates.
#[derive(Debug, Clone)]
pub struct MassFilter {
    /// Row a has the entries `starts[a]..starts[a + 1]`.
    starts: Vec<u32>,
    /// For each entry: the other node, and the weight.
    others: Vec<u32>,
    weights: Vec<f64>,
    /// 1/m of every coordinate, 1/kg; zero at prescribed ones.
    inverse_mass: Vec<Padded>,
    /// −P'(0), s², and ½ P''(0), s⁴.
    coefficients: [f64; 2],
}

impl MassFilter {
    /// Returns the filter with these links and the lumped `mass` of all coordinates, kg. P is 1 until
    /// [`MassFilter::with_highest`] chooses it.
    pub fn new(coordinates: &Coordinates, mass: &[f64], links: &[Link]) -> Self {
        let nodes = mass.len() / 3;
        let mut inverse_mass = vec![Padded::default(); nodes];
        for dof in coordinates.free().iter().map(|&dof| dof as usize) {
            inverse_mass[dof / 3].0[dof % 3] = 1.0 / mass[dof];
        }
        let moves = |node: u32| inverse_mass[node as usize] != Padded::default();
        let ends = |link: &Link| {
            let [a, b] = link.nodes;
            [(a, b), (b, a)]
        };
        let ends = || links.iter().flat_map(move |link| ends(link).map(|ends| (ends, link.weight)));
        let ends = || ends().filter(|((node, _), _)| moves(*node));
        let mut starts = vec![0_u32; nodes + 1];
        ends().for_each(|((node, _), _)| starts[node as usize + 1] += 1);
        (0..nodes).for_each(|node| starts[node + 1] += starts[node]);
        let count = starts[nodes] as usize;
        let (mut next, mut others, mut weights) = (starts.clone(), vec![0; count], vec![0.0; count]);
        for ((node, other), weight) in ends() {
            let place = &mut next[node as usize];
            others[*place as usize] = other;
            weights[*place as usize] = weight;
            *place += 1;
        }
        Self { starts, others, weights, inverse_mass, coefficients: [0.0; 2] }
    }

    /// Returns the filter with the polynomial for the highest eigenvalue Λ of M⁻¹L, 1/s².
    #[must_use]
    pub fn with_highest(self, lambda: f64) -> Self {
        Self { coefficients: polynomial(lambda), ..self }
    }

    /// Returns P(λ) for an eigenvalue λ of M⁻¹L, 1/s².
    pub fn factor(&self, lambda: f64) -> f64 {
        let [linear, quadratic] = self.coefficients;
        1.0 - lambda * linear + lambda * lambda * quadratic
    }

    /// Returns the number of weights that a product with L reads.
    pub fn entries(&self) -> usize {
        self.weights.len()
    }

    /// Returns 1/m of every coordinate, 1/kg; zero at prescribed ones.
    pub fn inverse_mass(&self) -> &[Padded] {
        &self.inverse_mass
    }

    /// Writes M⁻¹L v of the nodes from `first` on, as many as fit in `out`.
    #[inline(always)]
    pub fn laplacian(&self, first: usize, v: &[Padded], out: &mut [Padded]) {
        for (node, out) in (first..).zip(out) {
            let entries = self.starts[node] as usize..self.starts[node + 1] as usize;
            let (own, mut sum) = (v[node].0, [0.0; 4]);
            for (&other, &weight) in self.others[entries.clone()].iter().zip(&self.weights[entries]) {
                let other = &v[other as usize].0;
                for k in 0..4 {
                    sum[k] += weight * (own[k] - other[k]);
                }
            }
            for k in 0..4 {
                out.0[k] = self.inverse_mass[node].0[k] * sum[k];
            }
        }
    }

    /// Writes P(M⁻¹L) v of the nodes from `first` on, as many as fit in `out`; z is M⁻¹L v of all nodes.
    #[inline(always)]
    pub fn filtered(&self, first: usize, (v, z): (&[Padded], &[Padded]), out: &mut [Padded]) {
        let [linear, quadratic] = self.coefficients;
        self.laplacian(first, z, out);
        for (node, out) in (first..).zip(out) {
            for k in 0..4 {
                out.0[k] = v[node].0[k] - linear * z[node].0[k] + quadratic * out.0[k];
            }
        }
    }

    /// Returns q̇ = W p, m/s.
    pub(crate) fn velocity(&self, coordinates: &Coordinates, p: &[f64]) -> Vec<f64> {
        let mut q_dot = vec![0.0; p.len()];
        self.multiply(coordinates, p, &mut q_dot);
        q_dot
    }

    /// Returns p = W⁻¹q̇, kg m/s, to round-off.
    pub(crate) fn momentum(&self, coordinates: &Coordinates, q_dot: &[f64]) -> Vec<f64> {
        let free = coordinates.free();
        let inverse: Vec<f64> =
            free.iter().map(|&dof| self.inverse_mass[dof as usize / 3].0[dof as usize % 3]).collect();
        let mut p: Vec<f64> = q_dot.iter().zip(&inverse).map(|(v, inverse)| v / inverse).collect();
        // W takes the place of a mass matrix here, and 1/m that of its lumped form.
        solve_mass(|p, out| self.multiply(coordinates, p, out), &inverse, q_dot, &mut p);
        p
    }

    /// Computes M⁻¹p at the free coordinates; `p(k)` is the momentum of free coordinate k.
    pub fn divide(&self, coordinates: &Coordinates, p: impl Fn(usize) -> f64, v: &mut [Padded]) {
        for (k, &dof) in coordinates.free().iter().enumerate() {
            let (node, axis) = (dof as usize / 3, dof as usize % 3);
            v[node].0[axis] = p(k) * self.inverse_mass[node].0[axis];
        }
    }

    fn multiply(&self, coordinates: &Coordinates, p: &[f64], out: &mut [f64]) {
        let [mut v, mut z, mut w] = [(); 3].map(|()| vec![Padded::default(); self.inverse_mass.len()]);
        self.divide(coordinates, |k| p[k], &mut v);
        self.laplacian(0, &v, &mut z);
        self.filtered(0, (&v, &z), &mut w);
        for (out, &dof) in out.iter_mut().zip(coordinates.free()) {
            *out = w[dof as usize / 3].0[dof as usize % 3];
        }
    }
}

/// Returns −P'(0) and ½ P''(0). With T₃(y) = 4y³ − 3y, λ P(λ) is the cubic of the head of this file.
fn polynomial(lambda: f64) -> [f64; 2] {
    if lambda <= 0.0 {
        return [0.0; 2];
    }
    let (c, width) = (DAMPING, DAMPING + 1.0);
    let slope = 12.0 * c * c - 3.0;
    [12.0 * c * width / (slope * lambda), 4.0 * width * width / (slope * lambda * lambda)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_polynomial_is_positive_and_that_of_chebyshev() {
        let lambda = 7.0;
        let filter = MassFilter::new(&Coordinates::all_free(3), &[1.0; 3], &[]).with_highest(lambda);
        let t = |y: f64| 4.0 * y * y * y - 3.0 * y;
        let slope = 12.0 * DAMPING * DAMPING - 3.0;
        let mut highest = 0.0_f64;
        for k in 0..=1000 {
            let x = k as f64 / 1000.0;
            let value = x * filter.factor(x * lambda);
            let wanted = (t(DAMPING) - t(DAMPING - (DAMPING + 1.0) * x)) / ((DAMPING + 1.0) * slope);
            assert!((value - wanted).abs() < 1e-14, "{x}: {value} {wanted}");
            highest = highest.max(value);
        }
        assert!((1.0 / highest - 8.45).abs() < 0.01, "{}", 1.0 / highest);
        for k in -3000..3000 {
            assert!(filter.factor(0.01 * f64::from(k)) > 0.02);
        }
    }
}
