//! Scales a load in time by a number, a formula of t, or a table.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_core::Fault;

use crate::error::FemError;
use crate::path::expression::Expression;

/// Factor a(t) of a load: `amplitude = 2.0`, `"sin(2*pi*t)"`, or `[[0.0, 0.0], [0.5, 1.0]]`.
///
/// A table holds pairs (t in s, a) with increasing times. a is linear between them, and constant before the first and
/// after the last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Source", into = "Source")]
pub struct Amplitude(Kind);

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Constant(f64),
    Expression(Expression),
    Table(Vec<[f64; 2]>),
}

/// The forms in which a scene file gives an amplitude.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
enum Source {
    /// A constant factor.
    Constant(f64),
    /// A formula of t (s).
    Expression(String),
    /// Pairs (t in s, factor) with increasing times.
    Table(Vec<[f64; 2]>),
}

impl Default for Amplitude {
    fn default() -> Self {
        Self::constant(1.0)
    }
}

impl Amplitude {
    /// Returns the constant a(t) = value.
    pub fn constant(value: f64) -> Self {
        Self(Kind::Constant(value))
    }

    /// Returns a(t) from a formula of `t` (s).
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] if the formula does not parse.
    pub fn expression(source: &str) -> Result<Self, FemError> {
        Ok(Self(Kind::Expression(Expression::parse(source, &["t"])?)))
    }

    /// Returns a(t) that is linear between the points (t in s, a).
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] if the table is empty, holds a number that is not finite, or its times do not
    /// increase.
    pub fn table(points: Vec<[f64; 2]>) -> Result<Self, FemError> {
        let problem = if points.is_empty() {
            "the table is empty: give at least one pair [t, factor]".to_owned()
        } else if let Some(row) = points.iter().position(|point| !point.iter().all(|v| v.is_finite())) {
            format!("row {row} of the table holds a number that is not finite: give finite numbers")
        } else if let Some(row) = points.windows(2).position(|pair| pair[1][0] <= pair[0][0]) {
            format!("times must increase, but that of row {} is not above that of row {row}", row + 1)
        } else {
            return Ok(Self(Kind::Table(points)));
        };
        Err(FemError::Invalid { what: "amplitude", problem })
    }

    /// Returns a(t), t in s.
    pub fn at(&self, t: f64) -> f64 {
        match &self.0 {
            Kind::Constant(value) => *value,
            Kind::Expression(expression) => expression.evaluate(&[t]),
            Kind::Table(points) => {
                let after = points.partition_point(|point| point[0] <= t);
                let (Some(low), Some(high)) = (after.checked_sub(1), points.get(after)) else {
                    return points[after.saturating_sub(1)][1];
                };
                let low = points[low];
                low[1] + (high[1] - low[1]) * ((t - low[0]) / (high[0] - low[0]))
            }
        }
    }

    /// Returns the times of a table, s; none for other forms.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        let points: &[[f64; 2]] = match &self.0 {
            Kind::Table(points) => points,
            Kind::Constant(_) | Kind::Expression(_) => &[],
        };
        points.iter().map(|point| point[0])
    }

    /// Returns the fault of a stencil of a load at t (s) if a(t) is not finite.
    pub(crate) fn fault(&self, stencil: usize, t: f64) -> Option<Fault> {
        let value = self.at(t);
        (!value.is_finite()).then_some(Fault {
            element: stencil,
            quantity: "amplitude",
            value,
            domain: "must be finite",
            at_any_state: true,
        })
    }

    /// Returns whether the factor never changes.
    pub fn is_constant(&self) -> bool {
        match &self.0 {
            Kind::Constant(_) => true,
            Kind::Expression(expression) => !expression.uses(0),
            Kind::Table(points) => points.len() == 1,
        }
    }
}

impl TryFrom<Source> for Amplitude {
    type Error = FemError;
    fn try_from(source: Source) -> Result<Self, FemError> {
        match source {
            Source::Constant(value) => Ok(Self::constant(value)),
            Source::Expression(source) => Self::expression(&source),
            Source::Table(points) => Self::table(points),
        }
    }
}

impl From<Amplitude> for Source {
    fn from(amplitude: Amplitude) -> Self {
        match amplitude.0 {
            Kind::Constant(value) => Self::Constant(value),
            Kind::Expression(expression) => Self::Expression(expression.source().to_owned()),
            Kind::Table(points) => Self::Table(points),
        }
    }
}

impl JsonSchema for Amplitude {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Amplitude".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        Source::json_schema(generator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_and_constant_beyond_its_ends() {
        let table = Amplitude::table(vec![[1.0, 0.0], [2.0, 4.0], [4.0, 0.0]]).unwrap();
        for (t, expected) in [(0.0, 0.0), (1.0, 0.0), (1.5, 2.0), (2.0, 4.0), (3.0, 2.0), (9.0, 0.0)] {
            assert_eq!(table.at(t), expected, "t = {t}");
        }
        assert!(!table.is_constant());
        assert!(Amplitude::table(vec![[0.0, 1.0], [0.0, 2.0]]).is_err());
        assert!(Amplitude::table(vec![]).is_err());
    }

    #[test]
    fn a_formula_without_t_is_constant() {
        let amplitude = Amplitude::expression("2*pi").unwrap();
        assert!(amplitude.is_constant() && amplitude.at(3.0) == std::f64::consts::TAU);
    }
}
