//! Tests friction and damping of contact by the schemes whose forces act at the end of a step.

use crate::contact::assert_same_bits;
use crate::program::Program;

const SCHEMES: [&str; 3] = ["backward-euler", "bdf2", "newmark"];

/// Returns a soft block on a plane whose normal is tilted by `angle` (rad) against the direction of gravity, with an initial velocity
/// of `speed` (m/s) down the slope.
fn slope(scheme: &str, angle: f64, speed: f64, end: f64, contact: &str) -> String {
    let gravity = [9.81 * angle.sin(), -9.81 * angle.cos()];
    format!(
        r#"
gravity = [{}, 0.0, {}]
[time]
end = {end}
step = 1e-3
scheme = "{scheme}"
[contact]
{contact}
[[body]]
name = "block"
box = {{ size = [0.1, 0.1, 0.04], cells = [2, 2, 1], element = "hex8", origin = [0.0, 0.0, 1e-5] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
velocity = [{speed}, 0.0, 0.0]
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
[[probe]]
name = "top"
body = "block"
mean = "displacement"
[output]
history = 1
ledger = true
"#,
        gravity[0], gravity[1]
    )
}

/// A block of speed v stops after v²/(2 μ g), 0.1019 m here. Backward Euler takes the speed at the end of each step, so it makes about
/// h v/2 less. The part of the kinetic energy that friction does not take goes into the ledger as loss of the scheme.
#[test]
fn a_block_stops_by_friction_and_the_ledger_is_complete() {
    for scheme in SCHEMES {
        let program = Program::run(&slope(scheme, 0.0, 1.0, 0.3, "friction = 0.5"));
        let history = program.history();
        assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
        let friction = history.column("friction");
        assert!(friction.windows(2).all(|pair| pair[1] <= pair[0]), "{scheme}");
        let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-9, "{scheme}: {unexplained:e}");
        if scheme != "newmark" {
            let way = *history.column("top.mean.displacement.x").last().unwrap();
            assert!((way / 0.10194 - 1.0).abs() < 0.02, "{scheme}: {way}");
            let kinetic = history.column("kinetic");
            assert!(kinetic.last().unwrap() / kinetic[0] < 1e-6, "{scheme}");
            let share = -friction.last().unwrap() / kinetic[0];
            assert!((0.9..=1.0).contains(&share), "{scheme}: {share}");
        }
    }
}

/// Where the tangent of the slope is below the coefficient of friction, a block comes to rest and does not creep. By `bdf2` its
/// vibrations last .6 s.
#[test]
fn a_block_that_friction_holds_does_not_creep() {
    for scheme in ["backward-euler", "bdf2"] {
        let history = Program::run(&slope(scheme, 0.5, 0.0, 1.0, "friction = 0.7")).history();
        let (t, way) = (history.column("t"), history.column("top.mean.displacement.x"));
        let settled = t.iter().position(|t| *t > 0.75).unwrap();
        let creep = way.last().unwrap() - way[settled];
        assert!(creep.abs() < 1e-9, "{scheme}: {creep:e}");
        assert!(way[settled] < 2e-4, "{scheme}: {}", way[settled]);
    }
}

/// Damping is a force of its own, whose joules are reported; the block bounces less with it.
#[test]
fn damping_takes_energy_that_the_ledger_names() {
    let highest = |scheme: &str, contact: &str| {
        let scene = slope(scheme, 0.0, 0.0, 0.1, contact)
            .replace("origin = [0.0, 0.0, 1e-5]", "origin = [0.0, 0.0, 0.01]");
        let program = Program::run(&scene);
        let history = program.history();
        let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-9, "{scheme}: {unexplained:e}");
        let damped = history.column("contact_damping");
        assert!(damped.windows(2).all(|pair| pair[1] <= pair[0]), "{scheme}");
        let (t, way) = (history.column("t"), history.column("top.mean.displacement.z"));
        let met = t.iter().position(|t| *t > 0.047).unwrap();
        let height = way[met..].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (height, *damped.last().unwrap())
    };
    for scheme in ["backward-euler", "bdf2"] {
        let (free, damped) = (highest(scheme, "friction = 0.1"), highest(scheme, "damping = 1e-2"));
        assert_eq!(free.1, 0.0, "{scheme}");
        assert!(damped.1 < 0.0 && damped.0 < free.0, "{scheme}: {free:?} {damped:?}");
    }
}

/// A run in mid-slip continues with the same bits, on any number of threads.
#[test]
fn runs_are_the_same_on_any_threads_and_after_a_resume() {
    for scheme in SCHEMES {
        assert_same_bits(scheme, &slope(scheme, 0.0, 1.0, 0.06, "friction = 0.5\ndamping = 1e-3"), 0.02, 2);
    }
}

/// A cloth falls on a ball that is held. Its 1323 equations are too many for a factor of the complete tangent, so steps that are hard
/// to solve go by way of lagged friction, in descents, which the pair by pair method does not make. Air resistance is held in these passes.
/// They only lead to the solution: the ledger is complete, and runs continue with the same bits.
#[test]
fn a_cloth_on_a_ball_is_solved_by_way_of_lagged_friction() {
    let scene = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.1
step = 5e-3
scheme = "backward-euler"
[contact]
friction = 0.3
[[body]]
name = "cloth"
sheet = { size = [1.0, 1.0], cells = [20, 20], origin = [-0.5, -0.5, 0.01] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3, bending = "none" }
velocity = [0.5, 0.0, -1.0]
[[rigid]]
name = "ball"
shape = { kind = "sphere", radius = 0.3 }
position = [0.0, 0.0, -0.3]
fixed = true
[damping]
mass_rate = 0.5
[output]
history = 1
ledger = true
"#;
    let program = Program::run(scene);
    let report = program.report();
    let count = |name: &str| report["work"][name].as_u64().unwrap();
    assert!(count("descents") > 0, "{}", report["work"]);
    let unexplained = report["energy"]["unexplained"].as_f64().unwrap();
    assert!(unexplained.abs() < 1e-9, "{unexplained:e}");
    let history = program.history();
    assert!(*history.column("friction").last().unwrap() < 0.0);
    assert_same_bits("lagged friction", scene, 0.025, 2);
}

/// A block that starts inside the layer slides from the first step on: whatever presses it, friction has μ times the impulse of the normal
/// force. Adaptive steps, which begin anew where an interval is made again, take as much of its momentum as by `energy-momentum`; their
/// steps are so short that bristles stretch first.
#[test]
fn newmark_starts_with_the_friction_of_its_velocity() {
    let scene = |scheme: &str, step: &str| {
        slope(scheme, 0.0, 0.3, 0.006, "friction = 0.3\ndistance = 5e-3\ndamping = 1e-4")
            .replace("step = 1e-3", step)
            .replace("origin = [0.0, 0.0, 1e-5]", "origin = [0.0, 0.0, 0.004]")
    };
    let history = Program::run(&scene("newmark", "step = 1e-3")).history();
    let [t, px, pz] = ["t", "px", "pz"].map(|name| history.column(name));
    // The mass is 0.4 kg.
    let normal = |n: usize| pz[n] - pz[n - 1] + 0.4 * 9.81 * (t[n] - t[n - 1]);
    assert!(normal(1) > 1e-2, "it should be pressed");
    for n in 1..t.len() {
        let friction = px[n] - px[n - 1];
        assert!((friction + 0.3 * normal(n)).abs() < 1e-3 * normal(1), "{n} {friction:e} {:e}", normal(n));
    }
    let taken = |scheme: &str| {
        let adaptive = "step = \"adaptive\"\nlargest_step = 2e-3\ntolerance = 1e-2";
        let px = Program::run(&scene(scheme, adaptive)).history().column("px");
        px[0] - px[px.len() - 1]
    };
    let [newmark, other] = ["newmark", "energy-momentum"].map(taken);
    assert!(other > 0.03 && (newmark / other - 1.0).abs() < 0.1, "{newmark} {other}");
}

/// The probe of the contact force in a step that was cut is the force at its end, as in a run that takes the parts as its steps.
#[test]
fn the_probe_in_a_step_that_was_cut_is_the_force_at_its_end() {
    let impact = |step: f64| {
        let scene = slope("newmark", 0.0, 0.3, 0.02, "friction = 0.1\nstiffness = 1e6")
            .replace("size = [0.1, 0.1, 0.04]", "size = [0.2, 0.2, 0.1]")
            .replace("origin = [0.0, 0.0, 1e-5]", "origin = [0.0, 0.0, 3e-3]")
            .replace("velocity = [0.3, 0.0, 0.0]", "velocity = [0.3, 0.0, -3.0]")
            .replace("step = 1e-3", &format!("step = {step}"));
        let probe = "[[probe]]\nname = \"f\"\nbetween = [\"block\", \"floor\"]\nsum = \"contact_force\"\n";
        Program::run(&format!("{scene}{probe}")).history()
    };
    let cut = impact(2e-3);
    let whole = impact(5e-4);
    assert!(cut.column("substeps")[1..].iter().all(|&parts| parts == 4.0), "{:?}", cut.column("substeps"));
    let (cut, whole) = (cut.column("f.fz"), whole.column("f.fz"));
    let largest = whole.iter().copied().fold(0.0, f64::max);
    for (row, force) in cut.iter().enumerate() {
        assert!(
            (force - whole[4 * row]).abs() < 1e-9 * largest,
            "{row}: {force} N, not {} N",
            whole[4 * row]
        );
    }
    assert!(cut.iter().any(|&force| force > 0.0), "{cut:?}");
}

/// A sheet hits a box that is hardly wider than it, with strong friction and damping: normals at the rim are inclined, so that friction
/// that is taken back opens pairs further. Friction and damping never bring energy together.
#[test]
fn friction_and_damping_bring_no_energy_where_rims_lie_on_each_other() {
    for scheme in ["energy-momentum", "implicit-midpoint", "backward-euler", "bdf2", "newmark"] {
        for (friction, damping) in [(1.0, 0.01), (1.2, 0.002), (0.7, 0.01)] {
            let program = Program::run(&format!(
                r#"
[time]
end = 2.5e-3
step = 5e-4
scheme = "{scheme}"
[contact]
friction = {friction}
damping = {damping}
[[body]]
name = "sheet"
sheet = {{ size = [0.2, 0.2], cells = [1, 1], origin = [-0.1, -0.1, 0.0016] }}
velocity = [-0.5, 1.2, -1.2]
material = {{ law = "st-venant-kirchhoff", young = 2e7, poisson = 0.0, density = 1000.0, thickness = 1e-3, bending = "shell" }}
[[rigid]]
name = "box"
shape = {{ kind = "box", size = [0.201, 0.201, 0.08] }}
position = [0.0, 0.0, -0.04]
fixed = true
[output]
history = 1
"#
            ));
            let history = program.history();
            let [total, friction_work, damping_work] =
                ["total", "friction", "contact_damping"].map(|name| history.column(name));
            let dissipated: Vec<f64> = friction_work.iter().zip(&damping_work).map(|(a, b)| a + b).collect();
            let start = total[0];
            assert!(dissipated.windows(2).all(|pair| pair[1] <= pair[0]), "{scheme}: {dissipated:?}");
            assert!(total.iter().all(|&total| total <= start * (1.0 + 1e-9)), "{scheme}: {total:?}");
            assert!(dissipated.last().unwrap() < &(-0.1 * start), "{scheme}: {dissipated:?}");
        }
    }
}
