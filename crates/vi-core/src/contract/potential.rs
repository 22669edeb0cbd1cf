//! A potential energy V(x, t) as a sum of local terms, one per stencil.
//!
//! An element, a spring, a hinge, a contact and a penalty are one kind of thing: a small dense block of gradient and
//! Hessian on a few nodes. This keeps symmetry and energy visible, so that a line search, an energy ledger and a
//! Cholesky factor are possible.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::contract::discrete_gradient::DiscreteGradient;
use crate::contract::patch::Patch;

/// Which nodes each local term touches: `arity` nodes a stencil, `block` coordinates a node.
///
/// Coordinate k of node a is x[a·block + k]. Local entry `a_local·block + k` of a gradient block
/// belongs to coordinate k of the stencil's node number `a_local`.
#[derive(Debug, Clone, Copy)]
pub struct Stencils<'a> {
    /// Nodes a stencil.
    pub arity: usize,
    /// Coordinates a node (3 for points in space).
    pub block: usize,
    /// Node numbers, flat, `arity` a stencil.
    pub nodes: &'a [u32],
}

impl<'a> Stencils<'a> {
    /// Returns the number of stencils.
    pub fn count(&self) -> usize {
        self.nodes.len() / self.arity
    }

    /// Coordinates a stencil, n = arity · block: the length of a local gradient.
    pub fn size(&self) -> usize {
        self.arity * self.block
    }

    /// The nodes of one stencil.
    pub fn of(&self, stencil: usize) -> &'a [u32] {
        &self.nodes[stencil * self.arity..(stencil + 1) * self.arity]
    }
}

/// Length of the packed lower triangle of an n × n matrix, n(n+1)/2.
pub const fn packed_len(n: usize) -> usize {
    n * (n + 1) / 2
}

/// Structure of a term's Hessian ∂²V/∂x², known before it is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HessianKind {
    /// V is affine in x (gravity): no Hessian is ever built, the gradient is made once.
    Zero,
    /// V is quadratic in x (springs of zero length, linear elasticity): made once.
    Constant,
    /// V is a general function of x.
    Varying,
}

/// Properties of a term that allow work to be skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Traits {
    /// Structure of the Hessian.
    pub hessian: HessianKind,
    /// Does V depend on t explicitly?
    pub time_dependent: bool,
}

/// The account of the energy ledger that a term belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Account {
    /// Strain energy of bodies, springs, hinges.
    Elastic,
    /// Weight.
    Gravity,
    /// Energy of other conservative loads.
    Load,
    /// Energy of contact.
    Contact,
}

/// Why a term has no finite value at a state: the facts of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Index of the element in the caller's numbering (the mesh's, not the stencil's).
    pub element: usize,
    /// The quantity that left its domain, e.g. "det F".
    pub quantity: &'static str,
    /// Its value.
    pub value: f64,
    /// The domain in words, e.g. "must be positive".
    pub domain: &'static str,
}

/// V(x, t) as a sum of local terms V_s, one per stencil s.
///
/// Every method fills `out` for the stencils of `range` only, so that the caller chooses batches
/// that stay in cache; the result for a stencil must not depend on the range it is asked in.
/// Outside its domain a term writes a non-finite value (energy +∞, gradient NaN) and explains it
/// in [`Potential::fault`]. `x` holds all coordinates (m), `t` is the time (s).
pub trait Potential: Send + Sync {
    /// Name for reports and errors, e.g. `beam: neo-hookean`.
    fn name(&self) -> &str;

    /// The ledger account that the energy goes to.
    fn account(&self) -> Account;

    /// Which nodes each term touches; fixed for the life of the value unless it says otherwise.
    fn stencils(&self) -> Stencils<'_>;

    /// Returns the properties that allow work to be skipped.
    fn traits(&self) -> Traits;

    /// Energies V_s, J: one a stencil.
    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]);

    /// Gradients ∂V_s/∂x, N: n a stencil, n = `stencils().size()`.
    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]);

    /// Does the term know [`Potential::add_gradients`]?
    fn adds_gradients(&self) -> bool {
        false
    }

    /// Adds the gradients of a run of stencils to the sums of its nodes, for terms of points in space
    /// (block 3) that know a faster way there than one block a stencil. Only called
    /// where [`Potential::adds_gradients`].
    ///
    /// The order of additions at a node may depend on the run, and with it their round-off.
    fn add_gradients(&self, _range: Range<usize>, _t: f64, _patch: Patch<'_>) {}

    /// Hessians ∂²V_s/∂x², N/m: the packed lower triangle by rows, (0,0) (1,0) (1,1) (2,0) …,
    /// n(n+1)/2 a stencil.
    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]);

    /// Hessians with their negative eigenvalues set to zero, for a Newton step after a Cholesky
    /// factorisation has failed. The default takes the eigenvalues of each n × n block; a term that
    /// knows its eigensystem in closed form overrides it.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.hessians(range, x, t, out);
        let n = self.stencils().size();
        for block in out.chunks_exact_mut(packed_len(n)) {
            clamp_negative_eigenvalues(n, block);
        }
    }

    /// For terms that deform matter: the volume-weighted mean deformation gradient of each
    /// stencil, V_e F̄ (row-major 3 × 3, m³), 9 a stencil, from which a solver finds the rotation
    /// of each node. Returns false (and writes nothing) where the term has no such thing.
    fn mean_deformations(&self, _range: Range<usize>, _x: &[f64], _out: &mut [f64]) -> bool {
        false
    }

    /// A discrete gradient of this term, where it has one. Of live terms, implicit midpoint, energy–momentum and the
    /// explicit schemes then use it in place of the gradient.
    fn discrete_gradient(&self) -> Option<&dyn DiscreteGradient> {
        None
    }

    /// Does [`Potential::largest_step`] ever say less than 1? Terms that do not are never asked.
    fn limits_steps(&self) -> bool {
        false
    }

    /// The largest part of the step from `x` along `dx` (both of all coordinates, m), in (0, 1], by which this term stays
    /// inside its domain with a margin. It is asked before a correction of Newton's method is applied.
    fn largest_step(&self, _x: &[f64], _dx: &[f64]) -> f64 {
        1.0
    }

    /// The element that stencil `stencil` is, in the numbers of its mesh.
    fn element(&self, stencil: usize) -> usize {
        stencil
    }

    /// Why stencil `stencil` has no finite value at (x, t), if so.
    fn fault(&self, _stencil: usize, _x: &[f64], _t: f64) -> Option<Fault> {
        None
    }
}

/// Sets the negative eigenvalues of a packed symmetric matrix to zero.
fn clamp_negative_eigenvalues(n: usize, packed: &mut [f64]) {
    let mut full = DMatrix::zeros(n, n);
    let mut k = 0;
    for i in 0..n {
        for j in 0..=i {
            full[(i, j)] = packed[k];
            full[(j, i)] = packed[k];
            k += 1;
        }
    }
    if full.iter().any(|value| !value.is_finite()) {
        return;
    }
    let eigen = full.symmetric_eigen();
    if eigen.eigenvalues.iter().all(|&value| value >= 0.0) {
        return;
    }
    let scaled = DMatrix::from_fn(n, n, |i, j| eigen.eigenvectors[(i, j)] * eigen.eigenvalues[j].max(0.0));
    let projected = scaled * eigen.eigenvectors.transpose();
    let mut k = 0;
    for i in 0..n {
        for j in 0..=i {
            packed[k] = 0.5 * (projected[(i, j)] + projected[(j, i)]);
            k += 1;
        }
    }
}
