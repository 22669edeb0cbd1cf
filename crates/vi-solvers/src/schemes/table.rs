//! The table of time integrators: one row per scheme, and the only list of them.
//!
//! A row holds the variant of [`crate::Method`] with its parameters and their defaults, the name in scene files, the
//! source of the stepper, and the facts that everything else reads: checks, `bench`, `stress`, the schema of scenes
//! and the table in the README. To add a scheme, write its file and its row.

/// Calls the macro `$define` with the rows of the table:
///
/// ```text
/// /// Description; the schema of scenes shows it.
/// Variant { /// Description of the parameter.
///           parameter: type = default, } = "name-in-scenes" { source; facts }
/// ```
///
/// `source` is a `Source` and `facts` a [`crate::MethodFacts`] (`schemes/method.rs`); both may read the parameters.
#[doc(hidden)]
#[macro_export]
macro_rules! schemes {
    ($define:ident) => {
        $define! {
            /// Linear × left point: kick h, drift h. Variational, explicit, order 1.
            SymplecticEulerA = "symplectic-euler-a" {
                Source::Scheme(Scheme::symplectic_euler_a());
                MethodFacts {
                    made_of: "linear × left",
                    order: 1,
                    use_when: "teaching",
                    ..VARIATIONAL_EXPLICIT
                }
            }
            /// Linear × right point: drift h, kick h. Variational, explicit, order 1.
            SymplecticEulerB = "symplectic-euler-b" {
                Source::Scheme(Scheme::symplectic_euler_b());
                MethodFacts {
                    made_of: "linear × right",
                    order: 1,
                    use_when: "teaching",
                    ..VARIATIONAL_EXPLICIT
                }
            }
            /// Linear × trapezoid: kick h/2, drift h, kick h/2. Variational, explicit, order 2.
            StormerVerlet = "stormer-verlet" {
                Source::Scheme(Scheme::stormer_verlet());
                MethodFacts {
                    made_of: "linear × trapezoid",
                    order: 2,
                    is_symmetric: true,
                    is_benchmarked: true,
                    use_when: "soft bodies, many steps",
                    ..VARIATIONAL_EXPLICIT
                }
            }
            /// Symmetric symplectic Runge–Kutta–Nyström (Blanes & Moan 2002, SRKN₆ᵇ). Variational, explicit, order 4.
            BlanesMoan4 = "blanes-moan-4" {
                Source::KickDrift(Splitting::blanes_moan_4());
                MethodFacts {
                    made_of: "splitting, 6 forces",
                    order: 4,
                    is_symmetric: true,
                    forces_per_step: 6,
                    stability_limit: Some(3.1634),
                    recommended_limit: Some(2.8),
                    accepts: Accepts { forces: AcceptedForces::OfPosition, ..POTENTIAL_ONLY },
                    is_benchmarked: true,
                    use_when: "soft bodies at 1e-4 … 1e-7",
                    ..VARIATIONAL_EXPLICIT
                }
            }
            /// Symmetric symplectic Runge–Kutta–Nyström (Blanes & Moan 2002, SRKN₁₁ᵇ). Variational, explicit, order 6.
            BlanesMoan6 = "blanes-moan-6" {
                Source::KickDrift(Splitting::blanes_moan_6());
                MethodFacts {
                    made_of: "splitting, 11 forces",
                    order: 6,
                    is_symmetric: true,
                    forces_per_step: 11,
                    stability_limit: Some(3.1414),
                    recommended_limit: Some(2.8),
                    accepts: Accepts { forces: AcceptedForces::OfPosition, ..POTENTIAL_ONLY },
                    is_benchmarked: true,
                    use_when: "beyond 1e-7, references",
                    ..VARIATIONAL_EXPLICIT
                }
            }
            /// Linear × midpoint. Variational, implicit, order 2.
            ImplicitMidpoint = "implicit-midpoint" {
                Source::Scheme(Scheme::implicit_midpoint());
                MethodFacts {
                    made_of: "linear × midpoint",
                    order: 2,
                    is_benchmarked: true,
                    use_when: "stiff bodies, large steps",
                    ..VARIATIONAL_IMPLICIT
                }
            }
            /// Degree s × Gauss–Legendre with s points. Variational, implicit, order 2s.
            Gauss {
                /// Number of stages s, 1 … 5.
                stages: usize = 2,
            } = "gauss" {
                Source::gauss(stages);
                MethodFacts {
                    made_of: "degree s × Gauss–Legendre s",
                    order: 2 * stages,
                    accepts: Accepts { constraints: stages == 1, dissipative_terms: stages == 1, ..EVERYTHING },
                    is_benchmarked: stages == 2 || stages == 3,
                    use_when: "stiff bodies, accuracy",
                    ..VARIATIONAL_IMPLICIT
                }
            }
            /// Discrete gradient on the midpoint stage (Gonzalez 1996): conserves energy and momenta. Implicit, order 2.
            EnergyMomentum = "energy-momentum" {
                Source::own(|system, options| one_stage(EnergyMomentum::new(system), system, options));
                MethodFacts {
                    made_of: "discrete gradient",
                    order: 2,
                    conserves: Conserves { symplectic_form: false, energy: true, ..SYMPLECTIC },
                    is_benchmarked: true,
                    use_when: "long stiff runs",
                    ..VARIATIONAL_IMPLICIT
                }
            }
            /// Explicit Euler, for comparison: gains energy.
            ForwardEuler = "forward-euler" {
                Source::own(|system, options| Ok(Box::new(ForwardEuler::new(system, options))));
                MethodFacts {
                    order: 1,
                    is_explicit: true,
                    forces_per_step: 1,
                    stability_limit: Some(0.0),
                    recommended_limit: Some(0.0),
                    accepts: Accepts { contact: false, ..POTENTIAL_ONLY },
                    ..COMPARISON
                }
            }
            /// Implicit Euler, for comparison: loses energy.
            BackwardEuler = "backward-euler" {
                Source::own(|system, options| one_stage(BackwardEuler, system, options));
                MethodFacts {
                    order: 1,
                    accepts: EVERYTHING,
                    ..COMPARISON
                }
            }
            /// Implicit Euler with a fixed number of linear solves per step, for animation: order 1, loses energy, and
            /// does not converge if the solves are too few.
            TruncatedEuler {
                /// Linear solves per step.
                solves: u32 = 8,
            } = "truncated-euler" {
                Source::own(move |system, options| one_stage(TruncatedEuler::new(solves)?, system, options));
                MethodFacts {
                    made_of: "backward Euler, unfinished",
                    order: 1,
                    conserves: Conserves { linear_momentum: false, ..COMPARISON.conserves },
                    accepts: Accepts { dissipative_terms: false, contact: false, ..EVERYTHING },
                    use_when: "animation, at a fixed cost",
                    ..COMPARISON
                }
            }
            /// Backward differences of order 2, for comparison: loses energy.
            Bdf2 = "bdf2" {
                Source::own(|system, options| one_stage(Bdf2::default(), system, options));
                MethodFacts {
                    order: 2,
                    accepts: EVERYTHING,
                    ..COMPARISON
                }
            }
            /// Newmark's family, for comparison: average acceleration by default.
            Newmark {
                /// β; ¼ is the average acceleration.
                beta: f64 = 0.25,
                /// γ; ½ has no numerical damping.
                gamma: f64 = 0.5,
            } = "newmark" {
                Source::own(move |system, options| one_stage(Newmark::new(beta, gamma)?, system, options));
                MethodFacts {
                    order: if gamma == 0.5 { 2 } else { 1 },
                    is_symmetric: gamma == 0.5 && beta == 0.25,
                    ..COMPARISON
                }
            }
            /// Generalised-α (Chung & Hulbert 1993), for comparison: loses energy at high frequencies.
            GeneralizedAlpha {
                /// Spectral radius at infinite frequency, 0 … 1.
                spectral_radius: f64 = 0.8,
            } = "generalized-alpha" {
                Source::own(move |system, options| {
                    one_stage(GeneralizedAlpha::new(spectral_radius)?, system, options)
                });
                MethodFacts {
                    order: 2,
                    is_symmetric: spectral_radius == 1.0,
                    accepts: Accepts { dissipative_terms: false, contact: false, ..COMPARISON.accepts },
                    ..COMPARISON
                }
            }
        }
    };
}
