//! Solves (A + E) δ = b, where A has a factor and E is the difference between the true matrix and A. GMRES solves the
//! preconditioned system (I + A⁻¹E) δ = A⁻¹b.
//!
//! GMRES ends when the error is small relative to the whole δ. In contact, a correction may be much longer than the gap of a pair
//! in a stiff layer, and that error would then close the gap. So the residual b − (A + E) δ must be small too; otherwise
//! the rest is solved for in the same way.

use crate::linear::gmres;
use crate::vectors::{dot, norm, update};

/// Largest residual relative to b, and largest number of further solves that reduce it.
const REST: f64 = 1e-3;
const REFINEMENTS: u32 = 4;
/// Largest number of products with E per solve.
const MOST_PRODUCTS: usize = 60;

/// A system with A⁻¹ and products with E, and its solution so far.
pub(crate) trait Perturbed {
    type Error;
    /// Returns E v; `None` if E is zero.
    fn defect(&mut self, v: &[f64]) -> Option<Vec<f64>>;
    /// Computes v ← A⁻¹v.
    fn invert(&mut self, v: &mut [f64]) -> Result<(), Self::Error>;
    /// Adds A⁻¹r to the solution.
    fn add(&mut self, r: &[f64]) -> Result<(), Self::Error>;
    /// Returns the solution.
    fn solution(&mut self) -> &[f64];
}

/// Replaces the solution A⁻¹b of `system` by the solution δ of (A + E) δ = b; `size` is the norm of b. GMRES solves to
/// the relative error `forcing`. Returns the number of solves with A.
pub(crate) fn solve<P: Perturbed>(system: &mut P, size: f64, forcing: f64) -> Result<usize, P::Error> {
    let mut b = system.solution().to_vec();
    let mut products = 0;
    // The solution before the current solve, without A⁻¹b, and the remaining residual.
    let (mut solved, mut rest) = (vec![0.0; b.len()], vec![0.0; b.len()]);
    for _ in 0..=REFINEMENTS {
        let product = |v: &[f64]| {
            let mut image = v.to_vec();
            if let Some(mut change) = system.defect(v) {
                system.invert(&mut change)?;
                update(&mut image, |k, value| *value += change[k]);
            }
            Ok(image)
        };
        let (delta, count) = gmres::solve(product, dot, &b, forcing, MOST_PRODUCTS)?;
        products += count;
        let Some(defect) = system.defect(&delta) else { break };
        update(&mut rest, |k, rest| *rest -= defect[k]);
        system.add(&rest)?;
        products += 1;
        // With the difference d between the result of GMRES and that of A⁻¹(b − E ·), the residual is E d.
        let mut difference = delta;
        update(&mut difference, |k, value| *value += solved[k]);
        solved.copy_from_slice(system.solution());
        update(&mut difference, |k, value| *value -= solved[k]);
        let Some(left) = system.defect(&difference) else { break };
        if norm(&left) <= REST * size {
            break;
        }
        b.copy_from_slice(&left);
        system.invert(&mut b)?;
        rest = left;
    }
    Ok(products)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Diagonal A and E, and the solution.
    struct Diagonal {
        a: Vec<f64>,
        e: Vec<f64>,
        solution: Vec<f64>,
    }

    impl Perturbed for Diagonal {
        type Error = ();
        fn defect(&mut self, v: &[f64]) -> Option<Vec<f64>> {
            Some(self.e.iter().zip(v).map(|(e, v)| e * v).collect())
        }
        fn invert(&mut self, v: &mut [f64]) -> Result<(), ()> {
            v.iter_mut().zip(&self.a).for_each(|(v, a)| *v /= a);
            Ok(())
        }
        fn add(&mut self, r: &[f64]) -> Result<(), ()> {
            self.solution.iter_mut().zip(r).zip(&self.a).for_each(|((value, r), a)| *value += r / a);
            Ok(())
        }
        fn solution(&mut self) -> &[f64] {
            &self.solution
        }
    }

    /// A pair in a stiff layer, of which A has twice the stiffness, is pressed by a force of 100, and other coordinates
    /// by 1. Its gap changes by 2e-7 of their motion, and is still solved for to a hundredth.
    #[test]
    fn a_long_motion_does_not_close_the_gap_of_a_stiff_pair() {
        let stiff = 1e9;
        let a: Vec<f64> = std::iter::once(stiff).chain([1.0; 20]).collect();
        let e: Vec<f64> =
            std::iter::once(-0.5 * stiff).chain((1..=20).map(|k| 0.05 * f64::from(k))).collect();
        let b: Vec<f64> = std::iter::once(100.0).chain([1.0; 20]).collect();
        let solution = b.iter().zip(&a).map(|(b, a)| b / a).collect();
        let mut system = Diagonal { a, e, solution };
        solve(&mut system, norm(&b), 1e-4).unwrap();
        let gap = system.solution[0];
        assert!((gap / (100.0 / (0.5 * stiff)) - 1.0).abs() < 1e-2, "{gap:e}");
    }
}
