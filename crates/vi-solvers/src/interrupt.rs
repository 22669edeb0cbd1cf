//! A request to end work before it is complete.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::SolverError;

/// A request to end work before it is complete. Another thread or a signal handler makes it, with a clone.
///
/// Solvers look at it about once per linear solve, return [`SolverError::Interrupted`] soon after it was made, and
/// leave states as they were. Until the request is withdrawn, every further solve ends in this way.
///
/// ```rust
/// use vi_core::problems::SpringChain;
/// use vi_solvers::{Interrupt, Method, SolverError, SolverOptions, stepper};
///
/// let chain = SpringChain::unit(5);
/// let (system, mut state) = (chain.system()?, chain.disturbed_state());
/// let interrupt = Interrupt::new();
/// let options = SolverOptions { interrupt: interrupt.clone(), ..SolverOptions::default() };
/// let mut scheme = stepper(&Method::ImplicitMidpoint, &system, &options)?;
///
/// let before = state.clone();
/// std::thread::scope(|scope| {
///     scope.spawn(|| interrupt.ask());
/// });
/// let error = scheme.step(&system, &mut state, 0.1).unwrap_err();
/// assert_eq!((error.cause, &state), (SolverError::Interrupted, &before));
///
/// interrupt.withdraw();
/// scheme.step(&system, &mut state, 0.1)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Default)]
pub struct Interrupt(Option<Arc<AtomicBool>>);

impl Interrupt {
    /// A request that is never made; the default of all options.
    pub const NEVER: Self = Self(None);

    /// Returns a request that can be made.
    pub fn new() -> Self {
        Self(Some(Arc::default()))
    }

    /// Makes the request, also for all clones.
    pub fn ask(&self) {
        self.set(true);
    }

    /// Takes the request back, also for all clones.
    pub fn withdraw(&self) {
        self.set(false);
    }

    fn set(&self, is_asked: bool) {
        if let Some(flag) = &self.0 {
            flag.store(is_asked, Ordering::SeqCst);
        }
    }

    /// Returns whether the request stands.
    pub fn is_asked(&self) -> bool {
        self.0.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Returns whether the request can be made at all.
    pub fn is_possible(&self) -> bool {
        self.0.is_some()
    }

    /// Returns an error if the request stands.
    ///
    /// # Errors
    /// Returns [`SolverError::Interrupted`].
    pub fn check(&self) -> Result<(), SolverError> {
        if self.is_asked() { Err(SolverError::Interrupted) } else { Ok(()) }
    }
}

impl From<Arc<AtomicBool>> for Interrupt {
    /// Returns the request that stands while `flag` is true.
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self(Some(flag))
    }
}

/// Two requests are equal if they are the same.
impl PartialEq for Interrupt {
    fn eq(&self, other: &Self) -> bool {
        self.0.as_ref().map(Arc::as_ptr) == other.0.as_ref().map(Arc::as_ptr)
    }
}

/// The text is always the same, so that it does not distinguish options that lead to the same results.
impl fmt::Debug for Interrupt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Interrupt")
    }
}
