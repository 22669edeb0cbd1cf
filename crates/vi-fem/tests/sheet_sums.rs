//! Tests that the forces that a sheet sums over runs of triangles are the sums of those of single triangles.

use vi_core::{Padded, Patch, Potential};
use vi_fem::{Bending, Sheet, SheetLaw};
use vi_mesh::{Mesh, SheetMesh, SheetPattern};

/// Returns an irregular sheet, flat or curved.
fn mesh(cells: [u32; 2], height: f64) -> Mesh {
    let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let pattern = SheetPattern::Random;
    let sheet = SheetMesh { size: [1.0, 0.8], cells, pattern, seed: 3, origin: [0.0; 3], directions };
    let mut mesh = sheet.build().unwrap();
    for p in &mut mesh.points {
        p[2] = height * (p[0] * p[0] - 0.7 * p[1] * p[1] + 0.5 * p[0] * p[1]);
    }
    mesh
}

/// Returns positions in which the part beyond x = ½ is folded back, so that hinges are far from rest.
fn folded(mesh: &Mesh) -> Vec<f64> {
    let place = |(n, p): (usize, &[f64; 3])| {
        let ripple = |k: usize| 0.003 * ((3 * n + k) as f64 * 1.7).sin();
        let x = if p[0] > 0.5 { 0.5 - 0.9 * (p[0] - 0.5) } else { p[0] };
        let up = p[2] + 0.4 * (p[0] - 0.5).max(0.0) + 0.1 * (3.0 * p[1]).sin();
        [x + ripple(0), 1.05 * p[1] + ripple(1), up + ripple(2)]
    };
    mesh.points.iter().enumerate().flat_map(place).collect()
}

/// Returns the edges of the boundary with these nodes.
fn edges_where(mesh: &Mesh, inside: impl Fn(&[f64; 3]) -> bool) -> Vec<[u32; 2]> {
    let lines = mesh.cells_of_dimension(1);
    let nodes = lines.iter().filter_map(|&cell| mesh.cell(cell as usize));
    let edges = nodes.filter_map(|(_, nodes)| <[u32; 2]>::try_from(nodes).ok());
    edges.filter(|edge| edge.iter().all(|&node| inside(&mesh.points[node as usize]))).collect()
}

/// Returns the sums of the gradients of single stencils at the nodes.
fn block_sums(potential: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let stencils = potential.stencils();
    let mut blocks = vec![0.0; stencils.count() * stencils.size()];
    potential.gradients(0..stencils.count(), x, 0.0, &mut blocks);
    let mut sums = vec![0.0; x.len()];
    for (&node, block) in stencils.nodes.iter().zip(blocks.as_chunks::<3>().0) {
        for i in 0..3 {
            sums[3 * node as usize + i] += block[i];
        }
    }
    sums
}

/// Returns the sums of the runs of a potential.
fn run_sums(potential: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let (stencils, length) = (potential.stencils(), potential.run_length());
    assert!(potential.adds_gradients());
    let (mut points, mut sums) = (Patch::zeros(), Patch::zeros());
    for (point, &[a, b, c]) in points.iter_mut().zip(x.as_chunks::<3>().0) {
        *point = Padded([a, b, c, f64::NAN]);
    }
    for start in (0..stencils.count()).step_by(length) {
        let run = start..stencils.count().min(start + length);
        let nodes = &stencils.nodes[run.start * stencils.arity..run.end * stencils.arity];
        let places: Vec<u16> = nodes.iter().map(|&node| node as u16).collect();
        potential.add_gradients(run, 0.0, Patch { places: &places, x: &points, sums: &mut sums });
    }
    sums[..x.len() / 3].iter().flat_map(|sum| [sum.0[0], sum.0[1], sum.0[2]]).collect()
}

#[test]
fn runs_sum_what_the_blocks_are() {
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    // The larger mesh has several runs, the last of which are not full.
    for (cells, height) in [([5, 4], 0.0), ([5, 4], 0.4), ([33, 29], 0.4)] {
        let mesh = mesh(cells, height);
        let (x, elements) = (folded(&mesh), mesh.cells_of_dimension(2));
        let clamped = edges_where(&mesh, |p| p[0] == 0.0);
        let mirrored = edges_where(&mesh, |p| p[1] == 0.0);
        assert!(!clamped.is_empty() && !mirrored.is_empty());
        let mirrored: Vec<_> = mirrored.into_iter().map(|edge| (edge, [0.0, 1.0, 0.0])).collect();
        let bendings = Bending::ALL.iter().filter(|bending| **bending != Bending::Quadratic);
        for (law, &bending) in SheetLaw::examples()
            .into_iter()
            .flat_map(|law| bendings.clone().map(move |bending| (law.clone(), bending)))
        {
            let law = law.with_bending(bending);
            let sheet = Sheet {
                clamped: &clamped,
                mirrored: &mirrored,
                ..Sheet::new(&mesh, &elements, &law, 0, "flag")
            };
            for potential in sheet.potentials().unwrap() {
                let (blocks, runs) = (block_sums(&*potential, &x), run_sums(&*potential, &x));
                let differences: Vec<f64> = blocks.iter().zip(&runs).map(|(a, b)| a - b).collect();
                let (error, size) = (largest(&differences), largest(&blocks));
                let what = format!("{cells:?} {} {law:?}", potential.name());
                assert!(size > 0.0 && error <= 1e-12 * size, "{what}: {error:e} of {size:e}");
            }
        }
    }
}
