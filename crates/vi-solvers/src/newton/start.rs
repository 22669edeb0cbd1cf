//! Where Newton's method may start a step.

/// Where an iteration may start, from the best guess to the safest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// Extrapolated from the last steps, for motions that the steps resolve.
    Predicted,
    /// Extrapolated so that oscillations far beyond the step, which a scheme turns into ones of a period of
    /// one or two steps, are continued too.
    Stiff,
    /// Without acceleration.
    Inertial,
    /// Where the step began.
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
