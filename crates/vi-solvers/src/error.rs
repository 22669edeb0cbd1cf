//! Defines the error type of this crate.

mod cause;
mod description;

use thiserror::Error;

use description::{distance, explain_lowest, in_metres};

/// The errors of this crate.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SolverError {
    /// The fill-reducing ordering failed.
    #[error("ordering of {nodes} nodes failed: METIS reports {code}")]
    Ordering {
        /// Number of nodes of the graph.
        nodes: usize,
        /// METIS' return code.
        code: i32,
    },
    /// The factor does not fit in memory or in its index type.
    #[error("symbolic factorisation of {dofs} unknowns failed: {reason}")]
    Symbolic {
        /// Number of unknowns.
        dofs: usize,
        /// The reason.
        reason: &'static str,
    },
    /// A pivot was not positive.
    #[error(transparent)]
    NotPositiveDefinite(#[from] NotPositiveDefinite),
    /// A solve was requested from a factor that holds no matrix yet.
    #[error("solve before the first factorisation: factorise a matrix first")]
    NotFactored,
    /// A tangent that is not symmetric has no factors.
    #[error(
        "the tangent of {rows} equations and constraints is singular or not finite: use a smaller step, or remove constraints \
         that depend on each other"
    )]
    Singular {
        /// Number of equations and constraints.
        rows: usize,
    },
    /// A solve left a residual larger than round-off explains.
    #[error("linear solve left a backward error of {residual:.3e}, but {limit:e} is allowed")]
    Residual {
        /// ‖Ax − b‖/(‖b‖ + max|a_ij| ‖x‖).
        residual: f64,
        /// The largest value that is allowed.
        limit: f64,
    },
    /// Conjugate gradients found a direction in which the matrix or the preconditioner is not positive.
    #[error(
        "conjugate gradients: the matrix or its preconditioner is not positive definite (curvature {curvature:.3e} at iteration {iterations})"
    )]
    NegativeCurvature {
        /// Number of iterations made.
        iterations: u32,
        /// The curvature dᵀAd.
        curvature: f64,
    },
    /// Conjugate gradients did not reach the tolerance.
    #[error(
        "conjugate gradients: relative residual {residual:.3e} after {iterations} iterations, but {tolerance:e} was required"
    )]
    ConjugateGradients {
        /// Number of iterations made.
        iterations: u32,
        /// Relative residual in the preconditioned norm.
        residual: f64,
        /// The required relative residual.
        tolerance: f64,
    },
    /// A term of the potential left its domain.
    #[error("{term}")]
    Term {
        /// The term, the element and the quantity.
        term: TermFault,
        /// Whether the term was outside its domain when the step began. Then no smaller step helps.
        at_start: bool,
    },
    /// A step is too long for the forces of contact at a stage of the scheme.
    #[error(
        "{scheme} does not resolve contact with this step: hω = {product:.3} with the highest frequency ω of the surfaces \
         that press on each other, of at most {limit}; use a step of at most {longest:.3e} s, or {schemes}, which \
         need not resolve it"
    )]
    UnresolvedContact {
        /// Name of the scheme.
        scheme: &'static str,
        /// Largest hω that the scheme accepts.
        limit: f64,
        /// hω at the stage.
        product: f64,
        /// The longest step that is accepted at this configuration, s.
        longest: f64,
        /// Schemes that do not resolve contact.
        schemes: &'static str,
    },
    /// The straight path of a step would make surfaces pass through each other, and so would every other path that
    /// was tried.
    #[error(
        "surfaces would pass through each other in this step: a part moves too far in it; use a smaller step"
    )]
    Crossing {
        /// The nodes of one pair that would pass through each other; the last node is repeated if there are fewer than
        /// four.
        nodes: [u32; 4],
    },
    /// A number is not finite although no term reports a fault: the step is far too large.
    #[error(
        "{what} is not finite (at coordinate {dof}): use a smaller step, or correct the initial state and the loads"
    )]
    NotFinite {
        /// The array that holds the number.
        what: &'static str,
        /// The first coordinate x_i with a number that is not finite.
        dof: usize,
        /// Whether the number was not finite when the step began. Then no smaller step helps.
        at_start: bool,
    },
    /// The coordinates are so large compared with the extent of a body that round-off hides its shape.
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
        "no convergence after {iterations} iterations: residual {residual:.3e} relative in the energy \
         norm, but {tolerance:e} is required; use a smaller step"
    )]
    NoConvergence {
        /// Number of Newton iterations made.
        iterations: u32,
        /// Last relative residual in the energy norm.
        residual: f64,
        /// The required tolerance.
        tolerance: f64,
    },
    /// Bodies that nothing holds move away instead of coming to an equilibrium.
    #[error("nothing stops the bodies: they move {}; hold them, or let them rest on something", distance(*extents))]
    MovesAway {
        /// The distance that they moved, as a multiple of their extent; infinite if their loads do not balance along an axis along
        /// which nothing holds them.
        extents: f64,
    },
    /// The solve of a step would cost more than its [`Budget`](crate::Budget).
    #[error("the step was given up after {iterations} iterations, because shorter steps cost less")]
    Budget {
        /// Number of Newton iterations made.
        iterations: u32,
    },
    /// A step would bring a pair of surfaces so close that the next step would fail.
    #[error(
        "a pair of surfaces would end this step with a gap of {gap:.1e} of the distance below which it acts; use a smaller step"
    )]
    Narrow {
        /// The gap at the end of the step, as a fraction of the distance below which the pair acts.
        gap: f64,
    },
    /// The corrections of a step along a path of equilibria did not converge.
    #[error(
        "no convergence after {iterations} iterations: the last correction was {change:.3e} of the step, \
         but {tolerance:e} is required"
    )]
    Correction {
        /// Number of Newton iterations made.
        iterations: u32,
        /// The last correction relative to the step.
        change: f64,
        /// The required tolerance.
        tolerance: f64,
    },
    /// An option lies outside its domain.
    #[error("{option} = {value}: {allowed}")]
    Option {
        /// The name of the option in a scene file.
        option: &'static str,
        /// The value that was given.
        value: f64,
        /// The values that are allowed.
        allowed: &'static str,
    },
    /// No equilibrium was found beyond a load factor.
    #[error(
        "no equilibrium beyond load factor {load_factor}: an increment of {increment:.3e} fails ({cause}){}",
        explain_lowest(.lowest)
    )]
    Equilibrium {
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// The smallest increment that was tried.
        increment: f64,
        /// Lowest ω² of the last equilibrium, 1/s²; it is near zero at a limit point, and zero if it is round-off.
        lowest: Option<f64>,
        /// The last equilibrium.
        last: Box<vi_core::State>,
        /// The reason why that increment failed.
        cause: Box<SolverError>,
    },
    /// No minimum of V was found beyond an unstable equilibrium.
    #[error(
        "the equilibrium at load factor {load_factor} is unstable (lowest ω² {lowest:.3e} 1/s²), and the body has not come to rest \
         beyond it after a push of {push:e} m along its critical mode: {cause}; change `static.push`, or follow the path by \
         `static.arc_steps`"
    )]
    Branch {
        /// The load factor.
        load_factor: f64,
        /// Lowest ω² of the unstable equilibrium, 1/s².
        lowest: f64,
        /// Amplitude of the push, m.
        push: f64,
        /// The reason why the descent failed.
        cause: Box<SolverError>,
    },
    /// No equilibrium was found, because bodies can move freely and their loads do not balance.
    #[error(
        "no equilibrium at load factor {load_factor}: nothing holds {bodies} along {axis}, and the loads along {axis} sum to \
         {load:.3e} N; hold a part of it ([[fix]], or springs by [[attach]]), let it rest on something ([contact], with \
         friction if it can slide off), or balance its loads"
    )]
    Unheld {
        /// The load factor.
        load_factor: f64,
        /// Names of the bodies that move together.
        bodies: String,
        /// The axis along which no support holds these bodies: x, y or z.
        axis: String,
        /// Sum of the loads along the axis, N.
        load: f64,
    },
    /// No equilibrium was found at the end of an arc step, however short.
    #[error(
        "the path of equilibria cannot be followed beyond load factor {load_factor}: an arc step as short as a change \
         of the load factor by {load:.3e} at the start fails ({cause}); `static.smallest_increment` allows shorter ones"
    )]
    ArcStep {
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// Length of the shortest arc step tried, as the change of the load factor to which it corresponds at the
        /// start.
        load: f64,
        /// The reason why it failed.
        cause: Box<SolverError>,
    },
    /// All arc steps were used before the final load factor was reached.
    #[error(
        "the path of equilibria was followed for all {steps} arc steps, to load factor {load_factor}, but has not \
         reached load factor {end}: allow more arc steps (`static.arc_steps`)"
    )]
    ArcSteps {
        /// Number of arc steps made.
        steps: u32,
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// The requested final load factor.
        end: f64,
    },
    /// A term does not allow the displacement that a load increment requires, for example because the body would pass
    /// through another one.
    #[error(
        "a term allows only {part} of the way to load factor {load_factor}; use smaller increments \
         (`time.step`)"
    )]
    Blocked {
        /// The requested load factor.
        load_factor: f64,
        /// The fraction of the way that is allowed, below 1.
        part: f64,
        /// The nodes of one pair that would meet on the way, if that is the reason; the last node is repeated if there
        /// are fewer than four.
        nodes: Option<[u32; 4]>,
    },
    /// A step of bodies in contact failed.
    #[error("{cause}; {pair}")]
    InContact {
        /// The reason.
        cause: Box<SolverError>,
        /// The pair of surfaces at which it failed, and what to change.
        pair: Box<PairInContact>,
    },
    /// No equilibrium was found for a new value of the quantity that controls the path, however little it changes.
    #[error(
        "the path of equilibria cannot be followed beyond load factor {load_factor}: a change of the controlled \
         quantity by {change:.3e} fails ({cause}); if the path turns back in this quantity, follow it by arc length \
         (`static.arc_steps` instead of `static.control`)"
    )]
    ControlStep {
        /// Load factor of the last equilibrium.
        load_factor: f64,
        /// The smallest change tried, m or m³.
        change: f64,
        /// The reason why it failed.
        cause: Box<SolverError>,
    },
    /// The load does not change the quantity that controls the path.
    #[error(
        "the quantity that controls the path does not respond to the load at load factor {load_factor}; choose another quantity (`static.control`)"
    )]
    Unmoved {
        /// Load factor of the equilibrium.
        load_factor: f64,
    },
    /// The scheme does not accept this force without a potential.
    #[error(
        "scheme {scheme} does not accept the force '{force}', which {reason}; remove the force or choose one of {schemes}"
    )]
    Force {
        /// Name of the scheme.
        scheme: &'static str,
        /// Name of the force.
        force: String,
        /// The property of the force that the scheme does not accept.
        reason: &'static str,
        /// The schemes that accept it.
        schemes: Box<str>,
    },
    /// The scheme does not accept constraints.
    #[error(
        "scheme {scheme} does not accept the constraint '{constraint}'; choose one of {schemes}, or remove the rigid \
         bodies and joints"
    )]
    Constrained {
        /// Name of the scheme.
        scheme: &'static str,
        /// Name of the first constraint.
        constraint: String,
        /// The schemes that accept constraints.
        schemes: Box<str>,
    },
    /// The scheme does not accept live terms that dissipate.
    #[error(
        "scheme {scheme} would ignore the friction and damping of '{term}'; choose one of {schemes}, or set both to 0"
    )]
    Dissipative {
        /// Name of the scheme.
        scheme: &'static str,
        /// Name of the first term that dissipates.
        term: String,
        /// The schemes that accept such terms.
        schemes: Box<str>,
    },
    /// The analysis does not accept constraints.
    #[error("{analysis} does not accept the constraint '{constraint}'; remove the rigid bodies and joints")]
    ConstrainedAnalysis {
        /// Name of the analysis.
        analysis: &'static str,
        /// Name of the first constraint.
        constraint: String,
    },
    /// A force has no potential, and its tangent is not symmetric.
    #[error(
        "'{force}' has no potential: the part of its stiffness that is not symmetric is {size:.1e} of that of a mode, and \
         modes K φ = ω² M φ need a symmetric K; hold the edge of its surface, or excite the body in a run and read the \
         frequency of a probe"
    )]
    Circulatory {
        /// Name of the first force without a potential.
        force: String,
        /// Largest ratio |A φ| / (ω² |M φ|) of a mode φ, with the part A of the tangent that is not symmetric.
        size: f64,
    },
    /// The scheme is explicit: its steps divide by the mass of each coordinate and therefore need lumped mass.
    #[error("scheme {scheme} needs lumped mass; choose one of {schemes}, or lump the mass")]
    ConsistentMass {
        /// Name of the scheme.
        scheme: &'static str,
        /// The schemes that accept consistent mass.
        schemes: Box<str>,
    },
    /// Something does not run with a filtered mass.
    #[error("filtered mass does not run with {what}; remove it, or use lumped mass")]
    FilteredMass {
        /// The feature that does not run with a filtered mass, and the alternatives.
        what: String,
    },
    /// The constraints could not be satisfied to round-off.
    #[error(
        "constraint '{constraint}' has the error {defect:.3e} after {iterations} iterations: the step is too long, or joints \
         depend on each other in this position"
    )]
    ConstraintDefect {
        /// Name of the constraint with the largest error.
        constraint: String,
        /// Number of iterations made.
        iterations: u32,
        /// The value of the constraint.
        defect: f64,
    },
    /// The memory of a stepper does not fit the stepper that should continue from it.
    #[error(
        "cannot continue: the memory of the stepper has no entry '{missing}' of the right size; continue with the scheme and \
         the system that wrote it"
    )]
    Memory {
        /// The entry that is missing or has the wrong size.
        missing: &'static str,
    },
    /// The linear solver of PETSc cannot be used.
    #[error("\"petsc\" {reason}; use \"pcg\"")]
    Petsc {
        /// The reason.
        reason: String,
    },
    /// The work was abandoned on request ([`Interrupt`](crate::Interrupt)). This is not a failure: do not try a shorter
    /// step instead.
    #[error("ended early on request, without a result; do it again without the request")]
    Interrupted,
    /// Several ranks cannot step this system.
    #[error("{reason}")]
    Ranks {
        /// The reason, and what to write instead.
        reason: String,
    },
}

/// A pair of surfaces at which a step failed.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "in contact, the gap of {} and {} at {} is {gap:.3e} m, of a layer of {layer:.3e} m: {way_out}",
    .parts[0], .parts[1], in_metres(.place)
)]
pub struct PairInContact {
    /// Names of both bodies.
    pub bodies: [String; 2],
    /// Both parts in words, with their nodes and bodies.
    pub parts: [String; 2],
    /// Position of a node of the first part, m.
    pub place: [f64; 3],
    /// The gap at the start of the step that failed, m.
    pub gap: f64,
    /// The distance d̂ below which the parts press on each other, m.
    pub layer: f64,
    /// What to write in the scene instead.
    pub way_out: String,
}

impl SolverError {
    /// Returns the error of a program without PETSc.
    pub fn no_petsc() -> Self {
        let reason = "needs the program variational-mpi, built with its feature `petsc`".to_owned();
        Self::Petsc { reason }
    }
}

/// A pivot of a matrix is not positive, so that no Cholesky factor exists.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("matrix is not positive definite: the pivot of free coordinate {free} is not positive")]
pub struct NotPositiveDefinite {
    /// Index of the free coordinate q_k whose pivot failed.
    pub free: usize,
}

/// A term of the potential has no finite value. Tells which term, where and why.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{term}: element {}: {} = {:e} {}", .fault.element, .fault.quantity, .fault.value, .fault.domain)]
pub struct TermFault {
    /// Name of the term.
    pub term: Box<str>,
    /// The element, the quantity, its value and its domain.
    pub fault: vi_core::Fault,
}
