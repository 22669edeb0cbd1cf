//! Forward and backward substitution through the panels of a factor.
//!
//! Each supernode passes its parent a vector for the rows it shares with it, as fronts do, so that
//! subtrees run in parallel and sums keep their order. This room must not know how the panels were made.

use super::tree::{Family, Run, Supernode, Tree};

/// Columns handled at a time: each number of the vector is read and written once for four of the panel.
const COLUMNS: usize = 4;

/// Subtrees with less than this many panel numbers are not worth a task.
const PARALLEL_LENGTH: usize = 40_000;

/// The vectors of a subtree, each a run because the tree is postordered: the unknowns in elimination
/// order, and the rows shared with parents.
struct Vectors<'a> {
    unknowns: &'a mut [f64],
    shared: &'a mut [f64],
}

/// x ← A⁻¹x in elimination order; `shared` has `tree.vector_length` entries.
pub(super) fn solve(tree: &Tree, panels: &[f64], x: &mut [f64], shared: &mut [f64]) {
    let members = &tree.members[tree.roots.members.clone()];
    forward_family(
        tree,
        panels,
        members,
        tree.roots.parallel,
        Vectors { unknowns: &mut *x, shared: &mut *shared },
    );
    backward_family(tree, panels, members, tree.roots.parallel, None, Vectors { unknowns: x, shared });
}

/// Index in the whole vectors of the first entries of a supernode's subtree.
fn origin(tree: &Tree, s: usize) -> (usize, usize) {
    let first = &tree.supernodes[tree.supernodes[s].subtree];
    (first.first, first.vector)
}

/// Splits the vectors of some subtrees, which follow each other, before subtree `at`.
fn split<'a>(tree: &Tree, whole: Vectors<'a>, from: usize, at: usize) -> (Vectors<'a>, Vectors<'a>) {
    let ((x0, s0), (x1, s1)) = (origin(tree, from), origin(tree, at));
    let (x_left, x_right) = whole.unknowns.split_at_mut(x1 - x0);
    let (s_left, s_right) = whole.shared.split_at_mut(s1 - s0);
    (Vectors { unknowns: x_left, shared: s_left }, Vectors { unknowns: x_right, shared: s_right })
}

/// Splits the vectors of a subtree into those of its descendants, its own unknowns, its shared rows.
fn split_own<'a>(tree: &Tree, s: usize, whole: Vectors<'a>) -> (Vectors<'a>, &'a mut [f64], &'a mut [f64]) {
    let node = &tree.supernodes[s];
    let (x0, s0) = origin(tree, s);
    let (unknowns, own) = whole.unknowns.split_at_mut(node.first - x0);
    let (shared, rows) = whole.shared.split_at_mut(node.vector - s0);
    (Vectors { unknowns, shared }, &mut own[..node.columns], &mut rows[..node.below()])
}

/// Runs `left` and `right`, side by side where both halves of a family are worth it.
fn both(parallel: bool, left: impl FnOnce() + Send, right: impl FnOnce() + Send) {
    if parallel {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
}

fn is_heavy(tree: &Tree, members: &[u32]) -> bool {
    let (Some(&first), Some(&last)) = (members.first(), members.last()) else { return false };
    let (first, last) = (&tree.supernodes[first as usize], &tree.supernodes[last as usize]);
    last.panel + last.panel_length() - tree.supernodes[first.subtree].panel >= PARALLEL_LENGTH
}

fn forward_family(tree: &Tree, panels: &[f64], members: &[u32], parallel: bool, vectors: Vectors<'_>) {
    match members {
        [] => {}
        &[member] => forward(tree, panels, member as usize, vectors),
        _ => {
            let (left, right) = members.split_at(members.len() / 2);
            let (left_vectors, right_vectors) = split(tree, vectors, left[0] as usize, right[0] as usize);
            let parallel = parallel && is_heavy(tree, left) && is_heavy(tree, right);
            both(
                parallel,
                || forward_family(tree, panels, left, parallel, left_vectors),
                || forward_family(tree, panels, right, parallel, right_vectors),
            );
        }
    }
}

fn forward(tree: &Tree, panels: &[f64], s: usize, vectors: Vectors<'_>) {
    let node = &tree.supernodes[s];
    let Family { members, parallel } = node.children.clone();
    let (below, own, rows) = split_own(tree, s, vectors);
    let Vectors { unknowns, shared } = below;
    let members = &tree.members[members];
    forward_family(tree, panels, members, parallel, Vectors { unknowns, shared: &mut *shared });
    rows.fill(0.0);
    let base = origin(tree, s).1;
    for &child in members {
        let child = &tree.supernodes[child as usize];
        let update = &shared[child.vector - base..][..child.below()];
        for run in &tree.runs[child.runs.clone()] {
            add_run(run, node, update, own, rows);
        }
    }
    eliminate(node, &panels[node.panel..][..node.panel_length()], own, rows);
}

/// The part of an update that a run covers, added to the parent's unknowns or shared rows.
fn add_run(run: &Run, node: &Supernode, update: &[f64], own: &mut [f64], rows: &mut [f64]) {
    let update = &update[run.from as usize..][..run.length as usize];
    for (row, value) in (run.to as usize..).zip(update) {
        match row.checked_sub(node.columns) {
            None => own[row] += value,
            Some(row) => rows[row] += value,
        }
    }
}

/// own ← L₁₁⁻¹ own, rows ← rows − L₂₁ own.
fn eliminate(node: &Supernode, panel: &[f64], own: &mut [f64], rows: &mut [f64]) {
    let mut first = 0;
    while first < node.columns {
        let width = COLUMNS.min(node.columns - first);
        let mut x = [0.0; COLUMNS];
        for j in 0..width {
            let column = &panel[(first + j) * node.rows..][..node.rows];
            x[j] = own[first + j] / column[first + j];
            own[first + j] = x[j];
            for i in j + 1..width {
                own[first + i] -= column[first + i] * x[j];
            }
        }
        let next = first + width;
        if width == COLUMNS {
            let column = |j: usize| &panel[(first + j) * node.rows..][next..node.rows];
            let columns = [column(0), column(1), column(2), column(3)];
            let split = node.columns - next;
            subtract_four(&mut own[next..], columns.map(|c| &c[..split]), x);
            subtract_four(rows, columns.map(|c| &c[split..]), x);
        } else {
            for j in 0..width {
                let column = &panel[(first + j) * node.rows..][next..node.rows];
                for (value, l) in own[next..].iter_mut().chain(rows.iter_mut()).zip(column) {
                    *value -= l * x[j];
                }
            }
        }
        first = next;
    }
}

fn subtract_four(target: &mut [f64], columns: [&[f64]; COLUMNS], x: [f64; COLUMNS]) {
    let length = target.len();
    let [a, b, c, d] = columns.map(|column| &column[..length]);
    for i in 0..length {
        target[i] -= (a[i] * x[0] + b[i] * x[1]) + (c[i] * x[2] + d[i] * x[3]);
    }
}

/// The solution around a family: the parent's unknowns and the rows that it shares with its own parent.
#[derive(Clone, Copy)]
struct Above<'a> {
    own: &'a [f64],
    rows: &'a [f64],
}

fn backward_family(
    tree: &Tree,
    panels: &[f64],
    members: &[u32],
    parallel: bool,
    above: Option<Above<'_>>,
    vectors: Vectors<'_>,
) {
    match members {
        [] => {}
        &[member] => backward(tree, panels, member as usize, above, vectors),
        _ => {
            let (left, right) = members.split_at(members.len() / 2);
            let (left_vectors, right_vectors) = split(tree, vectors, left[0] as usize, right[0] as usize);
            let parallel = parallel && is_heavy(tree, left) && is_heavy(tree, right);
            both(
                parallel,
                || backward_family(tree, panels, left, parallel, above, left_vectors),
                || backward_family(tree, panels, right, parallel, above, right_vectors),
            );
        }
    }
}

fn backward(tree: &Tree, panels: &[f64], s: usize, above: Option<Above<'_>>, vectors: Vectors<'_>) {
    let node = &tree.supernodes[s];
    let (below, own, rows) = split_own(tree, s, vectors);
    if let Some(above) = above {
        for run in &tree.runs[node.runs.clone()] {
            let rows = &mut rows[run.from as usize..][..run.length as usize];
            for (row, value) in (run.to as usize..).zip(rows) {
                *value = match row.checked_sub(above.own.len()) {
                    None => above.own[row],
                    Some(row) => above.rows[row],
                };
            }
        }
    }
    substitute(node, &panels[node.panel..][..node.panel_length()], own, rows);
    let Family { members, parallel } = node.children.clone();
    let above = Above { own, rows };
    backward_family(tree, panels, &tree.members[members], parallel, Some(above), below);
}

/// own ← L₁₁⁻ᵀ (own − L₂₁ᵀ rows).
fn substitute(node: &Supernode, panel: &[f64], own: &mut [f64], rows: &[f64]) {
    let mut end = node.columns;
    while end > 0 {
        let width = if end.is_multiple_of(COLUMNS) { COLUMNS } else { end % COLUMNS };
        let first = end - width;
        let split = node.columns - end;
        let mut sums = [0.0; COLUMNS];
        let column = |j: usize| &panel[(first + j.min(width - 1)) * node.rows..][end..node.rows];
        let columns = [column(0), column(1), column(2), column(3)];
        add_four_products(&mut sums, columns.map(|c| &c[..split]), &own[end..]);
        add_four_products(&mut sums, columns.map(|c| &c[split..]), rows);
        for j in (0..width).rev() {
            let column = &panel[(first + j) * node.rows..][..node.rows];
            let mut value = own[first + j] - sums[j];
            for i in j + 1..width {
                value -= column[first + i] * own[first + i];
            }
            own[first + j] = value / column[first + j];
        }
        end = first;
    }
}

/// Dot products of four columns with one vector, in lanes that a compiler can keep in registers.
fn add_four_products(sums: &mut [f64; COLUMNS], columns: [&[f64]; COLUMNS], x: &[f64]) {
    const LANES: usize = 4;
    let length = x.len();
    let mut lanes = [[0.0; LANES]; COLUMNS];
    let whole = length - length % LANES;
    for first in (0..whole).step_by(LANES) {
        let x: &[f64] = &x[first..first + LANES];
        for (lanes, column) in lanes.iter_mut().zip(columns) {
            let column = &column[first..first + LANES];
            for lane in 0..LANES {
                lanes[lane] += column[lane] * x[lane];
            }
        }
    }
    for ((sum, lanes), column) in sums.iter_mut().zip(lanes).zip(columns) {
        *sum += (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
        for (l, x) in column[whole..length].iter().zip(&x[whole..]) {
            *sum += l * x;
        }
    }
}
