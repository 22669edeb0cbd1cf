//! Dampers that act on velocities.

/// A damper between two parts of a system at one instant. It resists the rate a = Σ b_n·ẋ_n (m/s) with the forces −c a b_n on
/// its nodes n.
#[derive(Debug, Clone, PartialEq)]
pub struct Damper {
    /// c, N s/m; never negative.
    pub coefficient: f64,
    /// The nodes n with b_n.
    pub covector: Vec<(u32, [f64; 3])>,
    /// Both parts, in the numbering of the term.
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
