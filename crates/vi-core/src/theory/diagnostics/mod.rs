//! Instruments for runs: how symplectic a map is, how its energy spreads, whether it reverses, and
//! where it crosses a section. They look at maps and states from outside: none knows a scheme,
//! except the shadow Hamiltonians, which belong to one.

pub(crate) mod energy;
pub(crate) mod section;
pub(crate) mod shadow;
pub(crate) mod symplectic;

pub use energy::Envelope;
pub use section::Section;
pub use shadow::{midpoint_shadow, verlet_shadow};
pub use symplectic::{area_factor, map_derivative, reversal_defect, symplecticity_defect};
