//! A sparse symmetric matrix on the free coordinates, in nodal blocks.

/// Symmetric matrix on the free coordinates.
#[derive(Clone)]
pub struct SymmetricMatrix {
    free_count: usize,
}

impl SymmetricMatrix {
    /// Number of rows.
    pub fn free_count(&self) -> usize {
        self.free_count
    }

    /// y = K x.
    pub fn multiply(&self, _x: &[f64], _y: &mut [f64]) {
        unimplemented!()
    }
}
