//! Measures the cost of contact on one thread: two folded sheets of 20 000 triangles, half an activation distance apart.
//!
//! `cargo bench -p vi-contact --bench contact`; divide by the counts that are printed first.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use vi_contact::{Body, Contact, ContactPotential, Neighbours, StepSettings, Surface, SurfaceBuilder};
use vi_core::Potential;

/// Squares along a side.
const SQUARES: usize = 100;

/// Two waves of cloth, shifted by a third of an edge against each other.
fn sheets() -> (Surface, Vec<f64>) {
    let edge = 1.0 / SQUARES as f64;
    let distance = 0.1 * edge;
    let (mut x, mut bodies) = (Vec::new(), [Vec::new(), Vec::new()]);
    for (sheet, triangles) in bodies.iter_mut().enumerate() {
        let base = (x.len() / 3) as u32;
        let n = SQUARES + 1;
        for j in 0..n {
            for i in 0..n {
                let shift = 0.33 * sheet as f64;
                let (u, v) = ((i as f64 + shift) * edge, (j as f64 + shift) * edge);
                x.extend([u, v, 0.05 * (9.0 * u).sin() + 0.5 * distance * sheet as f64]);
            }
        }
        for j in 0..SQUARES {
            for i in 0..SQUARES {
                let node = |i: usize, j: usize| base + (i + j * n) as u32;
                let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let mut builder = SurfaceBuilder::new(&x);
    for triangles in &bodies {
        let body = builder.body(Body { radius: 0.0, distance, stiffness: 1e5, meets_itself: true });
        builder.triangles(body, triangles);
    }
    builder.friction(0.3);
    (builder.build().expect("a valid surface"), x)
}

fn contact(c: &mut Criterion) {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the first pool");
    let (surface, x) = sheets();
    let surface = std::sync::Arc::new(surface);
    let margin = 1e-3;
    let potential = ContactPotential::near(surface.clone(), &x, 0.5 * margin);
    let neighbours = Neighbours::find(&surface, &x, margin);
    let contact = Contact { surface: &surface, neighbours: &neighbours };
    let x1: Vec<f64> = x.iter().enumerate().map(|(k, x)| x + 1e-5 * (k as f64).sin()).collect();
    let settings = StepSettings::over(1e-3);
    let (active, candidates) = (contact.active(&x).len() as u64, neighbours.count() as u64);
    let stencils = potential.stencils().count();
    println!("{} triangles, {active} pairs, {candidates} candidates", surface.cells().len());
    let mut group = c.benchmark_group("contact");
    group.sample_size(10).throughput(Throughput::Elements(active));
    group.bench_function("find acting pairs", |b| b.iter(|| black_box(contact.active(&x))));
    let mut gradients = vec![0.0; 12 * stencils];
    group.bench_function("gradient", |b| {
        b.iter(|| potential.gradients(0..stencils, &x, 0.0, black_box(&mut gradients)));
    });
    group.bench_function("discrete gradient", |b| b.iter(|| black_box(contact.step(&x, &x1, &settings))));
    let pairs = contact.active(&x);
    let mut block = [0.0; 78];
    group.bench_function("Hessian alone", |b| {
        b.iter(|| {
            for pair in &pairs {
                let size = 3 * pair.shape.arity();
                pair.hessian(&x, black_box(&mut block[..size * (size + 1) / 2]));
            }
        });
    });
    group.throughput(Throughput::Elements(candidates));
    group.bench_function("CCD of candidates", |b| b.iter(|| black_box(contact.first_impact(&x, &x1))));
    group.throughput(Throughput::Elements(surface.cells().len() as u64));
    group.bench_function("rebuild", |b| b.iter(|| black_box(Neighbours::find(&surface, &x, margin))));
    group.finish();
}

criterion_group!(benches, contact);
criterion_main!(benches);
