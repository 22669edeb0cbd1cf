//! What an error says about its cause, by which callers decide whether another attempt helps.

use super::SolverError;

impl SolverError {
    /// Returns whether the work was abandoned on request. Such an error is passed on: no other attempt is made.
    pub fn is_interruption(&self) -> bool {
        matches!(self, Self::Interrupted)
    }

    /// Returns whether bodies move away instead of coming to an equilibrium. Another way to solve the same equations does not help.
    pub(crate) fn moves_away(&self) -> bool {
        matches!(self, Self::MovesAway { .. })
    }

    /// Returns whether a term has no value at a time, whatever the state. Then no other way to that time helps.
    pub fn is_at_any_state(&self) -> bool {
        matches!(self.without_contact(), Self::Term { term, .. } if term.fault.at_any_state)
    }

    /// Returns the nodes of the pair that stopped a path, if that is the cause.
    pub fn obstacle(&self) -> Option<[u32; 4]> {
        match self {
            Self::Crossing { nodes } => Some(*nodes),
            Self::Blocked { nodes, .. } => *nodes,
            Self::Equilibrium { cause, .. }
            | Self::ArcStep { cause, .. }
            | Self::ControlStep { cause, .. }
            | Self::Branch { cause, .. }
            | Self::InContact { cause, .. } => cause.obstacle(),
            _ => None,
        }
    }

    /// Returns the error without the pair in contact that was added to it.
    pub fn without_contact(&self) -> &Self {
        match self {
            Self::InContact { cause, .. } => cause,
            other => other,
        }
    }
}
