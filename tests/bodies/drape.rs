//! Tests equilibria of cloth and thin sheets that begin flat, without or with little stiffness against their weight.

use crate::program::Program;

/// Young's modulus of the cloth, Pa, its thickness, m, its mass per area, kg/m², and gravity, m/s².
const YOUNG: f64 = 1e5;
const THICKNESS: f64 = 1e-3;
const AREA_DENSITY: f64 = 0.2;
const G: f64 = 9.81;

/// A horizontal sheet of 1 m × 1 m at z = 0 with `supports`, in equilibrium at each quarter of the time.
fn scene(young: f64, bending: &str, supports: &str, gravity: &str) -> String {
    format!(
        "{gravity}\n[[body]]\nname = \"cloth\"\nsheet = {{ size = [1.0, 1.0], cells = [12, 12] }}\n\
         material = {{ law = \"st-venant-kirchhoff\", young = {young:e}, poisson = 0.0, thickness = {THICKNESS:e}, \
         bending = \"{bending}\", area_density = {AREA_DENSITY:?} }}\n{supports}\n\
         [[probe]]\nname = \"end\"\nbody = \"cloth\"\nregion = \"x-max\"\nmean = \"displacement\"\n\
         [time]\nend = 1.0\nstep = 0.25\n[static]\n"
    )
}

const WEIGHT: &str = "gravity = [0.0, 0.0, -9.81]";
const GROWING_WEIGHT: &str = "gravity = [0.0, 0.0, -9.81]\ngravity_amplitude = \"t\"";
const EDGE: &str = "[[fix]]\nbody = \"cloth\"\nregion = \"x-min\"";

/// A membrane that begins flat and is held at one edge, about which it may turn, hangs down, longer by half its weight over its
/// stiffness: u = ρ g L²/(2 E h) at small strains.
#[test]
fn a_membrane_hangs_down_from_its_edge() {
    let stretch = AREA_DENSITY * G / (2.0 * YOUNG * THICKNESS);
    for gravity in [WEIGHT, GROWING_WEIGHT] {
        let program = Program::run(&scene(YOUNG, "none", EDGE, gravity));
        let history = program.history();
        let fall = -history.last("end.mean.displacement.z") - 1.0;
        // The strain is 1 % on average, so Green's strain differs by this order from that of the formula.
        assert!((fall / stretch - 1.0).abs() < 3e-2, "{gravity}: {fall:e} m, expected {stretch:e} m");
        let along = history.last("end.mean.displacement.x") + 1.0;
        assert!(along.abs() < 1e-3, "{gravity}: {along:e} m");
        let notes = program.report()["notes"].to_string();
        assert!(!notes.contains("buckles"), "{notes}");
    }
}

/// A clamped sheet of a thousandth of its length bends down under its weight, without load steps so small that it moves by its thickness
/// in each of them; the equilibrium does not depend on the steps.
#[test]
fn a_clamped_thin_sheet_bends_under_its_weight() {
    let clamped = format!("{EDGE}\nrotation = true");
    let ends = [WEIGHT, GROWING_WEIGHT].map(|gravity| {
        let program = Program::run(&scene(1e6, "shell", &clamped, gravity));
        let report = program.report();
        assert_eq!(report["substeps"].as_u64().unwrap_or(0), 0, "{gravity}");
        let iterations = report["work"]["newton_iterations"].as_u64().unwrap();
        assert!(iterations < 500, "{gravity}: {iterations} iterations");
        let history = program.history();
        ["x", "z"].map(|axis| history.last(&format!("end.mean.displacement.{axis}")))
    });
    assert!(ends[0][1] < -0.5, "the sheet of {:?} m hangs", ends[0]);
    for (one, other) in ends[0].iter().zip(&ends[1]) {
        assert!((one - other).abs() < 1e-6, "{ends:?}");
    }
}

/// Cloth held at two corners sags between them, with wrinkles, from the flat start on.
#[test]
fn cloth_sags_between_two_corners() {
    let corners = "[[fix]]\nbody = \"cloth\"\nnodes = [0, 156]";
    let program = Program::run(&scene(YOUNG, "shell", corners, WEIGHT));
    let history = program.history();
    let (elastic, gravity) = (history.last("elastic"), history.last("gravity"));
    // A linear response would store half of the energy that the load releases. Here the cloth mostly falls.
    assert!(gravity < 0.0 && elastic > 0.0 && elastic < -0.5 * gravity, "{elastic:e} J of {gravity:e} J");
    assert!(history.last("end.mean.displacement.z") < -0.9);
}
