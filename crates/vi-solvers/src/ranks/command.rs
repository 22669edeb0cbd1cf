//! The commands that the conductor (the first rank) sends to the other ranks, each for one component.

/// A command; its data follow in messages.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Command {
    /// Take the state that follows.
    Place {
        /// The time of the last evaluation, s, and whether its gradient is known, if there was one. Its positions follow.
        evaluated: Option<(f64, bool)>,
    },
    /// Make steps, and send the state back if all ranks succeed.
    Steps {
        /// The time at the start, s.
        t: f64,
        /// The length of a step, s.
        h: f64,
        /// The number of steps.
        count: u32,
    },
    /// Send the state back.
    State,
    /// Keep a copy of the state.
    Keep,
    /// Go back to the state that was kept, and send it.
    GoBack,
    /// Sum energies at the positions that follow.
    Energies {
        /// The time, s.
        t: f64,
    },
    /// Start Lanczos' method at the free coordinates that follow, with the vector after them.
    StartLanczos {
        /// The time, s.
        t: f64,
        /// The inverse of the unit of mass, 1/kg.
        per_unit: f64,
        /// The largest displacement of a difference, m.
        displacement: f64,
    },
    /// Divide the last vector by its norm, multiply it, and send the terms of the product of both back.
    MultiplyLanczos {
        /// The norm of the last vector.
        norm: f64,
    },
    /// Subtract the current and the earlier vector from the product, and send the squares of its numbers back.
    SubtractLanczos {
        /// The factors of the current and of the earlier vector.
        factors: [f64; 2],
    },
    /// Assemble A = aM + cK at the positions that follow, and prepare its solver.
    Prepare {
        /// The time, s.
        t: f64,
        /// The factors a and c.
        factors: [f64; 2],
        /// Whether negative eigenvalues of stencils are set to zero.
        is_projected: bool,
    },
    /// Solve with A for the load that follows, and send the solution back.
    Solve {
        /// The relative error to which the system is solved.
        tolerance: f64,
        /// The largest number of iterations.
        most: u32,
    },
    /// Send back the diagonal of the last K.
    Diagonal,
    /// Sum ∂V/∂x at the positions that follow, and send it back.
    Gradient {
        /// The time, s.
        t: f64,
    },
    /// Look for the first stencil without finite numbers at the positions that follow, and send it back.
    Fault {
        /// The time, s.
        t: f64,
    },
}

const LENGTH: usize = 4;

impl Command {
    /// Returns the command to component number `component` as bytes.
    pub(crate) fn encode(&self, component: usize) -> Vec<u8> {
        let (tag, numbers): (u32, [f64; LENGTH]) = match *self {
            Self::Place { evaluated: None } => (0, [0.0; LENGTH]),
            Self::Place { evaluated: Some((t, knows)) } => (1, [t, f64::from(u8::from(knows)), 0.0, 0.0]),
            Self::Steps { t, h, count } => (2, [t, h, f64::from(count), 0.0]),
            Self::Energies { t } => (3, [t, 0.0, 0.0, 0.0]),
            Self::Gradient { t } => (4, [t, 0.0, 0.0, 0.0]),
            Self::Prepare { t, factors: [a, c], is_projected } => {
                (5, [t, a, c, f64::from(u8::from(is_projected))])
            }
            Self::Solve { tolerance, most } => (6, [tolerance, f64::from(most), 0.0, 0.0]),
            Self::Diagonal => (7, [0.0; LENGTH]),
            Self::Fault { t } => (8, [t, 0.0, 0.0, 0.0]),
            Self::StartLanczos { t, per_unit, displacement } => (9, [t, per_unit, displacement, 0.0]),
            Self::MultiplyLanczos { norm } => (10, [norm, 0.0, 0.0, 0.0]),
            Self::SubtractLanczos { factors: [alpha, beta] } => (11, [alpha, beta, 0.0, 0.0]),
            Self::State => (12, [0.0; LENGTH]),
            Self::Keep => (13, [0.0; LENGTH]),
            Self::GoBack => (14, [0.0; LENGTH]),
        };
        let head = [component as u32, tag].into_iter().flat_map(u32::to_le_bytes);
        head.chain(numbers.into_iter().flat_map(f64::to_le_bytes)).collect()
    }

    /// Returns the component and the command that these bytes encode; `None` if they encode no command.
    pub(crate) fn decode(bytes: &[u8]) -> Option<(usize, Self)> {
        let (head, numbers) = bytes.split_at_checked(8)?;
        let word = |k: usize| Some(u32::from_le_bytes(*head[4 * k..].first_chunk()?));
        let number = |k: usize| Some(f64::from_le_bytes(*numbers.get(8 * k..)?.first_chunk()?));
        let command = match word(1)? {
            0 => Self::Place { evaluated: None },
            1 => Self::Place { evaluated: Some((number(0)?, number(1)? == 1.0)) },
            2 => Self::Steps { t: number(0)?, h: number(1)?, count: number(2)? as u32 },
            3 => Self::Energies { t: number(0)? },
            4 => Self::Gradient { t: number(0)? },
            5 => {
                let factors = [number(1)?, number(2)?];
                Self::Prepare { t: number(0)?, factors, is_projected: number(3)? == 1.0 }
            }
            6 => Self::Solve { tolerance: number(0)?, most: number(1)? as u32 },
            7 => Self::Diagonal,
            8 => Self::Fault { t: number(0)? },
            9 => Self::StartLanczos { t: number(0)?, per_unit: number(1)?, displacement: number(2)? },
            10 => Self::MultiplyLanczos { norm: number(0)? },
            11 => Self::SubtractLanczos { factors: [number(0)?, number(1)?] },
            12 => Self::State,
            13 => Self::Keep,
            14 => Self::GoBack,
            _ => return None,
        };
        Some((word(0)? as usize, command))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_arrive_as_they_were_sent() {
        let placed = Command::Place { evaluated: Some((0.3, true)) };
        let steps = Command::Steps { t: 0.1, h: 1e-3, count: 16 };
        let sums = [Command::Energies { t: 0.2 }, Command::Gradient { t: 0.4 }, Command::Fault { t: 0.6 }];
        let solves = [
            Command::Prepare { t: 0.1, factors: [1.0, 2.0], is_projected: true },
            Command::Diagonal,
            Command::Solve { tolerance: 0.5, most: 9 },
        ];
        let kept = [Command::State, Command::Keep, Command::GoBack];
        let others = [Command::Place { evaluated: None }, placed, steps].into_iter().chain(kept);
        let lanczos = [
            Command::StartLanczos { t: 0.1, per_unit: 2.0, displacement: 3.0 },
            Command::MultiplyLanczos { norm: 0.7 },
            Command::SubtractLanczos { factors: [4.0, 5.0] },
        ];
        for command in others.chain(sums).chain(solves).chain(lanczos) {
            assert_eq!(Command::decode(&command.encode(7)), Some((7, command)));
        }
        assert_eq!(Command::decode(b"short"), None);
    }
}
