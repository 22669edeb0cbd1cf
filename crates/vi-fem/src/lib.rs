//! Elements and materials: a mass and potentials for vi-core.
//!
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod error;
mod lanes;
mod load;
mod path;
mod sheet;
mod small;
mod solid;

pub use error::FemError;
pub use lanes::instructions::InstructionSet;
pub use lanes::real::Real;
pub use load::damping::{ConsistentMassDamping, MassDamping, Viscosity, kelvin_voigt};
pub use load::dead::DeadLoad;
pub use load::gravity::Gravity;
pub use load::pressure::{Pressure, pressure};
pub use load::spread::{Resultant, Spread};
pub use load::spring::{PointSpring, SpringEnd};
pub use load::tie::{Anchor, Tie, ties};
pub use load::wind::Wind;
pub use path::amplitude::Amplitude;
pub use path::expression::Expression;
pub use path::field::VectorField;
pub use path::motion::{Motion, Rotate, Sine, Table, Translate};
pub use path::own_motion::{NodalMotion, OwnMotion};
pub use sheet::bending::Bending;
pub use sheet::body::Sheet;
pub use sheet::direction::{CellDirection, CellField, Direction, DirectionComponent};
pub use sheet::law::SheetLaw;
pub use sheet::law::registered::*;
pub use sheet::material::{IsotropicSheet, SheetCommon, SheetMaterial, SheetParameters, SheetResponse};
pub use small::tensor;
pub use solid::check::check_body;
pub use solid::consistent_mass::consistent_mass;
pub use solid::elastic::elsewhere::elastic_elsewhere;
pub use solid::elastic::{elastic, elastic_in_portions, elastic_in_runs, elastic_on};
pub use solid::element::SOLIDS;
pub use solid::element::contract::Element;
pub use solid::element::solids::*;
pub use solid::fields::{ElementField, element_field};
pub use solid::mass::{
    MassProperties, add_lumped_mass, add_row_sums, mass_properties, rigid_velocities, volumes,
};
pub use solid::material::Law;
pub use solid::material::contract::{Material, Outside, positive_determinant};
pub use solid::material::formula::{Formula, FormulaParameters};
pub use solid::material::own::{Differentiated, EnergyDensity, OwnLaw, PointLaw};
pub use solid::material::parameters::{Isotropic, Parameters};
pub use solid::material::registered::*;
pub use solid::mean_dilation::{LockingCure, mean_dilation, mean_dilation_in_portions};
pub use solid::nodal_fields::nodal_field;

/// Configures property tests with a fixed seed, so that every run draws the same samples.
#[cfg(test)]
fn fixed_seed() -> proptest::test_runner::Config {
    use proptest::test_runner::{Config, RngSeed};
    Config { rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..Config::default() }
}
