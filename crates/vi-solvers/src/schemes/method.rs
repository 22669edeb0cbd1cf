//! The time integrators by name: their facts, the systems that they accept, and the construction of their steppers.
//! The rows are in `table.rs`.

use vi_core::{Scheme, System};

use crate::error::SolverError;
use crate::options::SolverOptions;
use crate::schemes::comparison::{
    BackwardEuler, Bdf2, ForwardEuler, GeneralizedAlpha, Newmark, TruncatedEuler,
};
use crate::schemes::energy_momentum::EnergyMomentum;
use crate::schemes::gauss::Gauss;
use crate::schemes::gauss::collocation::stages_outside_domain;
use crate::schemes::kick_drift::KickDrift;
use crate::schemes::kick_drift::splitting::Splitting;
use crate::schemes::one_stage::OneStage;
use crate::schemes::one_stage::rule::{Midpoint, Rule};
use crate::schemes::stepper::Stepper;

/// The facts about a scheme that are known before it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodFacts {
    /// Name in scene files.
    pub name: &'static str,
    /// Interpolation × quadrature, or the family, in words.
    pub made_of: &'static str,
    /// Classical order of accuracy.
    pub order: usize,
    /// Whether a step solves no equations.
    pub is_explicit: bool,
    /// Whether the scheme is its own adjoint, that is, reversible in time.
    pub is_symmetric: bool,
    /// Evaluations of ∂V/∂x per step of an explicit scheme; 0 if the solver decides.
    pub forces_per_step: usize,
    /// hω below which an explicit scheme is stable on the oscillator.
    pub stability_limit: Option<f64>,
    /// Largest hω that is recommended for long nonlinear runs.
    pub recommended_limit: Option<f64>,
    /// The quantities that the scheme conserves.
    pub conserves: Conserves,
    /// The systems that the scheme can step.
    pub accepts: Accepts,
    /// Whether `bench` compares the scheme when none is named.
    pub is_benchmarked: bool,
    /// Recommended use, in words.
    pub use_when: &'static str,
}

impl MethodFacts {
    /// Returns whether the scheme follows from a discrete Hamilton's principle. It then conserves the symplectic
    /// form, and its energy stays in a bounded band below the stability limit.
    pub fn is_variational(&self) -> bool {
        self.conserves.symplectic_form
    }
}

/// Quantities that a scheme conserves exactly, apart from round-off and the tolerance of the solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conserves {
    /// The symplectic form dq ∧ dp.
    pub symplectic_form: bool,
    /// The energy T + V.
    pub energy: bool,
    /// The linear momentum, without external forces.
    pub linear_momentum: bool,
    /// The angular momentum, without external forces.
    pub angular_momentum: bool,
}

impl Conserves {
    /// Returns the quantities in words, e.g. "symplectic form, momenta".
    pub fn words(&self) -> String {
        let momenta = match (self.linear_momentum, self.angular_momentum) {
            (true, true) => Some("momenta"),
            (true, false) => Some("linear momentum"),
            (false, true) => Some("angular momentum"),
            (false, false) => None,
        };
        let form = self.symplectic_form.then_some("symplectic form");
        let words: Vec<&str> =
            [form, self.energy.then_some("energy"), momenta].into_iter().flatten().collect();
        words.join(", ")
    }
}

/// The forces without a potential that a scheme accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AcceptedForces {
    /// No forces without a potential.
    None,
    /// Forces that do not depend on velocity.
    OfPosition,
    /// All forces, also those that depend on velocity.
    All,
}

/// The systems that a scheme can step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Accepts {
    /// The forces without a potential that the scheme accepts.
    pub forces: AcceptedForces,
    /// Whether the scheme accepts constraints: rigid bodies and joints.
    pub constraints: bool,
    /// Whether the scheme accepts mass that is not lumped.
    pub consistent_mass: bool,
    /// Whether the scheme accepts live terms that dissipate: contact with friction or damping. Other schemes use the
    /// potential of live terms only.
    pub dissipative_terms: bool,
    /// Whether every step ends at a configuration that live terms, such as contact, admit. Other schemes do not check
    /// the end of a step, or may end it before their equations are solved; scenes with contact refuse them.
    pub contact: bool,
}

const EVERYTHING: Accepts = Accepts {
    forces: AcceptedForces::All,
    constraints: true,
    consistent_mass: true,
    dissipative_terms: true,
    contact: true,
};

const POTENTIAL_ONLY: Accepts = Accepts {
    forces: AcceptedForces::None,
    constraints: false,
    consistent_mass: false,
    dissipative_terms: false,
    contact: true,
};

const SYMPLECTIC: Conserves =
    Conserves { symplectic_form: true, energy: false, linear_momentum: true, angular_momentum: true };

/// The facts of an explicit scheme with one force per step, to be completed by its row.
const VARIATIONAL_EXPLICIT: MethodFacts = MethodFacts {
    name: "",
    made_of: "",
    order: 0,
    is_explicit: true,
    is_symmetric: false,
    forces_per_step: 1,
    stability_limit: Some(2.0),
    recommended_limit: Some(1.8),
    conserves: SYMPLECTIC,
    accepts: Accepts { consistent_mass: false, ..EVERYTHING },
    is_benchmarked: false,
    use_when: "",
};

/// The facts of an implicit scheme, to be completed by its row.
const VARIATIONAL_IMPLICIT: MethodFacts = MethodFacts {
    is_explicit: false,
    is_symmetric: true,
    forces_per_step: 0,
    stability_limit: None,
    recommended_limit: None,
    accepts: EVERYTHING,
    ..VARIATIONAL_EXPLICIT
};

/// The facts of an implicit scheme that only serves comparison, to be completed by its row.
const COMPARISON: MethodFacts = MethodFacts {
    made_of: "not variational",
    is_symmetric: false,
    conserves: Conserves {
        symplectic_form: false,
        energy: false,
        linear_momentum: true,
        angular_momentum: false,
    },
    accepts: Accepts { constraints: false, ..EVERYTHING },
    use_when: "comparison only",
    ..VARIATIONAL_IMPLICIT
};

type Made = Result<Box<dyn Stepper>, SolverError>;
type Make = dyn Fn(&System, &SolverOptions) -> Made;

/// The origin of the stepper of a scheme.
enum Source {
    /// The stepper is derived from interpolation × quadrature.
    Scheme(Scheme),
    /// Kicks and drifts with tabulated coefficients.
    KickDrift(Splitting),
    /// A stepper that the scheme implements itself.
    Own(Box<Make>),
}

impl Source {
    fn own(make: impl Fn(&System, &SolverOptions) -> Made + 'static) -> Self {
        Self::Own(Box::new(make))
    }

    /// Returns degree s × Gauss–Legendre with s points.
    fn gauss(stages: usize) -> Self {
        match Scheme::gauss(stages) {
            Ok(scheme) => Self::Scheme(scheme),
            Err(_) => Self::own(move |_, _| Err(stages_outside_domain(stages))),
        }
    }
}

fn one_stage<R: Rule + 'static>(rule: R, system: &System, options: &SolverOptions) -> Made {
    Ok(Box::new(OneStage::new(rule, system, options)?))
}

/// Returns the stepper of a scheme that is interpolation × quadrature.
fn derived(name: &'static str, scheme: &Scheme, system: &System, options: &SolverOptions) -> Made {
    if let Some(coefficients) = Splitting::of(scheme) {
        return Ok(Box::new(KickDrift::new(name, coefficients, system, options)?));
    }
    if let Some(rule) = Midpoint::of(scheme) {
        return one_stage(rule, system, options);
    }
    Ok(Box::new(Gauss::new(scheme, system, options)?))
}

macro_rules! methods {
    ($(
        $(#[doc = $doc:literal])+
        $variant:ident $({ $($(#[doc = $about:literal])+ $parameter:ident: $type:ty = $default:expr,)+ })?
        = $name:literal { $source:expr; $facts:expr }
    )+) => {
        /// A time integrator with its parameters.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Method {
            $($(#[doc = $doc])+ $variant $({ $($(#[doc = $about])+ $parameter: $type,)+ })?,)+
        }

        impl Method {
            /// All schemes with their default parameters, in the order of the table.
            pub const ALL: [Self; [$($name),+].len()] =
                [$(Self::$variant $({ $($parameter: $default,)+ })?),+];

            /// Returns the facts that are known before the scheme runs.
            // Facts need not depend on the parameters.
            #[allow(unused_variables)]
            pub fn facts(&self) -> MethodFacts {
                match *self {
                    $(Self::$variant $({ $($parameter,)+ })? => MethodFacts { name: $name, ..$facts },)+
                }
            }

            fn source(&self) -> Source {
                match *self { $(Self::$variant $({ $($parameter,)+ })? => $source,)+ }
            }
        }
    };
}

crate::schemes!(methods);

impl Method {
    /// Returns all schemes, with `gauss` for each number of stages.
    pub fn variants() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().flat_map(|method| match method {
            Self::Gauss { .. } => (1..=5).map(|stages| Self::Gauss { stages }).collect(),
            other => vec![other],
        })
    }

    /// Returns the kicks and drifts of the scheme; `None` if it does not consist of them.
    pub(crate) fn splitting(&self) -> Option<Splitting> {
        match self.source() {
            Source::Scheme(scheme) => Splitting::of(&scheme),
            Source::KickDrift(coefficients) => Some(coefficients),
            Source::Own(_) => None,
        }
    }

    /// Returns the times (in units of h) and weights with which a step samples forces; `None` if it does not sum them.
    pub fn samples(&self) -> Option<Vec<[f64; 2]>> {
        if let Some(Splitting { kicks, drifts }) = self.splitting() {
            let time_of = |number: usize| drifts[..number].iter().sum::<f64>();
            return Some(kicks.iter().enumerate().map(|(number, kick)| [time_of(number), *kick]).collect());
        }
        let quadrature = self.scheme()?.quadrature;
        Some(quadrature.nodes().iter().zip(quadrature.weights()).map(|(t, weight)| [*t, *weight]).collect())
    }

    /// Returns the name in scene files.
    pub fn name(&self) -> &'static str {
        self.facts().name
    }

    /// Returns the name with the number of stages, e.g. `gauss 3`.
    pub fn label(&self) -> String {
        match self {
            Self::Gauss { stages } => format!("{} {stages}", self.name()),
            _ => self.name().to_owned(),
        }
    }

    /// Returns interpolation × quadrature, for the schemes that are defined by it alone.
    pub fn scheme(&self) -> Option<Scheme> {
        match self.source() {
            Source::Scheme(scheme) => Some(scheme),
            Source::KickDrift(_) | Source::Own(_) => None,
        }
    }

    /// Checks that the scheme can step this system.
    ///
    /// # Errors
    /// Returns [`SolverError::Force`], [`SolverError::Constrained`], [`SolverError::ConsistentMass`] or
    /// [`SolverError::Dissipative`] with the part that it does not accept, and the schemes that accept the system; [`SolverError::FilteredMass`].
    pub fn check(&self, system: &System) -> Result<(), SolverError> {
        match self.refusal(system, || Self::accepting(system)) {
            Some(error) => Err(error),
            None => self.check_filter(system),
        }
    }

    /// Returns the error about the first part of the system that the scheme does not accept, if there is one; `schemes` names those
    /// that do.
    fn refusal(&self, system: &System, schemes: impl Fn() -> Box<str>) -> Option<SolverError> {
        let MethodFacts { name: scheme, accepts, .. } = self.facts();
        let (refused, reason) = match accepts.forces {
            AcceptedForces::All => (None, ""),
            AcceptedForces::OfPosition => (
                system.forces().iter().find(|force| force.depends_on_velocity()),
                "depends on velocity: the order of the scheme would be lost",
            ),
            AcceptedForces::None => (system.forces().first(), "has no potential"),
        };
        if let Some(force) = refused {
            let force = force.name().to_owned();
            return Some(SolverError::Force { scheme, force, reason, schemes: schemes() });
        }
        if let (Some(constraint), false) = (system.constraints().first(), accepts.constraints) {
            let constraint = constraint.name().to_owned();
            return Some(SolverError::Constrained { scheme, constraint, schemes: schemes() });
        }
        if system.kinetic().is_some() && !accepts.consistent_mass {
            return Some(SolverError::ConsistentMass { scheme, schemes: schemes() });
        }
        let dissipative = system.terms().live().iter().find(|term| term.dissipates());
        if let (Some(term), false) = (dissipative, accepts.dissipative_terms) {
            let term = term.name().to_owned();
            return Some(SolverError::Dissipative { scheme, term, schemes: schemes() });
        }
        None
    }

    /// Checks that the scheme can step this system if its mass is filtered.
    fn check_filter(&self, system: &System) -> Result<(), SolverError> {
        let refused = |what: String| Err(SolverError::FilteredMass { what });
        if system.filter().is_none() {
            return Ok(());
        }
        if self.splitting().is_none() {
            return refused(format!("scheme {} (choose one of {})", self.name(), Self::accepting(system)));
        }
        if let Some(force) = system.forces().first() {
            return refused(format!("the force '{}'", force.name()));
        }
        match system.terms().live().first() {
            Some(live) => refused(format!("'{}'", live.name())),
            None => Ok(()),
        }
    }

    /// Returns the names of the schemes that accept a system, without explicit ones that conserve nothing.
    fn accepting(system: &System) -> Box<str> {
        let meets = !system.terms().live().is_empty();
        let is_proposed = |method: &&Self| {
            let facts = method.facts();
            (facts.conserves.angular_momentum || !facts.is_explicit)
                && (facts.accepts.contact || !meets)
                && (method.splitting().is_some() || system.filter().is_none())
                && method.refusal(system, Box::default).is_none()
        };
        let names = Self::ALL.iter().filter(is_proposed).map(Self::name);
        names.collect::<Vec<_>>().join(", ").into()
    }
}

/// Returns the stepper of the integrator `method` for `system`.
///
/// # Errors
/// Returns [`SolverError::Option`] if a parameter of the method or an option is outside its domain, and the errors of
/// [`Method::check`].
pub fn stepper(
    method: &Method,
    system: &System,
    options: &SolverOptions,
) -> Result<Box<dyn Stepper>, SolverError> {
    method.check(system)?;
    match method.source() {
        Source::Scheme(scheme) => derived(method.name(), &scheme, system, options),
        Source::KickDrift(coefficients) => {
            Ok(Box::new(KickDrift::new(method.name(), coefficients, system, options)?))
        }
        Source::Own(make) => make(system, options),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the smallest z = hω at which the trace of the step's 2 × 2 matrix on the oscillator leaves ±2. It
    /// scans z, because the first instability gap of the high orders near z = π is narrow.
    fn first_gap(scheme: &Splitting) -> f64 {
        let trace = |z: f64| {
            // Use (q, p) in units in which ω = 1 and h = z.
            let column = |mut q: f64, mut p: f64| {
                for i in 0..scheme.kicks.len() {
                    p -= scheme.kicks[i] * z * q;
                    q += scheme.drifts.get(i).unwrap_or(&0.0) * z * p;
                }
                (q, p)
            };
            column(1.0, 0.0).0 + column(0.0, 1.0).1
        };
        (1..).map(|k| 5e-5 * f64::from(k)).find(|&z| trace(z).abs() > 2.0 + 1e-12).unwrap()
    }

    #[test]
    fn stability_limits_of_the_table_are_the_first_gaps() {
        for method in Method::ALL {
            let Some(coefficients) = method.splitting() else { continue };
            let facts = method.facts();
            let (stated, found) = (facts.stability_limit.unwrap(), first_gap(&coefficients));
            assert!(stated <= found && stated > found - 2e-4, "{}: {stated} {found}", facts.name);
            assert!(facts.recommended_limit.unwrap() < stated);
            assert_eq!(facts.forces_per_step, coefficients.drifts.len(), "{}", facts.name);
        }
    }

    #[test]
    fn what_a_row_says_of_a_scheme_is_what_the_scheme_says() {
        for method in Method::variants() {
            let Some(scheme) = method.scheme() else { continue };
            let facts = method.facts();
            assert_eq!(facts.is_explicit, scheme.is_explicit(), "{}", facts.name);
            assert_eq!(facts.is_symmetric, scheme.is_symmetric(), "{}", facts.name);
            assert!(facts.is_variational(), "{}", facts.name);
        }
    }

    /// The samples of a step integrate polynomials exactly, as far as the order of the scheme says.
    #[test]
    fn samples_integrate_to_the_order() {
        for method in Method::variants() {
            let Some(samples) = method.samples() else { continue };
            for power in 0..method.facts().order as i32 {
                let sum: f64 = samples.iter().map(|[t, weight]| weight * t.powi(power)).sum();
                assert!((sum * f64::from(power + 1) - 1.0).abs() < 1e-12, "{}: {power}", method.label());
            }
        }
    }

    #[test]
    fn names_are_unique() {
        for (k, method) in Method::ALL.iter().enumerate() {
            assert!(Method::ALL[..k].iter().all(|other| other.name() != method.name()), "{}", method.name());
        }
    }
    /// Tests that README.md contains the table built from the rows.
    #[test]
    fn the_readme_has_the_table() {
        let is_compared_only = |facts: &MethodFacts| facts.made_of == COMPARISON.made_of;
        let mut table = String::new();
        for method in Method::ALL.iter().filter(|method| !is_compared_only(&method.facts())) {
            let MethodFacts { name, made_of, order, is_explicit, conserves, use_when, .. } = method.facts();
            let (parameters, order) = match method {
                Method::Gauss { .. } => (" (`stages` 1–5)", "2s".to_owned()),
                Method::TruncatedEuler { .. } => (" (`solves`)", order.to_string()),
                _ => ("", order.to_string()),
            };
            let (kind, conserves) = (if is_explicit { "explicit" } else { "implicit" }, conserves.words());
            table += &format!(
                "| `{name}`{parameters} | {made_of} | {order} | {kind} | {conserves} | {use_when} |\n"
            );
        }
        let compared: Vec<MethodFacts> =
            Method::ALL.iter().map(Method::facts).filter(is_compared_only).collect();
        let names: Vec<String> = compared.iter().map(|facts| format!("`{}`", facts.name)).collect();
        let (made_of, use_when) = (COMPARISON.made_of, COMPARISON.use_when);
        table += &format!("| {} | {made_of} | 1–2 | | | {use_when} |\n", names.join(", "));
        assert!(include_str!("../../../../README.md").contains(&table), "README.md should have:\n{table}");
    }
}
