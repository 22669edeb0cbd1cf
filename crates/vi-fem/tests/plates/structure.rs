//! A sheet under supports and dead loads: equilibrium by Newton's method, stability by the inertia of the stiffness
//! matrix, vibrations by subspace iteration.

use nalgebra::{DMatrix, SymmetricEigen};
use vi_core::Potential;
use vi_fem::{Sheet, SheetLaw};
use vi_mesh::Mesh;

use super::skyline::Skyline;

/// Potentials on the free coordinates, which are numbered along a sweep to keep the skyline low.
pub(crate) struct Structure {
    pub(crate) potentials: Vec<Box<dyn Potential>>,
    pub(crate) masses: Vec<f64>,
    /// Current positions of all coordinates, m.
    pub(crate) x: Vec<f64>,
    /// The free coordinates in the order of the sweep.
    free: Vec<usize>,
    /// The index of a coordinate in `free`.
    place: Vec<Option<usize>>,
    matrix: Skyline,
    /// Largest displacement of a coordinate in one Newton step, m: longer steps may fold facets over.
    pub(crate) longest_step: f64,
}

impl Structure {
    /// Returns a sheet at rest. `is_held(node, axis)` defines the supports, `clamped` the edges without rotation, and
    /// `sweep(node)` a key that grows along the sheet.
    pub(crate) fn new(
        mesh: &Mesh,
        law: &SheetLaw,
        clamped: &[[u32; 2]],
        is_held: impl Fn(usize, usize) -> bool,
        sweep: impl Fn(usize) -> f64,
    ) -> Self {
        let elements = mesh.cells_of_dimension(2);
        let sheet = Sheet { clamped, ..Sheet::new(mesh, &elements, law, 0, "sheet") };
        let mut masses = vec![0.0; mesh.points.len()];
        sheet.add_lumped_mass(&mut masses).unwrap();
        let potentials = sheet.potentials().unwrap();
        let mut nodes: Vec<usize> = (0..mesh.points.len()).collect();
        nodes.sort_by(|&a, &b| sweep(a).total_cmp(&sweep(b)));
        let free: Vec<usize> = nodes
            .iter()
            .flat_map(|&node| (0..3).map(move |axis| (node, axis)))
            .filter(|&(node, axis)| !is_held(node, axis))
            .map(|(node, axis)| 3 * node + axis)
            .collect();
        let mut place = vec![None; 3 * mesh.points.len()];
        for (k, &dof) in free.iter().enumerate() {
            place[dof] = Some(k);
        }
        let mut first: Vec<usize> = (0..free.len()).collect();
        for potential in &potentials {
            let stencils = potential.stencils();
            for stencil in 0..stencils.count() {
                let dofs =
                    || stencils.of(stencil).iter().flat_map(|&n| (0..3).map(move |i| 3 * n as usize + i));
                let Some(least) = dofs().filter_map(|dof| place[dof]).min() else { continue };
                for row in dofs().filter_map(|dof| place[dof]) {
                    first[row] = first[row].min(least);
                }
            }
        }
        let x = mesh.points.as_flattened().to_vec();
        Self { potentials, masses, x, free, place, matrix: Skyline::new(first), longest_step: f64::INFINITY }
    }

    pub(crate) fn add(&mut self, potential: Box<dyn Potential>) {
        self.potentials.push(potential);
    }

    pub(crate) fn energy(&self, x: &[f64]) -> f64 {
        let of = |potential: &dyn Potential| {
            let mut out = vec![0.0; potential.stencils().count()];
            potential.energies(0..out.len(), x, 0.0, &mut out);
            out.iter().sum::<f64>()
        };
        self.potentials.iter().map(|potential| of(&**potential)).sum()
    }

    /// Returns ∂V/∂q, N.
    fn gradient(&self, x: &[f64]) -> Vec<f64> {
        let all = self.internal_forces(x);
        self.free.iter().map(|&dof| all[dof]).collect()
    }

    /// Returns ∂V/∂x of all coordinates, free or held, N.
    pub(crate) fn internal_forces(&self, x: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; x.len()];
        for potential in &self.potentials {
            let stencils = potential.stencils();
            let size = stencils.size();
            let mut out = vec![0.0; stencils.count() * size];
            potential.gradients(0..stencils.count(), x, 0.0, &mut out);
            for (stencil, block) in out.chunks_exact(size).enumerate() {
                for (n, value) in block.iter().enumerate() {
                    sum[3 * stencils.of(stencil)[n / 3] as usize + n % 3] += value;
                }
            }
        }
        sum
    }

    fn assemble(&mut self, x: &[f64], projected: bool) {
        self.matrix.clear();
        for potential in &self.potentials {
            let stencils = potential.stencils();
            let size = stencils.size();
            let length = vi_core::packed_len(size);
            let mut block = vec![0.0; length];
            for stencil in 0..stencils.count() {
                if projected {
                    potential.projected_hessians(stencil..stencil + 1, x, 0.0, &mut block);
                } else {
                    potential.hessians(stencil..stencil + 1, x, 0.0, &mut block);
                }
                let nodes = stencils.of(stencil);
                let place = |n: usize| self.place[3 * nodes[n / 3] as usize + n % 3];
                let mut k = 0;
                for row in 0..size {
                    for column in 0..=row {
                        if let (Some(i), Some(j)) = (place(row), place(column)) {
                            self.matrix.add(i, j, block[k]);
                        }
                        k += 1;
                    }
                }
            }
        }
    }

    /// Finds the equilibrium under the dead loads `load` (N on every coordinate) by Newton's method with the exact
    /// Hessian if it is positive definite, else with the projected one, and a line search on the energy. Returns the
    /// number of iterations.
    pub(crate) fn equilibrate(&mut self, load: &[f64]) -> Result<usize, String> {
        let work = |x: &[f64]| x.iter().zip(load).map(|(x, f)| x * f).sum::<f64>();
        let mut energy = self.energy(&self.x) - work(&self.x);
        for iteration in 1..=400 {
            let mut step = self.gradient(&self.x);
            for (value, &dof) in step.iter_mut().zip(&self.free) {
                *value = load[dof] - *value;
            }
            let residual = step.clone();
            let x = self.x.clone();
            self.assemble(&x, false);
            let mut factor = self.matrix.factor(|_| 0.0);
            let is_exact = factor.negative == 0;
            if !is_exact {
                self.assemble(&x, true);
                factor = self.matrix.factor(|row| 1e-8 * self.matrix.diagonal(row));
            }
            factor.solve(&mut step);
            let decrement: f64 = step.iter().zip(&residual).map(|(s, r)| s * r).sum();
            let scale = self.energy(&x).abs().max(1e-300);
            if is_exact && decrement < 1e-13 * scale {
                self.advance(&x, &step, 1.0);
                return Ok(iteration);
            }
            let farthest = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            let mut length = (self.longest_step / farthest).min(1.0);
            loop {
                self.advance(&x, &step, length);
                let trial = self.energy(&self.x) - work(&self.x);
                if trial <= energy - 1e-4 * length * decrement + 1e-14 * scale {
                    energy = trial;
                    break;
                }
                length *= 0.5;
                if length < 1e-8 {
                    return Err(format!("no descent at iteration {iteration}, decrement {decrement:e}"));
                }
            }
        }
        Err("no convergence in 400 iterations".into())
    }

    fn advance(&mut self, x: &[f64], step: &[f64], length: f64) {
        for (&dof, s) in self.free.iter().zip(step) {
            self.x[dof] = x[dof] + length * s;
        }
    }

    /// Finds the straight equilibrium under small loads, stable or not, by three Newton steps without a line search.
    pub(crate) fn straight(&mut self, load: &[f64]) {
        for _ in 0..3 {
            let x = self.x.clone();
            let mut step = self.gradient(&x);
            for (value, &dof) in step.iter_mut().zip(&self.free) {
                *value = load[dof] - *value;
            }
            self.assemble(&x, false);
            self.matrix.factor(|_| 0.0).solve(&mut step);
            self.advance(&x, &step, 1.0);
        }
    }

    /// Returns the number of negative eigenvalues of the stiffness at the current positions.
    pub(crate) fn instabilities(&mut self) -> usize {
        let x = self.x.clone();
        self.assemble(&x, false);
        self.matrix.factor(|_| 0.0).negative
    }

    /// Returns the lowest `count` squared angular frequencies at the current positions, rad²/s², ascending, by
    /// subspace iteration on (K + shift M)⁻¹ M.
    pub(crate) fn squared_frequencies(&mut self, count: usize, shift: f64) -> Vec<f64> {
        let x = self.x.clone();
        self.assemble(&x, false);
        let mass: Vec<f64> = self.free.iter().map(|&dof| self.masses[dof / 3]).collect();
        let factor = self.matrix.factor(|row| shift * mass[row]);
        let n = mass.len();
        let width = 2 * count + 4;
        // In y = M^½ q the operator is symmetric.
        let mut basis =
            DMatrix::from_fn(n, width, |i, j| (((i * (2 * j + 3) + 7 * j) as f64) * 0.618_034).sin());
        let mut previous = vec![0.0; count];
        for _ in 0..200 {
            basis = basis.qr().q();
            let mut image = basis.clone();
            for mut column in image.column_iter_mut() {
                let mut q: Vec<f64> = column.iter().zip(&mass).map(|(y, m)| y * m.sqrt()).collect();
                factor.solve(&mut q);
                for ((y, q), m) in column.iter_mut().zip(q).zip(&mass) {
                    *y = q * m.sqrt();
                }
            }
            let projected = basis.transpose() * &image;
            let eigen = SymmetricEigen::new(0.5 * (&projected + projected.transpose()));
            let mut values: Vec<f64> = eigen.eigenvalues.iter().map(|value| 1.0 / value - shift).collect();
            values.sort_by(f64::total_cmp);
            values.truncate(count);
            let change = values.iter().zip(&previous).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if change < 1e-9 * (values[count - 1] + shift) {
                return values;
            }
            previous = values;
            basis = image;
        }
        previous
    }
}
