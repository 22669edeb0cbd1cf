//! Assembles the fronts of a tree from the leaves to the roots, and has each one eliminated.
//!
//! A symmetric matrix has one side: its lower triangle. A matrix A of symmetric pattern has two: the lower triangles of A and of Aᵀ,
//! which lie behind each other in every panel and in every update.

use std::marker::PhantomData;

use super::scalar::Scalar;
use super::tree::{Family, Supernode, Tree};

/// The input of a factorisation of a matrix with `SIDES` sides. Its errors are the position of the coordinate that cannot be
/// eliminated.
pub(super) struct Walk<'a, T, const SIDES: usize, E> {
    pub(super) tree: &'a Tree,
    /// The values of each side.
    pub(super) sides: [&'a [f64]; SIDES],
    /// The factor by which values are multiplied.
    pub(super) scale: f64,
    pub(super) block: usize,
    /// Eliminates the columns of an assembled front. Returns the column that cannot be eliminated.
    pub(super) eliminate: E,
    pub(super) number: PhantomData<T>,
}

/// A front whose columns are to be eliminated.
pub(super) struct Front<'a, T> {
    /// Position of the first column in the elimination order.
    pub(super) first: usize,
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// `rows` × `columns` numbers per side, column-major.
    pub(super) panel: &'a mut [T],
    /// The update for the parent: (rows − columns)² numbers per side, column-major.
    pub(super) update: &'a mut [T],
    /// Whether the content of the update counts as zero.
    pub(super) is_fresh: bool,
}

impl<T, const SIDES: usize, E> Walk<'_, T, SIDES, E>
where
    T: Scalar,
    E: Fn(Front<'_, T>) -> Result<(), usize> + Sync,
{
    /// Factors the matrix. Each side takes the memory that the tree asks for.
    pub(super) fn run(&self, panels: &mut [T], [stack, spare]: &mut [Vec<T>; 2]) -> Result<(), usize> {
        self.family(&self.tree.roots, panels, stack, spare)
    }

    /// Eliminates the subtrees of a family. Leaves their updates in `stack`; `panels` holds their panels.
    fn family(
        &self,
        family: &Family,
        panels: &mut [T],
        stack: &mut [T],
        spare: &mut [T],
    ) -> Result<(), usize> {
        let members = &self.tree.members[family.members.clone()];
        if family.parallel {
            return self.side_by_side(members, panels, stack, spare);
        }
        let mut rest = panels;
        for &member in members {
            let node = &self.tree.supernodes[member as usize];
            let (panels, others) = rest.split_at_mut(self.subtree_length(node));
            rest = others;
            let own = &mut stack[SIDES * node.update..][..SIDES * node.own];
            self.subtree(node, panels, own, &mut spare[..SIDES * node.other])?;
        }
        Ok(())
    }

    fn side_by_side(
        &self,
        members: &[u32],
        panels: &mut [T],
        stack: &mut [T],
        spare: &mut [T],
    ) -> Result<(), usize> {
        let supernodes = &self.tree.supernodes;
        match members {
            [] => Ok(()),
            &[member] => self.subtree(&supernodes[member as usize], panels, stack, spare),
            _ => {
                let (left, right) = members.split_at(members.len() / 2);
                let sum = |length: &dyn Fn(&Supernode) -> usize| {
                    left.iter().map(|&member| length(&supernodes[member as usize])).sum::<usize>()
                };
                let (left_panels, right_panels) = panels.split_at_mut(sum(&|node| self.subtree_length(node)));
                let (left_stack, right_stack) = stack.split_at_mut(sum(&|node| SIDES * node.own));
                let (left_spare, right_spare) = spare.split_at_mut(sum(&|node| SIDES * node.other));
                let (on_left, on_right) = rayon::join(
                    || self.side_by_side(left, left_panels, left_stack, left_spare),
                    || self.side_by_side(right, right_panels, right_stack, right_spare),
                );
                on_left.and(on_right)
            }
        }
    }

    /// Returns the number of entries in the panels of a subtree.
    fn subtree_length(&self, node: &Supernode) -> usize {
        SIDES * (node.panel + node.panel_length() - self.tree.supernodes[node.subtree].panel)
    }

    /// Eliminates a subtree. Its panels end with that of the root; its update is left at the start of `own`.
    fn subtree(
        &self,
        node: &Supernode,
        panels: &mut [T],
        own: &mut [T],
        other: &mut [T],
    ) -> Result<(), usize> {
        let (length, square) = (node.panel_length(), node.below() * node.below());
        let (descendants, panel) = panels.split_at_mut(panels.len() - SIDES * length);
        self.family(&node.children, descendants, other, own)?;
        let update = &mut own[..SIDES * square];
        let members = &self.tree.members[node.children.members.clone()];
        panel.fill(T::default());
        if !members.is_empty() {
            update.fill(T::default());
        }
        for side in 0..SIDES {
            let panel = &mut panel[side * length..][..length];
            let update = &mut update[side * square..][..square];
            self.add_entries(node, [self.sides[side], self.sides[SIDES - 1 - side]], panel);
            for &child in members {
                let child = &self.tree.supernodes[child as usize];
                let square = child.below() * child.below();
                let source = &other[SIDES * child.update + side * square..][..square];
                self.add_update(node, child, source, panel, update);
            }
        }
        let &Supernode { first, rows, columns, .. } = node;
        let is_fresh = members.is_empty();
        (self.eliminate)(Front { first, rows, columns, panel, update, is_fresh })
            .map_err(|column| first + column)
    }

    /// Adds the entries of a side in the columns of a front. Entries above the diagonal are those of the other side, transposed.
    fn add_entries(&self, node: &Supernode, values: [&[f64]; 2], panel: &mut [T]) {
        match self.block {
            3 => self.add_blocks::<3>(node, values, panel),
            2 => self.add_blocks::<2>(node, values, panel),
            _ => self.add_blocks::<1>(node, values, panel),
        }
        for number in &self.tree.numbers[node.numbers.clone()] {
            panel[number.target as usize] =
                T::of(values[(number.source % 2) as usize][(number.source / 2) as usize] * self.scale);
        }
    }

    fn add_blocks<const B: usize>(&self, node: &Supernode, values: [&[f64]; 2], panel: &mut [T]) {
        let values = values.map(|values| values.as_chunks::<B>().0);
        for block in &self.tree.blocks[node.blocks.clone()] {
            let place = (block.source / 2) as usize * B;
            let transposed = block.source % 2 == 1;
            let value = &values[usize::from(transposed)][place..place + B];
            // A diagonal block also writes above the diagonal; those places are never read.
            for j in 0..B {
                let target = &mut panel[block.target as usize + j * node.rows..][..B];
                for i in 0..B {
                    target[i] = T::of(if transposed { value[j][i] } else { value[i][j] } * self.scale);
                }
            }
        }
    }

    /// Adds one side of a child's update to the parent's front.
    fn add_update(
        &self,
        node: &Supernode,
        child: &Supernode,
        source: &[T],
        panel: &mut [T],
        update: &mut [T],
    ) {
        let order = child.below();
        let runs = &self.tree.runs[child.runs.clone()];
        for (k, run) in runs.iter().enumerate() {
            for offset in 0..run.length as usize {
                let column = run.from as usize + offset;
                let source = &source[column * order..][..order];
                let to = run.to as usize + offset;
                // Take the rest of this run, then the runs after it.
                let here = (column, to, run.length as usize - offset);
                let after =
                    runs[k + 1..].iter().map(|run| (run.from as usize, run.to as usize, run.length as usize));
                let (target, skip) = match to.checked_sub(node.columns) {
                    None => (&mut panel[to * node.rows..][..node.rows], 0),
                    Some(to) => (&mut update[to * node.below()..][..node.below()], node.columns),
                };
                for (from, to, length) in std::iter::once(here).chain(after) {
                    let target = &mut target[to - skip..][..length];
                    for (target, source) in target.iter_mut().zip(&source[from..][..length]) {
                        *target += *source;
                    }
                }
            }
        }
    }
}
