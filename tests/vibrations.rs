//! Modes of reference: the free cube (E2), rigid motions named.

use variational::core::{Coordinates, System};
use variational::fem::{BoxMesh, ElementKind, Isotropic, Law, add_lumped_mass, consistent_mass, elastic};
use variational::solvers::{ModeOptions, modes};

#[test]
fn e2_free_cube_with_the_exact_lame_mode() {
    let law = Law::Linear(Isotropic { young: 1.0, poisson: 0.3, density: 1.0 });
    let shape = BoxMesh { size: [1.0; 3], cells: [10; 3], element: ElementKind::Hex27, origin: [0.0; 3] };
    let mesh = shape.build().unwrap();
    let all = mesh.cells_of_dimension(3);
    let mut mass = vec![0.0; mesh.points.len()];
    add_lumped_mass(&mesh, &all, 1.0, &mut mass).unwrap();
    let terms = elastic(&mesh, &all, &law, 0, "cube").unwrap();
    let count = 3 * mesh.points.len();
    let mass = mass.iter().flat_map(|&m| [m; 3]).collect();
    let system = System::new(mass, terms, Coordinates::all_free(count)).unwrap();
    let state = system.state(0.0, mesh.points.as_flattened(), &vec![0.0; count]).unwrap();
    let kinetic = consistent_mass(&mesh, &all, 1.0, 0, "cube").unwrap();
    let found = modes(&system, &state, kinetic, &ModeOptions { count: 18, ..Default::default() }).unwrap();
    let omega: Vec<f64> = found.iter().map(|mode| mode.omega_squared.max(0.0).sqrt()).collect();
    assert!(found[..6].iter().all(|mode| mode.is_rigid) && !found[6].is_rigid, "{omega:?}");
    let near = |exact: f64, tolerance: f64| omega.iter().any(|omega| (omega - exact).abs() < tolerance);
    assert!(near(1.77126, 2e-4) && near(2.38518, 2e-4) && near(2.42566, 2e-4), "{omega:?}");
    // √2 π √(G/ρ), G = 1/2.6.
    let lame = 2.0_f64.sqrt() * std::f64::consts::PI * (1.0 / 2.6_f64).sqrt();
    assert!(near(lame, 2e-4 * lame), "{lame} {omega:?}");
}
