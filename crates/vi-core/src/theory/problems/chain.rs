//! A chain of anharmonic springs in space: small, free, geometrically and materially nonlinear, with all momenta
//! conserved. It is the test system for fast kernels.

use crate::contract::coordinates::{Coordinates, Prescribed};
use crate::contract::potential::HessianKind;
use crate::contract::system::{State, System};
use crate::error::CoreError;
use crate::theory::problems::term::{Jet, Term};

/// Point masses in a row, neighbours joined by springs V = ½ k e² + ¼ β e⁴, e = |x_b − x_a| − l.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringChain {
    /// Number of nodes, ≥ 2; 3 coordinates each.
    pub node_count: usize,
    /// Mass of a node, kg; every second node has twice this mass, so that symmetry hides no mode.
    pub mass: f64,
    /// Linear stiffness k of a spring, N/m.
    pub stiffness: f64,
    /// Cubic stiffness β of a spring, N/m³.
    pub quartic: f64,
    /// Length l of a spring without force, m.
    pub rest_length: f64,
}

impl SpringChain {
    /// Returns a chain of unit masses, springs and lengths with β = 1.
    pub fn unit(node_count: usize) -> Self {
        Self { node_count, mass: 1.0, stiffness: 1.0, quartic: 1.0, rest_length: 1.0 }
    }

    /// Returns the free chain.
    ///
    /// # Errors
    /// Returns the errors of [`System::new`].
    pub fn system(&self) -> Result<System, CoreError> {
        self.system_with(Coordinates::all_free(3 * self.node_count))
    }

    /// Returns the chain with prescribed coordinates.
    ///
    /// # Errors
    /// Returns the errors of [`Coordinates::new`] and [`System::new`].
    pub fn system_holding(&self, prescribed: Vec<Prescribed>) -> Result<System, CoreError> {
        self.system_with(Coordinates::new(3 * self.node_count, prescribed)?)
    }

    fn system_with(&self, coordinates: Coordinates) -> Result<System, CoreError> {
        let spring = *self;
        let springs = Term {
            name: "anharmonic springs",
            block: 3,
            nodes: (1..self.node_count as u32).flat_map(|b| [b - 1, b]).collect(),
            hessian: HessianKind::Varying,
            jet: move |_, x: &[f64; 6]| spring.jet(x),
        };
        let mass = (0..3 * self.node_count).map(|dof| self.mass * (1 + dof / 3 % 2) as f64).collect();
        System::new(mass, vec![Box::new(springs)], coordinates)
    }

    /// Returns a state off the axis, stretched, bent and spinning, without zeros or symmetries.
    pub fn disturbed_state(&self) -> State {
        let mut state = State { t: 0.0, q: Vec::new(), p: Vec::new() };
        for node in 0..self.node_count {
            let s = node as f64;
            let mass = self.mass * (1 + node % 2) as f64;
            state.q.extend([
                1.1 * self.rest_length * s,
                0.3 * self.rest_length * (1.3 * s).sin(),
                0.2 * self.rest_length * (0.7 * s).cos(),
            ]);
            state.p.extend([
                mass * 0.2 * (2.0 * s + 0.3).cos(),
                mass * 0.3 * (1.0 - 0.5 * s),
                mass * 0.1 * (3.0 * s).sin(),
            ]);
        }
        state
    }

    /// Evaluates one spring. With n = (x_b − x_a)/r and V' = k e + β e³, the block of x_b is
    /// V'' n nᵀ + (V'/r)(I − n nᵀ).
    fn jet(&self, x: &[f64; 6]) -> Jet<6> {
        let d = [x[3] - x[0], x[4] - x[1], x[5] - x[2]];
        let r = d.iter().map(|d| d * d).sum::<f64>().sqrt();
        let n = d.map(|d| d / r);
        let e = r - self.rest_length;
        let slope = self.stiffness * e + self.quartic * e * e * e;
        let curvature = self.stiffness + 3.0 * self.quartic * e * e;
        let mut jet = Jet {
            energy: 0.5 * self.stiffness * e * e + 0.25 * self.quartic * e * e * e * e,
            gradient: [0.0; 6],
            hessian: [[0.0; 6]; 6],
        };
        let sign = |i: usize| if i < 3 { -1.0 } else { 1.0 };
        for i in 0..6 {
            jet.gradient[i] = sign(i) * slope * n[i % 3];
            for j in 0..6 {
                let unit = if i % 3 == j % 3 { 1.0 } else { 0.0 };
                let projector = n[i % 3] * n[j % 3];
                jet.hessian[i][j] =
                    sign(i) * sign(j) * (curvature * projector + slope / r * (unit - projector));
            }
        }
        jet
    }
}
