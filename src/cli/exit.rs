//! Exit codes of the program.

pub(crate) const DONE: u8 = 0;
pub(crate) const BAD_INPUT: u8 = 2;
pub(crate) const BROKEN: u8 = 3;
pub(crate) const NO_CONVERGENCE: u8 = 4;
pub(crate) const INPUT_OUTPUT: u8 = 5;
pub(crate) const INTERRUPTED: u8 = 130;
