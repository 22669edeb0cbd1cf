//! Checks whether the cells of a mesh can carry elements.

use vi_mesh::{CellKind, Mesh, MeshError, volume_of_round_off};

use crate::small::tensor::determinant;
use crate::solid::element::contract::{Element, SolidVisitor};
use crate::solid::element::visit_solid;

/// Number of inverted elements that an error lists.
const NAMED: usize = 5;

/// Checks that the cells of `dimension` form a body: 3 for a solid, 2 for a sheet.
///
/// # Errors
/// Returns every problem found: those of [`Mesh::check`], and solid elements whose Jacobian is not positive at every
/// quadrature point.
pub fn check_body(mesh: &Mesh, dimension: usize) -> Result<(), Vec<MeshError>> {
    let mut problems = mesh.check(dimension).err().unwrap_or_default();
    let can_be_measured = problems.iter().all(|problem| matches!(problem, MeshError::Unused { .. }));
    if can_be_measured && dimension == 3 {
        problems.extend(inverted_elements(mesh));
    }
    if problems.is_empty() { Ok(()) } else { Err(problems) }
}

fn inverted_elements(mesh: &Mesh) -> Option<MeshError> {
    let (mut first_cell, mut count, mut total) = (0, 0, 0);
    let mut first = Vec::new();
    for block in &mesh.blocks {
        if block.kind.dimension() == 3 {
            total += block.cell_count();
            for (index, nodes) in block.cells().enumerate() {
                let Some(volume) = smallest_volume(block.kind, nodes, &mesh.points) else { continue };
                if volume <= volume_of_round_off(nodes.iter().map(|&node| mesh.points[node as usize])) {
                    count += 1;
                    if first.len() < NAMED {
                        first.push((first_cell + index, volume));
                    }
                }
            }
        }
        first_cell += block.cell_count();
    }
    (count > 0).then_some(MeshError::Inverted { count, total, first })
}

/// Returns the reference volume × the smallest Jacobian determinant at the quadrature points, m³. For a linear
/// tetrahedron this is its volume; for other elements a positive sign tells that the element is valid.
fn smallest_volume(kind: CellKind, nodes: &[u32], points: &[[f64; 3]]) -> Option<f64> {
    visit_solid(kind, SmallestVolume { nodes, points })
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

#[cfg(test)]
mod tests {
    use super::*;
    use vi_mesh::BoxMesh;

    #[test]
    fn inverted_elements_are_named_with_their_volume_beside_other_problems() {
        let shape = BoxMesh { size: [1.0; 3], cells: [1; 3], element: CellKind::Tet4, origin: [0.0; 3] };
        let mut mesh = shape.build().unwrap();
        check_body(&mesh, 3).unwrap();
        mesh.blocks[0].nodes.swap(0, 1);
        mesh.points.push([0.5; 3]);
        let problems = check_body(&mesh, 3).unwrap_err();
        assert!(matches!(&problems[0], MeshError::Unused { count: 1, first, .. } if first == &[8]));
        match &problems[1] {
            MeshError::Inverted { count: 1, total: 6, first } => {
                assert_eq!(first[0].0, 0);
                assert!((first[0].1 + 1.0 / 6.0).abs() < 1e-15);
            }
            other => panic!("{other:?}"),
        }
        mesh.points.pop();
        assert_eq!(mesh.repair(), 1);
        check_body(&mesh, 3).unwrap();
    }
}
