//! The registry of sheet laws that a scene can name.
//!
//! To add a law, write one file in `law/` with a [`SheetMaterial`] whose parameters have the fields `bending` and
//! `tension_field`, and add one line to `sheet_materials!` below. The line gives the scene name, the schema entry,
//! the potential and the tests that every law must pass.

mod invariants;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::FemError;
use crate::sheet::bending::Bending;
use crate::sheet::material::{SheetMaterial, SheetParameters, SheetVisitor};

macro_rules! sheet_materials {
    ($($(#[$doc:meta])* $file:ident: $variant:ident($material:ident) = $name:literal;)*) => {
        $(mod $file;)*

        /// The laws with their parameters.
        pub(crate) mod registered {
            $(pub use super::$file::*;)*
        }
        use registered::*;

        /// The law of a sheet with its parameters, as a scene file writes them.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(tag = "law", rename_all = "kebab-case")]
        #[non_exhaustive]
        pub enum SheetLaw {
            $($(#[$doc])* #[serde(rename = $name)] $variant(<$material as SheetMaterial>::Parameters),)*
        }

        impl SheetLaw {
            /// The scene names of all laws.
            pub const NAMES: &'static [&'static str] = &[$($name),*];

            /// Returns the scene name of this law.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => $name,)* }
            }

            /// Returns the parameters.
            pub fn parameters(&self) -> &dyn SheetParameters {
                match self { $(Self::$variant(parameters) => parameters,)* }
            }

            /// Returns one example of each law, with valid parameters.
            pub fn examples() -> Vec<Self> {
                vec![$(Self::$variant(<$material as SheetMaterial>::Parameters::example())),*]
            }

            /// Returns the law with another bending model.
            pub fn with_bending(mut self, bending: Bending) -> Self {
                match &mut self { $(Self::$variant(parameters) => parameters.bending = bending,)* }
                self
            }

            /// Returns the law with or without a tension field: wrinkles smaller than the elements.
            pub fn with_tension_field(mut self, tension_field: bool) -> Self {
                match &mut self { $(Self::$variant(parameters) => parameters.tension_field = tension_field,)* }
                self
            }

            pub(crate) fn visit<V: SheetVisitor>(&self, visitor: V) -> V::Output {
                match self { $(Self::$variant(parameters) => visitor.visit($material::new(parameters)),)* }
            }
        }
    };
}

sheet_materials! {
    /// St. Venant–Kirchhoff, W = μ E:E + ½ E ν/(1 − ν²) (tr E)²: small strains, large rotations.
    st_venant_kirchhoff: StVenantKirchhoff(StVenantKirchhoffSheet) = "st-venant-kirchhoff";
    /// Neo-Hookean with logarithmic volume terms, in plane stress: large strains.
    neo_hookean: NeoHookean(NeoHookeanSheet) = "neo-hookean";
    /// Corotated linear elasticity: linear in the principal stretches.
    corotated: Corotated(CorotatedSheet) = "corotated";
    /// Orthotropic St. Venant–Kirchhoff: woven cloth with warp, weft and shear moduli.
    orthotropic: Orthotropic(OrthotropicSheet) = "orthotropic";
}

impl SheetLaw {
    /// Returns the mass per area at rest, kg/m².
    pub fn area_density(&self) -> f64 {
        self.parameters().common().area_density
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Returns all problems at once.
    pub fn check(&self) -> Result<(), Vec<FemError>> {
        let problems = self.parameters().check();
        if problems.is_empty() { Ok(()) } else { Err(problems) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_says_a_sheet_in_one_line() {
        let text = r#"{ "law": "neo-hookean", "young": 1e6, "poisson": 0.3, "area_density": 0.2,
                        "thickness": 1e-3, "bending": "hinge" }"#;
        let law: SheetLaw = serde_json::from_str(text).unwrap();
        law.check().unwrap();
        assert_eq!((law.name(), law.area_density()), ("neo-hookean", 0.2));
        assert_eq!(law.parameters().common().bending, Bending::Hinge);
        let misspelt = text.replace("thickness", "tickness");
        assert!(serde_json::from_str::<SheetLaw>(&misspelt).is_err());
    }

    /// Checks W = ½ e·C e at strains of 1e-6, to the strain: a sum that cancels is off by 1e-16/1e-12.
    #[test]
    fn small_strains_have_energies_without_cancellation() {
        struct Energy([f64; 3]);
        impl SheetVisitor for Energy {
            type Output = f64;
            fn visit<M: SheetMaterial>(self, material: M) -> f64 {
                material.response(&self.0).energy
            }
        }
        for law in SheetLaw::examples() {
            let moduli = law.parameters().moduli();
            for strain in [[1e-6, 1e-6, 0.0], [1e-6, -1e-6, 5e-7], [-1e-6, 3e-7, -2e-6]] {
                let stress = moduli.map(|row| row.iter().zip(&strain).map(|(c, e)| c * e).sum::<f64>());
                let expected = 0.5 * stress.iter().zip(&strain).map(|(s, e)| s * e).sum::<f64>();
                let found = law.visit(Energy(strain));
                assert!((found - expected).abs() <= 2e-5 * expected, "{}: {found} {expected}", law.name());
            }
        }
    }

    #[test]
    fn zero_thickness_and_missing_mass_are_errors_with_a_way_out() {
        let text = r#"{ "law": "corotated", "young": 1e6, "poisson": 0.3, "thickness": 0.0 }"#;
        let problems = serde_json::from_str::<SheetLaw>(text).unwrap().check().unwrap_err();
        let text: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert!(text[0].contains("thickness") && text[1].contains("area_density"), "{text:?}");
    }
}
