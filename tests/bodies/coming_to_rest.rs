//! Tests bodies that damping brings to rest: steps at rest need no more iterations, and no force does work.

use crate::program::Program;

/// Returns a block of one or more elements that hangs on a wall or lies on a floor, with damping.
fn block(scheme: &str, step: f64, cells: [u32; 3], support: &str, damping: &str) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = {step}
scheme = "{scheme}"
{support}
[[body]]
name = "block"
box = {{ size = [0.1, 0.1, 0.1], cells = {cells:?}, element = "hex8" }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[damping]
{damping}
[output]
history = 1
ledger = true
"#
    )
}

const WALL: &str = "[[fix]]\nbody = \"block\"\nregion = \"x-min\"";

const FLOOR: &str = r#"
[contact]
damping = 1e-3
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
position = [0.0, 0.0, -0.001]
fixed = true
"#;

/// The energy that the scheme must explain at rest is round-off of the elastic energy, and not a part of the motion. Steps were divided
/// by 1024 there.
#[test]
fn energy_momentum_does_not_divide_steps_of_a_body_at_rest() {
    for (cells, support) in [([1, 1, 1], WALL), ([2, 2, 2], FLOOR)] {
        let program = Program::run(&block("energy-momentum", 1e-3, cells, support, "mass_rate = 50"));
        let report = program.report();
        assert_eq!(report["work"]["steps"].as_u64(), Some(1000), "{support}");
        let kinetic = program.history().column("kinetic");
        let largest = kinetic.iter().copied().fold(0.0, f64::max);
        assert!(*kinetic.last().unwrap() < 1e-9 * largest, "{support}: {:?}", kinetic.last());
        let drift = report["energy"]["relative_drift"].as_f64().unwrap();
        assert!(drift < 1e-9, "{support}: {drift:e}");
    }
}

/// Half kicks and the impulses of a floor move the momenta of a body at rest to and fro. Damping does no work on that.
#[test]
fn damping_does_no_work_on_a_body_at_rest() {
    for scheme in ["stormer-verlet", "symplectic-euler-a", "symplectic-euler-b"] {
        for damping in ["mass_rate = 300", "shear_viscosity = 100.0\nbulk_viscosity = 100.0"] {
            let work = |end: &str| {
                let scene = block(scheme, 4e-4, [2, 2, 1], FLOOR, damping).replace("end = 1.0", end);
                Program::run(&scene).report()["energy"]["damping_work"].as_f64().unwrap()
            };
            let (settled, all) = (work("end = 0.6"), work("end = 0.8"));
            assert!((all - settled).abs() < 1e-3 * all.abs(), "{scheme} {damping}: {settled:e} {all:e}");
            assert!(all < 0.0, "{scheme} {damping}: {all:e}");
        }
    }
}

/// The velocity by which a closing kick damps must obey the constraints: with a body on a rigid rod the dissipated energy has order 2.
#[test]
fn damping_beside_constraints_has_order_two() {
    let work = |scheme: &str, step: f64| {
        let scene = format!(
            r#"
gravity = [0, -9.81, 0]
[time]
end = 0.2
step = {step}
scheme = "{scheme}"
[damping]
shear_viscosity = 300.0
[[body]]
name = "block"
box = {{ size = [1, 0.6, 0.3], cells = [2, 1, 1], element = "hex8" }}
material = {{ law = "neo-hookean", young = 2e5, poisson = 0.3, density = 1000.0 }}
[[rigid]]
name = "rod"
shape = {{ kind = "rod", length = 1.0, radius = 0.02 }}
density = 2000.0
position = [-0.5, 0.1, 0.15]
[[attach]]
body = "block"
region = "x-min"
to = "rod"
[[joint]]
kind = "ball"
body = "rod"
point = [-1.0, 0.1, 0.15]
[output]
ledger = true
"#
        );
        let report = Program::run(&scene).report();
        ["damping_work", "relative_drift"].map(|name| report["energy"][name].as_f64().unwrap())
    };
    let [reference, _] = work("implicit-midpoint", 2.5e-4);
    let [coarse, fine] = [2e-3, 1e-3].map(|step| work("stormer-verlet", step));
    for [before, after] in [[coarse[0] - reference, fine[0] - reference], [coarse[1], fine[1]]] {
        let order = (before / after).log2();
        assert!((1.7..2.4).contains(&order), "{order}: {coarse:?} {fine:?} {reference}");
    }
}
