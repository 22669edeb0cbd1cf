//! A solver of linear systems from outside of the program, whose rows several processes (ranks) share.

/// The rows of a symmetric matrix that one rank has, in square blocks. Each rank has one run of rows, in the order of the ranks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BlockRows {
    /// Rows and columns of a block.
    pub block: usize,
    /// Row k of blocks has the blocks `starts[k]..starts[k + 1]`, in the order of their columns.
    pub starts: Vec<u32>,
    /// The column of each block, among the rows of blocks of all ranks.
    pub columns: Vec<u32>,
    /// All numbers of the first row of blocks, row by row of the matrix, then those of the second one, and so on.
    pub values: Vec<f64>,
    /// The positions of the nodes of the rows, m, `block` coordinates each. Rigid motions of these points are nearly in the
    /// null space of a matrix of stiffness.
    pub positions: Vec<f64>,
}

/// Solves linear systems with a symmetric matrix whose rows all ranks share.
///
/// Every method is collective: all ranks call it in the same order, with their own rows. Results may depend on rounding, and
/// therefore on the number of ranks; every rank must find the same outcome.
pub trait RankSolver: Send {
    /// Takes a matrix. All matrices have the pattern of the first one.
    fn prepare(&mut self, rows: &BlockRows);

    /// Solves for the load `b` of the own rows, from zero, to a relative error `tolerance` in the energy norm. Returns the number
    /// of iterations.
    ///
    /// # Errors
    /// Returns the reason, as the solver names it, if it does not reach the tolerance within `max_iterations`, for example
    /// because the matrix is not positive definite. Then `x` means nothing.
    fn solve(&mut self, b: &[f64], x: &mut [f64], tolerance: f64, max_iterations: u32)
    -> Result<u32, String>;
}
