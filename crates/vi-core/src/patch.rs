//! A patch: the nodes that a run of stencils touches, side by side in cache, with sums over them. It
//! must not know what is summed, nor which nodes of the body they are.

/// The coordinates of a node, and a fourth number that means nothing: a vector that one load reads.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Padded(pub [f64; 4]);

/// As many vectors as a u16 can name, so that no place needs a check.
pub type PatchArray = [Padded; 1 << 16];

/// Positions of the nodes that a run of stencils touches, and room for a sum at each.
pub struct Patch<'a> {
    /// Place in `x` and in `sums` of each node of each stencil of the run, in the stencils' order;
    /// never [`Patch::NOWHERE`].
    pub places: &'a [u16],
    /// Positions of the nodes, m.
    pub x: &'a PatchArray,
    /// Sums at the nodes, N; their fourth numbers may hold anything.
    pub sums: &'a mut PatchArray,
}

impl Patch<'_> {
    /// The place of what belongs to no node: anything may be added there.
    pub const NOWHERE: u16 = u16::MAX;

    /// Zeros for a patch.
    pub fn zeros() -> Box<PatchArray> {
        match vec![Padded::default(); 1 << 16].into_boxed_slice().try_into() {
            Ok(array) => array,
            Err(_) => unreachable!("the length is that of the array"),
        }
    }
}
