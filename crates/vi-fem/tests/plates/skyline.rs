//! A symmetric matrix in skyline storage and its LDLᵀ factors: small, serial and indefinite, which is enough for the
//! validation of plates and shells.

/// Row i holds the columns `first[i]..=i`.
pub(crate) struct Skyline {
    first: Vec<usize>,
    start: Vec<usize>,
    values: Vec<f64>,
}

impl Skyline {
    /// Returns the zero matrix with these first columns.
    pub(crate) fn new(first: Vec<usize>) -> Self {
        let mut start = vec![0];
        for (row, &column) in first.iter().enumerate() {
            start.push(start[row] + row - column + 1);
        }
        let values = vec![0.0; start[first.len()]];
        Self { first, start, values }
    }

    pub(crate) fn add(&mut self, row: usize, column: usize, value: f64) {
        let (row, column) = (row.max(column), row.min(column));
        self.values[self.start[row] + column - self.first[row]] += value;
    }

    pub(crate) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    pub(crate) fn diagonal(&self, row: usize) -> f64 {
        self.values[self.start[row + 1] - 1]
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.values[self.start[row]..self.start[row + 1]]
    }

    /// Returns the LDLᵀ factors of this matrix plus a diagonal. The number of negative pivots equals the number of
    /// negative eigenvalues (Sylvester).
    pub(crate) fn factor(&self, diagonal: impl Fn(usize) -> f64) -> Factor {
        let count = self.first.len();
        let mut lower =
            Self { first: self.first.clone(), start: self.start.clone(), values: self.values.clone() };
        let mut pivots = vec![0.0; count];
        let mut negative = 0;
        for i in 0..count {
            let (before, rest) = lower.values.split_at_mut(lower.start[i]);
            let (first, length) = (self.first[i], i - self.first[i]);
            let row = &mut rest[..=length];
            row[length] += diagonal(i);
            for j in first..i {
                let other = &before[lower.start[j]..lower.start[j + 1]];
                let from = first.max(self.first[j]);
                let (a, b) = (&row[from - first..j - first], &other[from - self.first[j]..j - self.first[j]]);
                row[j - first] -= dot(a, b);
            }
            for j in first..i {
                let u = row[j - first];
                row[j - first] = u / pivots[j];
                row[length] -= u * row[j - first];
            }
            pivots[i] = row[length];
            negative += usize::from(row[length] < 0.0);
        }
        Factor { lower, pivots, negative }
    }
}

/// Returns a dot product, summed in eight lanes.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (left, right) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = left.remainder().iter().zip(right.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in left.zip(right) {
        for lane in 0..8 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    lanes.iter().sum::<f64>() + tail
}

pub(crate) struct Factor {
    lower: Skyline,
    pivots: Vec<f64>,
    /// Number of negative pivots.
    pub(crate) negative: usize,
}

impl Factor {
    pub(crate) fn solve(&self, x: &mut [f64]) {
        for i in 0..x.len() {
            let row = self.lower.row(i);
            let (first, length) = (self.lower.first[i], row.len() - 1);
            x[i] -= dot(&row[..length], &x[first..i]);
        }
        for (x, pivot) in x.iter_mut().zip(&self.pivots) {
            *x /= pivot;
        }
        for i in (0..x.len()).rev() {
            let row = self.lower.row(i);
            let (first, length) = (self.lower.first[i], row.len() - 1);
            let value = x[i];
            for (x, l) in x[first..i].iter_mut().zip(&row[..length]) {
                *x -= l * value;
            }
        }
    }
}
