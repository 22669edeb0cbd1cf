//! The box around points.

/// The smallest box with sides along the axes that contains some points, m.
///
/// ```
/// let bounds = vi_mesh::Bounds::of([[0.0, 2.0, 1.0], [3.0, 1.0, 1.0]]);
/// assert_eq!((bounds.low, bounds.high), ([0.0, 1.0, 1.0], [3.0, 2.0, 1.0]));
/// assert_eq!(bounds.longest_side(), 3.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates, m; infinite without points.
    pub low: [f64; 3],
    /// Largest coordinates, m; −infinite without points.
    pub high: [f64; 3],
}

impl Bounds {
    /// Returns the box around points.
    pub fn of(points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let mut bounds = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };
        for point in points {
            for (k, x) in point.into_iter().enumerate() {
                bounds.low[k] = bounds.low[k].min(x);
                bounds.high[k] = bounds.high[k].max(x);
            }
        }
        bounds
    }

    /// Returns the lengths of the sides, m; −infinite without points.
    pub fn sides(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.high[k] - self.low[k])
    }

    /// Returns the length of the longest side, m; 0 without points.
    pub fn longest_side(&self) -> f64 {
        self.sides().into_iter().fold(0.0, f64::max)
    }
}
