//! Measures the change of linear and angular momentum over a run, relative to the largest momentum possible.

use serde_json::json;

use super::error::RunError;
use super::observer::{Observer, Purpose, Sight};
use super::report::Report;
use crate::record::{Bytes, record};
use crate::simulation::{Observation, Simulation};

/// Records the momenta of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct MomentumLedger {
    first: Momenta,
    mass: f64,
    size: f64,
    kinetic_max: f64,
    linear: f64,
    angular: f64,
}

/// Linear and angular momentum.
type Momenta = ([f64; 3], [f64; 3]);

record!(MomentumLedger { first: Momenta, mass: f64, size: f64, kinetic_max: f64, linear: f64, angular: f64 });

impl MomentumLedger {
    /// Makes the ledger at the first observation.
    pub fn new(simulation: &Simulation, first: &Observation) -> Self {
        let mut mass = 0.0;
        let mut size: f64 = 0.0;
        for component in simulation.components() {
            let system = component.system();
            let coordinates = system.coordinates();
            // Directors are not points, and their inertia is not mass.
            let of_points = coordinates.free().iter().zip(system.free_mass());
            let of_points = of_points.filter(|(dof, _)| !coordinates.is_director(**dof / 3));
            mass += of_points.map(|(_, mass)| mass).sum::<f64>() / 3.0;
            let x = system.positions(component.state());
            let places = (0_u32..).zip(x.chunks(3)).filter(|(node, _)| !coordinates.is_director(*node));
            size = places.flat_map(|(_, x)| x).fold(size, |size, x| size.max(x.abs()));
        }
        let first_kinetic = first.kinetic;
        let first = (first.momentum, first.angular_momentum);
        Self { first, mass, size, kinetic_max: first_kinetic, linear: 0.0, angular: 0.0 }
    }

    /// Records an observation.
    pub fn enter(&mut self, seen: &Observation) {
        self.kinetic_max = self.kinetic_max.max(seen.kinetic);
        for k in 0..3 {
            self.linear = self.linear.max((seen.momentum[k] - self.first.0[k]).abs());
            let change = seen.angular_momentum[k] - self.first.1[k];
            self.angular = self.angular.max(change.abs());
        }
    }

    /// Returns the largest change of a component of linear momentum, kg m/s.
    pub fn linear_change(&self) -> f64 {
        self.linear
    }

    /// Returns the largest change of a component of angular momentum, kg m²/s.
    pub fn angular_change(&self) -> f64 {
        self.angular
    }

    /// Returns the change of linear momentum over √(2 m T_max), the largest momentum of mass m with that energy.
    pub fn linear_drift(&self) -> f64 {
        relative(self.linear, (2.0 * self.mass * self.kinetic_max).sqrt())
    }

    /// Returns the change of angular momentum over √(2 m T_max) times the largest coordinate.
    pub fn angular_drift(&self) -> f64 {
        relative(self.angular, (2.0 * self.mass * self.kinetic_max).sqrt() * self.size)
    }
}

impl Observer for MomentumLedger {
    fn name(&self) -> &'static str {
        "momenta"
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        if let Sight::Row(row) = sight {
            self.enter(row.seen);
        }
        Ok(())
    }

    fn snapshot(&self, _: Purpose) -> Bytes {
        Bytes::of(self)
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        *self = snapshot.value()?;
        Ok(())
    }

    fn report(&self, simulation: &Simulation, report: &mut Report) {
        report.momentum = json!({
            "linear_change": self.linear_change(), "relative_linear_drift": self.linear_drift(),
            "angular_change": self.angular_change(), "relative_angular_drift": self.angular_drift(),
        });
        let assert = &simulation.scene().assert;
        report.assert_at_most("momentum_drift", assert.momentum_drift, self.linear_drift());
        report.assert_at_most("angular_momentum_drift", assert.angular_momentum_drift, self.angular_drift());
    }
}

fn relative(change: f64, scale: f64) -> f64 {
    if change == 0.0 { 0.0 } else { change / scale }
}
