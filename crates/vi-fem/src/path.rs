//! Given functions of time and place: amplitudes, motions, formulas and vector fields.

pub(crate) mod amplitude;
pub(crate) mod expression;
pub(crate) mod field;
pub(crate) mod motion;
pub(crate) mod own_motion;
