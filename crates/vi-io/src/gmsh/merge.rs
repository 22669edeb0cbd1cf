//! Merges copies of elements: MSH 2 keeps one physical tag per element, so Gmsh writes an element once for each group
//! that contains it. The copies become one cell in several groups.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::reading::Reading;
use vi_mesh::{CellKind, Mesh};

impl Reading<'_> {
    /// Merges cells of one kind, one geometric entity and the same nodes into the first of them.
    pub(super) fn merge_copies(&mut self) {
        let cells: Vec<(CellKind, &[u32])> = self.out.mesh.cells().collect();
        let sorted = |nodes: &[u32]| {
            let mut key = [u32::MAX; 27];
            key[..nodes.len()].copy_from_slice(nodes);
            key.sort_unstable();
            key
        };
        let mut by_hash: Vec<(u64, u32)> = Vec::with_capacity(cells.len());
        for (i, (kind, nodes)) in cells.iter().enumerate() {
            let mut hasher = DefaultHasher::new();
            (kind, self.cell_entities[i], sorted(nodes)).hash(&mut hasher);
            by_hash.push((hasher.finish(), i as u32));
        }
        by_hash.sort_unstable();
        // Maps each cell to the first of its copies, or to itself if no copy precedes it.
        let mut first: Vec<u32> = (0..cells.len() as u32).collect();
        let mut copies = 0;
        for run in by_hash.chunk_by(|a, b| a.0 == b.0) {
            // All cells of a run have the same nodes, unless their hashes collide; cells that collide are not merged.
            let head = run[0].1 as usize;
            for &(_, i) in &run[1..] {
                let (a, b) = (cells[head], cells[i as usize]);
                if a.0 == b.0
                    && self.cell_entities[head] == self.cell_entities[i as usize]
                    && sorted(a.1) == sorted(b.1)
                {
                    first[i as usize] = head as u32;
                    copies += 1;
                }
            }
        }
        if copies == 0 {
            return;
        }
        let mut kept = Mesh::default();
        let mut new = vec![0; cells.len()];
        let mut cell_tags = Vec::with_capacity(cells.len() - copies);
        for (i, (kind, nodes)) in cells.into_iter().enumerate() {
            if first[i] == i as u32 {
                new[i] = cell_tags.len() as u32;
                cell_tags.push(self.cell_tags[i]);
                kept.push_cell(kind, nodes);
            } else {
                new[i] = new[first[i] as usize];
            }
        }
        for cell in self.members.values_mut().flatten() {
            *cell = new[*cell as usize];
        }
        self.out.mesh.blocks = kept.blocks;
        self.cell_tags = cell_tags;
        self.out
            .notes
            .push(format!("{copies} copies of elements that are in several physical groups were merged"));
    }
}
