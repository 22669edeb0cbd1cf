//! Vector fields over a body at rest.

use crate::error::FemError;
use crate::path::expression::Expression;

/// A vector field over the body at rest. Each component is a constant, or a formula of the position `x y z` (m).
#[derive(Debug, Clone, PartialEq)]
pub struct VectorField([FieldComponent; 3]);

#[derive(Debug, Clone, PartialEq)]
enum FieldComponent {
    Number(f64),
    Expression(Expression),
}

impl From<[f64; 3]> for VectorField {
    fn from(value: [f64; 3]) -> Self {
        Self(value.map(FieldComponent::Number))
    }
}

impl VectorField {
    /// Returns a field whose components are formulas of `x y z`, the position at rest (m).
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] if a formula does not parse.
    pub fn expressions(sources: [&str; 3]) -> Result<Self, FemError> {
        let [a, b, c] = sources.map(|source| Expression::parse(source, &["x", "y", "z"]));
        Ok(Self([a?, b?, c?].map(FieldComponent::Expression)))
    }

    /// Returns the value at a position at rest (m).
    pub fn at(&self, position: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| match &self.0[i] {
            FieldComponent::Number(value) => *value,
            FieldComponent::Expression(expression) => expression.evaluate(&position),
        })
    }
}
