//! The initial guesses of Newton's method in a step.

/// The kinds of initial guess, from the most accurate to the safest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// Extrapolates from the last steps, for motions that the steps resolve.
    Predicted,
    /// Extrapolates such that fast oscillations continue too. A scheme turns oscillations much faster than the step
    /// into ones with a period of one or two steps.
    Stiff,
    /// Assumes zero acceleration.
    Inertial,
    /// Stays at the beginning of the step.
    Still,
}

impl Start {
    pub(super) const ALL: [Self; 4] = [Self::Predicted, Self::Stiff, Self::Inertial, Self::Still];

    pub(crate) fn number(self) -> u64 {
        self as u64
    }

    pub(crate) fn from_number(number: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|start| start.number() == number)
    }
}
