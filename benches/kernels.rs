//! Benchmarks element kernels of every law, gather, Hessian, factor, solve, whole steps, and writing VTU files, on
//! the cantilever P1 (docs/performance.md) with n = 4, 8, 16: `cargo bench --bench kernels`. Select a part by its
//! name: `cargo bench --bench kernels -- step/stormer-verlet`.

use std::hint::black_box;
use std::io::Cursor;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use variational::io::{VtuArray, VtuFrame, VtuOptions, VtuValues, encode_vtu};
use variational::mesh::{CellBlock, CellKind};
use variational::prelude::*;
use variational::solvers::{Assembler, Factor, HessianEvaluation};

const SIZES: [u32; 3] = [4, 8, 16];

fn block(n: u32, law: Law, scheme: SchemeName, step: f64) -> Simulation {
    let mesh =
        BoxMesh { size: [1.0, 0.25, 0.25], cells: [4 * n, n, n], element: CellKind::Tet4, origin: [0.0; 3] };
    let scene = Scene::new(Time::new(1.0, step, scheme))
        .gravity([0.0, -9.81, 0.0])
        .body(Body::from_box("block", mesh, law))
        .fix(Fix::region("block", "x-min"));
    match Simulation::new(scene) {
        Ok(simulation) => simulation,
        Err(problems) => panic!("{problems:?}"),
    }
}

fn st_venant_kirchhoff() -> Law {
    Law::StVenantKirchhoff(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 })
}

/// Takes ten samples in a second: this resolves differences of a few per cent, and all benchmarks take minutes.
fn quick(group: &mut BenchmarkGroup<'_, WallTime>) {
    group.sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
}

/// Forces and Hessians of all elements on one thread, without the sums over nodes.
fn elements(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("elements");
    quick(&mut group);
    for n in SIZES {
        for law in Law::examples() {
            let name = law.name();
            let simulation = block(n, law, SchemeName::StormerVerlet, 1e-4);
            let component = &simulation.components()[0];
            let (system, state) = (component.system(), component.state());
            let x = system.positions(state);
            let elastic = &system.potentials()[0];
            let (count, size) = (elastic.stencils().count(), elastic.stencils().size());
            group.throughput(Throughput::Elements(count as u64));
            let mut gradients = vec![0.0; count * size];
            group.bench_function(BenchmarkId::new(format!("force/{name}"), n), |bencher| {
                bencher.iter(|| elastic.gradients(0..count, black_box(&x), 0.0, &mut gradients));
            });
            let mut hessians = vec![0.0; count * size * (size + 1) / 2];
            group.bench_function(BenchmarkId::new(format!("hessian/{name}"), n), |bencher| {
                bencher.iter(|| elastic.hessians(0..count, black_box(&x), 0.0, &mut hessians));
            });
        }
    }
    group.finish();
}

/// Complete gradients and Hessians, sums included, and the linear algebra of an implicit step.
fn assembly(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("assembly");
    quick(&mut group);
    for n in SIZES {
        let law = st_venant_kirchhoff();
        let simulation = block(n, law, SchemeName::StormerVerlet, 1e-4);
        let component = &simulation.components()[0];
        let (system, state) = (component.system(), component.state());
        let x = system.positions(state);
        let mut assembler = Assembler::new(system);
        let mut gradient = vec![0.0; x.len()];
        group.bench_function(BenchmarkId::new("gradient", n), |bencher| {
            bencher.iter(|| assembler.gradient(black_box(&x), 0.0, &mut gradient));
        });
        group.bench_function(BenchmarkId::new("hessian", n), |bencher| {
            bencher.iter(|| {
                assembler.hessian(black_box(&x), 0.0, HessianEvaluation::Exact).unwrap();
            });
        });
        let stiffness = assembler.hessian(&x, 0.0, HessianEvaluation::Exact).unwrap();
        let (mass, c) = (system.free_mass(), 0.25e-4);
        let mut factor = match Factor::new(stiffness) {
            Ok(factor) => factor,
            Err(error) => panic!("{error}"),
        };
        group.bench_function(BenchmarkId::new("factor", n), |bencher| {
            bencher.iter(|| factor.factorize(mass, c, black_box(stiffness)));
        });
        let rhs = vec![1.0; mass.len()];
        let mut solution = rhs.clone();
        group.bench_function(BenchmarkId::new("solve", n), |bencher| {
            bencher.iter(|| {
                solution.copy_from_slice(&rhs);
                factor.solve(black_box(&mut solution))
            });
        });
    }
    group.finish();
}

/// Steps of complete schemes.
fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    quick(&mut group);
    for n in SIZES {
        for (name, scheme, step) in [
            ("stormer-verlet", SchemeName::StormerVerlet, 1.0 / (260.0 * f64::from(n))),
            ("blanes-moan-4", SchemeName::BlanesMoan4, 1.0 / (170.0 * f64::from(n))),
            ("implicit-midpoint", SchemeName::ImplicitMidpoint, 0.01),
        ] {
            let law = st_venant_kirchhoff();
            let mut simulation = block(n, law, scheme, step);
            group.bench_function(BenchmarkId::new(name, n), |bencher| bencher.iter(|| simulation.step()));
        }
    }
    group.finish();
}

/// Writes a frame with displacements into memory.
fn output(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("output");
    quick(&mut group);
    for n in SIZES {
        let simulation = block(n, st_venant_kirchhoff(), SchemeName::StormerVerlet, 1e-4);
        let mesh = &simulation.bodies()[0].mesh;
        let nodes = simulation.components()[0].system().potentials()[0].stencils().nodes.to_vec();
        let blocks = [CellBlock { kind: CellKind::Tet4, nodes }];
        let displacement: Vec<f64> = mesh.points.iter().flatten().map(|x| 1e-2 * (7.0 * x).sin()).collect();
        let arrays =
            [VtuArray { name: "displacement", components: 3, values: VtuValues::Real(&displacement) }];
        let frame =
            VtuFrame { points: &mesh.points, blocks: &blocks, point_data: &arrays, ..VtuFrame::default() };
        let mut file = Cursor::new(Vec::new());
        group.bench_function(BenchmarkId::new("vtu", n), |bencher| {
            bencher.iter(|| {
                file.set_position(0);
                encode_vtu(&mut file, black_box(&frame), VtuOptions::default())
            });
        });
    }
    group.finish();
}

criterion_group!(kernels, elements, assembly, steps, output);
criterion_main!(kernels);
