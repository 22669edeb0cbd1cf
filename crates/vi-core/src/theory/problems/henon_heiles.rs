//! The potential of Hénon & Heiles (1964), regular at low energy and chaotic at high energy: the classical example of
//! Poincaré sections.

use crate::contract::coordinates::Coordinates;
use crate::contract::potential::HessianKind;
use crate::contract::system::{State, System};
use crate::error::CoreError;
use crate::theory::problems::term::{Jet, Term};

/// V = ½ (x² + y²) + x²y − y³/3, unit mass; bounded motion below E = 1/6.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HenonHeiles;

impl HenonHeiles {
    /// Returns the system, two coordinates.
    ///
    /// # Errors
    /// Returns the errors of [`System::new`].
    pub fn system(&self) -> Result<System, CoreError> {
        let well = Term {
            name: "henon-heiles",
            block: 2,
            nodes: vec![0],
            hessian: HessianKind::Varying,
            jet: |_, &[x, y]: &[f64; 2]| Jet {
                energy: 0.5 * (x * x + y * y) + x * x * y - y * y * y / 3.0,
                gradient: [x + 2.0 * x * y, y + x * x - y * y],
                hessian: [[1.0 + 2.0 * y, 2.0 * x], [2.0 * x, 1.0 - 2.0 * y]],
            },
        };
        System::new(vec![1.0; 2], vec![Box::new(well)], Coordinates::all_free(2))
    }

    /// Returns the state on the section x = 0 with energy E, given y and p_y, and p_x > 0, or `None` if E is too
    /// small.
    pub fn on_section(&self, energy: f64, y: f64, p_y: f64) -> Option<State> {
        let square = 2.0 * energy - p_y * p_y - y * y + 2.0 * y * y * y / 3.0;
        (square > 0.0).then(|| State { t: 0.0, q: vec![0.0, y], p: vec![square.sqrt(), p_y] })
    }
}
