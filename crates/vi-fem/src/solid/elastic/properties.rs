//! Tests properties of elements on random meshes: jittered boxes with renumbered nodes and shuffled elements, with
//! every registered element and law. `PROPTEST_CASES=10000` draws more samples.

use proptest::prelude::*;
use vi_core::{Potential, packed_len};

use super::elastic_on;
use crate::lanes::instructions::InstructionSet;
use crate::solid::element::SOLIDS;
use crate::solid::material::Law;
use crate::solid::material::properties::law;
use vi_mesh::{BoxMesh, Mesh};

/// A mesh and a deformation of it.
#[derive(Debug, Clone)]
struct Body {
    mesh: Mesh,
    x: Vec<[f64; 3]>,
}

/// Draws a permutation of 0..count.
fn shuffled(count: usize) -> impl Strategy<Value = Vec<u32>> {
    Just((0..count as u32).collect::<Vec<_>>()).prop_shuffle()
}

fn body() -> impl Strategy<Value = Body> {
    let kind = (0..SOLIDS.len()).prop_map(|index| SOLIDS[index]);
    (kind, prop::array::uniform3(1_u32..4)).prop_flat_map(|(element, cells)| {
        let size = cells.map(f64::from);
        let mesh = BoxMesh { size, cells, element, origin: [0.0; 3] }.build().unwrap();
        let count = mesh.points.len();
        let jitter = |size: f64| prop::collection::vec(prop::array::uniform3(-size..size), count);
        let affine = prop::array::uniform3(prop::array::uniform3(-0.15..0.15));
        (Just(mesh), jitter(0.04), jitter(0.02), affine).prop_map(|(mut mesh, rest, moved, affine)| {
            for (point, by) in mesh.points.iter_mut().zip(rest) {
                *point = [0, 1, 2].map(|i| point[i] + by[i]);
            }
            let x = mesh.points.iter().zip(moved).map(|(point, by)| {
                [0, 1, 2].map(|i| point[i] + by[i] + (0..3).map(|j| affine[i][j] * point[j]).sum::<f64>())
            });
            let x = x.collect();
            Body { mesh, x }
        })
    })
}

/// Returns the body with node a renumbered to `number[a]` and its elements in the order `order`.
fn renumbered(body: &Body, number: &[u32], order: &[u32]) -> Body {
    let mut other = body.clone();
    for (a, &b) in number.iter().enumerate() {
        other.mesh.points[b as usize] = body.mesh.points[a];
        other.x[b as usize] = body.x[a];
    }
    let solids = body.mesh.cells_of_dimension(3);
    let mut cells = order.iter().filter_map(|&k| body.mesh.cell(solids[k as usize] as usize)).peekable();
    let kind = cells.peek().unwrap().0;
    let nodes = cells.flat_map(|(_, nodes)| nodes.iter().map(|&node| number[node as usize])).collect();
    other.mesh.blocks = vec![vi_mesh::CellBlock { kind, nodes }];
    other.mesh.regions.clear();
    other
}

/// Energies, gradients and packed Hessians of a range of stencils.
type Blocks = [Vec<f64>; 3];

fn blocks(potential: &dyn Potential, range: std::ops::Range<usize>, body: &Body) -> Blocks {
    let (x, size) = (body.x.as_flattened(), potential.stencils().size());
    let mut blocks = [1, size, packed_len(size)].map(|length| vec![f64::NAN; range.len() * length]);
    potential.energies(range.clone(), x, 0.0, &mut blocks[0]);
    potential.gradients(range.clone(), x, 0.0, &mut blocks[1]);
    potential.hessians(range, x, 0.0, &mut blocks[2]);
    blocks
}

fn potential(set: InstructionSet, body: &Body, law: &Law) -> Option<Box<dyn Potential>> {
    let elements = body.mesh.cells_of_dimension(3);
    elastic_on(set, &body.mesh, &elements, law, 0, "test").ok().map(|mut terms| terms.remove(0))
}

proptest! {
    #![proptest_config(crate::fixed_seed())]

    /// Any range on any instruction set gives the same as scalar arithmetic, up to round-off.
    #[test]
    fn lanes_do_what_one_number_does(
        body in body(), law in law(), first in any::<prop::sample::Index>(), last in any::<prop::sample::Index>(),
    ) {
        let scalar = potential(InstructionSet::Scalar, &body, &law).unwrap();
        let count = scalar.stencils().count();
        let (first, last) = (first.index(count), last.index(count));
        let range = first.min(last)..first.max(last) + 1;
        let expected = blocks(scalar.as_ref(), range.clone(), &body);
        let stiffness = expected[2].iter().fold(0.0_f64, |largest, k| largest.max(k.abs()));
        prop_assume!(expected.iter().flatten().all(|value| value.is_finite()));
        for set in [InstructionSet::Scalar, InstructionSet::Avx2, InstructionSet::Avx512] {
            let Some(lanes) = potential(set, &body, &law) else { continue };
            let found = blocks(lanes.as_ref(), range.clone(), &body);
            for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                prop_assert!((found - expected).abs() <= 1e-12 * stiffness, "{set:?}: {found} but {expected}");
            }
            // The results do not depend on the range, to the bit.
            let all = blocks(lanes.as_ref(), 0..count, &body);
            for (part, all) in found.iter().zip(&all) {
                let length = part.len() / range.len();
                prop_assert_eq!(&part[..], &all[range.start * length..range.end * length]);
            }
        }
    }

    /// Results do not depend on the numbering of nodes or the order of elements.
    #[test]
    fn numbering_is_no_physics(
        (body, number, order) in body().prop_flat_map(|body| {
            let (nodes, cells) = (body.mesh.points.len(), body.mesh.cells_of_dimension(3).len());
            (Just(body), shuffled(nodes), shuffled(cells))
        }),
        law in law(),
    ) {
        let sum = |body: &Body| {
            let term = potential(InstructionSet::Best, body, &law).unwrap();
            let count = term.stencils().count();
            let [energies, gradients, hessians] = blocks(term.as_ref(), 0..count, body);
            let mut force = vec![[0.0; 3]; body.x.len()];
            for (entry, gradient) in gradients.chunks_exact(3).enumerate() {
                let node = term.stencils().nodes[entry] as usize;
                force[node] = [0, 1, 2].map(|i| force[node][i] + gradient[i]);
            }
            let stiffness = hessians.iter().fold(0.0_f64, |largest, k| largest.max(k.abs()));
            (energies.iter().sum::<f64>(), force, stiffness)
        };
        let other = renumbered(&body, &number, &order);
        let ((energy, force, stiffness), (other_energy, other_force, _)) = (sum(&body), sum(&other));
        prop_assume!(energy.is_finite());
        prop_assert!((energy - other_energy).abs() <= 1e-12 * stiffness);
        for (a, force) in force.iter().enumerate() {
            for i in 0..3 {
                let off = force[i] - other_force[number[a] as usize][i];
                prop_assert!(off.abs() <= 1e-12 * stiffness, "node {}: {:e} of {:e} N/m", a, off, stiffness);
            }
        }
    }
}
