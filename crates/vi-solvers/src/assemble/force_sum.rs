//! Sums the forces without a potential, and their symmetric tangents.
//!
//! To an assembler, a force at given velocities is a gradient, and its tangent is a Hessian. The forces are therefore
//! wrapped as potentials and summed like any others, to the same bits on any number of threads. The wrappers read
//! positions and then velocities from one array.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Account, Force, ForceAccount, HessianKind, Potential, Stencils, System, Terms, Traits};

use crate::assemble::fixed::FixedSum;
use crate::assemble::hessian::HessianEvaluation;
use crate::linear::matrix::SymmetricMatrix;
use crate::vectors;

/// The tangent of a force that is assembled like a Hessian.
#[derive(Clone, Copy, PartialEq)]
enum Tangent {
    /// −∂f/∂x.
    Stiffness,
    /// −∂f/∂ẋ.
    Damping,
}

/// A force as a potential: its gradient is −f, its Hessian the tangent.
struct Term {
    force: Arc<dyn Force>,
    tangent: Tangent,
}

impl Potential for Term {
    fn name(&self) -> &str {
        self.force.name()
    }

    fn account(&self) -> Account {
        Account::Load
    }

    fn stencils(&self) -> Stencils<'_> {
        self.force.stencils()
    }

    /// Declares time dependence, so that nothing is cached as constant: velocities change without notice.
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: true }
    }

    fn energies(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..range.len()].fill(0.0);
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let (x, v) = x.split_at(x.len() / 2);
        self.force.forces(range, x, v, t, out);
        out.iter_mut().for_each(|value| *value = -*value);
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let (x, v) = x.split_at(x.len() / 2);
        match self.tangent {
            Tangent::Stiffness => self.force.stiffness(range, x, v, t, out),
            Tangent::Damping => self.force.damping(range, x, v, t, out),
        }
    }
}

/// The sum of some wrapped forces.
struct Group {
    sum: FixedSum,
    /// −Σ f of every coordinate at the last evaluation, N.
    negative: Vec<f64>,
}

impl Group {
    /// Returns the sum of the forces that `keep` selects; `None` if it selects none.
    fn new(system: &System, tangent: Tangent, keep: impl Fn(&dyn Force) -> bool) -> Option<Self> {
        let forces = system.forces().iter().filter(|force| keep(force.as_ref()));
        let terms: Vec<Arc<dyn Potential>> = forces
            .map(|force| Arc::new(Term { force: Arc::clone(force), tangent }) as Arc<dyn Potential>)
            .collect();
        if terms.is_empty() {
            return None;
        }
        let count = system.coordinates().dof_count();
        // Their stencils were accepted as parts of `system`.
        let terms = Terms::new(Arc::clone(system.terms().shared_coordinates()), terms).ok()?;
        Some(Self { sum: FixedSum::new(terms, None), negative: vec![0.0; count] })
    }
}

/// The forces of a system.
pub(crate) struct ForceSum {
    force: Option<Group>,
    damping: Option<Group>,
    stiffness_tangent: Option<Group>,
    damping_tangent: Option<Group>,
    depends_on_velocity: bool,
    /// Positions, then velocities.
    state: Vec<f64>,
    t: f64,
}

impl ForceSum {
    /// Builds the maps of the forces; `None` if the system has none.
    pub(crate) fn new(system: &System) -> Option<Self> {
        if system.forces().is_empty() {
            return None;
        }
        let of = |account| Group::new(system, Tangent::Stiffness, |force| force.account() == account);
        Some(Self {
            force: of(ForceAccount::Force),
            damping: of(ForceAccount::Damping),
            stiffness_tangent: None,
            damping_tangent: None,
            depends_on_velocity: system.forces().iter().any(|force| force.depends_on_velocity()),
            state: vec![0.0; 2 * system.coordinates().dof_count()],
            t: 0.0,
        })
    }

    /// Returns whether any force depends on ẋ.
    pub(crate) fn depends_on_velocity(&self) -> bool {
        self.depends_on_velocity
    }

    /// Evaluates all forces at positions and velocities of all coordinates.
    pub(crate) fn evaluate(&mut self, x: &[f64], v: &[f64], t: f64) {
        let (positions, velocities) = self.state.split_at_mut(x.len());
        positions.copy_from_slice(x);
        velocities.copy_from_slice(v);
        self.t = t;
        for group in [&mut self.force, &mut self.damping].into_iter().flatten() {
            group.sum.gradient(&self.state, t, &mut group.negative);
        }
    }

    /// Returns the force on coordinate x_i by ledger account, N: (force, damping).
    pub(crate) fn by_account(&self, dof: usize) -> (f64, f64) {
        let of = |group: &Option<Group>| group.as_ref().map_or(0.0, |group| -group.negative[dof]);
        (of(&self.force), of(&self.damping))
    }

    /// Returns Σ f_i d_i by ledger account, (force, damping); `along` holds d of all coordinates in the nodes' own axes.
    pub(crate) fn work(&self, along: &[f64]) -> (f64, f64) {
        let force = vectors::sum(along.len(), |dof| self.by_account(dof).0 * along[dof]);
        (force, vectors::sum(along.len(), |dof| self.by_account(dof).1 * along[dof]))
    }

    /// Returns the force on coordinate x_i, N.
    pub(crate) fn total(&self, dof: usize) -> f64 {
        let (force, damping) = self.by_account(dof);
        force + damping
    }

    /// Returns the symmetric part of −∂f/∂x on the free coordinates at the last evaluation.
    pub(crate) fn stiffness(&mut self, system: &System) -> Option<&SymmetricMatrix> {
        if self.stiffness_tangent.is_none() {
            self.stiffness_tangent = Group::new(system, Tangent::Stiffness, |_| true);
        }
        let group = self.stiffness_tangent.as_mut()?;
        Some(group.sum.hessian(&self.state, self.t, HessianEvaluation::Exact))
    }

    /// Returns the symmetric parts of −∂f/∂x and −∂f/∂ẋ at the last evaluation, with the factors 1 and ∂ẋ/∂q = `rate` (1/s) in −∂f/∂q.
    /// The latter is there only if a force depends on ẋ.
    pub(crate) fn tangents(
        &mut self,
        system: &System,
        rate: f64,
    ) -> impl Iterator<Item = (f64, &SymmetricMatrix)> {
        if self.stiffness_tangent.is_none() {
            self.stiffness_tangent = Group::new(system, Tangent::Stiffness, |_| true);
        }
        if self.damping_tangent.is_none() {
            self.damping_tangent = Group::new(system, Tangent::Damping, |force| force.depends_on_velocity());
        }
        let (state, t) = (&self.state, self.t);
        let groups = [(1.0, &mut self.stiffness_tangent), (rate, &mut self.damping_tangent)].into_iter();
        groups.filter_map(move |(factor, group)| {
            Some((factor, group.as_mut()?.sum.hessian(state, t, HessianEvaluation::Exact)))
        })
    }
}
