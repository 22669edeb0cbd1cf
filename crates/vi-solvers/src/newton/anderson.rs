//! Anderson acceleration of an iteration w ← w + δ(w) with one fixed factor (D. G. Anderson, J. ACM 12 (1965)
//! 547–560; Walker, Ni, SIAM J. Numer. Anal. 49 (2011) 1715–1735). The last few corrections show how the iteration
//! acts on a few directions, and these are corrected at once. Sums use the norm of A, in which errors are measured.

use nalgebra::{DMatrix, DVector};

use crate::vectors;

/// Number of differences that are kept.
const DEPTH: usize = 4;
/// A difference is dropped if this fraction or less of it is independent of the newer ones.
const INDEPENDENT: f64 = 1e-10;

/// One difference of successive iterates.
struct Difference {
    /// δ' − δ, and A times it.
    change: Vec<f64>,
    load: Vec<f64>,
    /// w' − w + δ' − δ.
    whole: Vec<f64>,
}

#[derive(Default)]
pub(super) struct Anderson {
    /// δ and Aδ of the last iteration; `None` after a new factor.
    last: Option<(Vec<f64>, Vec<f64>)>,
    /// w' − w of the last iteration.
    gone: Vec<f64>,
    /// The differences, newest first.
    differences: Vec<Difference>,
}

impl Anderson {
    /// Discards all differences, because the factor or the point has changed.
    pub(super) fn restart(&mut self) {
        self.last = None;
        self.differences.clear();
    }

    /// Records the correction δ with Aδ = `load`; replaces it by the accelerated one if `mix`.
    pub(super) fn mix(&mut self, delta: &mut [f64], load: &[f64], mix: bool) {
        let n = delta.len();
        let (mut raw, mut raw_load) = match self.last.take() {
            Some((last, last_load)) => {
                let mut difference =
                    if self.differences.len() == DEPTH { self.differences.pop() } else { None }
                        .unwrap_or_else(|| Difference {
                            change: vec![0.0; n],
                            load: vec![0.0; n],
                            whole: vec![0.0; n],
                        });
                let gone = &self.gone;
                vectors::fill(&mut difference.change, |k| delta[k] - last[k]);
                vectors::fill(&mut difference.load, |k| load[k] - last_load[k]);
                let change = &difference.change;
                vectors::fill(&mut difference.whole, |k| gone[k] + change[k]);
                self.differences.insert(0, difference);
                (last, last_load)
            }
            None => (vec![0.0; n], vec![0.0; n]),
        };
        raw.copy_from_slice(delta);
        raw_load.copy_from_slice(load);
        self.last = Some((raw, raw_load));
        if mix && !self.differences.is_empty() {
            let weights = self.weights(load);
            for (difference, weight) in self.differences.iter().zip(&weights) {
                let whole = &difference.whole;
                vectors::update(delta, |k, delta| *delta -= weight * whole[k]);
            }
        }
    }

    /// Records that the step w' − w = fraction · δ was made.
    pub(super) fn advance(&mut self, delta: &[f64], fraction: f64) {
        self.gone.resize(delta.len(), 0.0);
        vectors::fill(&mut self.gone, |k| fraction * delta[k]);
    }

    /// Returns the weights γ of the differences that minimise ‖δ − Σ γ_i Δδ_i‖ in the norm of A.
    fn weights(&self, load: &[f64]) -> Vec<f64> {
        let n = load.len();
        let product = |i: usize, load: &[f64]| {
            let change = &self.differences[i].change;
            vectors::sum(n, |k| change[k] * load[k])
        };
        let mut count = self.differences.len();
        let all = DMatrix::from_fn(count, count, |i, j| product(i.min(j), &self.differences[i.max(j)].load));
        let rhs = DVector::from_fn(count, |i, _| product(i, load));
        // Take roots of energies in a unit that is a power of two, so that the weights do not depend on units.
        let per_unit = vectors::per_unit(all[(0, 0)]);
        let (all, rhs) = (all * per_unit, rhs * per_unit);
        while count > 0 {
            let gram = all.view((0, 0), (count, count)).into_owned();
            if let Some(cholesky) = gram.clone().cholesky() {
                let l = cholesky.l_dirty();
                if (0..count).all(|i| l[(i, i)] * l[(i, i)] > INDEPENDENT * gram[(i, i)]) {
                    return cholesky.solve(&rhs.rows(0, count).into_owned()).iter().copied().collect();
                }
            }
            count -= 1;
        }
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_iteration_of_four_slow_directions_ends_after_five_steps() {
        // w ← w + δ with δ = −(1 − s_k) w_k has the contractions s_k, some of them above 1; A = 1.
        let keep = [0.9, -1.5, 0.5, 2.0, 0.0, 0.0, 0.0];
        let mut w = vec![1.0; 7];
        let mut anderson = Anderson::default();
        for _ in 0..6 {
            let load: Vec<f64> = w.iter().zip(keep).map(|(w, s)| -(1.0 - s) * w).collect();
            let mut delta = load.clone();
            anderson.mix(&mut delta, &load, true);
            anderson.advance(&delta, 1.0);
            w.iter_mut().zip(&delta).for_each(|(w, d)| *w += d);
        }
        assert!(w.iter().all(|w| w.abs() < 1e-9), "{w:?}");
    }
}
