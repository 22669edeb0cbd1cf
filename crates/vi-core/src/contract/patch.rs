//! A patch: the nodes that a run of stencils touches, side by side in cache, with sums over them.

/// The coordinates of a node, and a fourth number that means nothing: a vector that one load reads.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Padded(pub [f64; 4]);

/// As many vectors as a u16 can name, so that no place needs a check.
pub type PatchArray = [Padded; 1 << 16];

/// Positions of the nodes that a run of stencils touches, and a sum per node.
pub struct Patch<'a> {
    /// Place in `x` and in `sums` of each node of each stencil of the run, in the stencils' order;
    /// never [`Patch::NOWHERE`].
    pub places: &'a [u16],
    /// Positions of the nodes, m.
    pub x: &'a PatchArray,
    /// Sums at the nodes, N; their fourth numbers may hold anything.
    pub sums: &'a mut PatchArray,
}

/// Stencils that are summed together ([`crate::Potential::add_gradients`] is asked for one such run, the last of
/// a term may be shorter): at least eight runs a term so that threads stay in balance, yet long enough that
/// most nodes of a run are its own, and short enough (`size` coordinates a stencil) for its positions and
/// sums to stay in the first-level cache. A multiple of 64, or as many as places can name.
pub fn run_length(stencil_count: usize, size: usize) -> usize {
    let largest = (usize::from(u16::MAX) / size.max(1)).clamp(1, 1024);
    let fitting = (12 * 1024 / size.max(1)).next_multiple_of(64).clamp(64, 1024);
    (stencil_count / 8).next_multiple_of(64).clamp(64, fitting).min(largest)
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
