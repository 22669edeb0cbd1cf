//! The energy ledger: all contributions to the change of the energy of a run.

/// Contributions to the change of the total energy T + V over one step, J. They sum to the change.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepEnergy {
    /// Work done on the body by prescribed motion.
    pub prescribed: f64,
    /// Work of named non-conservative forces.
    pub force: f64,
    /// Work of physical damping (≤ 0).
    pub damping: f64,
    /// Work of friction between bodies (≤ 0), minus the energy stored in its bristles.
    pub friction: f64,
    /// Work of the damping of contact (≤ 0).
    pub contact_damping: f64,
    /// Error of the scheme: for implicit midpoint ΔV − ∇V(x_mid)·Δx.
    pub scheme: f64,
    /// Work of the residual that remains after the nonlinear solve.
    pub residual: f64,
}

impl StepEnergy {
    /// Returns the sum of all parts, J.
    pub fn total(&self) -> f64 {
        self.work() + self.scheme + self.residual
    }

    /// Returns the work done from outside plus the work of damping and friction, J: all parts except the errors of
    /// scheme and solver.
    pub fn work(&self) -> f64 {
        self.prescribed + self.force + self.damping + self.friction + self.contact_damping
    }
}

impl std::ops::AddAssign for StepEnergy {
    fn add_assign(&mut self, step: Self) {
        self.prescribed += step.prescribed;
        self.force += step.force;
        self.damping += step.damping;
        self.friction += step.friction;
        self.contact_damping += step.contact_damping;
        self.scheme += step.scheme;
        self.residual += step.residual;
    }
}

/// The account of a run: the initial energy plus all contributions, compared with the current energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyLedger {
    /// Total energy T + V at the start, J.
    pub initial: f64,
    /// Total energy now, J.
    pub current: f64,
    /// Sum of all contributions so far, J.
    pub parts: StepEnergy,
    /// Largest |H − H₀ − work done| so far, J: the drift.
    pub drift: f64,
    /// Largest kinetic energy so far, J: a scale for the drift.
    pub kinetic_max: f64,
}

impl EnergyLedger {
    /// Returns a ledger that starts with total energy `initial` and kinetic energy `kinetic`, J.
    pub fn new(initial: f64, kinetic: f64) -> Self {
        Self { initial, current: initial, parts: StepEnergy::default(), drift: 0.0, kinetic_max: kinetic }
    }

    /// Enters one step: the contributions, and the total and kinetic energy after the step, J.
    pub fn enter(&mut self, step: StepEnergy, total: f64, kinetic: f64) {
        self.parts += step;
        self.current = total;
        self.kinetic_max = self.kinetic_max.max(kinetic);
        self.drift = self.drift.max((total - self.initial - self.parts.work()).abs());
    }

    /// Returns the change that the parts do not explain, J: only round-off if every part is right.
    pub fn unexplained(&self) -> f64 {
        self.current - self.initial - self.parts.total()
    }
}
