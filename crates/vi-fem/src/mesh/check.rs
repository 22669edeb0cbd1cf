//! What can be wrong with a mesh, found all at once, and turning mirrored elements over. It must not
//! know where the mesh came from.

use super::Mesh;
use crate::element::{Element, SolidVisitor};
use crate::tensor::determinant;
use crate::{ElementKind, FemError};

/// How many offenders a message names.
const NAMED: usize = 5;

impl Mesh {
    /// Checks that the cells of `dimension` make a body: 3 a solid, 2 a sheet.
    ///
    /// # Errors
    /// Every problem found: node numbers out of range, coordinates that are not finite, no cells,
    /// nodes without a cell, solid elements that are inverted or without volume.
    pub fn check(&self, dimension: usize) -> Result<(), Vec<FemError>> {
        let mut problems = self.index_problems();
        problems.extend(self.coordinate_problems());
        if self.cells_of_dimension(dimension).is_empty() {
            problems.push(FemError::NoElements { dimension });
        }
        if problems.is_empty() {
            problems.extend(self.unused_nodes(dimension));
            if dimension == 3 {
                problems.extend(self.inverted_elements());
            }
        }
        if problems.is_empty() { Ok(()) } else { Err(problems) }
    }

    /// Turns over the linear tetrahedra that are numbered in mirror image (negative volume), and
    /// returns how many.
    pub fn repair(&mut self) -> usize {
        let mut turned = 0;
        for block in &mut self.blocks {
            if block.kind != ElementKind::Tet4 {
                continue;
            }
            for nodes in block.nodes.chunks_exact_mut(4) {
                if smallest_volume(ElementKind::Tet4, nodes, &self.points).is_some_and(|volume| volume < 0.0)
                {
                    nodes.swap(1, 2);
                    turned += 1;
                }
            }
        }
        turned
    }

    fn index_problems(&self) -> Vec<FemError> {
        let mut problems = Vec::new();
        for (index, block) in self.blocks.iter().enumerate() {
            let arity = block.kind.node_count();
            if !block.nodes.len().is_multiple_of(arity) {
                let length = block.nodes.len();
                problems.push(FemError::BlockLength { block: index, kind: block.kind, length, arity });
            }
        }
        let mut first = 0;
        for block in &self.blocks {
            let available = self.points.len();
            if let Some(at) = block.nodes.iter().position(|&node| node as usize >= available) {
                problems.push(FemError::OutOfRange {
                    what: "element",
                    index: first + at / block.kind.node_count(),
                    target: "node",
                    value: block.nodes[at] as usize,
                    available,
                });
            }
            first += block.count();
        }
        for (index, region) in self.regions.iter().enumerate() {
            if let Some(&cell) = region.elements.iter().find(|&&cell| cell as usize >= first) {
                problems.push(FemError::OutOfRange {
                    what: "region",
                    index,
                    target: "element",
                    value: cell as usize,
                    available: first,
                });
            }
        }
        problems
    }

    fn coordinate_problems(&self) -> Option<FemError> {
        let bad = |node: &usize| self.points[*node].iter().any(|value| !value.is_finite());
        let nodes: Vec<u32> = (0..self.points.len()).filter(bad).map(|node| node as u32).collect();
        let first = nodes.iter().copied().take(NAMED).collect();
        (!nodes.is_empty()).then_some(FemError::NotFinite { count: nodes.len(), first })
    }

    fn unused_nodes(&self, dimension: usize) -> Option<FemError> {
        let mut used = vec![false; self.points.len()];
        for block in self.blocks.iter().filter(|block| block.kind.dimension() == dimension) {
            for &node in &block.nodes {
                used[node as usize] = true;
            }
        }
        let count = used.iter().filter(|used| !**used).count();
        let first = (0..used.len()).filter(|&node| !used[node]).map(|node| node as u32).take(NAMED).collect();
        (count > 0).then_some(FemError::Unused { count, total: used.len(), first })
    }

    fn inverted_elements(&self) -> Option<FemError> {
        let (mut first_cell, mut count, mut total) = (0, 0, 0);
        let mut first = Vec::new();
        for block in &self.blocks {
            if block.kind.dimension() == 3 {
                total += block.count();
                for (index, nodes) in block.nodes.chunks_exact(block.kind.node_count()).enumerate() {
                    let Some(volume) = smallest_volume(block.kind, nodes, &self.points) else { continue };
                    if volume <= volume_of_round_off(nodes.iter().map(|&node| self.points[node as usize])) {
                        count += 1;
                        if first.len() < NAMED {
                            first.push((first_cell + index, volume));
                        }
                    }
                }
            }
            first_cell += block.count();
        }
        (count > 0).then_some(FemError::Inverted { count, total, first })
    }
}

/// Reference volume × the smallest Jacobian determinant at the quadrature points, m³: the volume of
/// a linear tetrahedron, and for others its sign says whether the element is sound.
fn smallest_volume(kind: ElementKind, nodes: &[u32], points: &[[f64; 3]]) -> Option<f64> {
    kind.visit_solid(SmallestVolume { nodes, points })
}

struct SmallestVolume<'a> {
    nodes: &'a [u32],
    points: &'a [[f64; 3]],
}

impl SolidVisitor for SmallestVolume<'_> {
    type Output = f64;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> f64 {
        let x: [[f64; 3]; N] = std::array::from_fn(|a| self.points[self.nodes[a] as usize]);
        let rule = E::rule();
        let volume: f64 = rule.iter().map(|(_, weight)| weight).sum();
        let jacobians =
            rule.iter().map(|&(xi, _)| determinant(&E::reference_gradient(&x, &E::gradients(xi))));
        volume * jacobians.fold(f64::INFINITY, f64::min)
    }
}

/// A volume that the round-off of an element with these nodes leaves of none, m³: that of products of its
/// size, and that of its coordinates, which may be much larger.
pub(crate) fn volume_of_round_off(mut nodes: impl Iterator<Item = [f64; 3]>) -> f64 {
    let Some(origin) = nodes.next() else { return 0.0 };
    let largest = |v: [f64; 3]| v.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
    let (mut size, mut reach) = (0.0_f64, largest(origin));
    for x in nodes {
        size = size.max(largest([0, 1, 2].map(|i| x[i] - origin[i])));
        reach = reach.max(largest(x));
    }
    (1e-14 * size + f64::EPSILON * reach) * size * size
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoxMesh, ElementBlock};

    fn cube() -> Mesh {
        BoxMesh { size: [1.0; 3], cells: [1; 3], element: ElementKind::Tet4, origin: [0.0; 3] }
            .build()
            .unwrap()
    }

    #[test]
    fn all_problems_are_reported_at_once() {
        let mut mesh = cube();
        mesh.points[3][1] = f64::NAN;
        mesh.blocks.push(ElementBlock { kind: ElementKind::Tet4, nodes: vec![0, 1, 2, 99] });
        mesh.regions[0].elements.push(4000);
        let problems = mesh.check(3).unwrap_err();
        assert_eq!(problems.len(), 3, "{problems:?}");
        assert!(problems.iter().any(|problem| problem.to_string().contains("node 99 is out of range")));
    }

    #[test]
    fn inverted_and_flat_elements_are_named_with_their_volume() {
        let mut mesh = cube();
        mesh.blocks[0].nodes.swap(0, 1);
        mesh.points.push([0.5; 3]);
        let problems = mesh.check(3).unwrap_err();
        assert!(matches!(&problems[0], FemError::Unused { count: 1, first, .. } if first == &[8]));
        match &problems[1] {
            FemError::Inverted { count: 1, total: 6, first } => {
                assert_eq!(first[0].0, 0);
                assert!((first[0].1 + 1.0 / 6.0).abs() < 1e-15);
            }
            other => panic!("{other:?}"),
        }
        mesh.points.pop();
        assert_eq!(mesh.repair(), 1);
        mesh.check(3).unwrap();
    }

    #[test]
    fn a_surface_is_no_solid() {
        let mesh = Mesh {
            points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            blocks: vec![ElementBlock { kind: ElementKind::Tri3, nodes: vec![0, 1, 2] }],
            regions: vec![],
        };
        assert!(mesh.check(3).unwrap_err()[0].to_string().contains("volume elements"));
        mesh.check(2).unwrap();
    }

    #[test]
    fn an_unknown_region_lists_those_there_are() {
        let message = cube().region_nodes("clamp").unwrap_err().to_string();
        assert!(message.contains("'clamp'") && message.contains("x-min"), "{message}");
    }
}
