//! The assembly tree of a multifrontal factor. It determines which columns are eliminated together, where their dense
//! front is stored, and to which entries of its parent the update of a front is added (Duff, Reid 1983; Liu 1992).
//!
//! It is built once per pattern from the nodal graph. Supernodes are runs of consecutive nodes of a postordered
//! nested dissection that have equal columns; runs are merged if this stores only few zeros (Ashcraft, Grimes 1989).
//! All lengths of panels and fronts count coordinates, not nodes.

use std::ops::Range;

use crate::error::SolverError;
use crate::index::NONE;
use crate::linear::matrix::Pattern;
use crate::linear::ordering::{Graph, Ordering};

/// Children are eliminated in parallel if at least two of them need this many operations.
const PARALLEL_FLOPS: f64 = 1e6;

/// A run of rows of an update matrix, and its position in the parent's front.
#[derive(Clone, Copy)]
pub(crate) struct Run {
    pub(crate) from: u32,
    pub(crate) to: u32,
    pub(crate) length: u32,
}

/// A full block of the matrix, and its position in the panel.
#[derive(Clone, Copy)]
pub(crate) struct BlockSource {
    /// 2 · place, plus 1 if the block lies above the diagonal: the entry that is stored is its transpose.
    pub(crate) source: u32,
    /// Index in the panel of the block's first number.
    pub(crate) target: u32,
}

/// A single number of the matrix, and its position in the panel.
#[derive(Clone, Copy)]
pub(crate) struct NumberSource {
    /// 2 · place, plus 1 if the number lies above the diagonal.
    pub(crate) source: u32,
    pub(crate) target: u32,
}

/// Columns that are eliminated together: a dense panel of `rows` × `columns`, whose first `columns` rows are the
/// supernode's own coordinates, and an update of the remaining rows squared for the parent.
pub(crate) struct Supernode {
    /// Position of the first coordinate in the elimination order.
    pub(crate) first: usize,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    /// The first descendant; the subtree is the range of supernodes from there to this one.
    pub(crate) subtree: usize,
    /// Start of the panel, and of its part of the update vector of a solve.
    pub(crate) panel: usize,
    pub(crate) vector: usize,
    pub(crate) children: Family,
    /// The positions of the rows of the update in the front of the parent.
    pub(crate) runs: Range<usize>,
    pub(crate) blocks: Range<usize>,
    pub(crate) numbers: Range<usize>,
    /// Start of the update in the stack region of its family. From level to level updates alternate between two
    /// stacks. `own` is the length that this subtree needs in the stack of its own update, which also holds the updates
    /// two levels below. `other` is the length that it needs in the other stack, for one and three levels below.
    pub(crate) update: usize,
    pub(crate) own: usize,
    pub(crate) other: usize,
    /// Number of operations of the subtree.
    pub(crate) flops: f64,
}

impl Supernode {
    /// Returns the number of rows below the diagonal block, which is the order of the update.
    pub(crate) fn below(&self) -> usize {
        self.rows - self.columns
    }

    pub(crate) fn panel_length(&self) -> usize {
        self.rows * self.columns
    }
}

/// Supernodes with the same parent, ascending; or the roots.
#[derive(Clone, Default)]
pub(crate) struct Family {
    pub(crate) members: Range<usize>,
    /// Whether the members are eliminated in parallel.
    pub(crate) parallel: bool,
}

/// The assembly tree.
pub(crate) struct Tree {
    /// The supernodes in postorder.
    pub(crate) supernodes: Vec<Supernode>,
    /// The supernodes, ordered by family.
    pub(crate) members: Vec<u32>,
    pub(crate) roots: Family,
    pub(crate) runs: Vec<Run>,
    pub(crate) blocks: Vec<BlockSource>,
    pub(crate) numbers: Vec<NumberSource>,
    /// The free coordinate at each position of the elimination order.
    pub(crate) permutation: Vec<u32>,
    pub(crate) panel_length: usize,
    pub(crate) vector_length: usize,
    /// Lengths of the two update stacks.
    pub(crate) stack: [usize; 2],
    pub(crate) flops: f64,
}

impl Tree {
    pub(crate) fn new(pattern: &Pattern) -> Result<Self, SolverError> {
        let graph = pattern.graph();
        let ordering = Ordering::new(&graph)?;
        // Position of the first coordinate of each eliminated node.
        let mut first = vec![0_usize; graph.node_count() + 1];
        for (k, &node) in ordering.order.iter().enumerate() {
            first[k + 1] = first[k] + graph.weights[node as usize] as usize;
        }
        let ranges = supernodes(&graph, &ordering, &first);
        let mut tree = Self {
            supernodes: Vec::with_capacity(ranges.len()),
            members: Vec::new(),
            roots: Family::default(),
            runs: Vec::new(),
            blocks: Vec::new(),
            numbers: Vec::new(),
            permutation: permutation(pattern, &ordering),
            panel_length: 0,
            vector_length: 0,
            stack: [0; 2],
            flops: 0.0,
        };
        tree.build(pattern, &graph, &ordering, &first, &ranges);
        if tree.supernodes.iter().any(|node| node.panel_length() > u32::MAX as usize) {
            let reason = "a front has more than 2^32 entries";
            return Err(SolverError::Symbolic { dofs: pattern.free_count, reason });
        }
        Ok(tree)
    }

    /// Returns the size of the maps in bytes.
    pub(crate) fn bytes(&self) -> usize {
        size_of::<Supernode>() * self.supernodes.len()
            + size_of::<Run>() * self.runs.len()
            + 8 * (self.blocks.len() + self.numbers.len())
            + 4 * (self.members.len() + self.permutation.len())
    }

    fn build(
        &mut self,
        pattern: &Pattern,
        graph: &Graph,
        ordering: &Ordering,
        first: &[usize],
        ranges: &[Range<usize>],
    ) {
        let mut owner = vec![0_u32; graph.node_count()];
        for (s, range) in ranges.iter().enumerate() {
            owner[range.clone()].fill(s as u32);
        }
        let structures = row_structures(graph, ordering, ranges, &owner);
        let parent: Vec<u32> =
            structures.iter().map(|rows| rows.first().map_or(NONE, |&row| owner[row as usize])).collect();
        let families = self.families(&parent);

        // Position of each row in the current front.
        let mut local = vec![0_u32; graph.node_count()];
        let place_front = |s: usize, local: &mut [u32]| {
            let mut next = 0;
            for position in ranges[s].clone().chain(structures[s].iter().map(|&row| row as usize)) {
                local[position] = next;
                next += (first[position + 1] - first[position]) as u32;
            }
            next as usize
        };
        for (s, range) in ranges.iter().enumerate() {
            let rows = place_front(s, &mut local);
            let columns = first[range.end] - first[range.start];
            let (blocks, numbers) = (self.blocks.len(), self.numbers.len());
            for position in range.clone() {
                self.sources(pattern, ordering, position, rows, &local);
            }
            let below = (rows - columns) as f64;
            let columns_f = columns as f64;
            let children = families[s].clone();
            let members = &self.members[children.members.clone()];
            let flops = columns_f * columns_f * columns_f / 3.0
                + columns_f * columns_f * below
                + columns_f * below * below
                + members.iter().map(|&child| self.supernodes[child as usize].flops).sum::<f64>();
            let subtree = members.first().map_or(s, |&child| self.supernodes[child as usize].subtree);
            self.supernodes.push(Supernode {
                first: first[range.start],
                columns,
                rows,
                subtree,
                panel: self.panel_length,
                vector: self.vector_length,
                children,
                runs: 0..0,
                blocks: blocks..self.blocks.len(),
                numbers: numbers..self.numbers.len(),
                update: 0,
                own: 0,
                other: 0,
                flops,
            });
            self.panel_length += rows * columns;
            self.vector_length += rows - columns;
        }
        for (s, &above) in parent.iter().enumerate() {
            if above != NONE {
                place_front(above as usize, &mut local);
                self.supernodes[s].runs = push_runs(&mut self.runs, &structures[s], first, &local);
            }
        }
        for s in 0..ranges.len() {
            let (family_stack, family_spare) = self.lay_out(self.supernodes[s].children.clone(), s);
            let node = &mut self.supernodes[s];
            node.own = (node.below() * node.below()).max(family_spare);
            node.other = family_stack;
        }
        let (stack, spare) = self.lay_out(self.roots.clone(), NONE as usize);
        self.stack = [stack, spare];
        self.flops = self.members[self.roots.members.clone()]
            .iter()
            .map(|&root| self.supernodes[root as usize].flops)
            .sum();
    }

    /// Returns the children of every supernode, and stores the roots in `self`.
    fn families(&mut self, parent: &[u32]) -> Vec<Family> {
        let mut count = vec![0_usize; parent.len() + 1];
        let slot = |above: u32| if above == NONE { parent.len() } else { above as usize };
        for &above in parent {
            count[slot(above)] += 1;
        }
        let mut next = 0;
        let mut families: Vec<Family> = count
            .iter()
            .map(|&count| {
                next += count;
                Family { members: next - count..next - count, parallel: false }
            })
            .collect();
        self.members = vec![0; parent.len()];
        for (s, &above) in parent.iter().enumerate() {
            let family = &mut families[slot(above)];
            self.members[family.members.end] = s as u32;
            family.members.end += 1;
        }
        self.roots = families.pop().unwrap_or_default();
        families
    }

    /// Decides how a family is eliminated and where its updates lie. Returns the length of the stack for the updates
    /// of the family, and of the one for those of their children.
    fn lay_out(&mut self, mut family: Family, parent: usize) -> (usize, usize) {
        let members: Vec<usize> =
            self.members[family.members.clone()].iter().map(|&member| member as usize).collect();
        let large = members.iter().filter(|&&member| self.supernodes[member].flops > PARALLEL_FLOPS);
        family.parallel = large.count() >= 2;
        let (mut stack, mut spare, mut next) = (0_usize, 0_usize, 0_usize);
        for member in members {
            let node = &mut self.supernodes[member];
            node.update = next;
            stack = stack.max(next + node.own);
            if family.parallel {
                next += node.own;
                spare += node.other;
            } else {
                next += node.below() * node.below();
                spare = spare.max(node.other);
            }
        }
        match self.supernodes.get_mut(parent) {
            Some(node) => node.children = family,
            None => self.roots = family,
        }
        (stack, spare)
    }

    /// Records the entries of the matrix in the columns of one node.
    fn sources(
        &mut self,
        pattern: &Pattern,
        ordering: &Ordering,
        position: usize,
        rows: usize,
        local: &[u32],
    ) {
        let block = pattern.block;
        let this = ordering.order[position] as usize;
        let lower = pattern.row(this).map(|entry| (pattern.columns[entry], pattern.places[entry], true));
        let upper = pattern.upper(this).map(|(row, place)| (row, place, false));
        let free = |row: usize| &pattern.free_of[row * block..(row + 1) * block];
        let is_full = |row: usize| !free(row).contains(&NONE);
        let column = local[position] as usize;
        for (other, place, transposed) in lower.chain(upper) {
            let other = other as usize;
            let other_position = ordering.position[other] as usize;
            if other_position < position {
                continue;
            }
            let row = local[other_position] as usize;
            if is_full(this) && is_full(other) {
                let target = (column * rows + row) as u32;
                self.blocks.push(BlockSource { source: 2 * place + u32::from(transposed), target });
                continue;
            }
            for (across, j) in (0..block).filter(|&j| free(this)[j] != NONE).enumerate() {
                for (down, i) in (0..block).filter(|&i| free(other)[i] != NONE).enumerate() {
                    let (r, c) = if transposed { (j, i) } else { (i, j) };
                    if row + down >= column + across {
                        let source = ((place as usize * block + r) * block + c) as u32;
                        let target = ((column + across) * rows + row + down) as u32;
                        self.numbers
                            .push(NumberSource { source: 2 * source + u32::from(transposed), target });
                    }
                }
            }
        }
    }
}

fn permutation(pattern: &Pattern, ordering: &Ordering) -> Vec<u32> {
    let block = pattern.block;
    let coordinates = ordering
        .order
        .iter()
        .flat_map(|&row| pattern.free_of[row as usize * block..(row as usize + 1) * block].iter().copied());
    coordinates.filter(|&free| free != NONE).collect()
}

/// Returns the number of nodes in each column of the factor below the diagonal. From every entry of a row it walks up
/// the elimination tree to a node that this row has already reached.
fn column_counts(graph: &Graph, ordering: &Ordering, first: &[usize]) -> Vec<usize> {
    let count = graph.node_count();
    let mut below = vec![0; count];
    let mut reached = vec![NONE; count];
    for row in 0..count {
        reached[row] = row as u32;
        for &neighbour in graph.of(ordering.order[row] as usize) {
            let mut at = ordering.position[neighbour as usize];
            while (at as usize) < row && reached[at as usize] != row as u32 {
                reached[at as usize] = row as u32;
                below[at as usize] += first[row + 1] - first[row];
                at = ordering.parent[at as usize];
            }
        }
    }
    below
}

/// Returns whether a child may be merged into its parent, given the number of columns and the fraction of stored
/// zeros.
fn worth_merging(columns: usize, zeros: f64) -> bool {
    columns <= 12 || (columns <= 48 && zeros < 0.5) || (columns <= 144 && zeros < 0.15) || zeros < 0.05
}

/// Returns the ranges of positions that are eliminated together.
fn supernodes(graph: &Graph, ordering: &Ordering, first: &[usize]) -> Vec<Range<usize>> {
    struct Candidate {
        range: Range<usize>,
        below: usize,
        entries: f64,
    }
    let stored = |columns: usize, below: usize| (columns * (columns + 1) / 2 + columns * below) as f64;
    let below = column_counts(graph, ordering, first);
    let mut child_count = vec![0_u32; below.len()];
    for &above in ordering.parent.iter().filter(|&&above| above != NONE) {
        child_count[above as usize] += 1;
    }
    let mut done: Vec<Candidate> = Vec::new();
    let mut start = 0;
    for end in 1..=below.len() {
        let continues = end < below.len()
            && ordering.parent[end - 1] == end as u32
            && child_count[end] == 1
            && below[end - 1] == below[end] + first[end + 1] - first[end];
        if continues {
            continue;
        }
        let columns = first[end] - first[start];
        let mut next =
            Candidate { range: start..end, below: below[end - 1], entries: stored(columns, below[end - 1]) };
        while let Some(child) = done.last() {
            let above = ordering.parent[child.range.end - 1];
            let columns = first[end] - first[child.range.start];
            let total = stored(columns, next.below);
            let entries = child.entries + next.entries;
            let is_child = above != NONE && next.range.contains(&(above as usize));
            if !is_child || !worth_merging(columns, 1.0 - entries / total) {
                break;
            }
            next = Candidate { range: child.range.start..end, below: next.below, entries };
            done.pop();
        }
        done.push(next);
        start = end;
    }
    done.into_iter().map(|candidate| candidate.range).collect()
}

/// Returns the positions below each supernode's columns that its front contains, ascending.
fn row_structures(
    graph: &Graph,
    ordering: &Ordering,
    ranges: &[Range<usize>],
    owner: &[u32],
) -> Vec<Vec<u32>> {
    let mut structures: Vec<Vec<u32>> = vec![Vec::new(); ranges.len()];
    let mut marked = vec![NONE; graph.node_count()];
    let mut children: Vec<Vec<u32>> = vec![Vec::new(); ranges.len()];
    for (s, range) in ranges.iter().enumerate() {
        let mut rows = Vec::new();
        let mut visit = |position: u32, rows: &mut Vec<u32>| {
            if position as usize >= range.end && marked[position as usize] != s as u32 {
                marked[position as usize] = s as u32;
                rows.push(position);
            }
        };
        for position in range.clone() {
            for &neighbour in graph.of(ordering.order[position] as usize) {
                visit(ordering.position[neighbour as usize], &mut rows);
            }
        }
        for &child in &children[s] {
            for &row in &structures[child as usize] {
                visit(row, &mut rows);
            }
        }
        rows.sort_unstable();
        if let Some(&row) = rows.first() {
            children[owner[row as usize] as usize].push(s as u32);
        }
        structures[s] = rows;
    }
    structures
}

/// Records the positions of the rows of an update in the front that `local` describes, as contiguous runs.
fn push_runs(runs: &mut Vec<Run>, rows: &[u32], first: &[usize], local: &[u32]) -> Range<usize> {
    let start = runs.len();
    let mut from = 0;
    for &row in rows {
        let row = row as usize;
        let length = (first[row + 1] - first[row]) as u32;
        let to = local[row];
        match runs[start..].last_mut() {
            Some(run) if run.to + run.length == to => run.length += length,
            _ => runs.push(Run { from, to, length }),
        }
        from += length;
    }
    start..runs.len()
}
