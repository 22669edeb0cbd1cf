//! Counts the work that a stepper has done.

macro_rules! work {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// Counts of work done.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[non_exhaustive]
        pub struct Work {
            $($(#[$doc])* pub $name: u64,)*
        }

        impl Work {
            /// Returns the names and counts, in order.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, u64)> + use<> {
                [$((stringify!($name), self.$name)),*].into_iter()
            }

            /// Returns the counts for these names, or `None` if a name is unknown.
            pub fn from_counts<'a>(counts: impl IntoIterator<Item = (&'a str, u64)>) -> Option<Self> {
                let mut work = Self::default();
                for (name, count) in counts {
                    match name {
                        $(stringify!($name) => work.$name = count,)*
                        _ => return None,
                    }
                }
                Some(work)
            }
        }

        impl std::ops::AddAssign for Work {
            fn add_assign(&mut self, other: Self) {
                $(self.$name += other.$name;)*
            }
        }

        impl std::ops::Sub for Work {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self { $($name: self.$name - other.$name),* }
            }
        }
    };
}

work! {
    /// Steps made.
    steps,
    /// Evaluations of ∂V/∂x.
    gradients,
    /// Evaluations of V.
    energies,
    /// Evaluations of ∂²V/∂x².
    hessians,
    /// Numeric factorisations.
    factorizations,
    /// Factorisations (of the above) because there was no factor yet, or h had changed.
    factorizations_new,
    /// Factorisations (of the above) before a step, because the old factor had become more expensive than a new one.
    factorizations_stale,
    /// Factorisations (of the above) inside a step that converged too slowly.
    factorizations_slow,
    /// Factorisations (of the above) in full Newton iterations.
    factorizations_newton,
    /// Linear solves.
    solves,
    /// Iterations of conjugate gradients.
    pcg_iterations,
    /// Iterations of conjugate gradients for velocities from momenta, M⁻¹p (consistent mass).
    mass_iterations,
    /// Newton iterations.
    newton_iterations,
    /// Energies or residuals evaluated in line searches.
    line_searches,
    /// Hessians projected to be positive definite because the exact one gave no factor or no descent direction.
    projections,
    /// Steps whose cheap iteration failed and that full Newton steps with an energy descent solved.
    descents,
    /// Solves in which friction between sticking and sliding needed bristles that were soft at first.
    softenings,
    /// Searches for pairs of live terms, such as contact, among all parts of their surfaces.
    searches,
    /// Candidates of live terms whose path was checked.
    path_checks,
    /// Pairs of live terms whose force was evaluated.
    pair_forces,
    /// Implicit steps whose prediction already satisfied the tolerance, so that nothing was solved.
    skipped,
    /// Steps of a fixed number of linear solves that ended far from convergence.
    stopped_short,
}
