//! Compares assembled sums with dense sums entry by entry, on random bodies: solids and sheets of any law on jittered
//! meshes with shuffled node numbers and any coordinates held. `PROPTEST_CASES=10000` draws more bodies.

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};
use springs::{dense, fixed};
use variational::core::{Coordinates, Potential, System};
use variational::fem::{Bending, Law, Sheet, SheetLaw, elastic};
use variational::mesh::{BoxMesh, Mesh, SheetMesh};
use variational::solvers::{Assembler, HessianEvaluation};

#[path = "../../crates/vi-solvers/tests/springs/mod.rs"]
mod springs;

#[derive(Debug, Clone)]
struct Body {
    mesh: Mesh,
    x: Vec<f64>,
    law: usize,
    bending: usize,
    held: Vec<bool>,
}

fn meshes() -> impl Strategy<Value = Mesh> {
    let solid =
        (0..variational::fem::SOLIDS.len(), prop::array::uniform3(1_u32..4)).prop_map(|(kind, cells)| {
            let element = variational::fem::SOLIDS[kind];
            BoxMesh { size: cells.map(f64::from), cells, element, origin: [0.0; 3] }.build().unwrap()
        });
    let sheet = (1_u32..7, 1_u32..7).prop_map(|(m, n)| {
        let shape = serde_json::json!({ "size": [f64::from(m), f64::from(n)], "cells": [m, n] });
        serde_json::from_value::<SheetMesh>(shape).unwrap().build().unwrap()
    });
    prop_oneof![2 => solid, 1 => sheet]
}

fn body() -> impl Strategy<Value = Body> {
    let choices = (any::<prop::sample::Index>(), any::<prop::sample::Index>());
    (meshes(), choices).prop_flat_map(|(mesh, (law, bending))| {
        let count = mesh.points.len();
        let is_sheet = !mesh.cells_of_dimension(2).is_empty() && mesh.cells_of_dimension(3).is_empty();
        let law = law.index(if is_sheet { SheetLaw::NAMES.len() } else { Law::NAMES.len() });
        let bending = bending.index(Bending::ALL.len());
        let numbers = Just((0..count as u32).collect::<Vec<_>>()).prop_shuffle();
        let jitter = prop::collection::vec(-0.05..0.05, 3 * count);
        let held = prop::collection::vec(prop::bool::weighted(0.2), 3 * count);
        (Just(mesh), numbers, jitter, held).prop_map(move |(mesh, numbers, jitter, held)| {
            let mut shuffled = mesh.clone();
            for (point, &number) in mesh.points.iter().zip(&numbers) {
                shuffled.points[number as usize] = *point;
            }
            for block in &mut shuffled.blocks {
                block.nodes.iter_mut().for_each(|node| *node = numbers[*node as usize]);
            }
            shuffled.regions.clear();
            let rest = shuffled.points.as_flattened();
            let x = rest.iter().zip(jitter).map(|(x, by)| 1.1 * x + by).collect();
            Body { mesh: shuffled, x, law, bending, held }
        })
    })
}

fn system(body: &Body) -> System {
    let solids = body.mesh.cells_of_dimension(3);
    let terms: Vec<Box<dyn Potential>> = if solids.is_empty() {
        let mut law = serde_json::to_value(&SheetLaw::examples()[body.law]).unwrap();
        law["bending"] = serde_json::to_value(Bending::ALL[body.bending]).unwrap();
        let law = serde_json::from_value(law).unwrap();
        let triangles = body.mesh.cells_of_dimension(2);
        Sheet::new(&body.mesh, &triangles, &law, 0, "sheet").potentials().unwrap()
    } else {
        // Splits the elements into two terms that share nodes.
        let (first, second) = solids.split_at(solids.len() / 2);
        let laws = Law::examples();
        [(first, body.law), (second, (body.law + 1) % laws.len())]
            .into_iter()
            .filter(|(cells, _)| !cells.is_empty())
            .flat_map(|(cells, law)| elastic(&body.mesh, cells, &laws[law], 0, "solid").unwrap())
            .collect()
    };
    let held = (0..body.x.len() as u32).filter(|&dof| body.held[dof as usize]).collect();
    let coordinates = Coordinates::new(body.x.len(), fixed(&body.x, held)).unwrap();
    System::new(vec![1.0; body.x.len()], terms, coordinates).unwrap()
}

fn largest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

proptest! {
    #![proptest_config(Config { rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..Config::default() })]

    #[test]
    fn gathered_sums_are_the_dense_ones(body in body(), direction in prop::collection::vec(-1.0..1.0, 64)) {
        let system = system(&body);
        let (energy, gradient, hessian) = dense(&system, &body.x, 0.0);
        prop_assume!(energy.is_finite());
        // The round-off of a sum scales with these values, whatever the order of summation.
        let stiffness = largest(hessian.iter().flatten());
        let force = stiffness * largest(&body.x);
        let mut assembler = Assembler::new(&system);
        let found = assembler.energies(&body.x, 0.0).total();
        prop_assert!((found - energy).abs() <= 1e-13 * force * largest(&body.x), "{} J, not {}", found, energy);
        let mut found = vec![f64::NAN; body.x.len()];
        assembler.gradient(&body.x, 0.0, &mut found);
        let free = system.coordinates().free();
        for &dof in free {
            let off = found[dof as usize] - gradient[dof as usize];
            prop_assert!(off.abs() <= 1e-13 * force, "force {}: {:e} of {:e}", dof, off, force);
        }
        let matrix = assembler.hessian(&body.x, 0.0, HessianEvaluation::Exact).unwrap();
        prop_assert_eq!(matrix.free_count(), free.len());
        let along: Vec<f64> = (0..free.len()).map(|k| direction[k % direction.len()]).collect();
        let mut product = vec![f64::NAN; free.len()];
        matrix.multiply(&along, &mut product);
        for (&row, product) in free.iter().zip(product) {
            let entries = free.iter().zip(&along);
            let expected: f64 = entries.map(|(&column, by)| hessian[row as usize][column as usize] * by).sum();
            let off = product - expected;
            prop_assert!(off.abs() <= 1e-12 * stiffness, "row {}: {:e} of {:e}", row, off, stiffness);
        }
    }
}
