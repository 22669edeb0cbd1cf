//! Forward and backward substitution through the panels of a factor.
//!
//! Each supernode passes its parent a vector for the rows that they share, as fronts do. Hence subtrees run in
//! parallel, and sums keep their order.

use pulp::Arch;

use super::panel::{Eliminate, Substitute};
use super::scalar::{self, Scalar};
use super::tree::{Family, Run, Supernode, Tree};

/// Subtrees with fewer panel entries than this run without a task of their own.
const PARALLEL_LENGTH: usize = 40_000;

/// The vectors of a subtree: its unknowns in elimination order, and the rows shared with parents. Each is contiguous
/// because the tree is postordered.
struct Vectors<'a, T> {
    unknowns: &'a mut [T],
    shared: &'a mut [T],
}

/// The factors of a matrix with one side, LLᵀ, or with two, LU; see `walk`.
pub(super) struct Factors<'a, T> {
    pub(super) tree: &'a Tree,
    pub(super) panels: &'a [T],
    pub(super) sides: usize,
    /// If not empty, the rows of each front stand in another order, by positions in the whole elimination order.
    pub(super) order: &'a [u32],
}

/// Computes x ← A⁻¹x in elimination order; `shared` has `tree.vector_length` entries.
pub(super) fn solve<T: Scalar>(factors: Factors<'_, T>, x: &mut [T], shared: &mut [T]) {
    let tree = factors.tree;
    let walk = Walk { tree, factors, arch: Arch::new() };
    let members = &tree.members[tree.roots.members.clone()];
    let parallel = tree.roots.parallel;
    walk.forward_family(members, parallel, Vectors { unknowns: &mut *x, shared: &mut *shared });
    walk.backward_family(members, parallel, None, Vectors { unknowns: x, shared });
}

/// The input of a substitution, and the vector instructions of the machine.
struct Walk<'a, T> {
    tree: &'a Tree,
    factors: Factors<'a, T>,
    arch: Arch,
}

/// Returns the indices of the first entries of a supernode's subtree in the whole vectors.
fn origin(tree: &Tree, s: usize) -> (usize, usize) {
    let first = &tree.supernodes[tree.supernodes[s].subtree];
    (first.first, first.vector)
}

/// Splits the vectors of consecutive subtrees before subtree `at`.
fn split<'a, T>(
    tree: &Tree,
    whole: Vectors<'a, T>,
    from: usize,
    at: usize,
) -> (Vectors<'a, T>, Vectors<'a, T>) {
    let ((x0, s0), (x1, s1)) = (origin(tree, from), origin(tree, at));
    let (x_left, x_right) = whole.unknowns.split_at_mut(x1 - x0);
    let (s_left, s_right) = whole.shared.split_at_mut(s1 - s0);
    (Vectors { unknowns: x_left, shared: s_left }, Vectors { unknowns: x_right, shared: s_right })
}

/// Splits the vectors of a subtree into those of its descendants, its own unknowns, and its shared rows.
fn split_own<'a, T>(
    tree: &Tree,
    s: usize,
    whole: Vectors<'a, T>,
) -> (Vectors<'a, T>, &'a mut [T], &'a mut [T]) {
    let node = &tree.supernodes[s];
    let (x0, s0) = origin(tree, s);
    let (unknowns, own) = whole.unknowns.split_at_mut(node.first - x0);
    let (shared, rows) = whole.shared.split_at_mut(node.vector - s0);
    (Vectors { unknowns, shared }, &mut own[..node.columns], &mut rows[..node.below()])
}

/// Runs `left` and `right`; in parallel if `parallel` says that both halves of a family are large enough.
fn both(parallel: bool, left: impl FnOnce() + Send, right: impl FnOnce() + Send) {
    if parallel {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
}

fn is_large(tree: &Tree, members: &[u32]) -> bool {
    let (Some(&first), Some(&last)) = (members.first(), members.last()) else { return false };
    let (first, last) = (&tree.supernodes[first as usize], &tree.supernodes[last as usize]);
    last.panel + last.panel_length() - tree.supernodes[first.subtree].panel >= PARALLEL_LENGTH
}

/// The solution around a family: the parent's unknowns, and the rows that the parent shares with its own parent.
#[derive(Clone, Copy)]
struct Above<'a, T> {
    own: &'a [T],
    rows: &'a [T],
}

impl<T: Scalar> Walk<'_, T> {
    /// Returns one side of the panel of a supernode.
    fn panel(&self, node: &Supernode, side: usize) -> &[T] {
        let Factors { panels, sides, .. } = self.factors;
        &panels[sides * node.panel + side * node.panel_length()..][..node.panel_length()]
    }

    /// Moves the right sides of a front to where its rows stand.
    fn reorder(&self, node: &Supernode, own: &mut [T]) {
        if let Some(order) = self.factors.order.get(node.first..node.first + node.columns)
            && order.iter().zip(0..).any(|(from, to)| *from != to)
        {
            let before = own.to_vec();
            own.iter_mut().zip(order).for_each(|(value, &from)| *value = before[from as usize]);
        }
    }

    fn forward_family(&self, members: &[u32], parallel: bool, vectors: Vectors<'_, T>) {
        match members {
            [] => {}
            &[member] => self.forward(member as usize, vectors),
            _ => {
                let (left, right) = members.split_at(members.len() / 2);
                let (left_vectors, right_vectors) =
                    split(self.tree, vectors, left[0] as usize, right[0] as usize);
                let parallel = parallel && is_large(self.tree, left) && is_large(self.tree, right);
                both(
                    parallel,
                    || self.forward_family(left, parallel, left_vectors),
                    || self.forward_family(right, parallel, right_vectors),
                );
            }
        }
    }

    fn forward(&self, s: usize, vectors: Vectors<'_, T>) {
        let node = &self.tree.supernodes[s];
        let Family { members, parallel } = node.children.clone();
        let (below, own, rows) = split_own(self.tree, s, vectors);
        let Vectors { unknowns, shared } = below;
        let members = &self.tree.members[members];
        self.forward_family(members, parallel, Vectors { unknowns, shared: &mut *shared });
        rows.fill(T::default());
        let base = origin(self.tree, s).1;
        for &child in members {
            let child = &self.tree.supernodes[child as usize];
            let update = &shared[child.vector - base..][..child.below()];
            for run in &self.tree.runs[child.runs.clone()] {
                add_run(run, node, update, own, rows);
            }
        }
        self.reorder(node, own);
        let panel = self.panel(node, 0);
        self.arch.dispatch(Eliminate { panel, rows: node.rows, own: &mut *own, below: &mut *rows });
        drop_negligible(own);
        drop_negligible(rows);
    }

    fn backward_family(
        &self,
        members: &[u32],
        parallel: bool,
        above: Option<Above<'_, T>>,
        vectors: Vectors<'_, T>,
    ) {
        match members {
            [] => {}
            &[member] => self.backward(member as usize, above, vectors),
            _ => {
                let (left, right) = members.split_at(members.len() / 2);
                let (left_vectors, right_vectors) =
                    split(self.tree, vectors, left[0] as usize, right[0] as usize);
                let parallel = parallel && is_large(self.tree, left) && is_large(self.tree, right);
                both(
                    parallel,
                    || self.backward_family(left, parallel, above, left_vectors),
                    || self.backward_family(right, parallel, above, right_vectors),
                );
            }
        }
    }

    fn backward(&self, s: usize, above: Option<Above<'_, T>>, vectors: Vectors<'_, T>) {
        let node = &self.tree.supernodes[s];
        let (below, own, rows) = split_own(self.tree, s, vectors);
        if let Some(above) = above {
            for run in &self.tree.runs[node.runs.clone()] {
                let rows = &mut rows[run.from as usize..][..run.length as usize];
                for (row, value) in (run.to as usize..).zip(rows) {
                    *value = match row.checked_sub(above.own.len()) {
                        None => above.own[row],
                        Some(row) => above.rows[row],
                    };
                }
            }
        }
        let panel = self.panel(node, self.factors.sides - 1);
        self.arch.dispatch(Substitute { panel, rows: node.rows, own: &mut *own, below: rows });
        drop_negligible(own);
        let Family { members, parallel } = node.children.clone();
        let above = Above { own, rows };
        self.backward_family(&self.tree.members[members], parallel, Some(above), below);
    }
}

/// Sets unknowns whose products with entries of L may be subnormal to zero. The largest entry of the right side is one or more.
fn drop_negligible<T: Scalar>(unknowns: &mut [T]) {
    scalar::drop_below(T::NEGLIGIBLE * T::NEGLIGIBLE, unknowns);
}

/// Adds the part of an update that a run covers to the parent's unknowns or shared rows.
fn add_run<T: Scalar>(run: &Run, node: &Supernode, update: &[T], own: &mut [T], rows: &mut [T]) {
    let update = &update[run.from as usize..][..run.length as usize];
    for (row, value) in (run.to as usize..).zip(update) {
        match row.checked_sub(node.columns) {
            None => own[row] += *value,
            Some(row) => rows[row] += *value,
        }
    }
}
