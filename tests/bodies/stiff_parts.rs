//! Swings a bar with a stiff band under implicit schemes: the number of iterations hardly depends on how stiff the band is.

use vi_core::{Coordinates, Fixed, Prescribed, State, System};
use vi_fem::{Gravity, Isotropic, Law, add_lumped_mass, elastic};
use vi_mesh::{BoxMesh, CellKind};
use vi_solvers::{Method, SolverOptions, stepper};

const STEP: f64 = 5e-3;
const STEPS: u32 = 40;

/// Returns a clamped bar of 1 × .25 × .25 m under its weight, with `ratio` times the stiffness for .3 < x < .5, and a start at
/// rest.
fn bar(ratio: f64) -> (System, State) {
    let mesh =
        BoxMesh { size: [1.0, 0.25, 0.25], cells: [20, 5, 5], element: CellKind::Tet4, origin: [0.0; 3] };
    let mesh = mesh.build().unwrap();
    let elements = mesh.cells_of_dimension(3);
    let mut masses = vec![0.0; mesh.points.len()];
    add_lumped_mass(&mesh, &elements, 1000.0, &mut masses).unwrap();
    let is_stiff = |&element: &u32| {
        let (_, nodes) = mesh.cell(element as usize).unwrap();
        let centre =
            nodes.iter().map(|&node| mesh.points[node as usize][0]).sum::<f64>() / nodes.len() as f64;
        (0.3..0.5).contains(&centre)
    };
    let (stiff, soft): (Vec<u32>, Vec<u32>) = elements.iter().partition(|element| is_stiff(element));
    let law = |young| Law::StVenantKirchhoff(Isotropic { young, poisson: 0.3, density: 1000.0 });
    let mut terms = elastic(&mesh, &soft, &law(1e6), 0, "soft").unwrap();
    terms.extend(elastic(&mesh, &stiff, &law(1e6 * ratio), 0, "stiff").unwrap());
    terms.push(Box::new(Gravity::new(&masses, [0.0, -9.81, 0.0])));
    let rest: Vec<f64> = mesh.points.iter().flatten().copied().collect();
    let clamped: Vec<u32> = (0..rest.len() as u32).filter(|&dof| rest[dof as usize / 3 * 3] == 0.0).collect();
    let values = clamped.iter().map(|&dof| rest[dof as usize]).collect();
    let clamp = Prescribed { dofs: clamped, path: Box::new(Fixed(values)) };
    let coordinates = Coordinates::new(rest.len(), vec![clamp]).unwrap();
    let mass = (0..rest.len()).map(|dof| masses[dof / 3]).collect();
    let system = System::new(mass, terms, coordinates).unwrap();
    let mut q = vec![0.0; system.coordinates().free_count()];
    system.coordinates().restrict(&rest, &mut q);
    let p = vec![0.0; q.len()];
    (system, State { t: 0.0, q, p })
}

fn iterations(method: Method, ratio: f64) -> u64 {
    let (system, mut state) = bar(ratio);
    let mut stepper = stepper(&method, &system, &SolverOptions::default()).unwrap();
    for step in 0..STEPS {
        let made = stepper.step(&system, &mut state, STEP);
        made.unwrap_or_else(|error| panic!("{method:?}, ratio {ratio:e}, step {step}: {error}"));
    }
    stepper.work().newton_iterations
}

#[test]
fn iterations_do_not_grow_with_the_ratio_of_stiffness() {
    for method in [Method::ImplicitMidpoint, Method::BackwardEuler] {
        let counts = [1.0, 1e3, 1e6].map(|ratio| iterations(method, ratio));
        assert!(counts.iter().all(|&count| count <= 2 * counts[0]), "{method:?}: {counts:?}");
    }
}
