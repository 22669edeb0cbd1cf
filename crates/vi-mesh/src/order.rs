//! Orders the elements of a region and the nodes of a mesh such that neighbours in the list are neighbours in space.
//! A run of elements then touches few nodes, and these are near each other.

use crate::bounds::Bounds;
use crate::mesh::Mesh;

/// Number of bits of each coordinate that are used.
const BITS: u32 = 20;
/// Number of bits of a place on the curve.
pub(crate) const PLACE_BITS: u32 = 3 * BITS;

/// Morton's curve through a box of points (G. M. Morton, 1966).
pub(crate) struct Curve {
    low: [f64; 3],
    scale: f64,
}

impl Curve {
    pub(crate) fn through(points: impl Iterator<Item = [f64; 3]>) -> Self {
        let bounds = Bounds::of(points);
        let extent = bounds.longest_side();
        Self { low: bounds.low, scale: if extent > 0.0 { f64::from((1 << BITS) - 1) / extent } else { 0.0 } }
    }

    /// Returns the position of a point on the curve.
    pub(crate) fn place(&self, point: [f64; 3]) -> u64 {
        (0..3).map(|i| spread(((point[i] - self.low[i]) * self.scale) as u64) << i).sum()
    }
}

/// Returns the mean of some points.
pub(crate) fn centroid(points: impl ExactSizeIterator<Item = [f64; 3]>) -> [f64; 3] {
    let count = points.len() as f64;
    let mut sum = [0.0; 3];
    for point in points {
        for i in 0..3 {
            sum[i] += point[i] / count;
        }
    }
    sum
}

/// Sorts elements along Morton's curve through their centroids.
pub fn sort_by_place(mesh: &Mesh, elements: &mut [u32]) {
    let centroid_of = |element: u32| {
        let nodes = mesh.cell(element as usize).map_or(&[][..], |(_, nodes)| nodes);
        centroid(nodes.iter().map(|&node| mesh.points[node as usize]))
    };
    let curve = Curve::through(elements.iter().map(|&element| centroid_of(element)));
    elements.sort_by_cached_key(|&element| curve.place(centroid_of(element)));
}

/// A renumbering of the nodes of a mesh along Morton's curve, like that of the elements. Runs of elements and of
/// nodes then lie together in space and in memory, whatever the order in a file, and a core mostly reads what it
/// wrote itself.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Numbering {
    /// The new number of each node.
    number: Vec<u32>,
}

impl Numbering {
    /// Returns the numbering along the curve.
    pub fn by_place(mesh: &Mesh) -> Self {
        Self::along(&Curve::through(mesh.points.iter().copied()), &mesh.points)
    }

    /// Returns the numbering of points along a curve.
    pub(crate) fn along(curve: &Curve, points: &[[f64; 3]]) -> Self {
        let mut nodes: Vec<u32> = (0..points.len() as u32).collect();
        nodes.sort_by_cached_key(|&node| curve.place(points[node as usize]));
        let mut number = vec![0; nodes.len()];
        for (new, &node) in nodes.iter().enumerate() {
            number[node as usize] = new as u32;
        }
        Self { number }
    }

    /// Returns the new number of a node; a node that the mesh does not have keeps its number.
    pub fn of(&self, node: u32) -> u32 {
        self.number.get(node as usize).copied().unwrap_or(node)
    }

    /// Returns the node that has a new number. This takes a linear search.
    pub fn node(&self, number: u32) -> Option<u32> {
        self.number.iter().position(|&of| of == number).map(|node| node as u32)
    }

    /// Returns nodal values in the new order.
    pub fn values<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let mut ordered = values.to_vec();
        for (value, &number) in values.iter().zip(&self.number) {
            ordered[number as usize] = *value;
        }
        ordered
    }

    /// Returns the mesh with its nodes renumbered; cells and regions keep their numbers.
    pub fn mesh(&self, mesh: &Mesh) -> Mesh {
        let mut blocks = mesh.blocks.clone();
        for node in blocks.iter_mut().flat_map(|block| &mut block.nodes) {
            *node = self.of(*node);
        }
        Mesh { points: self.values(&mesh.points), blocks, regions: mesh.regions.clone() }
    }
}

/// Inserts two zeros before each of the lowest 21 bits.
fn spread(bits: u64) -> u64 {
    let mut x = bits & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::CellKind;
    use crate::generate::box_mesh::BoxMesh;

    #[test]
    fn every_third_bit() {
        assert_eq!(spread(0b1011), 0b001_000_001_001);
        assert_eq!(spread(0x1f_ffff).count_ones(), 21);
    }

    #[test]
    fn a_numbering_is_of_the_same_mesh() {
        let mesh =
            BoxMesh { size: [4.0, 1.0, 2.0], cells: [5, 3, 4], element: CellKind::Tet10, origin: [1.0; 3] };
        let mesh = mesh.build().unwrap();
        let numbering = Numbering::by_place(&mesh);
        let other = numbering.mesh(&mesh);
        let corners = |mesh: &Mesh, cell| -> Vec<[f64; 3]> {
            mesh.cell(cell).unwrap().1.iter().map(|&node| mesh.points[node as usize]).collect()
        };
        assert!((0..mesh.cell_count()).all(|cell| corners(&mesh, cell) == corners(&other, cell)));
        assert_eq!(mesh.regions, other.regions);
        let mut numbers: Vec<u32> = (0..mesh.points.len() as u32).map(|node| numbering.of(node)).collect();
        assert_eq!(numbering.node(numbers[17]), Some(17));
        numbers.sort_unstable();
        assert!(numbers.into_iter().eq(0..mesh.points.len() as u32));
        // Most neighbours in the list are neighbours in space.
        let steps = other.points.windows(2).map(|pair| (0..3).map(|i| (pair[1][i] - pair[0][i]).abs()).sum());
        let mut steps: Vec<f64> = steps.collect();
        steps.sort_by(f64::total_cmp);
        assert!(steps[steps.len() / 2] < 0.5, "{}", steps[steps.len() / 2]);
    }

    #[test]
    fn runs_touch_few_nodes() {
        let mesh =
            BoxMesh { size: [4.0, 1.0, 1.0], cells: [32, 8, 8], element: CellKind::Tet4, origin: [0.0; 3] };
        let mesh = mesh.build().unwrap();
        let mut elements = mesh.cells_of_dimension(3);
        let nodes_of = |elements: &[u32]| -> usize {
            let of_run = |run: &[u32]| {
                let mut nodes: Vec<u32> =
                    run.iter().flat_map(|&e| mesh.cell(e as usize).unwrap().1).copied().collect();
                nodes.sort_unstable();
                nodes.dedup();
                nodes.len()
            };
            elements.chunks(1024).map(of_run).sum()
        };
        let before = nodes_of(&elements);
        let all = elements.clone();
        sort_by_place(&mesh, &mut elements);
        assert!(nodes_of(&elements) < before * 3 / 4, "{} {before}", nodes_of(&elements));
        elements.sort_unstable();
        assert_eq!(elements, all);
    }
}
