//! Solids: elements, constitutive laws, their energies, masses and fields.

pub(crate) mod check;
pub(crate) mod consistent_mass;
pub(crate) mod elastic;
pub(crate) mod element;
pub(crate) mod fields;
pub(crate) mod law_kernels;
pub(crate) mod mass;
pub(crate) mod material;
pub(crate) mod mean_dilation;
pub(crate) mod nodal_fields;
