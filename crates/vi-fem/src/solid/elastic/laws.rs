//! Tests the laws that the elastic potential must obey for every element with every material law. The registration
//! line of an element or a law also adds its tests.

use vi_core::{Padded, Patch, Potential, packed_len};

use super::elastic_on;
use crate::lanes::instructions::InstructionSet;
use crate::small::tensor::{Mat3, product};
use crate::solid::elastic::elastic;
use crate::solid::element::SOLIDS;
use crate::solid::material::Law;
use crate::solid::material::parameters::Isotropic;
use crate::solid::mean_dilation::mean_dilation;
use vi_mesh::{BoxMesh, CellKind, Mesh};

/// Returns a box of 2 × 2 × 2 cells whose inner nodes are moved, so that no two elements are alike.
pub(super) fn distorted(element: CellKind) -> Mesh {
    let mut mesh =
        BoxMesh { size: [1.0, 1.2, 0.9], cells: [2, 2, 2], element, origin: [0.0; 3] }.build().unwrap();
    for point in &mut mesh.points {
        let [x, y, z] = *point;
        // The displacement is zero on the surface, so that the body stays a box.
        let bubble = x * (1.0 - x) * y * (1.2 - y) * z * (0.9 - z);
        *point = [x + 0.9 * bubble, y - 1.1 * bubble, z + 0.8 * bubble];
    }
    mesh.check(3).unwrap();
    mesh
}

pub(super) fn potential(mesh: &Mesh, law: &Law) -> Box<dyn Potential> {
    elastic(mesh, &mesh.cells_of_dimension(3), law, 0, "test").unwrap().remove(0)
}

pub(super) fn flat(mesh: &Mesh, map: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<f64> {
    mesh.points.iter().flat_map(|&point| map(point)).collect()
}

pub(super) fn energy(potential: &dyn Potential, x: &[f64]) -> f64 {
    let mut out = vec![0.0; potential.stencils().count()];
    potential.energies(0..out.len(), x, 0.0, &mut out);
    out.iter().sum()
}

/// Returns the gradient blocks of all stencils.
pub(super) fn gradient_blocks(potential: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let stencils = potential.stencils();
    let mut out = vec![0.0; stencils.count() * stencils.size()];
    potential.gradients(0..stencils.count(), x, 0.0, &mut out);
    out
}

/// Returns ∂V/∂x, summed over the stencils.
fn gradient(potential: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let stencils = potential.stencils();
    let mut sum = vec![0.0; x.len()];
    for (block, stencil) in gradient_blocks(potential, x).chunks_exact(stencils.size()).zip(0..) {
        for (a, &node) in stencils.of(stencil).iter().enumerate() {
            for i in 0..3 {
                sum[3 * node as usize + i] += block[3 * a + i];
            }
        }
    }
    sum
}

pub(super) fn size_of(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

fn for_all(check: impl Fn(CellKind, &Mesh, &Law, &dyn Potential)) {
    for &kind in SOLIDS {
        let mesh = distorted(kind);
        for law in Law::examples() {
            check(kind, &mesh, &law, potential(&mesh, &law).as_ref());
            let cured = mean_dilation(&mesh, &mesh.cells_of_dimension(3), &law, 0, "mean dilation");
            check(kind, &mesh, &law, cured.unwrap().remove(0).as_ref());
        }
    }
}

pub(super) const STRETCH: Mat3<f64> = [[1.1, 0.05, -0.02], [0.03, 0.94, 0.04], [-0.01, 0.06, 1.07]];

pub(super) fn apply(f: &Mat3<f64>, x: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (0..3).map(|j| f[i][j] * x[j]).sum())
}

/// A smooth deformation with J > 0 that is not affine.
pub(super) fn bent(x: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = apply(&STRETCH, x);
    [a + 0.05 * (2.0 * b).sin(), b - 0.04 * c * c, c + 0.06 * a * b]
}

#[test]
fn patch_test_an_affine_map_is_in_balance_inside() {
    for_all(|kind, mesh, law, potential| {
        let x = flat(mesh, |point| apply(&STRETCH, point));
        let force = gradient(potential, &x);
        let scale = size_of(&gradient_blocks(potential, &x));
        let boundary: Vec<u32> = ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"]
            .iter()
            .flat_map(|name| mesh.region_nodes(name).unwrap())
            .collect();
        let mut inside = 0;
        for node in (0..mesh.points.len()).filter(|&node| !boundary.contains(&(node as u32))) {
            inside += 1;
            let residual = size_of(&force[3 * node..3 * node + 3]);
            assert!(residual <= 1e-12 * scale, "{kind} {}: {residual:e} of {scale:e}", law.name());
        }
        assert!(inside > 0);
    });
}

#[test]
fn the_energy_of_an_affine_map_is_exact() {
    for_all(|kind, mesh, law, potential| {
        let x = flat(mesh, |point| apply(&STRETCH, point));
        let cell = BoxMesh { size: [1.0; 3], cells: [1; 3], element: CellKind::Tet4, origin: [0.0; 3] };
        let cube = cell.build().unwrap();
        let density =
            energy(self::potential(&cube, law).as_ref(), &flat(&cube, |point| apply(&STRETCH, point)));
        let found = energy(potential, &x) / (1.0 * 1.2 * 0.9);
        assert!((found / density - 1.0).abs() < 1e-12, "{kind} {}: {found} {density}", law.name());
    });
}

#[test]
fn gradients_and_hessians_are_derivatives() {
    for_all(|kind, mesh, law, potential| {
        let x = flat(mesh, bent);
        let stencils = potential.stencils();
        let size = stencils.size();
        // Test one stencil, and each of its coordinates.
        let stencil = stencils.count() / 2;
        let value = |x: &[f64]| {
            let (mut energy, mut gradient) = ([0.0], vec![0.0; size]);
            potential.energies(stencil..stencil + 1, x, 0.0, &mut energy);
            potential.gradients(stencil..stencil + 1, x, 0.0, &mut gradient);
            (energy[0], gradient)
        };
        let mut hessian = vec![0.0; packed_len(size)];
        potential.hessians(stencil..stencil + 1, &x, 0.0, &mut hessian);
        let (_, gradient) = value(&x);
        let (slope_scale, curve_scale) = (size_of(&gradient), size_of(&hessian));
        for local in 0..size {
            let dof = 3 * stencils.of(stencil)[local / 3] as usize + local % 3;
            let at = |by: f64| {
                let mut x = x.clone();
                x[dof] += by;
                value(&x)
            };
            let e = 1e-4;
            let ([a, b], [c, d]) = ([at(e), at(-e)], [at(2.0 * e), at(-2.0 * e)]);
            let slope = (8.0 * (a.0 - b.0) - (c.0 - d.0)) / (12.0 * e);
            let error = (gradient[local] - slope).abs();
            assert!(error < 1e-7 * slope_scale, "{kind} {}: gradient {local}: {error:e}", law.name());
            for row in local..size {
                let slope = (8.0 * (a.1[row] - b.1[row]) - (c.1[row] - d.1[row])) / (12.0 * e);
                let error = (hessian[row * (row + 1) / 2 + local] - slope).abs();
                assert!(
                    error < 1e-7 * curve_scale,
                    "{kind} {}: Hessian {row} {local}: {error:e}",
                    law.name()
                );
            }
        }
    });
}

#[test]
fn rigid_motions_do_no_work() {
    let (s, c) = (0.6, 0.8);
    let rotations: [Mat3<f64>; 3] = [
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        product(&[[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], &[[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]),
    ];
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for_all(|kind, mesh, law, potential| {
        let modulus = 1e6;
        let turns = if matches!(law, Law::Linear(_)) { &[identity][..] } else { &rotations[..] };
        for turn in turns {
            let x = flat(mesh, |point| {
                let [a, b, c] = apply(turn, point);
                [a + 3.0, b - 1.0, c + 0.5]
            });
            let (energy, force) = (energy(potential, &x), size_of(&gradient_blocks(potential, &x)));
            assert!(energy.abs() <= 1e-14 * modulus, "{kind} {}: energy {energy:e}", law.name());
            assert!(force <= 1e-13 * modulus, "{kind} {}: force {force:e}", law.name());
        }
        // For any deformation the forces have no resultant, and no moment if the law is objective.
        let x = flat(mesh, bent);
        let force = gradient(potential, &x);
        let scale = size_of(&force);
        let (mut sum, mut moment) = ([0.0; 3], [0.0; 3]);
        for (f, x) in force.chunks_exact(3).zip(x.chunks_exact(3)) {
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                sum[i] += f[i];
                moment[i] += x[j] * f[k] - x[k] * f[j];
            }
        }
        assert!(size_of(&sum) <= 1e-12 * scale, "{kind} {}: {sum:?}", law.name());
        assert!(
            matches!(law, Law::Linear(_)) || size_of(&moment) <= 1e-12 * scale,
            "{kind} {}: {moment:?}",
            law.name()
        );
    });
}

#[test]
fn a_stencil_does_not_depend_on_the_range_it_is_asked_in() {
    for_all(|_, mesh, _, potential| {
        let x = flat(mesh, bent);
        let stencils = potential.stencils();
        let (count, size) = (stencils.count(), stencils.size());
        let (block, all) = (packed_len(size), gradient_blocks(potential, &x));
        let (mut energies, mut hessians) = (vec![0.0; count], vec![0.0; count * block]);
        potential.energies(0..count, &x, 0.0, &mut energies);
        potential.hessians(0..count, &x, 0.0, &mut hessians);
        for range in [0..1, count - 1..count, 0..count.min(3), count / 2..count, 1..count] {
            let mut gradients = vec![0.0; range.len() * size];
            potential.gradients(range.clone(), &x, 0.0, &mut gradients);
            assert_eq!(gradients, all[range.start * size..range.end * size]);
            let mut part = vec![0.0; range.len() * block];
            potential.hessians(range.clone(), &x, 0.0, &mut part);
            assert_eq!(part, hessians[range.start * block..range.end * block]);
            let mut part = vec![0.0; range.len()];
            potential.energies(range.clone(), &x, 0.0, &mut part);
            assert_eq!(part, energies[range]);
        }
    });
}

/// Returns ∂V/∂x of the stencils of `range` as the term itself sums it, with the nodes of the patch in reverse order.
fn patch_gradient(potential: &dyn Potential, range: std::ops::Range<usize>, x: &[f64]) -> Vec<f64> {
    let (stencils, count) = (potential.stencils(), x.len() / 3);
    let (mut points, mut sums) = (Patch::zeros(), Patch::zeros());
    for (point, &[a, b, c]) in points.iter_mut().zip(x.as_chunks::<3>().0.iter().rev()) {
        *point = Padded([a, b, c, f64::NAN]);
    }
    let nodes = range.clone().flat_map(|stencil| stencils.of(stencil));
    let places: Vec<u16> = nodes.map(|&node| (count - 1 - node as usize) as u16).collect();
    assert!(potential.adds_gradients());
    potential.add_gradients(range, 0.0, Patch { places: &places, x: &points, sums: &mut sums });
    sums[..count].iter().rev().flat_map(|sum| [sum.0[0], sum.0[1], sum.0[2]]).collect()
}

#[test]
fn a_patch_sums_what_the_blocks_are() {
    for &kind in SOLIDS {
        let mesh = distorted(kind);
        let x = flat(&mesh, bent);
        for law in Law::examples() {
            for set in [InstructionSet::Scalar, InstructionSet::Avx2, InstructionSet::Avx512] {
                let built = elastic_on(set, &mesh, &mesh.cells_of_dimension(3), &law, 0, "test");
                let Some(potential) = built.ok().map(|mut potentials| potentials.remove(0)) else { continue };
                let count = potential.stencils().count();
                let whole = gradient(potential.as_ref(), &x);
                let scale = size_of(&gradient_blocks(potential.as_ref(), &x));
                // Use ranges that begin and end inside groups of eight.
                let mut sum = vec![0.0; x.len()];
                for range in [0..0, 0..1, 1..count / 2, count / 2..count - 1, count - 1..count] {
                    let part = patch_gradient(potential.as_ref(), range, &x);
                    sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
                }
                let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-12 * scale;
                assert!(whole.iter().zip(&sum).all(close), "{kind} {} {set:?}", law.name());
            }
        }
    }
}

#[test]
fn instruction_sets_agree_to_round_off() {
    for &kind in SOLIDS {
        let mesh = distorted(kind);
        let x = flat(&mesh, bent);
        for law in Law::examples() {
            let blocks = |set| {
                let built = elastic_on(set, &mesh, &mesh.cells_of_dimension(3), &law, 0, "test");
                built.ok().map(|potentials| gradient_blocks(potentials[0].as_ref(), &x))
            };
            let scalar = blocks(InstructionSet::Scalar).unwrap();
            for set in [InstructionSet::Avx2, InstructionSet::Avx512] {
                let Some(lanes) = blocks(set) else { continue };
                let scale = size_of(&scalar);
                let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-12 * scale;
                assert!(scalar.iter().zip(&lanes).all(close), "{kind} {} {set:?}", law.name());
            }
        }
    }
}

#[test]
fn projected_hessians_are_positive_and_keep_what_is() {
    for_all(|kind, mesh, law, potential| {
        // Compress to a third, so that tangents have negative eigenvalues.
        let x = flat(mesh, |[x, y, z]| [0.35 * x, 1.05 * y, 0.95 * z]);
        let size = potential.stencils().size();
        let mut packed = vec![0.0; packed_len(size)];
        potential.projected_hessians(0..1, &x, 0.0, &mut packed);
        let matrix = nalgebra::DMatrix::from_fn(size, size, |i, j| {
            let (row, column) = (i.max(j), i.min(j));
            packed[row * (row + 1) / 2 + column]
        });
        let eigenvalues = matrix.symmetric_eigenvalues();
        assert!(
            eigenvalues.min() >= -1e-12 * eigenvalues.max(),
            "{kind} {}: {}",
            law.name(),
            eigenvalues.min()
        );
    });
}

#[test]
fn inverted_elements_are_reported_not_panicked_on() {
    let mesh = distorted(CellKind::Tet4);
    let x = flat(&mesh, |[x, y, z]| [-x, y, z]);
    let law = Law::NeoHookean(Isotropic { young: 1.0, poisson: 0.3, density: 1.0 });
    let potential = potential(&mesh, &law);
    assert_eq!(energy(potential.as_ref(), &x), f64::INFINITY);
    assert!(gradient_blocks(potential.as_ref(), &x).iter().any(|value| value.is_nan()));
    // Each stencil names its element, in whatever order the stencils are summed.
    let mut named: Vec<usize> = (0..potential.stencils().count())
        .map(|stencil| {
            let fault = potential.fault(stencil, &x, 0.0).unwrap();
            assert_eq!(fault.quantity, "det F");
            assert!((fault.value + 1.0).abs() < 1e-12);
            let (_, nodes) = mesh.cell(fault.element).unwrap();
            assert_eq!(nodes, potential.stencils().of(stencil));
            fault.element
        })
        .collect();
    named.sort_unstable();
    assert!(named.into_iter().eq(0..mesh.cells_of_dimension(3).len()));
    assert!(potential.fault(3, &flat(&mesh, |x| x), 0.0).is_none());
}

#[test]
fn mean_deformations_are_weighted_by_volume_and_stiffness() {
    for_all(|kind, mesh, _, potential| {
        let count = potential.stencils().count();
        let mut out = vec![0.0; 9 * count];
        assert!(potential.mean_deformations(0..count, &flat(mesh, |x| apply(&STRETCH, x)), &mut out));
        let sum = |k: usize| out.iter().skip(k).step_by(9).sum::<f64>();
        let weight = 2.0_f64.powi((sum(0) / (1.08 * STRETCH[0][0])).log2().round() as i32);
        for k in 0..9 {
            assert!((sum(k) / weight - 1.08 * STRETCH[k / 3][k % 3]).abs() < 1e-12, "{kind}");
        }
    });
}

/// Tests the energy at rest of the single tetrahedron of the reference cases, x₁ = (1.2, 0, 0).
#[test]
fn single_tetrahedron_energy() {
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let blocks = vec![vi_mesh::CellBlock { kind: CellKind::Tet4, nodes: vec![0, 1, 2, 3] }];
    let mesh = Mesh { points, blocks, regions: vec![] };
    let mut masses = vec![0.0; 4];
    crate::add_lumped_mass(&mesh, &[0], 6.0, &mut masses).unwrap();
    assert!(masses.iter().all(|mass| (mass - 0.25).abs() < 1e-16));
    // The kinetic energy of the velocities (3,3,−2), (−3,−1,1), (2,−1,2).
    let kinetic = 0.5 * 0.25 * (22.0 + 11.0 + 9.0);
    let x = [0.0, 0.0, 0.0, 1.2, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let parameters = Isotropic { young: 1000.0, poisson: 0.3, density: 6.0 };
    for (law, total) in [
        (Law::StVenantKirchhoff(parameters.clone()), 10.679487179487),
        (Law::NeoHookean(parameters), 9.263417035889),
    ] {
        let found = kinetic + energy(potential(&mesh, &law).as_ref(), &x);
        assert!((found - total).abs() < 1e-11, "{}: {found}", law.name());
    }
}
