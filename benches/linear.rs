//! Measures assembly and linear algebra on a clamped beam of 6 · 4n³ StVK tetrahedra, as the least of several passes:
//! energy, gradient and Hessian compared with their kernels alone, product, factor, solve, conjugate gradients. Uses
//! one thread and then two.
//!
//! `cargo bench --bench linear -- [cells across: 4 8 16] [step 0.01]`

use std::time::Instant;

use vi_core::{Coordinates, Fixed, Potential, Prescribed, System, packed_len};
use vi_fem::{Isotropic, Law, add_lumped_mass, elastic};
use vi_mesh::{BoxMesh, CellKind};
use vi_solvers::{Assembler, Factor, HessianEvaluation, Pcg, Preconditioner};

/// Number of passes of each measurement; the least time counts.
const PASSES: usize = 7;

/// Number of stencils per call of a kernel when it is timed alone.
const BATCH: usize = 64;

fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let step: f64 = arguments.get(1).map_or(0.01, |step| step.parse().expect("a step"));
    // `cargo bench -- --test` only checks that it runs.
    let is_test = std::env::args().any(|argument| argument == "--test");
    let sizes = match arguments.first() {
        _ if is_test => vec![2],
        Some(n) => vec![n.parse().expect("a number of cells")],
        None => vec![4, 8, 16],
    };
    for n in sizes {
        let (system, x) = beam(n);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| measure(n, threads, step, &system, &x));
        }
    }
}

/// Returns the beam of the reference problem P1, 1 × 0.25 × 0.25 m, slightly bent.
fn beam(n: u32) -> (System, Vec<f64>) {
    let mesh =
        BoxMesh { size: [1.0, 0.25, 0.25], cells: [4 * n, n, n], element: CellKind::Tet4, origin: [0.0; 3] };
    let mesh = mesh.build().expect("a box");
    let elements = mesh.cells_of_dimension(3);
    let rest: Vec<f64> = mesh.points.iter().flatten().copied().collect();
    let mut masses = vec![0.0; mesh.points.len()];
    add_lumped_mass(&mesh, &elements, 1000.0, &mut masses).expect("masses");
    let law = Law::StVenantKirchhoff(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 });
    let terms = elastic(&mesh, &elements, &law, 0, "beam").expect("a law");
    let clamped: Vec<u32> = (0..rest.len() as u32).filter(|&dof| rest[dof as usize / 3 * 3] == 0.0).collect();
    let values = clamped.iter().map(|&dof| rest[dof as usize]).collect();
    let path = Prescribed { dofs: clamped, path: Box::new(Fixed(values)) };
    let coordinates = Coordinates::new(rest.len(), vec![path]).expect("coordinates");
    let mass = (0..rest.len()).map(|dof| masses[dof / 3]).collect();
    let system = System::new(mass, terms, coordinates).expect("a system");
    let x = rest.iter().enumerate().map(|(k, &value)| match k % 3 {
        1 => value - 0.05 * rest[k - 1].powi(2),
        _ => value,
    });
    let x = x.collect();
    (system, x)
}

/// Returns the least time of several passes, s.
fn least(mut pass: impl FnMut()) -> f64 {
    let mut timed = || {
        let start = Instant::now();
        pass();
        start.elapsed().as_secs_f64()
    };
    (0..PASSES).map(|_| timed()).fold(f64::INFINITY, f64::min)
}

fn kernel(
    potential: &dyn Potential,
    numbers: usize,
    mut evaluate: impl FnMut(std::ops::Range<usize>, &mut [f64]),
) -> f64 {
    let count = potential.stencils().count();
    let mut out = vec![0.0; BATCH * numbers];
    least(|| {
        for first in (0..count).step_by(BATCH) {
            let range = first..count.min(first + BATCH);
            let length = range.len() * numbers;
            evaluate(range, &mut out[..length]);
        }
    })
}

fn measure(n: u32, threads: usize, step: f64, system: &System, x: &[f64]) {
    let potential = system.potentials()[0].as_ref();
    let stencils = potential.stencils();
    let (count, size) = (stencils.count() as f64, stencils.size());
    let mut assembler = Assembler::new(system);
    let mut gradient = vec![0.0; x.len()];
    let each = |seconds: f64| seconds / count * 1e9;
    println!("\nn{n}, {count} tetrahedra, {threads} thread(s)");

    let alone = kernel(potential, 1, |range, out| potential.energies(range, x, 0.0, out));
    let time = least(|| {
        std::hint::black_box(assembler.energies(x, 0.0));
    });
    println!("  energy    {:7.1} ns per tet, kernel alone {:7.1}", each(time), each(alone));
    let alone = kernel(potential, size, |range, out| potential.gradients(range, x, 0.0, out));
    let time = least(|| assembler.gradient(x, 0.0, &mut gradient));
    println!("  gradient  {:7.1} ns per tet, kernel alone {:7.1}", each(time), each(alone));
    let alone = kernel(potential, packed_len(size), |range, out| potential.hessians(range, x, 0.0, out));
    let first = Instant::now();
    assembler.hessian(x, 0.0, HessianEvaluation::Exact).unwrap();
    let first = first.elapsed().as_secs_f64();
    let time = least(|| {
        assembler.hessian(x, 0.0, HessianEvaluation::Exact).unwrap();
    });
    println!(
        "  Hessian   {:7.1} ns per tet, kernel alone {:7.1}; pattern {:.1} ms",
        each(time),
        each(alone),
        first * 1e3
    );

    let k = assembler.hessian(x, 0.0, HessianEvaluation::Exact).unwrap();
    let mut rhs = vec![0.0; k.free_count()];
    system.coordinates().restrict(&gradient, &mut rhs);
    let mut out = rhs.clone();
    let mut places = vec![0.0; k.free_count()];
    system.coordinates().restrict(x, &mut places);
    let time = least(|| k.multiply(&rhs, &mut out));
    println!("  product   {:8.3} ms, {} entries", time * 1e3, k.nnz());

    let (mass, c) = (system.free_mass(), step * step / 4.0);
    let start = Instant::now();
    let mut factor = Factor::new(k).expect("an order");
    println!("  ordering  {:8.2} ms", start.elapsed().as_secs_f64() * 1e3);
    let time = least(|| factor.factorize(mass, c, k).expect("a positive definite matrix"));
    let facts = factor.facts();
    println!(
        "  factor    {:8.2} ms, {:.1} GF/s, {} entries, {} supernodes, {:.1} MB",
        time * 1e3,
        facts.flops / time * 1e-9,
        facts.nnz,
        facts.supernodes,
        facts.bytes as f64 * 1e-6
    );
    let mut residual = 0.0;
    let time = least(|| {
        out.copy_from_slice(&rhs);
        residual = factor.solve(&mut out).expect("a solution");
    });
    println!(
        "  solve     {:8.3} ms, {:.1} GB/s, residual {residual:.0e}",
        time * 1e3,
        facts.solve_bytes / time * 1e-9
    );

    for kind in [Preconditioner::BlockJacobi, Preconditioner::Ssor, Preconditioner::BlockIncompleteCholesky] {
        let mut pcg = Pcg::new(k, kind);
        let prepare = least(|| {
            pcg.prepare(mass, c, k, &places).expect("a positive definite matrix");
        });
        let mut iterations = 0;
        let time =
            least(|| iterations = pcg.solve(&rhs, &mut out, 1e-6, 10_000).expect("convergence").iterations);
        let facts = pcg.facts();
        println!(
            "  {kind:?}: prepare {:.2} ms, {:.2} ms for {iterations} iterations to 1e-6, {:.1} GB/s",
            prepare * 1e3,
            time * 1e3,
            facts.iteration_bytes * f64::from(iterations) / time * 1e-9
        );
    }
}
