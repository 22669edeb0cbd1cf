//! The one error type of this crate.

/// Errors of Lagrangian systems and schemes, with the facts.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoreError {
    /// Two arrays that must have the same length have not.
    #[error("{what}: expected {expected} entries, found {found}")]
    Length {
        /// The array in question.
        what: &'static str,
        /// The length that the system implies.
        expected: usize,
        /// The length that was given.
        found: usize,
    },
    /// A free coordinate carries no inertia.
    #[error(
        "coordinate {dof} is free but its mass is {mass} kg; a free coordinate needs a positive, finite mass"
    )]
    Mass {
        /// The coordinate x_i.
        dof: usize,
        /// Mass at the coordinate, kg.
        mass: f64,
    },
    /// The mass cannot be consistent.
    #[error("mass cannot be consistent here: {reason}; lumped mass serves there")]
    ConsistentMass {
        /// Reason.
        reason: &'static str,
    },
    /// A coordinate that is named does not exist, or is named twice.
    #[error("{what}: coordinate {dof} is out of range or given twice (there are {count})")]
    Coordinate {
        /// The list in question.
        what: &'static str,
        /// The coordinate x_i.
        dof: usize,
        /// Number of coordinates.
        count: usize,
    },
    /// Axes of a node that are not orthonormal.
    #[error("the axes {} and {} of node {node} have the product {product}; axes must be unit vectors, normal to each other", axes[0], axes[1])]
    Axes {
        /// The node.
        node: usize,
        /// Their scalar product.
        product: f64,
        /// Which two, from 0.
        axes: [usize; 2],
    },
    /// A term that does not count three coordinates a node, where nodes have axes of their own.
    #[error(
        "term '{term}' counts {block} coordinates per node; beside nodes with axes of their own it must be 3"
    )]
    Block {
        /// The term's name.
        term: String,
        /// Coordinates per node.
        block: usize,
    },
    /// A node cannot be tied to others as asked.
    #[error("node {node} cannot be tied to others: {reason}")]
    Combination {
        /// The tied node.
        node: usize,
        /// Why not.
        reason: String,
    },
    /// A constraint that constrains nothing.
    #[error("constraint '{constraint}' reads no free coordinate: remove it, or free what it joins")]
    Constraint {
        /// Name of the constraint.
        constraint: String,
    },
    /// A term's stencil names a node that the system has not.
    #[error("term '{term}', stencil {stencil}: node {node} is out of range (there are {count})")]
    Stencil {
        /// The term's name.
        term: String,
        /// The stencil's index.
        stencil: usize,
        /// The node that does not exist.
        node: usize,
        /// Number of nodes.
        count: usize,
    },
    /// A scheme or quadrature that is not defined for this number of points.
    #[error("{what} with {count} points is not defined; {allowed}")]
    Points {
        /// The rule in question.
        what: &'static str,
        /// The number of points that was asked for.
        count: usize,
        /// Numbers of points that are defined.
        allowed: &'static str,
    },
    /// The quadrature has too few points for the interpolation: some motion costs no action.
    #[error(
        "degenerate scheme: a quadrature of {points} points cannot see the velocity of a polynomial of degree {degree}; \
         use at least {degree} points inside the step or at its ends"
    )]
    Degenerate {
        /// Degree of the interpolation.
        degree: usize,
        /// Points of the quadrature.
        points: usize,
    },
    /// A step that does not move time.
    #[error("the step must be finite and not zero, found h = {h} s")]
    StepSize {
        /// The step, s.
        h: f64,
    },
    /// The discrete Legendre transform has no inverse at this step.
    #[error("the step equations are singular at h = {h} s: D1 D2 L_d has no inverse; choose another step")]
    SingularStep {
        /// The step, s.
        h: f64,
    },
    /// The Legendre transform has no inverse: some velocity costs no kinetic energy.
    #[error("the mass d2L/dv2 has no inverse at t = {t} s: some velocity does not enter the Lagrangian")]
    SingularMass {
        /// The time, s.
        t: f64,
    },
    /// The second variation is singular where an isolated equilibrium was sought.
    #[error(
        "the second variation is singular near parameter {parameter}: equilibria are not isolated there; \
         start elsewhere or follow the branch through this point"
    )]
    SingularStiffness {
        /// The parameter.
        parameter: f64,
    },
    /// A nonlinear solve did not converge.
    #[error("no convergence after {iterations} iterations: residual {residual:e}")]
    Convergence {
        /// Newton iterations made.
        iterations: usize,
        /// Norm of the last residual.
        residual: f64,
    },
}
