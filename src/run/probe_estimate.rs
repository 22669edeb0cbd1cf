//! The estimated error of a probe.

use serde::Serialize;

use crate::record::record;

/// The estimated error of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ProbeEstimate {
    /// |error| of the displacement along each axis, m.
    pub error: [f64; 3],
    /// Observed order; `None` if the differences do not show one.
    pub observed_order: Option<f64>,
}

record!(ProbeEstimate { error: [f64; 3], observed_order: Option<f64> });
