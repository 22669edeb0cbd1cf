//! Counts of the work that a stepper has done.

macro_rules! work {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// Counts of work done.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[non_exhaustive]
        pub struct Work {
            $($(#[$doc])* pub $name: u64,)*
        }

        impl Work {
            /// Names and counts, in order.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, u64)> + use<> {
                [$((stringify!($name), self.$name)),*].into_iter()
            }

            /// Counts by their names; none where a name is unknown.
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
    /// Of these: because there was none yet, or h had changed.
    factorizations_new,
    /// Of these: before a step, because the old factor had become dearer than a new one.
    factorizations_stale,
    /// Of these: inside a step that converged too slowly.
    factorizations_slow,
    /// Of these: full Newton iterations.
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
    /// Hessians projected to be positive definite, where the exact one gave no factor or no good direction.
    projections,
    /// Steps whose cheap iteration failed and that full Newton steps down an energy solved.
    descents,
    /// Implicit steps whose prediction already satisfied the tolerance: nothing was solved.
    skipped,
}
