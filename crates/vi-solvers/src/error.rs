//! What can go wrong in assembly and in sparse solves, with the facts.

use thiserror::Error;

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SolverError {
    /// The fill-reducing ordering could not be made.
    #[error("ordering of {nodes} nodes failed: METIS reports {code}")]
    Ordering {
        /// Nodes of the graph.
        nodes: usize,
        /// METIS' return code.
        code: i32,
    },
    /// The factor would not fit in memory or its index type.
    #[error("symbolic factorisation of {dofs} unknowns failed: {reason}")]
    Symbolic {
        /// Unknowns.
        dofs: usize,
        /// Why.
        reason: &'static str,
    },
    /// A pivot was not positive.
    #[error(transparent)]
    NotPositiveDefinite(#[from] NotPositiveDefinite),
    /// A solve was asked of a factor that holds no matrix yet.
    #[error("solve before the first factorisation")]
    NotFactored,
    /// A solve left a residual above what round-off explains.
    #[error("linear solve left a backward error of {residual:e}, {limit:e} allowed")]
    Residual {
        /// ‖Ax − b‖/(‖b‖ + max|a_ij| ‖x‖).
        residual: f64,
        /// What is allowed.
        limit: f64,
    },
    /// Conjugate gradients met a direction in which the matrix or the preconditioner is not positive.
    #[error("conjugate gradients: curvature {curvature:e} at iteration {iterations}: not positive definite")]
    NegativeCurvature {
        /// Iterations made.
        iterations: u32,
        /// dᵀAd.
        curvature: f64,
    },
    /// Conjugate gradients did not reach the tolerance.
    #[error(
        "conjugate gradients: relative residual {residual:e} after {iterations} iterations, {tolerance:e} wanted"
    )]
    ConjugateGradients {
        /// Iterations made.
        iterations: u32,
        /// Relative residual in the preconditioned norm.
        residual: f64,
        /// What was wanted.
        tolerance: f64,
    },
    /// A term of the potential left its domain.
    #[error("{term}")]
    Term {
        /// Which, where and why.
        term: TermFault,
        /// Was it so before the step began? Then no smaller step helps.
        at_start: bool,
    },
    /// The straight path of a step, or any path to its end that was found, meets a surface.
    #[error(
        "surfaces would pass through each other in this step: something moves too far at once; a smaller step helps"
    )]
    Crossing,
    /// A number is not finite and no term says why: the step is far too large.
    #[error("{what} is not finite (at coordinate {dof})")]
    NotFinite {
        /// The array in question.
        what: &'static str,
        /// The first coordinate x_i where it is so.
        dof: usize,
        /// Was it so before the step began?
        at_start: bool,
    },
    /// The coordinates are so large beside the extent of a body that their round-off hides its shape.
    #[error(
        "coordinates of up to {reach:.3e} m do not resolve a body of {extent:.3e} m: differences of its forces \
         would be round-off; place the scene nearer to the origin"
    )]
    Unresolved {
        /// Extent of the body, m.
        extent: f64,
        /// Largest coordinate, m.
        reach: f64,
    },
    /// The nonlinear solve did not converge.
    #[error(
        "no convergence after {iterations} iterations: residual {residual:e} relative in the energy \
         norm, {tolerance:e} asked for; a smaller step helps"
    )]
    NoConvergence {
        /// Newton iterations made.
        iterations: u32,
        /// Last residual, relative, in the energy norm.
        residual: f64,
        /// What was asked for.
        tolerance: f64,
    },
    /// The corrections of a step along a path of equilibria did not come to rest.
    #[error(
        "no convergence after {iterations} iterations: the last correction was {change:e} of the step, \
         {tolerance:e} asked for"
    )]
    Correction {
        /// Newton iterations made.
        iterations: u32,
        /// The last correction over the step.
        change: f64,
        /// What was asked for.
        tolerance: f64,
    },
    /// An option outside its domain.
    #[error("{option} = {value}: {allowed}")]
    Option {
        /// Its name in a scene file.
        option: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// No equilibrium was found beyond a load factor.
    #[error(
        "no equilibrium beyond load factor {load_factor}: an increment of {increment:e} fails ({cause}){}",
        explain_lowest(.lowest)
    )]
    Equilibrium {
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// The smallest increment that was tried.
        increment: f64,
        /// Lowest ω² of the last equilibrium, 1/s²: near zero at a limit point.
        lowest: Option<f64>,
        /// Why that increment failed.
        cause: Box<SolverError>,
    },
    /// No equilibrium was found at the end of an arc step, however short.
    #[error(
        "the path of equilibria cannot be followed beyond load factor {load_factor}: an arc step as short as a change \
         of the load factor by {load:e} at the start fails ({cause}); `static.smallest_increment` allows shorter ones"
    )]
    ArcStep {
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// Length of the shortest arc step tried, as the change of the load factor that it is at the start.
        load: f64,
        /// Why it failed.
        cause: Box<SolverError>,
    },
    /// The arc steps were used up before the load factor at the end was reached.
    #[error(
        "the path of equilibria was followed for all {steps} arc steps, to load factor {load_factor}, and has not \
         come to load factor {end}: allow more arc steps (`static.arc_steps`)"
    )]
    ArcSteps {
        /// Arc steps made.
        steps: u32,
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// Load factor asked for.
        end: f64,
    },
    /// A term does not allow the body to move as far as an increment of the load asks, for example because it would
    /// pass through another body.
    #[error(
        "a term allows {part} of the way to load factor {load_factor} and no more; take smaller increments \
         (`static.increment`)"
    )]
    Blocked {
        /// Load factor that was asked for.
        load_factor: f64,
        /// Part of the way that is allowed, below 1.
        part: f64,
    },
    /// No equilibrium was found with the value that controls the path, however little that changes.
    #[error(
        "the path of equilibria cannot be followed beyond load factor {load_factor}: a change of the controlled \
         quantity by {change:e} fails ({cause}); where the path turns back in this quantity, follow it by arc length \
         (`static.arc_steps` instead of `static.control`)"
    )]
    ControlStep {
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// The smallest change tried, m or m³.
        change: f64,
        /// Why it failed.
        cause: Box<SolverError>,
    },
    /// The load does not move what controls the path.
    #[error("the quantity that controls the path does not respond to the load at load factor {load_factor}")]
    Unmoved {
        /// Load factor of the equilibrium.
        load_factor: f64,
    },
    /// A scheme that has no place for a force that no potential gives.
    #[error(
        "scheme {scheme} cannot take the force '{force}', which {reason}; remove the force or choose one of {schemes}"
    )]
    Force {
        /// The scheme's name.
        scheme: &'static str,
        /// The force's name.
        force: String,
        /// Why not.
        reason: &'static str,
        /// Schemes that can.
        schemes: Box<str>,
    },
    /// A scheme that has no place for constraints.
    #[error(
        "scheme {scheme} cannot keep the constraint '{constraint}'; choose one of {schemes}, or remove the rigid \
         bodies and joints"
    )]
    Constrained {
        /// The scheme's name.
        scheme: &'static str,
        /// The first constraint.
        constraint: String,
        /// Schemes that can.
        schemes: Box<str>,
    },
    /// An analysis that has no place for constraints.
    #[error("{analysis} cannot keep the constraint '{constraint}'; remove the rigid bodies and joints")]
    ConstrainedAnalysis {
        /// The analysis.
        analysis: &'static str,
        /// The first constraint.
        constraint: String,
    },
    /// An explicit scheme, whose steps divide by the mass of each coordinate.
    #[error("scheme {scheme} needs lumped mass; choose one of {schemes}, or lump the mass")]
    ConsistentMass {
        /// The scheme's name.
        scheme: &'static str,
        /// Schemes that can.
        schemes: Box<str>,
    },
    /// The constraints could not be satisfied to round-off.
    #[error(
        "constraint '{constraint}' is {defect:e} off after {iterations} iterations: the step is too long, or joints \
         depend on each other here"
    )]
    ConstraintDefect {
        /// The constraint furthest off.
        constraint: String,
        /// Iterations made.
        iterations: u32,
        /// Its value.
        defect: f64,
    },
    /// A memory to continue from that does not fit.
    #[error("cannot continue: the memory of the stepper has no fitting '{missing}'")]
    Memory {
        /// What is missing or has the wrong size.
        missing: &'static str,
    },
}

/// A matrix has a pivot that is not positive: a Cholesky factor does not exist.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("matrix is not positive definite: the pivot of free coordinate {free} is not positive")]
pub struct NotPositiveDefinite {
    /// Index of the free coordinate q_k where the pivot failed.
    pub free: usize,
}

/// A term of the potential has no finite value: which, where and why.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{term}: element {}: {} = {:e} {}", .fault.element, .fault.quantity, .fault.value, .fault.domain)]
pub struct TermFault {
    /// The term's name.
    pub term: String,
    /// The element, quantity, value and domain.
    pub fault: vi_core::Fault,
}

fn explain_lowest(lowest: &Option<f64>) -> String {
    match lowest {
        Some(lowest) => format!(
            "; the lowest eigenvalue of the last equilibrium is {lowest:e} 1/s²: where it has fallen towards \
             zero this is a limit point, which an arc-length search can pass"
        ),
        None => String::new(),
    }
}
