//! The matrices and forces of a scene, for other programs and solvers: mass M, stiffness K = ∂²V/∂q² and the residual
//! f − ∂V/∂q on the free coordinates. They are written as Matrix Market files, and with the feature `sprs` converted
//! to `sprs::CsMat`.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

#[cfg(feature = "sprs")]
use sprs::{CsMat, TriMat};
use vi_core::{State, System, Terms};
use vi_solvers::{Assembler, HessianEvaluation, SolverError, SymmetricMatrix};

use crate::simulation::Simulation;

/// The lower triangle of a symmetric matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct LowerTriangle {
    /// Number of rows and columns.
    pub size: usize,
    /// Entries (row, column, value) with row ≥ column, sorted by row and then by column.
    pub entries: Vec<(usize, usize, f64)>,
}

impl LowerTriangle {
    fn of(matrix: &SymmetricMatrix) -> Self {
        let mut entries: Vec<_> = matrix.lower_triangle().collect();
        entries.sort_unstable_by_key(|&(row, column, _)| (row, column));
        Self { size: matrix.free_count(), entries }
    }

    /// Returns the full matrix in compressed row format.
    #[cfg(feature = "sprs")]
    pub fn to_csr(&self) -> CsMat<f64> {
        let mut triplets = TriMat::new((self.size, self.size));
        for &(row, column, value) in &self.entries {
            triplets.add_triplet(row, column, value);
            if row != column {
                triplets.add_triplet(column, row, value);
            }
        }
        triplets.to_csr()
    }

    fn write(&self, path: &Path) -> io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "%%MatrixMarket matrix coordinate real symmetric")?;
        writeln!(file, "{} {} {}", self.size, self.size, self.entries.len())?;
        for (row, column, value) in &self.entries {
            writeln!(file, "{} {} {value:e}", row + 1, column + 1)?;
        }
        file.flush()
    }
}

/// M, K and the residual of a component at a state, on its n free coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrices {
    /// M, kg, n × n.
    pub mass: LowerTriangle,
    /// K = ∂²V/∂q², N/m, n × n, without the tangents of forces that have no potential.
    pub stiffness: LowerTriangle,
    /// f − ∂V/∂q, N, one per free coordinate. It equals M q̈ if there are no constraints.
    pub residual: Vec<f64>,
}

impl Matrices {
    /// Computes the matrices of a system at a state.
    ///
    /// # Errors
    /// Returns an error if the terms cannot be assembled into one matrix, or the mass is filtered: only its inverse is
    /// sparse.
    pub fn new(system: &System, state: &State) -> Result<Self, SolverError> {
        if system.filter().is_some() {
            return Err(SolverError::FilteredMass { what: "matrices (only its inverse is sparse)".into() });
        }
        let hessian = |terms: &Terms, x: &[f64], t: f64| {
            let mut assembler = Assembler::new(terms);
            assembler.hessian(x, t, HessianEvaluation::Exact).map(LowerTriangle::of)
        };
        let x = system.positions(state);
        let mass = match system.kinetic() {
            Some(kinetic) => hessian(kinetic, &vec![0.0; x.len()], 0.0)?,
            None => {
                let entries = system.free_mass().iter().enumerate().map(|(k, &mass)| (k, k, mass)).collect();
                LowerTriangle { size: system.free_mass().len(), entries }
            }
        };
        let stiffness = hessian(system.terms(), &x, state.t)?;
        let mut residual = vec![0.0; mass.size];
        system.coordinates().restrict(&vi_solvers::net_forces(system, state), &mut residual);
        Ok(Self { mass, stiffness, residual })
    }

    /// Writes `mass.mtx`, `stiffness.mtx` and `residual.mtx` (Matrix Market) into a directory, with `prefix` before
    /// their names.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub fn write(&self, directory: &Path, prefix: &str) -> io::Result<()> {
        std::fs::create_dir_all(directory)?;
        let path = |name: &str| directory.join(format!("{prefix}{name}.mtx"));
        self.mass.write(&path("mass"))?;
        self.stiffness.write(&path("stiffness"))?;
        let mut file = BufWriter::new(File::create(path("residual"))?);
        writeln!(file, "%%MatrixMarket matrix array real general\n{} 1", self.residual.len())?;
        for value in &self.residual {
            writeln!(file, "{value:e}")?;
        }
        file.flush()
    }
}

impl Simulation {
    /// Returns M, K and the residual of component number `component` in its current state.
    ///
    /// # Errors
    /// Returns the errors of [`Matrices::new`].
    pub fn matrices(&self, component: usize) -> Result<Matrices, SolverError> {
        let component = &self.components()[component];
        Matrices::new(component.system(), component.state())
    }
}
