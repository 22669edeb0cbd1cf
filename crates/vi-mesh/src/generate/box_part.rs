//! The part of a box that one of several processes computes, and the elements of a box as functions of their numbers. A process
//! never holds the elements of the others.

use std::ops::Range;
use std::sync::Arc;

use super::box_cells::{LatticePoint, elements, facets};
use super::box_mesh::{BoxMesh, FACES, cells_of};
use crate::cell::CellKind;
use crate::error::MeshError;
use crate::far::{FarElements, FarMesh};
use crate::mesh::{CellBlock, Mesh, Region};
use crate::order::{Curve, Numbering, PLACE_BITS, centroid};
use crate::part::MeshPart;
use crate::runs::Runs;

/// Number of leading bits of a place on the curve by which elements are counted.
const BIN_BITS: u32 = 18;

impl BoxMesh {
    /// Returns the part of [`BoxMesh::build`] that process number `process` needs: the runs that it computes, and all
    /// runs that share nodes with them. Returns `None` for elements with nodes elsewhere than at the corners of the
    /// cells of the box.
    ///
    /// # Errors
    /// Returns the errors of [`BoxMesh::build`].
    pub fn part(&self, process: usize, runs: &Runs) -> Result<Option<MeshPart>, MeshError> {
        self.check()?;
        let Some(grid) = Grid::new(self) else { return Ok(None) };
        let along = Along::new(&grid);
        let run_length = runs.length();
        let is_own: Vec<bool> = (0..runs.count()).map(|run| runs.process_of(run) == process).collect();

        let mut is_own_node = vec![false; grid.node_count()];
        for (_, element) in along.elements_of_runs(&is_own, run_length) {
            grid.corners(element).for_each(|node| is_own_node[node as usize] = true);
        }
        let touches = |element: u32| grid.corners(element).any(|node| is_own_node[node as usize]);
        let mut is_in_part = vec![false; runs.count()];
        for (position, element) in along.elements_of_bins(&along.bins_with(touches)) {
            is_in_part[position as usize / run_length] |= touches(element);
        }
        drop(is_own_node);
        let on_curve = along.elements_of_runs(&is_in_part, run_length);

        let mut sorted: Vec<u32> = on_curve.iter().map(|(_, element)| *element).collect();
        sorted.sort_unstable();
        let number = |(_, element): &(u32, u32)| sorted.partition_point(|other| other < element) as u32;
        let order = on_curve.iter().map(number).collect();
        drop(on_curve);
        let mesh = grid.mesh_of(&sorted);
        let ends = [0, grid.node_count() as u32 - 1].map(|node| grid.point(node));
        let numbering = Numbering::along(&Curve::through(ends.into_iter()), &mesh.points);
        let runs = runs.listed(|run| is_in_part[run]);
        Ok(Some(MeshPart { mesh, numbering, order, run_length, runs }))
    }

    /// Returns the nodes of [`BoxMesh::build`] with the facets of its faces, which are cells 0, 1 … here, and its elements. Returns
    /// `None` for elements with nodes elsewhere than at the corners of the cells of the box.
    ///
    /// # Errors
    /// Returns the errors of [`BoxMesh::build`].
    pub fn without_elements(&self) -> Result<Option<FarMesh>, MeshError> {
        self.check()?;
        let Some(grid) = Grid::new(self) else { return Ok(None) };
        let points = (0..grid.node_count() as u32).map(|node| grid.point(node)).collect();
        let mut mesh = Mesh { points, ..Mesh::default() };
        grid.add_faces(&mut mesh, Some);
        Ok(Some((mesh, Arc::new(grid))))
    }
}

/// The nodes and elements of a box as functions of their numbers, which are those of [`BoxMesh::build`].
#[derive(Debug)]
struct Grid {
    kind: CellKind,
    /// Cells along each axis.
    cells: [usize; 3],
    /// The elements of a cell.
    elements: Vec<Vec<LatticePoint>>,
    /// Coordinates of the nodes along each axis, m.
    axes: [Vec<f64>; 3],
}

impl Grid {
    fn new(shape: &BoxMesh) -> Option<Self> {
        let elements = elements(shape.element)?;
        if elements.iter().flatten().flatten().any(|place| place % 2 != 0) {
            return None;
        }
        let cells = shape.cells.map(|count| count as usize);
        let axes = [0, 1, 2].map(|axis| (0..=cells[axis]).map(|i| shape.place(axis, 2 * i)).collect());
        Some(Self { kind: shape.element, cells, elements, axes })
    }

    fn element_count(&self) -> usize {
        self.elements.len() * self.cells.iter().product::<usize>()
    }

    fn node_count(&self) -> usize {
        self.cells.iter().map(|count| count + 1).product()
    }

    /// Returns the number of a point of a cell.
    fn node(&self, cell: [usize; 3], point: &LatticePoint) -> u32 {
        let [i, j, k] = [0, 1, 2].map(|axis| cell[axis] + point[axis] / 2);
        (i + (self.cells[0] + 1) * (j + (self.cells[1] + 1) * k)) as u32
    }

    fn corners(&self, element: u32) -> impl ExactSizeIterator<Item = u32> {
        let (element, [nx, ny, _]) = (element as usize, self.cells);
        let (cell, points) = (element / self.elements.len(), &self.elements[element % self.elements.len()]);
        let cell = [cell % nx, cell / nx % ny, cell / (nx * ny)];
        points.iter().map(move |point| self.node(cell, point))
    }

    fn point(&self, node: u32) -> [f64; 3] {
        let [nx, ny] = [self.cells[0] + 1, self.cells[1] + 1];
        let at = [node as usize % nx, node as usize / nx % ny, node as usize / (nx * ny)];
        [0, 1, 2].map(|axis| self.axes[axis][at[axis]])
    }

    fn centroid(&self, element: u32) -> [f64; 3] {
        centroid(self.corners(element).map(|node| self.point(node)))
    }

    /// Returns the mesh of some elements (ascending), with the facets of the box whose nodes all belong to them.
    fn mesh_of(&self, part: &[u32]) -> Mesh {
        let mut numbers: Vec<u32> = part.iter().flat_map(|&element| self.corners(element)).collect();
        let corners = numbers.clone();
        numbers.sort_unstable();
        numbers.dedup();
        numbers.shrink_to_fit();
        let number = |node: u32| numbers.binary_search(&node).ok().map(|own| own as u32);
        let nodes = corners.into_iter().filter_map(number).collect();
        let cells = (0..part.len() as u32).collect();
        let mut mesh = Mesh {
            points: numbers.iter().map(|&node| self.point(node)).collect(),
            blocks: vec![CellBlock { kind: self.kind, nodes }],
            regions: vec![Region { name: "box".into(), dimension: 3, cells }],
        };
        self.add_faces(&mut mesh, number);
        mesh
    }

    /// Adds the facets of the box whose nodes all have a number, and the regions of its faces.
    fn add_faces(&self, mesh: &mut Mesh, number: impl Fn(u32) -> Option<u32>) {
        let mut cell_count = mesh.cell_count() as u32;
        for (name, axis, far) in FACES {
            let (kind, of_cell) = facets(self.kind, &self.elements, axis, far);
            let mut nodes: Vec<u32> = Vec::new();
            for cell in cells_of(self.cells, Some((axis, if far { self.cells[axis] - 1 } else { 0 }))) {
                for facet in &of_cell {
                    let known = facet.iter().map(|point| number(self.node(cell, point)));
                    nodes.extend(known.collect::<Option<Vec<u32>>>().unwrap_or_default());
                }
            }
            let end = cell_count + (nodes.len() / kind.node_count()) as u32;
            mesh.regions.push(Region { name: name.into(), dimension: 2, cells: (cell_count..end).collect() });
            cell_count = end;
            match mesh.blocks.last_mut() {
                Some(block) if block.kind == kind => block.nodes.extend(nodes),
                _ => mesh.blocks.push(CellBlock { kind, nodes }),
            }
        }
    }
}

/// Stands for a node of no process.
const NONE: u32 = u32::MAX;

impl FarElements for Grid {
    fn kind(&self) -> CellKind {
        self.kind
    }

    fn count(&self) -> usize {
        self.element_count()
    }

    fn point(&self, node: u32) -> [f64; 3] {
        Grid::point(self, node)
    }

    fn add_nodes(&self, elements: Range<u32>, nodes: &mut Vec<u32>) {
        nodes.extend(elements.flat_map(|element| self.corners(element)));
    }

    fn of_runs(&self, runs: &[usize], run_length: usize) -> Vec<u32> {
        let mut is_wanted = vec![false; self.element_count().div_ceil(run_length)];
        runs.iter().for_each(|&run| is_wanted[run] = true);
        let found = Along::new(self).elements_of_runs(&is_wanted, run_length);
        found.into_iter().map(|(_, element)| element).collect()
    }

    fn nodes_of_processes(&self, runs: &Runs) -> Vec<Vec<u32>> {
        let along = Along::new(self);
        let process_at = |position: usize| runs.process_of(position / runs.length()) as u32;
        // Most bins belong to one process; the elements of the others must be sorted.
        let ends = |bin: usize| along.before[bin]..along.before[bin + 1];
        let process_of = |bin: usize| {
            let positions = ends(bin);
            let process = process_at(positions.start);
            (process_at(positions.end - 1) == process).then_some(process)
        };
        let is_split = |bin: usize| !ends(bin).is_empty() && process_of(bin).is_none();
        let split: Vec<bool> = (0..1 << BIN_BITS).map(is_split).collect();
        let of_split = along.elements_of_bins(&split).into_iter();
        let mut of_split: Vec<(u32, u32)> =
            of_split.map(|(position, element)| (element, process_at(position as usize))).collect();
        of_split.sort_unstable();

        // The first process that is found at a node, and the others.
        let (mut first, mut others) = (vec![NONE; self.node_count()], Vec::new());
        for element in 0..self.element_count() as u32 {
            let process = process_of(along.bin(along.place(element)))
                .unwrap_or_else(|| of_split[of_split.partition_point(|&(other, _)| other < element)].1);
            for node in self.corners(element) {
                match &mut first[node as usize] {
                    unknown if *unknown == NONE => *unknown = process,
                    known if *known != process => others.push((node, process)),
                    _ => {}
                }
            }
        }
        others.sort_unstable();
        others.dedup();
        let mut nodes = vec![Vec::new(); runs.process_count()];
        (0..).zip(&first).for_each(|(node, &process)| nodes[process as usize].push(node));
        others.into_iter().for_each(|(node, process)| nodes[process as usize].push(node));
        nodes.iter_mut().for_each(|nodes| nodes.sort_unstable());
        nodes
    }
}

/// The elements of a box along Morton's curve. They are counted in bins of places, so that a few of them can be listed with
/// their positions without sorting all.
struct Along<'a> {
    grid: &'a Grid,
    curve: Curve,
    /// Number of elements in the bins before each bin.
    before: Vec<usize>,
}

impl<'a> Along<'a> {
    fn new(grid: &'a Grid) -> Self {
        let elements = 0..grid.element_count() as u32;
        let curve = Curve::through(elements.clone().map(|element| grid.centroid(element)));
        let mut this = Self { grid, curve, before: vec![0; (1 << BIN_BITS) + 1] };
        for element in elements {
            let bin = this.bin(this.place(element));
            this.before[bin + 1] += 1;
        }
        for bin in 0..1 << BIN_BITS {
            this.before[bin + 1] += this.before[bin];
        }
        this
    }

    fn place(&self, element: u32) -> u64 {
        self.curve.place(self.grid.centroid(element))
    }

    fn bin(&self, place: u64) -> usize {
        (place >> (PLACE_BITS - BIN_BITS)) as usize
    }

    /// Returns which bins have an element with a property.
    fn bins_with(&self, has: impl Fn(u32) -> bool) -> Vec<bool> {
        let mut bins = vec![false; 1 << BIN_BITS];
        for element in (0..self.grid.element_count() as u32).filter(|&element| has(element)) {
            bins[self.bin(self.place(element))] = true;
        }
        bins
    }

    /// Returns the positions and numbers of the elements of some bins, in the order of the curve.
    fn elements_of_bins(&self, bins: &[bool]) -> Vec<(u32, u32)> {
        let placed = (0..self.grid.element_count() as u32).map(|element| (self.place(element), element));
        let mut found: Vec<(u64, u32)> = placed.filter(|(place, _)| bins[self.bin(*place)]).collect();
        found.sort_unstable();
        let of_bin = found.chunk_by(|a, b| self.bin(a.0) == self.bin(b.0));
        let positions = of_bin.flat_map(|bin| (self.before[self.bin(bin[0].0)] as u32..).take(bin.len()));
        positions.zip(&found).map(|(position, (_, element))| (position, *element)).collect()
    }

    /// Returns the positions and numbers of the elements of some runs, in the order of the curve.
    fn elements_of_runs(&self, is_wanted: &[bool], run_length: usize) -> Vec<(u32, u32)> {
        let has_wanted = |ends: &[usize]| match ends[0] < ends[1] {
            true => (ends[0] / run_length..=(ends[1] - 1) / run_length).any(|run| is_wanted[run]),
            false => false,
        };
        let bins: Vec<bool> = self.before.windows(2).map(has_wanted).collect();
        let mut found = self.elements_of_bins(&bins);
        found.retain(|(position, _)| is_wanted[*position as usize / run_length]);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::sort_by_place;
    use crate::pieces::CutMesh;
    use std::convert::Infallible;

    /// Every part has the elements of its runs in the order of the whole mesh, at the same places, all elements at the nodes
    /// of its own runs, and the nodes of the regions there.
    #[test]
    fn parts_agree_with_the_whole() {
        for (element, cells) in
            [(CellKind::Tet4, [9, 4, 5]), (CellKind::Hex8, [7, 8, 9]), (CellKind::Wedge6, [5, 7, 4])]
        {
            let shape = BoxMesh { size: [1.0, 0.3, 0.4], cells, element, origin: [0.1, -0.7, 0.2] };
            let whole = shape.build().unwrap();
            let mut sorted = whole.cells_of_dimension(3);
            sort_by_place(&whole, &mut sorted);
            let numbering = Numbering::by_place(&whole);
            let places = |mesh: &Mesh, cell: u32| -> Vec<[f64; 3]> {
                let (_, nodes) = mesh.cell(cell as usize).unwrap();
                nodes.iter().map(|&node| mesh.points[node as usize]).collect()
            };
            let (count, run_length) = (3, 64);
            let mut computed = Vec::new();
            let (nodes, far) = shape.without_elements().unwrap().unwrap();
            assert_eq!((&nodes.points, far.count()), (&whole.points, sorted.len()));
            for region in &nodes.regions {
                assert_eq!(nodes.region_nodes(&region.name), whole.region_nodes(&region.name));
            }
            let runs: Vec<&[u32]> = sorted.chunks(run_length).collect();
            assert_eq!(far.of_runs(&[0, 2], run_length), [runs[0], runs[2]].concat());
            let window = far.window(sorted.iter().copied(), |node| whole.points[node as usize]);
            for (cell, &element) in sorted.iter().enumerate() {
                assert_eq!(places(&window.mesh, cell as u32), places(&whole, element));
            }
            let shares = Runs::in_equal_shares(sorted.len(), run_length, count);
            let of_processes = far.nodes_of_processes(&shares);
            let cut_mesh = CutMesh::new(&whole, 5, run_length).unwrap();
            for process in 0..count {
                let part = shape.part(process, &shares).unwrap().unwrap();
                // The part that is cut out of the whole mesh has the same elements and the same order.
                let cut = MeshPart::of_mesh(&whole, process, &shares);
                let read = |piece| Ok::<_, Infallible>(cut_mesh.piece(piece));
                assert_eq!(cut_mesh.pieces().part(process, &shares, read).unwrap(), cut);
                let volumes = cut.mesh.cells_of_dimension(3);
                assert_eq!(cut.mesh.points, part.mesh.points);
                assert!(volumes.iter().all(|&k| cut.mesh.cell(k as usize) == part.mesh.cell(k as usize)));
                let same = |a: &MeshPart, b: &MeshPart| {
                    (&a.numbering, &a.order, a.run_length, &a.runs)
                        == (&b.numbering, &b.order, b.run_length, &b.runs)
                };
                assert!(same(&cut, &part) && volumes.len() == part.order.len());
                let runs: Vec<&[u32]> = part.order.chunks(run_length).collect();
                assert_eq!(runs.len(), part.runs.len());
                let own = runs.iter().zip(&part.runs).filter(|(_, of)| of.1 == process as u32);
                let own: Vec<u32> = own.flat_map(|(run, _)| run.iter().copied()).collect();
                computed.extend(own.iter().map(|&cell| places(&part.mesh, cell)));
                // Whole nodes of this process, by place.
                let has = |cells: &mut dyn Iterator<Item = u32>, mesh: &Mesh, at: [f64; 3]| {
                    cells.filter(|&cell| places(mesh, cell).contains(&at)).count()
                };
                let mut nodes: Vec<u32> =
                    own.iter().flat_map(|&cell| part.mesh.cell(cell as usize).unwrap().1.to_vec()).collect();
                nodes.sort_unstable();
                nodes.dedup();
                let number =
                    |&node: &u32| whole.points.iter().position(|x| *x == part.mesh.points[node as usize]);
                let mut numbers: Vec<u32> = nodes.iter().filter_map(number).map(|node| node as u32).collect();
                numbers.sort_unstable();
                assert_eq!(numbers, of_processes[process]);
                for &node in nodes.iter().step_by(7) {
                    let at = part.mesh.points[node as usize];
                    let here = has(&mut (0..part.mesh.cell_count() as u32), &part.mesh, at);
                    assert_eq!(here, has(&mut (0..whole.cell_count() as u32), &whole, at));
                    for region in &whole.regions {
                        let is_in = |mesh: &Mesh| {
                            let nodes = mesh.region_nodes(&region.name).unwrap();
                            nodes.iter().any(|&node| mesh.points[node as usize] == at)
                        };
                        assert_eq!(is_in(&part.mesh), is_in(&whole), "{} {at:?}", region.name);
                        assert_eq!(is_in(&cut.mesh), is_in(&whole), "{} {at:?}", region.name);
                    }
                }
                let node_of = |at: &[f64; 3]| whole.points.iter().position(|x| x == at).unwrap() as u32;
                let mut by_number: Vec<u32> = (0..part.mesh.points.len() as u32).collect();
                by_number.sort_by_key(|&node| part.numbering.of(node));
                let numbers = by_number.iter().map(|&n| numbering.of(node_of(&part.mesh.points[n as usize])));
                assert!(numbers.is_sorted());
            }
            assert!(
                computed.iter().eq(sorted
                    .iter()
                    .map(|&cell| places(&whole, cell))
                    .collect::<Vec<_>>()
                    .iter())
            );
        }
    }

    #[test]
    fn elements_with_other_nodes_are_left_to_the_whole_mesh() {
        for element in [CellKind::Tet10, CellKind::Pyramid5] {
            let shape = BoxMesh { size: [1.0; 3], cells: [2; 3], element, origin: [0.0; 3] };
            assert_eq!(shape.part(0, &Runs::in_equal_shares(48, 64, 1)).unwrap(), None);
        }
    }
}
