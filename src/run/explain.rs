//! Explains what a run builds, what it evaluates once, and what it skips, with reasons: `variational run --explain`.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde_json::{Map, Value};
use vi_core::{HessianKind, Potential, System};
use vi_solvers::{Assembler, Factor, HessianEvaluation};

use crate::simulation::{Component, Simulation};

/// Lists the parts that will be built, by component and term.
///
/// For implicit schemes it builds the matrix and makes one step of a copy, to report sizes and the choice of the linear
/// solver.
pub fn explain(simulation: &Simulation) -> String {
    let method = simulation.method();
    let facts = method.facts();
    let mut text = match &simulation.scene().statics {
        Some(_) => "statics: an equilibrium at every load step, by Newton's method\n".to_owned(),
        None => format!(
            "{}: order {}, {}; {}\n",
            method.name(),
            facts.order,
            if facts.is_explicit { "explicit" } else { "implicit" },
            if facts.is_variational() { "variational" } else { "not variational" }
        ),
    };
    if simulation.scene().contact.is_some() {
        contact(&mut text, simulation);
    }
    for (index, component) in simulation.components().iter().enumerate() {
        let bodies: Vec<&str> = simulation
            .bodies()
            .iter()
            .filter(|body| body.component == index)
            .map(|body| body.name.as_str())
            .collect();
        let _ = writeln!(text, "system {index}: {}", bodies.join(", "));
        system(&mut text, component, facts.is_explicit);
        if !facts.is_explicit && component.stepper().is_some() && simulation.scene().statics.is_none() {
            linear_solver(&mut text, simulation, component);
        }
    }
    text
}

/// Largest number of pairs of bodies that are listed as searched, and as not searched for one reason.
const NAMED: usize = 24;

/// Lists the pairs of bodies that are searched for contact, and the other pairs with the reason.
fn contact(text: &mut String, simulation: &Simulation) {
    let mut lists: BTreeMap<Option<&str>, Vec<String>> = BTreeMap::new();
    for ([a, b], reason) in simulation.contact_pairs() {
        let [first, second] = [a, b].map(|number| simulation.name_of(number));
        let pair = if a == b { format!("{first} itself") } else { format!("{first} – {second}") };
        lists.entry(reason).or_default().push(pair);
    }
    for (reason, pairs) in lists {
        let more = pairs.len().saturating_sub(NAMED);
        let named = pairs[..pairs.len() - more].join(", ");
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let _ = match reason {
            None => writeln!(text, "contact searches: {named}{more}"),
            Some(reason) => writeln!(text, "contact skips ({reason}): {named}{more}"),
        };
    }
}

/// Appends the linear solver of the steps, found by making one.
fn linear_solver(text: &mut String, simulation: &Simulation, component: &Component) {
    let options = simulation.scene().solver.options();
    let Ok(mut stepper) = vi_solvers::stepper(&simulation.method(), component.system(), &options) else {
        return;
    };
    let mut state = component.state().clone();
    let step = stepper.step(component.system(), &mut state, simulation.step_size());
    let _ = match (stepper.linear_solver(), step) {
        (Some(reason), _) => writeln!(text, "  linear solver: {reason}"),
        (None, Ok(_)) => {
            writeln!(text, "  linear solver: none yet, because the first step solves no equations")
        }
        (None, Err(error)) => writeln!(text, "  linear solver: not known, {error}"),
    };
}

fn system(text: &mut String, component: &Component, is_explicit: bool) {
    let system = component.system();
    let coordinates = system.coordinates();
    let (all, free) = (coordinates.dof_count(), coordinates.free_count());
    let _ = writeln!(text, "  coordinates: {all}, of which {free} free; prescribed ones are eliminated");
    let _ = match (system.kinetic(), system.filter()) {
        (None, Some(filter)) => writeln!(
            text,
            "  mass: {free} numbers (lumped), whose inverse is filtered by two products with {} weights per drift",
            filter.entries()
        ),
        (None, None) => writeln!(text, "  mass: {free} numbers (lumped), {}", bytes(8 * free as u64)),
        (Some(kinetic), _) => {
            let stencils: usize = kinetic.fixed().iter().map(|term| term.stencils().count()).sum();
            writeln!(text, "  mass: a matrix summed from {stencils} elements (consistent), made once")
        }
    };
    if component.stepper().is_none() {
        let _ = writeln!(text, "  skipped: no coordinate is free, so there are no steps");
        return;
    }
    let mut varying = false;
    for potential in system.potentials() {
        varying |= potential.traits().hessian == HessianKind::Varying;
        term(text, system, potential.as_ref(), is_explicit);
    }
    let mut assembler = Assembler::new(system);
    let constant = assembler.work().constant_stencils;
    let _ = writeln!(
        text,
        "  gradients made once: {constant} stencils (affine terms, and those that cannot move)"
    );
    if is_explicit {
        let _ = writeln!(
            text,
            "  skipped: Hessian, sparsity pattern, ordering and factor; explicit steps need none"
        );
        return;
    }
    let state = component.state();
    let x = system.positions(state);
    let Ok(matrix) = assembler.hessian(&x, state.t, HessianEvaluation::Exact) else { return };
    let _ = writeln!(
        text,
        "  matrix M + cK: {free} × {free}, {} entries in its lower triangle, {}; {}",
        matrix.nnz(),
        bytes(matrix.bytes() as u64),
        if varying { "the pattern is made once, the values when a factor is renewed" } else { "made once" }
    );
    match Factor::new(matrix) {
        Ok(factor) => {
            let facts = factor.facts();
            let _ = writeln!(
                text,
                "  factor: {} entries in {} supernodes, {}, {:.3} Gflop in double precision; ordering and symbolic part made once{}",
                facts.nnz,
                facts.supernodes,
                bytes(facts.bytes),
                1e-9 * facts.flops,
                if varying { "" } else { ", the numeric part as long as h is constant" }
            );
        }
        Err(error) => {
            let _ = writeln!(text, "  factor: {error}");
        }
    }
}

fn term(text: &mut String, system: &System, potential: &dyn Potential, is_explicit: bool) {
    let stencils = potential.stencils();
    let coordinates = system.coordinates();
    let mut moving = vec![false; coordinates.dof_count()];
    for &dof in coordinates.free() {
        moving[dof as usize] = true;
    }
    for own in coordinates.node_axes() {
        let of_node = &mut moving[3 * own.node as usize..][..3];
        let any = of_node.contains(&true);
        of_node.fill(any);
    }
    for (node, terms) in coordinates.combinations() {
        for axis in 0..3 {
            let free = terms.iter().any(|&(k, _)| moving[3 * k as usize + axis]);
            moving[3 * node as usize + axis] = free;
        }
    }
    let can_move = |stencil: &usize| {
        let mut nodes = stencils.of(*stencil).iter();
        let block = stencils.block;
        nodes.any(|&node| (0..block).any(|k| moving[node as usize * block + k]))
    };
    let still = stencils.count() - (0..stencils.count()).filter(can_move).count();
    let traits = potential.traits();
    let gradient = match (traits.hessian, traits.time_dependent) {
        (HessianKind::Zero, false) => "gradient made once (affine)",
        _ => "gradient at every evaluation",
    };
    let hessian = match traits.hessian {
        _ if is_explicit => "no Hessian (explicit)",
        HessianKind::Zero => "no Hessian (affine)",
        HessianKind::Constant => "Hessian made once (quadratic)",
        HessianKind::Varying => "Hessian when a factor is renewed",
    };
    let _ = write!(
        text,
        "  term '{}': {} stencils of {} nodes; {gradient}; {hessian}",
        potential.name(),
        potential.elsewhere().map_or(stencils.count(), |elsewhere| elsewhere.count),
        stencils.arity
    );
    if still > 0 {
        let _ = write!(text, "; {still} stencils cannot move");
    }
    let (n, count) = (stencils.size() as u64, stencils.count() as u64);
    let local = if is_explicit { 8 * n * count } else { 8 * (n + n * (n + 1) / 2) * count };
    let _ = writeln!(text, "; local blocks {}", bytes(local));
}

/// Lists the counts of work.
pub fn account(work: &Map<String, Value>) -> String {
    let (done, none): (Vec<_>, Vec<_>) = work.iter().partition(|(_, count)| count.as_u64() != Some(0));
    let words = |name: &str| name.replace('_', " ");
    let done: Vec<String> = done.iter().map(|(name, count)| format!("{count} {}", words(name))).collect();
    let none: Vec<String> = none.iter().map(|(name, _)| words(name)).collect();
    let mut text = format!("done: {}\n", done.join(", "));
    if !none.is_empty() {
        let _ = writeln!(text, "never: {}", none.join(", "));
    }
    text
}

/// Formats 1536 as `1.5 kB`.
fn bytes(count: u64) -> String {
    let value = count as f64;
    match value {
        v if v >= 1e9 => format!("{:.1} GB", 1e-9 * v),
        v if v >= 1e6 => format!("{:.1} MB", 1e-6 * v),
        v if v >= 1e3 => format!("{:.1} kB", 1e-3 * v),
        v => format!("{v} B"),
    }
}
