//! V and its derivatives at a configuration q at time t, checked to be finite: what a stepper sees
//! of a body. It must not know which scheme asks.

use vi_core::{State, System};

use crate::vectors;
use crate::{Assembler, HessianEvaluation, SolverError, SymmetricMatrix, Work};

/// The sums of a system's terms with the buffers to evaluate them.
pub(crate) struct Forces {
    assembler: Assembler,
    /// Positions of all coordinates at the last evaluation.
    x: Vec<f64>,
    t: f64,
    gradient: Vec<f64>,
    /// Does `gradient` belong to `x` and `t`?
    gradient_is_of_x: bool,
    is_time_dependent: bool,
    pub(crate) work: Work,
}

impl Forces {
    pub(crate) fn new(system: &System) -> Self {
        let count = system.coordinates().dof_count();
        Self {
            assembler: Assembler::new(system),
            x: vec![f64::NAN; count],
            t: f64::NAN,
            gradient: vec![0.0; count],
            gradient_is_of_x: false,
            is_time_dependent: system.potentials().iter().any(|term| term.traits().time_dependent),
            work: Work::default(),
        }
    }

    /// ∂V/∂x of all coordinates at the last configuration, N.
    pub(crate) fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    /// x of all coordinates at the last configuration, m.
    pub(crate) fn positions(&self) -> &[f64] {
        &self.x
    }

    /// t of the last configuration, s.
    pub(crate) fn time(&self) -> f64 {
        self.t
    }

    /// Goes to positions `x` of all coordinates at time t.
    pub(crate) fn go_to_positions(&mut self, x: &[f64], t: f64) {
        self.x.copy_from_slice(x);
        self.t = t;
        self.gradient_is_of_x = false;
    }

    /// The gradient at the last configuration, if it was evaluated there.
    pub(crate) fn known_gradient(&self) -> Option<&[f64]> {
        self.gradient_is_of_x.then_some(&self.gradient[..])
    }

    pub(crate) fn assembler(&mut self) -> &mut Assembler {
        &mut self.assembler
    }

    /// Is (q, t), to the bit, where the last evaluation was made?
    pub(crate) fn is_at(&self, system: &System, q: &[f64], t: f64) -> bool {
        let free = system.coordinates().free();
        self.t == t && q.iter().zip(free).all(|(q, &dof)| *q == self.x[dof as usize])
    }

    /// Goes to (q, t); keeps the gradient only where that is where it was evaluated, to the bit.
    fn go_to(&mut self, system: &System, q: &[f64], t: f64) {
        if self.is_at(system, q, t) {
            return;
        }
        system.coordinates().embed(q, t, &mut self.x);
        self.t = t;
        self.gradient_is_of_x = false;
    }

    /// Evaluates ∂V/∂x at (q, t), unless that is where the last one was made.
    pub(crate) fn evaluate(
        &mut self,
        system: &System,
        q: &[f64],
        t: f64,
        at_start: bool,
    ) -> Result<(), SolverError> {
        self.go_to(system, q, t);
        if self.gradient_is_of_x {
            return Ok(());
        }
        self.assembler.gradient(system, &self.x, t, &mut self.gradient);
        self.work.gradients += 1;
        let gradient = &self.gradient;
        let total = vectors::sum(gradient.len(), |k| 0.0 * gradient[k]);
        if total == 0.0 {
            self.gradient_is_of_x = true;
            return Ok(());
        }
        Err(self.why_not_finite(system, at_start))
    }

    /// The error of a failed step from `state`: where the start itself has no finite force, that.
    pub(crate) fn explain(&mut self, system: &System, state: &State, error: SolverError) -> SolverError {
        if check_state(state, system).is_err() {
            return error;
        }
        self.evaluate(system, &state.q, state.t, true).err().unwrap_or(error)
    }

    /// V at (q, t), J.
    pub(crate) fn energy(&mut self, system: &System, q: &[f64], t: f64) -> f64 {
        self.go_to(system, q, t);
        self.work.energies += 1;
        self.assembler.energies(system, &self.x, t).total()
    }

    /// V with positions `x` of all coordinates at time t, J.
    pub(crate) fn energy_of_positions(&mut self, system: &System, x: &[f64], t: f64) -> f64 {
        self.work.energies += 1;
        self.assembler.energies(system, x, t).total()
    }

    /// Does V depend on t explicitly?
    pub(crate) fn is_time_dependent(&self) -> bool {
        self.is_time_dependent
    }

    /// ∂²V/∂q² at the last configuration.
    pub(crate) fn hessian(&mut self, system: &System, kind: HessianEvaluation) -> &SymmetricMatrix {
        self.work.hessians += 1;
        self.work.projections += u64::from(kind == HessianEvaluation::Projected);
        self.assembler.hessian(system, &self.x, self.t, kind)
    }

    fn why_not_finite(&self, system: &System, at_start: bool) -> SolverError {
        if let Some(dof) = self.x.iter().position(|x| !x.is_finite()) {
            return SolverError::NotFinite { what: "position", dof, at_start };
        }
        match self.assembler.fault(system, &self.x, self.t) {
            Some(term) => SolverError::Term { term, at_start },
            None => {
                let dof = self.gradient.iter().position(|g| !g.is_finite()).unwrap_or(0);
                SolverError::NotFinite { what: "force", dof, at_start }
            }
        }
    }
}

/// Reports momenta or positions of a start that are not finite.
pub(crate) fn check_state(state: &State, system: &System) -> Result<(), SolverError> {
    let n = system.coordinates().free_count();
    for (what, values) in [("position", &state.q), ("momentum", &state.p)] {
        if values.len() != n {
            return Err(SolverError::Memory { missing: "state of this system" });
        }
        if vectors::sum(n, |k| 0.0 * values[k]) != 0.0 {
            let k = values.iter().position(|value| !value.is_finite()).unwrap_or(0);
            let dof = system.coordinates().free()[k] as usize;
            return Err(SolverError::NotFinite { what, dof, at_start: true });
        }
    }
    Ok(())
}
