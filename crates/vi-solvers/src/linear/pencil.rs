//! A pair of symmetric matrices K and M, with a factor of K + σM.

use crate::error::SolverError;
use crate::interrupt::Interrupt;
use crate::linear::factor::Factor;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::matrix_sum::MatrixSum;
use crate::vectors;

/// The matrices K and M, with a factor of K + σM.
pub(crate) struct Pencil {
    stiffness: SymmetricMatrix,
    lumped: Vec<f64>,
    /// The consistent mass and the sum K + σM, if the mass is not lumped.
    consistent: Option<(SymmetricMatrix, MatrixSum)>,
    factor: Factor,
    /// The shift σ, 1/s².
    pub(crate) shift: f64,
    interrupt: Interrupt,
}

impl Pencil {
    pub(crate) fn lumped(stiffness: SymmetricMatrix, lumped: Vec<f64>) -> Result<Self, SolverError> {
        let factor = Factor::new(&stiffness)?;
        Ok(Self { stiffness, lumped, consistent: None, factor, shift: 0.0, interrupt: Interrupt::NEVER })
    }

    pub(crate) fn consistent(
        stiffness: SymmetricMatrix,
        lumped: Vec<f64>,
        mass: SymmetricMatrix,
    ) -> Result<Self, SolverError> {
        let sum = MatrixSum::new(&[&stiffness, &mass])?;
        let factor = Factor::new(sum.matrix())?;
        let consistent = Some((mass, sum));
        Ok(Self { stiffness, lumped, consistent, factor, shift: 0.0, interrupt: Interrupt::NEVER })
    }

    /// Returns the pencil with a request that ends factorisations and solves.
    pub(crate) fn interruptible(self, interrupt: &Interrupt) -> Self {
        Self { interrupt: interrupt.clone(), ..self }
    }

    /// Returns the number of unknowns.
    pub(crate) fn size(&self) -> usize {
        self.lumped.len()
    }

    /// Returns max K_ii/M_ii, 1/s².
    pub(crate) fn stiffest(&self) -> f64 {
        let mut diagonal = vec![0.0; self.size()];
        self.stiffness.diagonal(&mut diagonal);
        diagonal.iter().zip(&self.lumped).map(|(k, m)| (k / m).abs()).fold(0.0, f64::max)
    }

    /// Factors K + σM for the first of σ, 10 σ, 100 σ, … for which it is positive definite.
    pub(crate) fn factorize(&mut self, shift: f64) -> Result<(), SolverError> {
        let mut shift = shift;
        let mut last = None;
        for _ in 0..25 {
            self.interrupt.check()?;
            let result = match &mut self.consistent {
                None => {
                    let mass: Vec<f64> = self.lumped.iter().map(|mass| shift * mass).collect();
                    self.factor.factorize(&mass, 1.0, &self.stiffness)
                }
                Some((mass, sum)) => {
                    self.factor.factorize(&[], 1.0, sum.combine(&[(1.0, &self.stiffness), (shift, mass)]))
                }
            };
            match result {
                Ok(()) => {
                    self.shift = shift;
                    return Ok(());
                }
                Err(error) => last = Some(error),
            }
            shift *= 10.0;
        }
        Err(last.map_or(SolverError::NotFactored, SolverError::NotPositiveDefinite))
    }

    /// Computes x = (K + σM)⁻¹ b in place.
    pub(crate) fn solve(&mut self, rhs_to_solution: &mut [f64]) -> Result<(), SolverError> {
        self.interrupt.check()?;
        self.factor.solve(rhs_to_solution).map(|_| ())
    }

    /// Computes y = M x.
    pub(crate) fn multiply_mass(&self, x: &[f64], y: &mut [f64]) {
        match &self.consistent {
            Some((mass, _)) => mass.multiply(x, y),
            None => vectors::fill(y, |k| self.lumped[k] * x[k]),
        }
    }

    /// Returns ‖Kφ − λMφ‖ / ((|λ| + σ) ‖Mφ‖) in the norm of the inverse lumped mass.
    pub(crate) fn residual(&self, vector: &[f64], value: f64) -> f64 {
        let n = self.size();
        let (mut k_x, mut m_x) = (vec![0.0; n], vec![0.0; n]);
        self.stiffness.multiply(vector, &mut k_x);
        self.multiply_mass(vector, &mut m_x);
        let difference = vectors::sum(n, |k| (k_x[k] - value * m_x[k]).powi(2) / self.lumped[k]);
        let size = vectors::sum(n, |k| m_x[k] * m_x[k] / self.lumped[k]);
        (difference / size).sqrt() / (value.abs() + self.shift)
    }

    /// Returns xᵀM y.
    pub(crate) fn mass_product(&self, x: &[f64], y: &[f64]) -> f64 {
        let mut m_y = vec![0.0; y.len()];
        self.multiply_mass(y, &mut m_y);
        vectors::sum(x.len(), |k| x[k] * m_y[k])
    }
}
