//! Edits a mesh as a whole: selects cells, welds points, cuts quadrilaterals into triangles. Groups and arrays follow.

use std::collections::HashMap;

use vi_mesh::{CellBlock, CellKind};

use crate::mesh::MeshFile;

/// A cell of an edited mesh: its kind, its nodes, and the number of the cell that it came from.
type Kept = (CellKind, Vec<u32>, usize);

impl MeshFile {
    /// Keeps the cells that `keep` accepts (number, kind, nodes) and the points that they use. Returns the number of
    /// points removed.
    pub fn retain_cells(&mut self, keep: impl Fn(usize, CellKind, &[u32]) -> bool) -> usize {
        let kept = self
            .mesh
            .cells()
            .enumerate()
            .filter(|(cell, (kind, nodes))| keep(*cell, *kind, nodes))
            .map(|(cell, (kind, nodes))| (kind, nodes.to_vec(), cell))
            .collect();
        self.replace_cells(kept);
        self.drop_unused_points()
    }

    /// Merges points that lie nearer to each other than `distance` (in the unit of the file) into the first of them,
    /// which keeps its data. Returns the number of points removed. Cells keep their number of nodes, two of which may
    /// then be the same.
    pub fn weld(&mut self, distance: f64) -> usize {
        if distance.is_nan() || distance <= 0.0 {
            return 0;
        }
        let key = |x: &[f64; 3]| x.map(|x| (x / distance).floor() as i64);
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(self.mesh.points.len());
        let mut map: Vec<u32> = Vec::with_capacity(self.mesh.points.len());
        for (index, x) in self.mesh.points.iter().enumerate() {
            let [i, j, k] = key(x);
            let around = (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [a, b, c])));
            let near = around
                .filter_map(|[a, b, c]| {
                    cells.get(&[i.saturating_add(a), j.saturating_add(b), k.saturating_add(c)])
                })
                .flatten()
                .copied()
                .filter(|&other| {
                    let y = self.mesh.points[other as usize];
                    (0..3).map(|d| (x[d] - y[d]).powi(2)).sum::<f64>() < distance * distance
                })
                .min();
            map.push(near.unwrap_or_else(|| {
                cells.entry([i, j, k]).or_default().push(index as u32);
                index as u32
            }));
        }
        for node in self.mesh.blocks.iter_mut().flat_map(|block| &mut block.nodes) {
            *node = map[*node as usize];
        }
        let gone: Vec<bool> = map.iter().enumerate().map(|(index, &to)| to != index as u32).collect();
        self.drop_points(&gone)
    }

    /// Cuts each linear quadrilateral into two triangles along the shorter diagonal (the first if they are equal).
    /// Returns the number of quadrilaterals cut.
    pub fn cut_quadrilaterals(&mut self) -> usize {
        let square = |a: u32, b: u32| -> f64 {
            let (a, b) = (self.mesh.points[a as usize], self.mesh.points[b as usize]);
            (0..3).map(|d| (a[d] - b[d]).powi(2)).sum()
        };
        let mut cut = 0;
        let mut kept: Vec<Kept> = Vec::with_capacity(self.mesh.cell_count());
        for (cell, (kind, nodes)) in self.mesh.cells().enumerate() {
            if let (CellKind::Quad4, &[a, b, c, d]) = (kind, nodes) {
                let halves = if square(a, c) <= square(b, d) {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, b, d], [b, c, d]]
                };
                kept.extend(halves.map(|half| (CellKind::Tri3, half.to_vec(), cell)));
                cut += 1;
            } else {
                kept.push((kind, nodes.to_vec(), cell));
            }
        }
        if cut > 0 {
            self.replace_cells(kept);
        }
        cut
    }

    /// Removes the points that no cell uses, and returns their number.
    pub fn drop_unused_points(&mut self) -> usize {
        let mut unused = vec![true; self.mesh.points.len()];
        for &node in self.mesh.blocks.iter().flat_map(|block| &block.nodes) {
            unused[node as usize] = false;
        }
        self.drop_points(&unused)
    }

    /// Replaces the cells; they are given in ascending order of the cells that they came from.
    fn replace_cells(&mut self, cells: Vec<Kept>) {
        let mut from = Vec::with_capacity(cells.len());
        let mut blocks: Vec<CellBlock> = Vec::new();
        for (kind, nodes, source) in cells {
            from.push(source as u32);
            match blocks.last_mut() {
                Some(block) if block.kind == kind => block.nodes.extend(nodes),
                _ => blocks.push(CellBlock { kind, nodes }),
            }
        }
        for region in &mut self.mesh.regions {
            let mut cells = Vec::with_capacity(region.cells.len());
            for &cell in &region.cells {
                let first = from.partition_point(|&source| source < cell);
                let count = from[first..].iter().take_while(|&&source| source == cell).count();
                cells.extend((first..first + count).map(|cell| cell as u32));
            }
            region.cells = cells;
        }
        self.mesh.regions.retain(|region| !region.cells.is_empty());
        for array in &mut self.cell_data {
            let size = array.components;
            let tuple = |&source: &u32| &array.values[source as usize * size..][..size];
            array.values = from.iter().flat_map(tuple).copied().collect();
        }
        self.mesh.blocks = blocks;
    }

    /// Removes points that no cell uses, and returns their number.
    fn drop_points(&mut self, gone: &[bool]) -> usize {
        let count = gone.iter().filter(|gone| **gone).count();
        if count == 0 {
            return 0;
        }
        let mut next = 0;
        let map: Vec<u32> = gone
            .iter()
            .map(|gone| {
                next += u32::from(!gone);
                next.saturating_sub(1)
            })
            .collect();
        for node in self.mesh.blocks.iter_mut().flat_map(|block| &mut block.nodes) {
            *node = map[*node as usize];
        }
        let mut stays = gone.iter().map(|gone| !gone);
        self.mesh.points.retain(|_| stays.next().unwrap_or(true));
        for array in &mut self.point_data {
            let tuples = array.values.chunks_exact(array.components).zip(gone);
            array.values = tuples.filter(|(_, gone)| !**gone).flat_map(|(tuple, _)| tuple).copied().collect();
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::DataArray;
    use vi_mesh::{Mesh, Region};

    /// Makes two adjacent squares whose common points are duplicated, and one unused point.
    fn squares() -> MeshFile {
        let points = [0.0, 1.0, 1.0, 2.0]
            .iter()
            .flat_map(|&x| [[x, 0.0, 0.0], [x, 1.0, 0.0]])
            .chain([[9.0; 3]])
            .collect();
        let mesh = Mesh {
            points,
            blocks: vec![
                CellBlock { kind: CellKind::Quad4, nodes: vec![0, 2, 3, 1, 4, 6, 7, 5] },
                CellBlock { kind: CellKind::Line2, nodes: vec![2, 3] },
            ],
            regions: vec![
                Region { name: "right".into(), dimension: 2, cells: vec![1] },
                Region { name: "middle".into(), dimension: 1, cells: vec![2] },
            ],
        };
        MeshFile {
            mesh,
            point_data: vec![DataArray {
                name: "n".into(),
                components: 1,
                values: (0..9).map(f64::from).collect(),
            }],
            cell_data: vec![DataArray {
                name: "c".into(),
                components: 2,
                values: (0..6).map(f64::from).collect(),
            }],
            ..MeshFile::default()
        }
    }

    #[test]
    fn welded_points_are_the_first_of_them_and_data_follow() {
        let mut mesh = squares();
        assert_eq!(mesh.weld(1e-9), 2);
        assert_eq!(mesh.mesh.blocks[0].nodes, [0, 2, 3, 1, 2, 4, 5, 3]);
        assert_eq!(mesh.drop_unused_points(), 1);
        assert_eq!(mesh.point_data[0].values, [0.0, 1.0, 2.0, 3.0, 6.0, 7.0]);
        assert_eq!((mesh.weld(1e-9), mesh.weld(0.0), mesh.drop_unused_points()), (0, 0, 0));
    }

    #[test]
    fn points_are_welded_across_the_cells_of_the_search() {
        let mut mesh = squares();
        mesh.mesh.points[4][0] -= 0.9e-3;
        mesh.mesh.points[5][1] += 0.9e-3;
        assert_eq!(mesh.weld(1e-3), 2);
    }

    #[test]
    fn quadrilaterals_become_triangles_in_their_groups() {
        let mut mesh = squares();
        assert_eq!(mesh.cut_quadrilaterals(), 2);
        assert_eq!(mesh.mesh.blocks[0].nodes, [0, 2, 3, 0, 3, 1, 4, 6, 7, 4, 7, 5]);
        assert_eq!(
            (mesh.mesh.regions[0].cells.as_slice(), mesh.mesh.regions[1].cells.as_slice()),
            (&[2, 3][..], &[4][..])
        );
        assert_eq!(mesh.cell_data[0].values, [0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn a_part_has_its_own_points_and_groups() {
        let mut mesh = squares();
        assert_eq!(mesh.retain_cells(|cell, _, _| cell == 1), 5);
        assert_eq!((mesh.mesh.points.len(), mesh.mesh.blocks[0].nodes.as_slice()), (4, &[0, 2, 3, 1][..]));
        assert_eq!((mesh.mesh.regions.len(), mesh.mesh.regions[0].cells.as_slice()), (1, &[0][..]));
    }
}
