//! Block Lanczos method for (K + σM)⁻¹M with full reorthogonalisation; it finds the largest θ = 1/(λ + σ) first. A
//! block as wide as the number of rigid motions of a free body finds multiple eigenvalues. The start is fixed, so
//! that equal inputs give equal bits (Grimes, Lewis & Simon 1994).

use nalgebra::DMatrix;

use crate::error::SolverError;
use crate::linear::pencil::Pencil;
use crate::vectors;

/// Number of vectors per block.
const BLOCK: usize = 6;

/// An eigenpair of K φ = λ M φ with φᵀMφ = 1.
#[derive(Debug, Clone)]
pub(crate) struct Pair {
    pub(crate) value: f64,
    pub(crate) vector: Vec<f64>,
}

/// Returns the `count` lowest eigenpairs, ascending.
pub(crate) fn lowest_pairs(
    pencil: &mut Pencil,
    count: usize,
    tolerance: f64,
) -> Result<Vec<Pair>, SolverError> {
    let stiffest = pencil.stiffest();
    if stiffest == 0.0 {
        // There is no stiffness: every vector of mass norm 1 is a mode of zero frequency.
        pencil.factorize(1.0)?;
        return Krylov::new(pencil).pairs(pencil, count, tolerance);
    }
    // A first pass with a tiny shift shows where the wanted values lie; the second pass shifts there.
    pencil.factorize(1e-8 * stiffest)?;
    let look = Krylov::new(pencil).pairs(pencil, count, 1e-2)?;
    let highest = look.last().map_or(stiffest, |pair| pair.value.abs());
    let lowest = look.first().map_or(0.0, |pair| pair.value);
    let shift = (0.1 * highest).max(-2.0 * lowest).max(1e-12 * stiffest);
    pencil.factorize(shift)?;
    Krylov::new(pencil).pairs(pencil, count, tolerance)
}

/// An M-orthonormal basis Q of the Krylov space, with MQ and the projection T = QᵀM(K + σM)⁻¹MQ.
struct Krylov {
    basis: Vec<Vec<f64>>,
    weighted: Vec<Vec<f64>>,
    /// The columns of T that are known so far.
    projection: Vec<Vec<f64>>,
    /// (K + σM)⁻¹M times the last block, orthogonal to the basis.
    next: Vec<Vec<f64>>,
    /// Number of random vectors drawn so far.
    drawn: u64,
}

impl Krylov {
    fn new(pencil: &Pencil) -> Self {
        let mut krylov = Self {
            basis: Vec::new(),
            weighted: Vec::new(),
            projection: Vec::new(),
            next: Vec::new(),
            drawn: 0,
        };
        krylov.next = (0..BLOCK.min(pencil.size())).map(|_| krylov.draw(pencil.size())).collect();
        krylov
    }

    /// Returns a vector of numbers in ±1 by the splitmix64 generator, the same in every run.
    fn draw(&mut self, n: usize) -> Vec<f64> {
        self.drawn += 1;
        let mut state = self.drawn.wrapping_mul(0xD1B5_4A32_D192_ED03);
        (0..n)
            .map(|_| {
                state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
                let mut z = state;
                z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
            })
            .collect()
    }

    /// Removes the components along the basis from `vector`; returns the products QᵀM·vector.
    fn orthogonalise(&self, vector: &mut [f64]) -> Vec<f64> {
        let mut products = vec![0.0; self.basis.len()];
        for _ in 0..2 {
            for (k, (q, weighted)) in self.basis.iter().zip(&self.weighted).enumerate() {
                let along = vectors::sum(vector.len(), |i| weighted[i] * vector[i]);
                products[k] += along;
                vectors::update(vector, |i, value| *value -= along * q[i]);
            }
        }
        products
    }

    /// Adds the next block to the basis and applies the operator to it. Components along earlier vectors are removed;
    /// if nothing is left of a vector, a new random one is drawn.
    fn grow(&mut self, pencil: &mut Pencil) -> Result<(), SolverError> {
        let n = pencil.size();
        let first = self.basis.len();
        for mut vector in std::mem::take(&mut self.next) {
            if self.basis.len() == n {
                break;
            }
            let mut size = pencil.mass_product(&vector, &vector).sqrt();
            let mut attempts = 0;
            loop {
                self.orthogonalise(&mut vector);
                let mut weighted = vec![0.0; n];
                pencil.multiply_mass(&vector, &mut weighted);
                let rest = vectors::sum(n, |i| vector[i] * weighted[i]).max(0.0).sqrt();
                if rest > 1e-10 * size && rest > 0.0 {
                    vectors::update(&mut vector, |_, value| *value /= rest);
                    vectors::update(&mut weighted, |_, value| *value /= rest);
                    self.basis.push(vector);
                    self.weighted.push(weighted);
                    break;
                }
                attempts += 1;
                if attempts > 5 {
                    break;
                }
                vector = self.draw(n);
                size = pencil.mass_product(&vector, &vector).sqrt();
            }
        }
        for k in first..self.basis.len() {
            let mut image = self.weighted[k].clone();
            pencil.solve(&mut image)?;
            let column = self.orthogonalise(&mut image);
            self.projection.push(column);
            self.next.push(image);
        }
        Ok(())
    }

    /// Grows the basis until the `count` largest θ have converged.
    fn pairs(mut self, pencil: &mut Pencil, count: usize, tolerance: f64) -> Result<Vec<Pair>, SolverError> {
        let n = pencil.size();
        let limit = n.min(20 * count + 300);
        let mut worst = f64::INFINITY;
        while self.basis.len() < limit {
            let before = self.basis.len();
            self.grow(pencil)?;
            let size = self.basis.len();
            let is_whole = size >= n || size == before;
            if size < count + BLOCK && !is_whole {
                continue;
            }
            let projection = DMatrix::from_fn(size, size, |i, j| {
                let (i, j) = (i.min(j), i.max(j));
                self.projection[j][i]
            });
            let eigen = projection.symmetric_eigen();
            let mut order: Vec<usize> = (0..size).collect();
            order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
            // ‖A⁻¹My − θy‖_M comes from the next block's contribution to the last rows of the Ritz vector.
            let gram = self.next_gram(pencil);
            let last = size - self.next.len();
            worst = 0.0;
            for &k in order.iter().take(count) {
                let tail = |i: usize| eigen.eigenvectors[(last + i, k)];
                let mut square = 0.0;
                for i in 0..self.next.len() {
                    for j in 0..self.next.len() {
                        square += tail(i) * gram[i][j] * tail(j);
                    }
                }
                worst = f64::max(worst, square.max(0.0).sqrt() / eigen.eigenvalues[k].abs());
            }
            if worst <= tolerance || is_whole {
                let wanted = order.iter().take(count);
                let pair = |&k: &usize| {
                    let mut vector = vec![0.0; n];
                    for (i, q) in self.basis.iter().enumerate() {
                        let share = eigen.eigenvectors[(i, k)];
                        vectors::update(&mut vector, |j, value| *value += share * q[j]);
                    }
                    let size = pencil.mass_product(&vector, &vector).sqrt();
                    vectors::update(&mut vector, |_, value| *value /= size);
                    Pair { value: 1.0 / eigen.eigenvalues[k] - pencil.shift, vector }
                };
                let mut pairs: Vec<Pair> = wanted.map(pair).collect();
                pairs.sort_by(|a, b| a.value.total_cmp(&b.value));
                return Ok(pairs);
            }
        }
        Err(SolverError::NoConvergence { iterations: limit as u32, residual: worst, tolerance })
    }

    fn next_gram(&self, pencil: &Pencil) -> Vec<Vec<f64>> {
        let product = |x: &Vec<f64>, y: &Vec<f64>| pencil.mass_product(x, y);
        self.next.iter().map(|x| self.next.iter().map(|y| product(x, y)).collect()).collect()
    }
}
