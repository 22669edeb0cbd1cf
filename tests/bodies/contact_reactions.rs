//! Tests that the reactions of supports contain all forces of contact.

use crate::program::{History, Program};

const STEP: f64 = 1e-3;
const END: f64 = 0.02;
const G: f64 = 9.81;
/// Mass of the plate that is held by its nodes, kg.
const PLATE: f64 = 1000.0 * 0.8 * 0.4 * 0.05;

const BALL: &str = r#"
[[rigid]]
name = "free"
shape = { kind = "sphere", radius = 0.05 }
density = 1000.0
position = [0.3, 0.1, 0.0505]
velocity = [2.0, 0.5, 0.0]
angular_velocity = [1.0, -5.0, 3.0]
"#;

const BLOCK: &str = r#"
[[rigid]]
name = "free"
shape = { kind = "box", size = [0.1, 0.1, 0.02] }
density = 1000.0
position = [0.3, 0.1, 0.0101]
velocity = [2.0, 0.5, 0.0]
angular_velocity = [0.0, 0.0, 8.0]
"#;

const SOFT: &str = r#"
[[body]]
name = "free"
box = { size = [0.1, 0.1, 0.04], cells = [2, 2, 1], element = "hex8", origin = [0.3, 0.1, 0.0005] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
velocity = [2.0, 0.5, 0.0]
"#;

const PLANE: &str = r#"
[[rigid]]
name = "support"
shape = { kind = "plane", normal = [0, 0, 1] }
position = [0.1, -0.2, 0.0]
fixed = true
"#;

const BOX: &str = r#"
[[rigid]]
name = "support"
shape = { kind = "box", size = [4.0, 4.0, 0.2] }
position = [0.1, -0.2, -0.1]
fixed = true
"#;

const HELD: &str = r#"
[[body]]
name = "support"
box = { size = [0.8, 0.4, 0.05], cells = [8, 4, 1], element = "hex8", origin = [0.0, -0.1, -0.05] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "support"
box = { min = [-1.0, -1.0, -1.0] }
axes = ["x", "y", "z"]
"#;

fn scene(scheme: &str, free: &str, support: &str) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -{G}]
[time]
end = {END}
step = {STEP}
scheme = "{scheme}"
[solver]
tolerance = 1e-12
[contact]
friction = 0.4
damping = 1e-3
{free}
{support}
[[probe]]
name = "f"
between = ["free", "support"]
sum = "contact_force"
[output]
history = 1
"#
    )
}

/// Returns the last values of three columns.
fn last(history: &History, names: [&str; 3]) -> [f64; 3] {
    names.map(|name| history.last(name))
}

/// Returns the changes of three columns over the last step, per second.
fn rates(history: &History, names: [&str; 3]) -> [f64; 3] {
    names.map(|name| match history.column(name)[..] {
        [.., before, after] => (after - before) / STEP,
        _ => f64::NAN,
    })
}

/// Returns the mean of a column over both ends of the last step.
fn mean_of_last(history: &History, name: &str) -> f64 {
    match history.column(name)[..] {
        [.., before, after] => 0.5 * (before + after),
        _ => f64::NAN,
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
    })
}

fn vector(value: &serde_json::Value) -> [f64; 3] {
    [0, 1, 2].map(|k| value[k].as_f64().unwrap())
}

/// Returns force, and moment about the origin, of the only reaction of a run, without what carries the weight of the support.
fn reaction(program: &Program, weight: f64) -> [[f64; 3]; 2] {
    let report = program.report();
    let reactions = report["results"]["reactions"].as_array().unwrap();
    assert_eq!(reactions.len(), 1);
    let of = |key: &str| vector(&reactions[0][key]);
    let (centroid, mut force, moment) = (of("centroid"), of("force"), of("moment"));
    force[2] -= weight;
    let shifted = cross(centroid, force);
    [force, [0, 1, 2].map(|k| moment[k] + shifted[k])]
}

fn assert_close(found: [f64; 3], expected: [f64; 3], scale: f64, what: &str) {
    for k in 0..3 {
        assert!((found[k] - expected[k]).abs() < scale, "{what}: {found:?}, not {expected:?}");
    }
}

/// What a support gives a body that slides on it, with friction and damping, is the force of the probe. With weight it is the rate of
/// change of both momenta over the last step.
#[test]
fn reactions_are_the_rates_of_momenta_that_weight_does_not_give() {
    for support in [PLANE, BOX, HELD] {
        for (free, schemes) in [
            (BALL, &["energy-momentum", "implicit-midpoint", "stormer-verlet", "backward-euler"][..]),
            (BLOCK, &["energy-momentum", "implicit-midpoint", "stormer-verlet", "bdf2"][..]),
            (SOFT, &["energy-momentum", "implicit-midpoint"][..]),
        ] {
            for scheme in schemes {
                let program = Program::run(&scene(scheme, free, support));
                let history = program.history();
                let what = format!("{scheme}, {support}, {free}");
                let [force, moment] = reaction(&program, if support == HELD { PLATE * G } else { 0.0 });
                let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
                let probe = last(&history, ["f.fx", "f.fy", "f.fz"]);
                assert!(probe[2] > 0.0 && probe[0] < -0.1 * probe[2], "{what}: {probe:?}");
                assert_close(force, probe, 1e-9 * size, &what);
                if ["backward-euler", "bdf2"].contains(scheme) {
                    continue;
                }
                // The momentum at the start gives the mass. The weight acts at the mean of both places.
                let weight = -G * history.column("px")[0] / 2.0;
                let rate = rates(&history, ["px", "py", "pz"]);
                assert_close(rate, [force[0], force[1], force[2] + weight], 1e-6 * size, &what);
                let rate = rates(&history, ["lx", "ly", "lz"]);
                assert!((rate[2] - moment[2]).abs() < 1e-6 * size, "{what}: {rate:?} {moment:?}");
                if free != SOFT {
                    let place = ["free.x", "free.y", "free.z"].map(|name| mean_of_last(&history, name));
                    let of_weight = cross(place, [0.0, 0.0, weight]);
                    let expected = [0, 1, 2].map(|k| rate[k] - of_weight[k]);
                    assert_close(moment, expected, 1e-6 * size, &what);
                }
            }
        }
    }
}

/// In equilibrium with friction, the support carries the weight, and its moment.
#[test]
fn the_reaction_in_equilibrium_is_the_weight_with_its_moment() {
    let scene = r#"
gravity = [3.0, 0.0, -9.0]
gravity_amplitude = "t"
[time]
end = 1.0
step = 0.25
[static]
[contact]
friction = 0.5
[[body]]
name = "block"
box = { size = [0.1, 0.1, 0.04], cells = [2, 2, 1], element = "hex8", origin = [0.3, 0.2, 0.0005] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000 }
"#;
    for support in [PLANE, BOX] {
        let [force, moment] = reaction(&Program::run(&format!("{scene}{support}")), 0.0);
        assert_close(force, [-1.2, 0.0, 3.6], 1e-8, support);
        // The middle of the block in y is at .25 m; gravity has no component along y.
        let along = [0.25 * 3.6, moment[1], 0.25 * 1.2];
        assert_close(moment, along, 1e-8, support);
    }
}
