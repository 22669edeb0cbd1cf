//! Diagnostics of runs: the symplecticity of a map, the spread of its energy, its reversibility, and its crossings of
//! a section. They use only maps and states and are independent of the scheme, except for the shadow Hamiltonians,
//! each of which belongs to one scheme.

pub(crate) mod energy;
pub(crate) mod section;
pub(crate) mod shadow;
pub(crate) mod symplectic;

pub use energy::Envelope;
pub use section::Section;
pub use shadow::{midpoint_shadow, verlet_shadow};
pub use symplectic::{area_factor, map_derivative, reversal_defect, symplecticity_defect};
