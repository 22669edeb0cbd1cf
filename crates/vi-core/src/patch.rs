//! A patch: the nodes that a run of stencils touches, side by side in cache, with sums over them. It
//! must not know what is summed, nor which nodes of the body they are.

/// The coordinates of a node, and a fourth number that means nothing: a vector that one load reads.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Padded(pub [f64; 4]);

/// Positions of the nodes that a run of stencils touches, and room for a sum at each.
pub struct Patch<'a> {
    /// Place in `x` and in `sums` of each node of each stencil of the run, in the stencils' order.
    pub places: &'a [u16],
    /// Positions of the nodes, m.
    pub x: &'a [Padded],
    /// Sums at the nodes, N; their fourth numbers may hold anything.
    pub sums: &'a mut [Padded],
}
