//! A patch: the nodes of a run of stencils, stored contiguously so that they stay in cache, with sums over them.

/// The coordinates of a node, padded with an unused fourth number, so that one vector load reads them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Padded(pub [f64; 4]);

/// As many vectors as a u16 can index, so that no index needs a bounds check.
pub type PatchArray = [Padded; 1 << 16];

/// Positions of the nodes of a run of stencils, and one sum per node.
pub struct Patch<'a> {
    /// Index into `x` and `sums` of each node of each stencil of the run, in the order of the stencils; never
    /// [`Patch::NOWHERE`].
    pub places: &'a [u16],
    /// Positions of the nodes, m.
    pub x: &'a PatchArray,
    /// Sums at the nodes, N; their fourth numbers are arbitrary.
    pub sums: &'a mut PatchArray,
}

/// Returns the number of stencils that are summed together, as [`crate::Potential::add_gradients`] receives them; the
/// last run of a term may be shorter. There are at least eight runs per term, so that threads stay balanced. A run is
/// long enough that most of its nodes are in no other run, and short enough (for `size` coordinates per stencil) that
/// its positions and sums stay in the first-level cache. The length is a multiple of 64, or as many stencils as
/// `places` can index.
pub fn run_length(stencil_count: usize, size: usize) -> usize {
    let largest = (usize::from(u16::MAX) / size.max(1)).clamp(1, 1024);
    let fitting = (12 * 1024 / size.max(1)).next_multiple_of(64).clamp(64, 1024);
    (stencil_count / 8).next_multiple_of(64).clamp(64, fitting).min(largest)
}

impl Patch<'_> {
    /// An index that belongs to no node: sums there are ignored.
    pub const NOWHERE: u16 = u16::MAX;

    /// Returns an array of zeros for a patch.
    pub fn zeros() -> Box<PatchArray> {
        match vec![Padded::default(); 1 << 16].into_boxed_slice().try_into() {
            Ok(array) => array,
            Err(_) => unreachable!("the length is that of the array"),
        }
    }
}
