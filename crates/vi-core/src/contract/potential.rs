//! A potential energy V(x, t) as a sum of local terms, one per stencil.
//!
//! An element, a spring, a hinge, a contact and a penalty all have the same form: a small dense block of gradient and
//! Hessian on a few nodes. Symmetry and energy are then explicit, which line search, energy ledger and Cholesky
//! factor need.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::DMatrix;

use crate::contract::acting::Acting;
use crate::contract::discrete_gradient::{DiscreteGradient, Impulse, StepSpan};
use crate::contract::meeting::Meeting;
use crate::contract::patch::{Patch, run_length};
use crate::contract::tube::Tube;

/// The nodes of each local term: `arity` nodes per stencil, `block` coordinates per node.
///
/// Coordinate k of node a is x[a·block + k]. Local entry `a_local·block + k` of a gradient block
/// belongs to coordinate k of the stencil's node number `a_local`.
#[derive(Debug, Clone, Copy)]
pub struct Stencils<'a> {
    /// Nodes per stencil.
    pub arity: usize,
    /// Coordinates per node (3 for points in space).
    pub block: usize,
    /// Node numbers, flat, `arity` per stencil.
    pub nodes: &'a [u32],
}

impl<'a> Stencils<'a> {
    /// Returns the number of stencils.
    pub fn count(&self) -> usize {
        self.nodes.len() / self.arity
    }

    /// Returns the number of coordinates per stencil, n = arity · block: the length of a local gradient.
    pub fn size(&self) -> usize {
        self.arity * self.block
    }

    /// Returns the nodes of one stencil.
    pub fn of(&self, stencil: usize) -> &'a [u32] {
        &self.nodes[stencil * self.arity..(stencil + 1) * self.arity]
    }
}

/// Returns the length of the packed lower triangle of an n × n matrix, n(n+1)/2.
pub const fn packed_len(n: usize) -> usize {
    n * (n + 1) / 2
}

/// Structure of a term's Hessian ∂²V/∂x², known before it is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HessianKind {
    /// V is affine in x (gravity): no Hessian is built, and the gradient is evaluated once.
    Zero,
    /// V is quadratic in x (springs of zero length, linear elasticity): the Hessian is evaluated once.
    Constant,
    /// V is a general function of x.
    Varying,
}

/// Properties of a term that allow work to be skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Traits {
    /// Structure of the Hessian.
    pub hessian: HessianKind,
    /// Whether V depends explicitly on t.
    pub time_dependent: bool,
}

/// The account of the energy ledger to which a term belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Account {
    /// Strain energy of bodies, springs, hinges.
    Elastic,
    /// Energy in the gravity field.
    Gravity,
    /// Energy of other conservative loads.
    Load,
    /// Energy of contact.
    Contact,
}

/// The reason why a term has no finite value at a state.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Index of the element in the caller's numbering (that of the mesh, not that of the stencils).
    pub element: usize,
    /// The quantity outside its domain, e.g. "det F".
    pub quantity: &'static str,
    /// The value of this quantity, in SI units.
    pub value: f64,
    /// The domain in words, e.g. "must be positive".
    pub domain: &'static str,
    /// Whether the quantity is outside its domain at any state of this time, such as an amplitude that is not a number. Then no
    /// other step to this time succeeds.
    pub at_any_state: bool,
}

/// Makes the stencils with these numbers.
pub type MakeFew = dyn Fn(&[usize]) -> Few + Send + Sync;

/// A few stencils of a term.
pub struct Few {
    /// The stencils, on nodes of their own.
    pub term: Box<dyn Potential>,
    /// The number of each of these nodes in the system.
    pub nodes: Vec<u32>,
    /// The element of each stencil in the caller's numbering.
    pub elements: Vec<u32>,
}

impl Few {
    /// Returns the positions of its nodes among those of all coordinates, m.
    pub fn positions(&self, x: &[f64]) -> Vec<f64> {
        self.nodes.iter().flat_map(|&node| &x[3 * node as usize..][..3]).copied().collect()
    }
}

/// Stencils that other processes hold ([`Elsewhere`](crate::Elsewhere)).
pub struct Far<'a> {
    /// Number of stencils.
    pub count: usize,
    /// Number of stencils that are summed together.
    pub run_length: usize,
    /// Makes some of them.
    pub make: &'a MakeFew,
}

/// V(x, t) as a sum of local terms V_s, one per stencil s.
///
/// Every method fills `out` only for the stencils of `range`, so that the caller can choose batches that stay in
/// cache. The result for a stencil must not depend on `range`. Outside its domain a term writes a non-finite value
/// (energy +∞, gradient NaN), and [`Potential::fault`] explains it. `x` holds all coordinates (m), `t` is the time
/// (s).
pub trait Potential: Send + Sync {
    /// Returns the name for reports and errors, e.g. `beam: neo-hookean`.
    fn name(&self) -> &str;

    /// Returns the ledger account to which the energy belongs.
    fn account(&self) -> Account;

    /// Returns the nodes of each local term. They do not change during the life of the value.
    fn stencils(&self) -> Stencils<'_>;

    /// Returns the number of stencils, which may be known before their nodes are.
    fn stencil_count(&self) -> usize {
        self.stencils().count()
    }

    /// Returns the number of stencils that are summed together; the last run may be shorter. Sums have the same bits
    /// only for the same runs.
    fn run_length(&self) -> usize {
        let stencils = self.stencils();
        run_length(stencils.count(), stencils.size())
    }

    /// Returns the properties that allow work to be skipped.
    fn traits(&self) -> Traits;

    /// Writes the energies V_s, J: one per stencil.
    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]);

    /// Returns Σ V_s over all stencils, J, if the term can compute it with less work than stencil by stencil.
    fn energy(&self, _x: &[f64], _t: f64) -> Option<f64> {
        None
    }

    /// Writes the gradients ∂V_s/∂x, N: n per stencil, n = `stencils().size()`.
    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]);

    /// Returns whether the term implements [`Potential::add_gradients`].
    fn adds_gradients(&self) -> bool {
        false
    }

    /// Adds the gradients of a run of [`Potential::run_length`] stencils to the sums of its nodes. Terms of points in
    /// space (block 3) may implement it if it is faster than one block per stencil. It is called only if
    /// [`Potential::adds_gradients`] is true.
    ///
    /// The order of additions at a node, and so their round-off, may depend on the run.
    fn add_gradients(&self, _range: Range<usize>, _t: f64, _patch: Patch<'_>) {}

    /// Writes the Hessians ∂²V_s/∂x², N/m: packed lower triangles by rows, (0,0) (1,0) (1,1) (2,0) …, with n(n+1)/2
    /// entries per stencil.
    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]);

    /// Writes the Hessians with their negative eigenvalues set to zero, for a Newton step after a failed Cholesky
    /// factorisation. The default computes the eigenvalues of each n × n block; a term with an eigensystem in closed
    /// form overrides it.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.hessians(range, x, t, out);
        let n = self.stencils().size();
        for block in out.chunks_exact_mut(packed_len(n)) {
            clamp_negative_eigenvalues(n, block);
        }
    }

    /// For terms that deform a body: writes the mean deformation gradient of each stencil weighted by its volume and
    /// stiffness, w V_e F̄ (row-major 3 × 3, J), 9 numbers per stencil, from which a solver finds the rotation of each node:
    /// where materials meet, nodes turn with the stiffer one. w (Pa) is the power of two at or below the sum of the moduli
    /// ∂²Ψ/∂F_ij² at rest ([`binary_exponent`](crate::binary_exponent)), so that the weight causes no rounding. Returns false, and
    /// writes nothing, if the term has no deformation gradient.
    fn mean_deformations(&self, _range: Range<usize>, _x: &[f64], _out: &mut [f64]) -> bool {
        false
    }

    /// For terms that deform a body: writes the corrections G_s − ∂V_s/∂x(x_m) of the gradients at x_m = (x₀ + x₁)/2,
    /// one per stencil as in [`Potential::gradients`], to forces G_s over a step between these ends. G_s·(x₁ − x₀) =
    /// V_s(x₁) − V_s(x₀), and G_s has no resultant, no moment about x_m, and the order 2 of the gradient there, for any
    /// rotation between the ends. Energy–momentum applies them. Returns false, and writes nothing, if the term has
    /// none. To find out, call it with an empty range.
    fn corrections_over_step(&self, _range: Range<usize>, _ends: [&[f64]; 2], _out: &mut [f64]) -> bool {
        false
    }

    /// For terms with forces over a step: writes symmetric approximations of ∂G_s/∂x_m for a fixed x₀, N/m, packed as in
    /// [`Potential::hessians`]; positive semidefinite ones if `is_projected`. Returns false, and writes nothing, if the Hessians at x_m
    /// are as good.
    fn hessians_over_step(
        &self,
        _range: Range<usize>,
        _ends: [&[f64]; 2],
        _is_projected: bool,
        _out: &mut [f64],
    ) -> bool {
        false
    }

    /// Returns a discrete gradient of this term, if it has one. Implicit midpoint, energy–momentum and the explicit
    /// schemes use it in place of the gradient for live terms.
    fn discrete_gradient(&self) -> Option<&dyn DiscreteGradient> {
        None
    }

    /// Returns the forces −∂V/∂x at x between the parts that a live term tells apart, summed over each pair of parts: the
    /// [impulses](Impulse) of one second. Terms without parts return none.
    fn forces_between(&self, _x: &[f64]) -> Vec<Impulse> {
        Vec::new()
    }

    /// Returns the friction over a step between two places as a potential of the second one, for terms whose discrete gradient [has
    /// friction](DiscreteGradient::over_step) with this span and memory. Normal forces and directions of slip keep the values that they
    /// have between these `places`, and tractions follow slips from those that `acting` predicts, with the stiffness that its
    /// [penalty](Acting::penalty) allows. Returns `None` if there is no friction, or if the forces of the step do not
    /// [act at its end](StepSpan::acts_at_end).
    fn lagged_friction(
        &self,
        _span: StepSpan,
        _memory: &[f64],
        _places: [&[f64]; 2],
        _acting: &Acting,
    ) -> Option<Arc<dyn Potential>> {
        None
    }

    /// Returns whether [`Potential::largest_step`] can be less than 1. It is not called for other terms.
    fn limits_steps(&self) -> bool {
        false
    }

    /// Returns the largest fraction, in (0, 1], of the step from `x` along `dx` (both of all coordinates, m) for
    /// which this term stays inside its domain with a margin. It is called before a correction of Newton's method is
    /// applied.
    fn largest_step(&self, _x: &[f64], _dx: &[f64]) -> f64 {
        1.0
    }

    /// Returns the groups of nodes that meet on the straight path from `x` to `end`, or that come nearer than the fraction `kept`
    /// in [0, ½] of their gap at `x`; of gaps wider than the reach of the term, this is the fraction of that reach. If only the
    /// nodes of these groups are stopped, the resulting path must be checked again.
    fn meetings(&self, x: &[f64], end: &[f64], _kept: f64) -> Vec<Meeting> {
        let dx: Vec<f64> = end.iter().zip(x).map(|(end, x)| end - x).collect();
        let part = if self.limits_steps() { self.largest_step(x, &dx) } else { 1.0 };
        let nodes = 0..(x.len() / self.stencils().block.max(1)) as u32;
        nodes.filter(|_| part < 1.0).map(|node| Meeting { nodes: [node; 4], part, size: 0.0 }).collect()
    }

    /// Returns this term with only those stencils that can act in a tube of configurations. This term must be valid there.
    /// Returns `None` if the term cannot choose them.
    fn narrowed(&self, _tube: &Tube) -> Option<Arc<dyn Potential>> {
        None
    }

    /// Returns a term with the stencils of this one and its energies, gradients, Hessians and faults at positions `x`, and only there.
    /// A term returns one if its stencils have work in common, which each batch of stencils would repeat otherwise.
    fn at(&self, _x: &[f64]) -> Option<Arc<dyn Potential>> {
        None
    }

    /// Returns the description of the stencils if other processes hold them; `None` if this process does.
    fn elsewhere(&self) -> Option<Far<'_>> {
        None
    }

    /// Returns a term with only the stencils `range`, on the same nodes, with less memory than this one. `range` begins at
    /// a multiple of 64. Returns `None` if the term takes little memory; [`Portion`](crate::Portion) then keeps all of it.
    fn portion(&self, _range: Range<usize>) -> Option<Arc<dyn Potential>> {
        None
    }

    /// Returns the two nodes of the first edge of stencil `stencil` whose normal a support holds within this term, if
    /// there is one. V_s is then not invariant under rotations: the support exerts the couple −Σ x × ∂V_s/∂x (N m) on
    /// the stencil.
    fn held_edge(&self, _stencil: usize) -> Option<[u32; 2]> {
        None
    }

    /// Returns the element of stencil `stencil`, in the numbering of its mesh.
    fn element(&self, stencil: usize) -> usize {
        stencil
    }

    /// Returns why stencil `stencil` has no finite value at (x, t), if this is so.
    fn fault(&self, _stencil: usize, _x: &[f64], _t: f64) -> Option<Fault> {
        None
    }
}

/// Sets the negative eigenvalues of a packed symmetric matrix to zero.
fn clamp_negative_eigenvalues(n: usize, packed: &mut [f64]) {
    // Most stencils of contact do not act.
    if packed.iter().all(|&value| value == 0.0) {
        return;
    }
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
