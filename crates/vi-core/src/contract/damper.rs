//! Dampers and dry friction that act on velocities.

/// A damper between two parts of a system at one instant. It resists the rate a = Σ b_n·ẋ_n (m/s) with the forces −c a b_n on
/// its nodes n.
#[derive(Debug, Clone, PartialEq)]
pub struct Damper {
    /// Number of the pair that it belongs to, as in [`Rubbing::pair`](crate::Rubbing::pair).
    pub pair: u64,
    /// Damping coefficient c, N s/m; never negative.
    pub coefficient: f64,
    /// Pairs (node n, dimensionless vector b_n).
    pub covector: Vec<(u32, [f64; 3])>,
    /// The two parts on which the damper acts, in the numbering of the term.
    pub between: [u32; 2],
    /// The sum of b_n over the nodes of the first part.
    pub on_first: [f64; 3],
}

impl Damper {
    /// Returns the rate a, m/s, for the velocities of all coordinates.
    pub fn rate(&self, velocity: &[f64]) -> f64 {
        let of_node = |&(node, b): &(u32, [f64; 3])| {
            let first = 3 * node as usize;
            (0..3).map(|k| b[k] * velocity[first + k]).sum::<f64>()
        };
        self.covector.iter().map(of_node).sum()
    }

    /// Adds `factor` · b to a covector of all coordinates.
    pub fn add_covector(&self, factor: f64, out: &mut [f64]) {
        for &(node, b) in &self.covector {
            let first = 3 * node as usize;
            (0..3).for_each(|k| out[first + k] += factor * b[k]);
        }
    }
}

/// Dry friction of a pair at the end of a step, next to the force F (N) by which dampers press the pair there. It resists the rates a₁
/// and a₂ (m/s) of slip along two tangents as two dampers with the same coefficient c would, where c is the largest with
/// ```text
/// c ≤ coefficient   and   c |(a₁, a₂)| ≤ reserve + μ F.
/// ```
/// F is negative if dampers resist the opening of a pair. The traction over the step of a pair that slides is then too
/// large by −μ F, and a force of this size is taken back, at most all of the traction.
#[derive(Debug, Clone, PartialEq)]
pub struct DryFriction {
    /// The dampers of slip along both tangents, without coefficients.
    pub along: [Damper; 2],
    /// The bound `coefficient` on c, N s/m: the coefficient of a bristle if the pair sticks, infinite if it slides.
    pub coefficient: f64,
    /// Coulomb's limit minus the traction over the step, N.
    pub reserve: f64,
    /// Coefficient of friction μ.
    pub friction: f64,
    /// Force that presses the pair over the step, N.
    pub pressing: f64,
    /// Components along both tangents of the direction in which the traction over the step drove the second part of a pair that slid.
    pub direction: [f64; 2],
}

impl DryFriction {
    /// Returns whether the pair slides.
    pub fn slides(&self) -> bool {
        self.coefficient.is_infinite()
    }

    /// Returns the forces along both tangents, N, that reduce the traction over the step to Coulomb's limit at the
    /// force F = `pressing` (N), at most to zero.
    pub fn taken_back(&self, pressing: f64) -> [f64; 2] {
        let held_back = (-pressing).clamp(0.0, self.pressing.max(0.0));
        let size = if self.slides() { self.friction * held_back } else { 0.0 };
        self.direction.map(|part| size * part)
    }

    /// Returns c, N s/m, at the rate of slip |(a₁, a₂)| (m/s) and the force F (N); 0 for a pair that slides without rate.
    pub fn coefficient_at(&self, rate: f64, pressing: f64) -> f64 {
        let limit = (self.reserve + self.friction * pressing).max(0.0);
        match (rate == 0.0, self.slides()) {
            (true, true) => 0.0,
            (true, false) => self.coefficient,
            (false, _) => self.coefficient.min(limit / rate),
        }
    }
}

/// The dampers and the friction that act on the velocities at the end of a step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EndForces {
    /// Dampers of gaps.
    pub dampers: Vec<Damper>,
    /// Friction of the pairs that these dampers press.
    pub friction: Vec<DryFriction>,
}
