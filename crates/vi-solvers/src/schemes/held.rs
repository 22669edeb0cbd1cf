//! The work on a body whose coordinates are all prescribed: its path is known, so no scheme solves for it.

use vi_core::{StepEnergy, System};

use crate::assemble::assembler::Assembler;
use crate::assemble::force_sum::ForceSum;
use crate::schemes::accounts;

/// Nodes and weights of Gauss's rule with three points on [0, 1], which integrates powers of degree 5 in time exactly.
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Books the work on a system without a free coordinate.
///
/// The energy of such a system is V(x(t), t) on the given path x(t). Loads that change with time take in ∫ ∂V/∂t dt =
/// ΔV_loads − ∫ ∂V_loads/∂x·ẋ dt, forces without a potential do ∫ f·ẋ dt, and the supports do the rest, ∫ (∂V/∂x −
/// f)·ẋ dt = ΔV − ∫ ∂V/∂t dt − ∫ f·ẋ dt. So the balance holds to round-off, and only the division between these entries has
/// the error of a quadrature.
pub struct HeldWork {
    assembler: Assembler,
    forces: Option<ForceSum>,
    /// Whether ẋ is the rate of a load factor, so that forces are those at rest.
    is_static: bool,
    /// Time and V at the end of the last step.
    last: Option<(f64, f64)>,
}

impl HeldWork {
    /// Prepares the account of a system without a free coordinate, in motion or for a sequence of equilibria.
    pub fn new(system: &System, is_static: bool) -> Self {
        Self { assembler: Assembler::new(system), forces: ForceSum::new(system), is_static, last: None }
    }

    /// Returns the contributions to the change of energy from time `from` to `to`, J.
    pub fn over(&mut self, system: &System, from: f64, to: f64) -> StepEnergy {
        let start = match self.last {
            Some((t, energy)) if t == from => energy,
            _ => self.energy(system, from),
        };
        let end = self.energy(system, to);
        self.last = Some((to, end));
        let coordinates = system.coordinates();
        let mut x = vec![0.0; coordinates.dof_count()];
        let (mut x_dot, still) = (x.clone(), x.clone());
        let (mut loads, mut force, mut damping) = (0.0, 0.0, 0.0);
        if accounts::changing(system).next().is_some() {
            loads = changing_energy(system, to, &mut x) - changing_energy(system, from, &mut x);
        }
        for (node, weight) in GAUSS {
            let (t, duration) = (from + node * (to - from), weight * (to - from));
            coordinates.embed(&[], t, &mut x);
            coordinates.embed_velocity(&[], t, &mut x_dot);
            let power = |term| accounts::power_on(term, &x, t, &x_dot);
            loads -= duration * accounts::changing(system).map(power).sum::<f64>();
            if let Some(forces) = &mut self.forces {
                forces.evaluate(&x, if self.is_static { &still } else { &x_dot }, t);
                coordinates.to_own_axes(&mut x_dot);
                let (of_force, of_damping) = forces.work(&x_dot);
                force += duration * of_force;
                damping += duration * of_damping;
            }
        }
        let prescribed = end - start - loads - force - damping;
        StepEnergy { prescribed, force: force + loads, damping, ..StepEnergy::default() }
    }

    /// Returns V at time t, J.
    fn energy(&mut self, system: &System, t: f64) -> f64 {
        self.assembler.energies(&system.coordinates().positions(&[], t), t).total()
    }
}

/// Returns the energy of the terms that change with time at time t, J; leaves the positions then in `x`.
fn changing_energy(system: &System, t: f64, x: &mut [f64]) -> f64 {
    system.coordinates().embed(&[], t, x);
    accounts::changing(system).map(|term| accounts::energy_of(term, x, t)).sum()
}
