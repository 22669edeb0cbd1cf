//! The strain energy of elements that other processes hold.

use std::sync::Arc;

use vi_core::{Account, Elsewhere, Few, HessianKind, Traits, run_length};
use vi_mesh::{FarElements, Numbering};

use crate::error::FemError;
use crate::lanes::pack::sorted_place;
use crate::solid::elastic::elastic_in_runs;
use crate::solid::law_kernels::kernels_of;
use crate::solid::material::Law;

/// Returns the potential of [`elastic`](crate::elastic) for all elements of a mesh that this process does not hold. `numbering`
/// gives the number of a node of the mesh in the system.
///
/// # Errors
/// Returns [`FemError::Parameter`] for the first parameter of the law out of its range.
pub fn elastic_elsewhere(
    elements: Arc<dyn FarElements>,
    law: &Law,
    numbering: Arc<Numbering>,
    name: &str,
) -> Result<Elsewhere, FemError> {
    if let Some(problem) = law.parameters().check().into_iter().next() {
        return Err(problem);
    }
    let (count, arity) = (elements.count(), elements.kind().node_count());
    let run_length = run_length(count, 3 * arity);
    let hessian = if kernels_of(law).is_linear() { HessianKind::Constant } else { HessianKind::Varying };
    let label = format!("{name}: {}", law.name());
    let (law, place) = (law.clone(), name.to_owned());
    let make = move |stencils: &[usize]| {
        let elements_of = elements_of(elements.as_ref(), stencils, run_length);
        let window = elements.window(elements_of.iter().copied(), |node| elements.point(node));
        let all: Vec<u32> = (0..elements_of.len() as u32).collect();
        // Runs of one element keep their order.
        let made = elastic_in_runs(&window.mesh, (&all, 1), &law, 0, &place);
        let term = made.ok().and_then(|mut terms| terms.pop()).expect("the law and the elements are sound");
        let nodes = window.nodes.iter().map(|&node| numbering.of(node)).collect();
        let cells = elements_of.into_iter().map(|element| elements.cell(element)).collect();
        Few { term, nodes, elements: cells }
    };
    Ok(Elsewhere {
        name: label,
        account: Account::Elastic,
        traits: Traits { hessian, time_dependent: false },
        arity,
        count,
        run_length,
        make: Box::new(make),
    })
}

/// Returns the elements of stencils.
fn elements_of(elements: &dyn FarElements, stencils: &[usize], run_length: usize) -> Vec<u32> {
    let mut runs: Vec<usize> = stencils.iter().map(|stencil| stencil / run_length).collect();
    runs.sort_unstable();
    runs.dedup();
    let of_runs = elements.of_runs(&runs, run_length);
    let element = |stencil: &usize| {
        let run = stencil / run_length;
        let length = run_length.min(elements.count() - run * run_length);
        let first = runs.partition_point(|&other| other < run) * run_length;
        of_runs[first + sorted_place(stencil % run_length, length)]
    };
    stencils.iter().map(element).collect()
}
