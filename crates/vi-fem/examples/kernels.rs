//! Measures the element kernels: ns per element for energy, gradient, gradient summed at the nodes, Hessian and
//! projected Hessian, for each law and instruction set. It uses one thread and asks for chunks, as an assembler does.
//!
//! `cargo run --release -p vi-fem --example kernels [cells across, 16] [element, tet4]`

use std::cell::RefCell;
use std::time::Instant;

use vi_core::{Padded, Patch, PatchArray, Stencils, packed_len};
use vi_fem::{InstructionSet, Law, elastic_on};
use vi_mesh::{BoxMesh, CellKind};

/// Number of elements per call: their blocks stay in the second-level cache.
const CHUNK: usize = 1024;
/// Number of repetitions of each measurement.
const PASSES: usize = 7;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let n: u32 = arguments.next().map_or(16, |n| n.parse().expect("a number of cells"));
    let element = arguments.next().map_or(CellKind::Tet4, |name| {
        *CellKind::ALL.iter().find(|kind| kind.name() == name).expect("an element")
    });
    let mesh = BoxMesh { size: [1.0, 0.25, 0.25], cells: [4 * n, n, n], element, origin: [0.0; 3] };
    let mesh = mesh.build().expect("a box");
    let elements = mesh.cells_of_dimension(3);
    let wave = |value: f64, i: usize| value + 2e-3 * (9.0 * value + 2.0 * i as f64).sin() / f64::from(n);
    let x: Vec<f64> =
        mesh.points.iter().flatten().enumerate().map(|(i, &value)| wave(value, i % 3)).collect();
    println!("{} elements {element}, ns per element (least of {PASSES} passes)", elements.len());
    println!(
        "{:22} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}",
        "law", "set", "energy", "gradient", "summed", "Hessian", "projected", "mean F"
    );
    for law in Law::examples() {
        for set in [InstructionSet::Scalar, InstructionSet::Avx2, InstructionSet::Avx512] {
            let Ok(potentials) = elastic_on(set, &mesh, &elements, &law, 0, "box") else { continue };
            let potential = &potentials[0];
            let (count, size) = (potential.stencils().count(), potential.stencils().size());
            let mut out = vec![0.0; CHUNK * packed_len(size)];
            // Take the least time of each chunk over the passes, which removes the load of other programs.
            let mut time = |work: &dyn Fn(std::ops::Range<usize>, &mut [f64])| {
                let mut least = vec![f64::INFINITY; count.div_ceil(CHUNK)];
                for _ in 0..PASSES {
                    for (chunk, least) in least.iter_mut().enumerate() {
                        let first = chunk * CHUNK;
                        let start = Instant::now();
                        work(first..count.min(first + CHUNK), &mut out);
                        *least = least.min(start.elapsed().as_secs_f64());
                    }
                }
                least.iter().sum::<f64>() / count as f64 * 1e9
            };
            let patches: Vec<PatchOfChunk> = (0..count.div_ceil(CHUNK))
                .map(|chunk| {
                    PatchOfChunk::new(potential.stencils(), chunk * CHUNK..count.min((chunk + 1) * CHUNK), &x)
                })
                .collect();
            let sums = RefCell::new(Patch::zeros());
            let figures = [
                time(&|range, out| potential.energies(range, &x, 0.0, out)),
                time(&|range, out| potential.gradients(range, &x, 0.0, out)),
                time(&|range, _| {
                    let PatchOfChunk { places, x } = &patches[range.start / CHUNK];
                    let mut sums = sums.borrow_mut();
                    potential.add_gradients(range, 0.0, Patch { places, x, sums: &mut sums });
                }),
                time(&|range, out| potential.hessians(range, &x, 0.0, out)),
                time(&|range, out| potential.projected_hessians(range, &x, 0.0, out)),
                time(&|range, out| {
                    potential.mean_deformations(range, &x, out);
                }),
            ];
            print!("{:22} {:>8}", law.name(), format!("{set:?}").to_lowercase());
            figures.iter().for_each(|figure| print!(" {figure:8.2}"));
            println!();
        }
    }
}

/// The nodes of a chunk, stored contiguously.
struct PatchOfChunk {
    places: Vec<u16>,
    x: Box<PatchArray>,
}

impl PatchOfChunk {
    fn new(stencils: Stencils<'_>, range: std::ops::Range<usize>, x: &[f64]) -> Self {
        let nodes = &stencils.nodes[range.start * stencils.arity..range.end * stencils.arity];
        let mut own = nodes.to_vec();
        own.sort_unstable();
        own.dedup();
        let place = |node: &u32| own.binary_search(node).expect("a node of the chunk") as u16;
        let point = |node: &u32| {
            let at = 3 * *node as usize;
            Padded([x[at], x[at + 1], x[at + 2], 0.0])
        };
        let mut x = Patch::zeros();
        x.iter_mut().zip(&own).for_each(|(x, node)| *x = point(node));
        Self { places: nodes.iter().map(place).collect(), x }
    }
}
