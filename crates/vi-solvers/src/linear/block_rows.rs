//! A square sparse matrix of 3 × 3 blocks that is not symmetric, and its incomplete LU factor without fill (J. A. Meijerink,
//! H. A. van der Vorst, Math. Comp. 31 (1977) 148–162), whose pivots are blocks.

use nalgebra::{Matrix3, Vector3};

/// Number of nodes of dyads that are summed before they are added to the matrix: those of a pair.
const CLIQUE: usize = 4;
/// The factor is that of the matrix with its diagonal increased by this fraction (T. A. Manteuffel, Math. Comp. 34 (1980) 473–497):
/// dyads of a point and a triangle have positive entries between the nodes of the triangle, so pivots can vanish without. Products per
/// system of folded cloth (`benches/layers.py folded --cells 50`) and of a stack of five cloths by steps of .2 ms: with .05, 7 and 86,
/// some systems not solved in 400; .1, 7 and 39; .2, 9 and 33; .3, 11 and 37; 1, 17 and 55; with inverses of the diagonal blocks
/// alone, 29 and 114, in two and four times the time.
const SHIFT: f64 = 0.2;

/// A block vector with few entries: nodes, each with three numbers.
pub(crate) type Sparse<'a> = &'a [(u32, Vector3<f64>)];

/// The sum of consecutive dyads that have parts at the same few nodes.
#[derive(Default)]
struct Clique {
    nodes: Vec<u32>,
    /// Rows and columns in the order of `nodes`.
    sum: [[Matrix3<f64>; CLIQUE]; CLIQUE],
}

impl Clique {
    /// Returns the place of a node. Returns `None` if it is not there and there is no room for it.
    fn place(&mut self, node: u32) -> Option<usize> {
        if let Some(place) = self.nodes.iter().position(|other| *other == node) {
            return Some(place);
        }
        (self.nodes.len() < CLIQUE).then(|| {
            self.nodes.push(node);
            self.nodes.len() - 1
        })
    }

    /// Returns the places of the nodes of a part. Returns `None` if there is no room for them.
    fn places(&mut self, part: Sparse<'_>) -> Option<[usize; CLIQUE]> {
        let mut places = [0; CLIQUE];
        if part.len() > CLIQUE {
            return None;
        }
        for (place, (node, _)) in places.iter_mut().zip(part) {
            *place = self.place(*node)?;
        }
        Some(places)
    }

    /// Adds a dyad. Returns false, and adds nothing, if there is no room for its nodes.
    fn add(&mut self, left: Sparse<'_>, right: Sparse<'_>) -> bool {
        let before = self.nodes.len();
        let (Some(rows), Some(columns)) = (self.places(left), self.places(right)) else {
            self.nodes.truncate(before);
            return false;
        };
        for ((_, a), row) in left.iter().zip(rows) {
            for ((_, b), column) in right.iter().zip(columns) {
                self.sum[row][column] += a * b.transpose();
            }
        }
        true
    }
}

/// The matrix. It is summed with `begin`, `add` and `finish`.
#[derive(Default)]
pub(crate) struct BlockRows {
    /// While the matrix is summed: column and number of each block of each row, in the order of their first use.
    open: Vec<Vec<(u32, u32)>>,
    /// While the matrix is summed: the blocks by these numbers. Those on the diagonal are the first.
    sums: Vec<Matrix3<f64>>,
    clique: Clique,
    /// First block of each row, followed by the number of all.
    starts: Vec<u32>,
    columns: Vec<u32>,
    blocks: Vec<Matrix3<f64>>,
}

impl BlockRows {
    /// Begins with a diagonal matrix.
    pub(crate) fn begin(&mut self, diagonal: impl ExactSizeIterator<Item = Vector3<f64>>) {
        let count = diagonal.len();
        self.open.iter_mut().for_each(Vec::clear);
        self.open.resize_with(count, Vec::new);
        self.sums.clear();
        self.sums.extend(diagonal.map(|entries| Matrix3::from_diagonal(&entries)));
        self.open.iter_mut().zip(0..).for_each(|(row, node)| row.push((node, node)));
        self.clique.nodes.clear();
    }

    /// Adds the dyad `left` `right`ᵀ.
    pub(crate) fn add(&mut self, left: Sparse<'_>, right: Sparse<'_>) {
        if self.clique.add(left, right) {
            return;
        }
        self.flush();
        if !self.clique.add(left, right) {
            for (row, a) in left {
                for (column, b) in right {
                    *self.block(*row, *column) += a * b.transpose();
                }
            }
        }
    }

    /// Adds the clique to the matrix, and empties it.
    fn flush(&mut self) {
        let Clique { mut nodes, sum } = std::mem::take(&mut self.clique);
        for (row, parts) in nodes.iter().zip(&sum) {
            for (column, part) in nodes.iter().zip(parts) {
                *self.block(*row, *column) += part;
            }
        }
        // The next clique uses the same memory.
        nodes.clear();
        self.clique.nodes = nodes;
    }

    fn block(&mut self, row: u32, column: u32) -> &mut Matrix3<f64> {
        let open = &mut self.open[row as usize];
        let number = match open.iter().find(|(other, _)| *other == column) {
            Some((_, number)) => *number,
            None => {
                let number = self.sums.len() as u32;
                self.sums.push(Matrix3::zeros());
                open.push((column, number));
                number
            }
        };
        &mut self.sums[number as usize]
    }

    /// Completes the matrix.
    pub(crate) fn finish(&mut self) {
        self.flush();
        self.starts.clear();
        self.starts.push(0);
        self.columns.clear();
        self.blocks.clear();
        for row in &mut self.open {
            row.sort_unstable();
            self.columns.extend(row.iter().map(|(column, _)| *column));
            self.blocks.extend(row.iter().map(|(_, number)| self.sums[*number as usize]));
            self.starts.push(self.columns.len() as u32);
        }
    }

    fn row(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    fn row_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the number of blocks.
    pub(crate) fn block_count(&self) -> usize {
        self.blocks.len()
    }

    /// Calls `each` with the row, the column and the value of each block.
    pub(crate) fn for_each(&self, mut each: impl FnMut(usize, usize, &Matrix3<f64>)) {
        for row in 0..self.row_count() {
            self.row(row).for_each(|k| each(row, self.columns[k] as usize, &self.blocks[k]));
        }
    }

    /// Writes the product with x.
    pub(crate) fn apply(&self, x: &[f64], out: &mut [f64]) {
        let (x, out) = (x.as_chunks::<3>().0, out.as_chunks_mut::<3>().0);
        for (row, out) in out.iter_mut().enumerate() {
            let mut sum = Vector3::zeros();
            for k in self.row(row) {
                sum += self.blocks[k] * Vector3::from(x[self.columns[k] as usize]);
            }
            *out = sum.into();
        }
    }
}

/// The incomplete factor L U: L has unit blocks on its diagonal and is stored below that of U, whose diagonal is stored inverted.
#[derive(Default)]
pub(crate) struct IncompleteLu {
    /// Number of the block on the diagonal of each row.
    pivots: Vec<u32>,
    blocks: Vec<Matrix3<f64>>,
    /// While a row is factored: the number of its block in each column, plus one.
    number_of: Vec<u32>,
}

impl IncompleteLu {
    /// Factors a matrix. A pivot that is singular is replaced by the block of the matrix.
    pub(crate) fn factor(&mut self, matrix: &BlockRows) {
        let count = matrix.row_count();
        self.blocks.clone_from(&matrix.blocks);
        self.pivots.clear();
        self.number_of.clear();
        self.number_of.resize(count, 0);
        for row in 0..count {
            matrix.row(row).for_each(|k| self.number_of[matrix.columns[k] as usize] = k as u32 + 1);
            let pivot = self.number_of[row] as usize - 1;
            self.blocks[pivot] += Matrix3::from_diagonal(&(matrix.blocks[pivot].diagonal() * SHIFT));
            for k in matrix.row(row).start..pivot {
                let above = matrix.columns[k] as usize;
                let first = self.pivots[above] as usize;
                let factor = self.blocks[k] * self.blocks[first];
                self.blocks[k] = factor;
                for other in first + 1..matrix.row(above).end {
                    let number = self.number_of[matrix.columns[other] as usize];
                    if number > 0 {
                        let part = factor * self.blocks[other];
                        self.blocks[number as usize - 1] -= part;
                    }
                }
            }
            let inverse = self.blocks[pivot].try_inverse().or_else(|| matrix.blocks[pivot].try_inverse());
            self.blocks[pivot] = inverse.unwrap_or_else(Matrix3::identity);
            self.pivots.push(pivot as u32);
            matrix.row(row).for_each(|k| self.number_of[matrix.columns[k] as usize] = 0);
        }
    }

    /// Solves L U x = b in place, for the matrix that was factored.
    pub(crate) fn solve(&self, matrix: &BlockRows, x: &mut [f64]) {
        let x = x.as_chunks_mut::<3>().0;
        for row in 0..matrix.row_count() {
            let mut sum = Vector3::from(x[row]);
            for k in matrix.row(row).start..self.pivots[row] as usize {
                sum -= self.blocks[k] * Vector3::from(x[matrix.columns[k] as usize]);
            }
            x[row] = sum.into();
        }
        for row in (0..matrix.row_count()).rev() {
            let pivot = self.pivots[row] as usize;
            let mut sum = Vector3::from(x[row]);
            for k in pivot + 1..matrix.row(row).end {
                sum -= self.blocks[k] * Vector3::from(x[matrix.columns[k] as usize]);
            }
            x[row] = (self.blocks[pivot] * sum).into();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::bicgstab;

    type Owned = Vec<(u32, Vector3<f64>)>;

    /// Returns dyads of four nodes of a chain of `count` nodes, with the right vectors slightly rotated.
    fn dyads(count: u32) -> Vec<[Owned; 2]> {
        let weights = [1.0, -0.5, -0.3, -0.2];
        let normal = |k: f64| Vector3::new((0.3 * k).sin(), (0.3 * k).cos(), 0.2) * 10.0;
        let part = |first: u32, turn: f64| -> Owned {
            let of = |(a, weight): (u32, &f64)| {
                ((7 * (first + a)) % count, normal(f64::from(first) + turn) * *weight)
            };
            (0..).zip(&weights).map(of).collect()
        };
        (0..count - 3).map(|first| [part(first, 0.0), part(first, 0.1)]).collect()
    }

    fn matrix(count: u32) -> BlockRows {
        let mut matrix = BlockRows::default();
        // A matrix that was used before is emptied.
        for _ in 0..2 {
            matrix.begin((0..count).map(|node| Vector3::repeat(1.0 + f64::from(node % 3))));
            dyads(count).iter().for_each(|[left, right]| matrix.add(left, right));
            matrix.finish();
        }
        matrix
    }

    #[test]
    fn the_product_is_that_of_the_dyads() {
        let count = 40;
        let x: Vec<f64> = (0..3 * count).map(|k| f64::from(k).sin()).collect();
        let at = |node: u32| Vector3::from_column_slice(&x[3 * node as usize..3 * node as usize + 3]);
        let mut expected: Vec<Vector3<f64>> =
            (0..count).map(|node| at(node) * (1.0 + f64::from(node % 3))).collect();
        for [left, right] in dyads(count) {
            let along: f64 = right.iter().map(|(node, value)| value.dot(&at(*node))).sum();
            left.iter().for_each(|(node, value)| expected[*node as usize] += value * along);
        }
        let mut out = vec![0.0; x.len()];
        matrix(count).apply(&x, &mut out);
        for (out, expected) in out.chunks_exact(3).zip(expected) {
            assert!((Vector3::from_column_slice(out) - expected).norm() < 1e-11);
        }
    }

    #[test]
    fn the_factor_leaves_few_products() {
        let matrix = matrix(200);
        let mut factor = IncompleteLu::default();
        factor.factor(&matrix);
        let b: Vec<f64> = (0..600).map(|k| f64::from(k).cos()).collect();
        let mut x = Vec::new();
        let mut products = |precondition: &dyn Fn(&mut [f64])| {
            bicgstab::solve(|v, out| matrix.apply(v, out), precondition, &b, &mut x, 1e-9, 1000).unwrap()
        };
        let plain = products(&|_| ());
        let with_factor = products(&|v| factor.solve(&matrix, v));
        assert!(3 * with_factor < plain, "{with_factor} {plain}");
    }
}
