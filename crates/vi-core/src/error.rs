//! The error type of this crate.

/// Errors of Lagrangian systems and schemes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoreError {
    /// Two arrays must have the same length but do not.
    #[error("{what}: expected {expected} entries, found {found}")]
    Length {
        /// Name of the array.
        what: &'static str,
        /// Length that the system requires.
        expected: usize,
        /// Length found.
        found: usize,
    },
    /// A free coordinate has no mass.
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
    #[error("mass cannot be consistent here: {reason}; use lumped mass instead")]
    ConsistentMass {
        /// Reason.
        reason: &'static str,
    },
    /// The mass cannot be filtered.
    #[error("mass cannot be filtered here: {reason}; use lumped mass instead")]
    FilteredMass {
        /// Reason.
        reason: &'static str,
    },
    /// A coordinate does not exist, or is given twice.
    #[error("{what}: coordinate {dof} is out of range or given twice (there are {count})")]
    Coordinate {
        /// Name of the list.
        what: &'static str,
        /// The coordinate x_i.
        dof: usize,
        /// Number of coordinates.
        count: usize,
    },
    /// Axes of a node are not orthonormal.
    #[error("the axes {} and {} of node {node} have the scalar product {product}; axes must be unit vectors, normal to each other", axes[0], axes[1])]
    Axes {
        /// The node.
        node: usize,
        /// Their scalar product.
        product: f64,
        /// Indices of the two axes, from 0.
        axes: [usize; 2],
    },
    /// A term does not have three coordinates per node, but some nodes have their own axes.
    #[error(
        "term '{term}' has {block} coordinates per node; it must have 3, because some nodes have their own axes"
    )]
    Block {
        /// The term's name.
        term: String,
        /// Coordinates per node.
        block: usize,
    },
    /// A node cannot be tied to others as requested.
    #[error("node {node} cannot be tied to others: {reason}")]
    Combination {
        /// The tied node.
        node: usize,
        /// Reason.
        reason: String,
    },
    /// A constraint contains no free coordinate.
    #[error(
        "constraint '{constraint}' contains no free coordinate: remove it, or free a node that it constrains"
    )]
    Constraint {
        /// Name of the constraint.
        constraint: String,
    },
    /// A stencil refers to a node that does not exist.
    #[error("term '{term}', stencil {stencil}: node {node} is out of range (there are {count})")]
    Stencil {
        /// Name of the term.
        term: String,
        /// Index of the stencil.
        stencil: usize,
        /// The missing node.
        node: usize,
        /// Number of nodes.
        count: usize,
    },
    /// A scheme or quadrature that is not defined for this number of points.
    #[error("{what} with {count} points is not defined; {allowed}")]
    Points {
        /// Name of the rule.
        what: &'static str,
        /// The requested number of points.
        count: usize,
        /// The allowed numbers of points.
        allowed: &'static str,
    },
    /// The quadrature has too few points for the interpolation: some motion does not change the action.
    #[error(
        "degenerate scheme: a quadrature of {points} points does not determine the velocity of a polynomial of degree {degree}; \
         use at least {degree} points inside the step or at its ends"
    )]
    Degenerate {
        /// Degree of the interpolation.
        degree: usize,
        /// Points of the quadrature.
        points: usize,
    },
    /// The step has zero or non-finite length.
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
    /// The Legendre transform has no inverse: some velocity does not change the kinetic energy.
    #[error(
        "the mass d2L/dv2 has no inverse at t = {t} s: some velocity does not enter the Lagrangian; give its coordinate a \
         mass, or remove the coordinate"
    )]
    SingularMass {
        /// The time, s.
        t: f64,
    },
    /// The second variation is singular, so the equilibrium is not isolated.
    #[error(
        "the second variation is singular near parameter {parameter}: equilibria are not isolated there; \
         start elsewhere or follow the branch through this point"
    )]
    SingularStiffness {
        /// The parameter.
        parameter: f64,
    },
    /// A nonlinear solve did not converge.
    #[error(
        "no convergence after {iterations} iterations: residual {residual:.3e}; take a shorter step or a start nearer to the \
         solution"
    )]
    Convergence {
        /// Newton iterations made.
        iterations: usize,
        /// Norm of the last residual.
        residual: f64,
    },
}
