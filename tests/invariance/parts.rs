//! Tests invariance under units and translations for parts of bodies, loads, damping, air, modes, and paths of
//! equilibria.

use variational::prelude::*;
use variational::study::modes::scene_modes;
use variational::study::stress::Transform;

use super::scenes::SOLID;
use super::{EXPLICIT, FAR, IMPLICIT, UNITS, check_moved, check_units, in_units, scene};

/// Selections of every kind, rollers, a moment, a body force, weight with an amplitude, damping.
const ROLLERS: &str = r#"
gravity = [0.0, -9.81, 0.0]
gravity_amplitude = "min(40*t, 1)"
[[body]]
name = "beam"
box = { size = [1.0, 0.25, 0.25], cells = [4, 2, 2], element = "hex8", origin = [0.1, 0.2, 0.3] }
material = { law = "neo-hookean", young = 2e5, poisson = 0.3, density = 900.0 }
[[fix]]
body = "beam"
plane = { point = [0.1, 0.2, 0.3], normal = [2.0, 0.0, 0.0] }
axes = ["x"]
[[fix]]
body = "beam"
sphere = { centre = [0.1, 0.2, 0.3], radius = 0.125 }
[[fix]]
body = "beam"
region = "z-min"
axes = ["normal"]
[[fix]]
body = "beam"
box = { min = [1.05, -inf, 0.54] }
axes = [[1.0, 2.0, 0.0]]
motion = { kind = "sine", amplitude = [0.0, 0.02, 0.0], frequency = 3.0, phase = 1.5707963267948966 }
[[load]]
kind = "force"
body = "beam"
region = "x-max"
force = [0.0, 0.0, -3.0]
moment = [1.0, 0.0, 0.5]
about = [1.1, 0.3, 0.4]
amplitude = "sin(20*t)"
[[load]]
kind = "body-force"
body = "beam"
force = ["100*x", 0.0, "30*(y - z)"]
[damping]
shear_viscosity = 3.0
stiffness_time = 1e-4
mass_rate = 0.5
"#;

/// A tube of quadratic elements held about its axis, with a nearly incompressible block beside it.
const ORDERS: &str = r#"
gravity = [1.0, -9.81, 3.0]
[[body]]
name = "curved"
box = { size = [0.5, 0.5, 0.5], cells = [2, 1, 1], element = "wedge6", origin = [0.25, 0.0, 0.0] }
material = { law = "corotated", young = 2e5, poisson = 0.3, density = 900.0 }
order = 2
[[fix]]
body = "curved"
region = "x-min"
axes = ["radial", "axial"]
about = { point = [0.5, 0.25, 0.25], axis = [1.0, 0.0, 0.0] }
[[body]]
name = "rubber"
box = { size = [0.5, 0.5, 0.5], cells = [1, 2, 1], element = "hex8", origin = [0.0, 1.0, 0.0] }
material = { law = "mooney-rivlin", c10 = 3e4, c01 = 1e4, bulk = 4e7, density = 1100.0 }
locking = "mean-dilation"
displacement = ["0.01*(y - 1.0)", 0.0, 0.0]
velocity = [0.0, "sin(2*x)", 0.1]
[[fix]]
body = "rubber"
region = "y-min"
"#;

/// A cell that is periodic in one direction, under pressure.
const PERIODIC: &str = r#"
[[body]]
name = "cell"
box = { size = [1.0, 0.5, 0.5], cells = [3, 2, 1], element = "tet4", origin = [0.3, 0.1, 0.0] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 1000.0 }
velocity = [0.1, 0.0, "0.5*x"]
[[periodic]]
body = "cell"
from = { region = "x-min" }
to = { plane = { point = [1.3, 0.0, 0.0], normal = [1.0, 0.0, 0.0] } }
[[fix]]
body = "cell"
region = "y-min"
axes = ["y"]
[[load]]
kind = "traction"
body = "cell"
plane = { point = [0.0, 0.6, 0.0], normal = [0.0, 1.0, 0.0] }
traction = [0.0, -500.0, 0.0]
amplitude = [[0.0, 0.0], [0.005, 1.0]]
"#;

/// Half a sheet at a mirror plane, in wind.
const AIR: &str = r#"
gravity = [0.0, 0.0, -9.81]
wind = { velocity = [3.0, 1.0, 0.5] }
[[body]]
name = "half"
sheet = { size = [0.5, 1.0], cells = [2, 3] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.4, thickness = 2e-3, bending = "hinge" }
[[fix]]
body = "half"
region = "x-min"
axes = ["x"]
symmetry = true
[[fix]]
body = "half"
region = "y-min"
rotation = true
"#;

/// A sheet on a rotating arm.
const ARM: &str = r#"
gravity = [0.0, 0.0, -9.81]
[[rigid]]
name = "arm"
mass = 1.0
shape = { kind = "rod", length = 1.0, radius = 0.02 }
position = [2.0, 0.0, 0.0]
motion = { kind = "rotate", axis = [0.0, 0.0, 1.0], point = [1.5, 0.0, 0.0], rate = 2.0 }
[[body]]
name = "blade"
sheet = { size = [0.5, 0.25], cells = [3, 2], pattern = "cross", origin = [2.5, 0.0, 0.0] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, area_density = 0.5, thickness = 4e-3 }
[[attach]]
body = "blade"
region = "x-min"
to = "arm"
"#;

/// A shallow arch of two legs in plane strain, pushed at its crown.
const ARCH: &str = r#"
[[body]]
name = "leg"
box = { size = [1.0, 0.125, 0.125], cells = [8, 1, 1], element = "hex8" }
displacement = [0.0, "0.05*x", 0.0]
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0.0, density = 1000.0 }
[[fix]]
body = "leg"
region = "x-min"
[[fix]]
body = "leg"
region = "x-max"
axes = ["x"]
[[load]]
kind = "point"
body = "leg"
point = [1.0, 0.0, 0.0]
force = [0.0, -10.0, 0.0]
amplitude = "t"
[[probe]]
name = "crown"
body = "leg"
point = [1.0, 0.0, 0.0]
"#;

/// Schemes that accept damping and wind.
const DAMPED: [&str; 4] =
    ["\"stormer-verlet\"", "\"implicit-midpoint\"", "\"gauss\"\nstages = 2", "\"energy-momentum\""];

fn each(check: impl Fn(&str, &Scene)) {
    for (name, body, small, large) in
        [("orders", ORDERS, 1e-4, 0.01), ("periodic", PERIODIC, 2e-4, 0.01), ("arm", ARM, 2e-4, 0.00125)]
    {
        for scheme in EXPLICIT {
            check(&format!("{name}, {scheme}"), &scene(body, small, 20, scheme));
        }
        for scheme in IMPLICIT {
            check(&format!("{name}, {scheme}"), &scene(body, large, 6, scheme));
        }
    }
    for scheme in DAMPED {
        let (step, steps) = if scheme == DAMPED[0] { (2e-4, 20) } else { (0.0025, 8) };
        check(&format!("rollers, {scheme}"), &scene(ROLLERS, step, steps, scheme));
        check(&format!("air, {scheme}"), &scene(AIR, step, steps, scheme));
    }
    let consistent = format!("{ORDERS}[solver]\nmass = \"consistent\"\n");
    for scheme in IMPLICIT {
        check(&format!("consistent mass, {scheme}"), &scene(&consistent, 0.01, 6, scheme));
    }
}

#[test]
fn units_change_no_bit_of_what_scenes_say_of_parts() {
    each(check_units);
}

#[test]
fn parts_far_from_the_origin_are_those_near() {
    each(check_moved);
}

fn path(control: &str) -> Scene {
    let text = format!("{ARCH}\n[time]\nend = 1.0\nstep = 0.125\n[static]\n{control}\n");
    let parsed = Scene::parse(&text, &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    parsed.scene.unwrap()
}

#[test]
fn units_change_no_bit_of_a_path_of_equilibria() {
    check_units("arc", &path("arc_steps = 6"));
    let control = r#"control = { kind = "displacement", probe = "crown", axis = "y", to = -0.1 }"#;
    check_units("control", &path(control));
    check_moved("control", &path(control));
}

/// Returns ω² of all modes (1/s²).
fn squares(scene: Scene, mass: MassKind) -> Vec<f64> {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|problems| panic!("{problems:?}"));
    let found = scene_modes(&mut simulation, 6, mass).unwrap();
    found.modes.iter().map(|mode| mode.mode.omega_squared).collect()
}

/// In other units ω² has the same bits times T⁻². Far away it changes by the relative error of the stiffness: the
/// round-off of coordinates, 10⁶ times larger there, over the size of an element.
#[test]
fn modes_do_not_see_units_or_places() {
    let still = AIR.replace("wind = { velocity = [3.0, 1.0, 0.5] }\n", "");
    for body in [SOLID, PERIODIC, &still] {
        for mass in [MassKind::Consistent, MassKind::Lumped] {
            let own = scene(body, 0.01, 1, "\"implicit-midpoint\"");
            let found = squares(own.clone(), mass);
            assert!(found.len() >= 6);
            for units in UNITS {
                let transform = in_units(units);
                let there = squares(transform.of(&own).unwrap(), mass);
                let per_square = transform.factor([0, 0, 2]);
                let there: Vec<f64> = there.iter().map(|square| square * per_square).collect();
                assert_eq!(found, there, "{units:?} {mass:?}");
            }
            let there = squares(Transform::Moved(FAR).of(&own).unwrap(), mass);
            let largest = found.iter().fold(0.0_f64, |largest, square| largest.max(square.abs()));
            for (a, b) in found.iter().zip(&there) {
                assert!((a - b).abs() < 1e-8 * largest, "{a:e} {b:e} {mass:?}");
            }
        }
    }
}
