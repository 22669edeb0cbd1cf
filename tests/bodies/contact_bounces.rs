//! Tests boxes that bounce on a floor, case H12 of docs/validation-contact.md.

use crate::program::Program;

/// A tilted rigid box dropped on a floor keeps its energy through every bounce, and in long steps too, in which it turns by more than a
/// radian. The floor has no friction, so its horizontal momentum and its angular momentum about the vertical stay zero.
#[test]
fn a_box_bounces_on_without_loss() {
    for (step, bound) in [(2e-3, 1e-10), (0.03, 1e-8), (0.04, 1e-8), (0.06, 1e-8), (0.09, 1e-8)] {
        let run = Program::run(&bounces(step, 0.1)).history();
        let (total, kinetic) = (run.column("total"), run.column("kinetic"));
        let drift = total.iter().map(|e| (e / total[0] - 1.0).abs()).fold(0.0, f64::max);
        assert!(drift < bound, "{step}: {drift:e}");
        let momentum = (2.0 * 8.0 * kinetic.iter().fold(0.0_f64, |most, &kinetic| most.max(kinetic))).sqrt();
        for (name, scale) in [("px", momentum), ("py", momentum), ("lz", 0.1 * momentum)] {
            let most = run.column(name).into_iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            assert!(most < bound * scale, "{step}, {name}: {most:e}");
        }
    }
}

/// A box that falls flat on a floor rises to the height from which it fell and does not turn, although the diagonals of its faces are not
/// symmetric. The same holds for one element. The largest height at the end of a step is within g h²/8 of the apex.
#[test]
fn a_box_that_falls_flat_rises_without_turning() {
    let rigid = Program::run(&bounces(2e-3, 0.0)).history();
    let element = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.35
step = 1e-3
scheme = "energy-momentum"
[contact]
[[body]]
name = "cube"
box = { size = [0.2, 0.2, 0.2], cells = [1, 1, 1], element = "hex8", origin = [-0.1, -0.1, 0.1] }
material = { law = "neo-hookean", young = 1e7, poisson = 0.3, density = 1000.0 }
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
fixed = true
"#,
    )
    .history();
    for run in [&rigid, &element] {
        let largest = |name: &str| run.column(name).into_iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let arm = 0.1 * largest("pz");
        let center: Vec<f64> = ["lx", "ly", "lz"].iter().map(|name| largest(name)).collect();
        assert!(center.iter().all(|&l| l < 1e-11 * arm), "{center:?} of {arm}");
        assert!(run.column("pz").iter().any(|&p| p > 0.0), "it bounces");
    }
    let (t, z) = (rigid.column("t"), rigid.column("box.z"));
    let fall = (2.0_f64 * 1.0 / 9.81).sqrt();
    for bounce in 1..=9 {
        let times = [f64::from(2 * bounce - 1) * fall, f64::from(2 * bounce + 1) * fall];
        let between = t.iter().zip(&z).filter(|(t, _)| (times[0]..times[1]).contains(*t));
        let apex = between.fold(0.0_f64, |most, (_, &z)| most.max(z));
        assert!((apex - 1.1).abs() < 1e-5, "bounce {bounce}: {apex}");
    }
}

/// Returns a scene of a box that falls by a metre on a floor, tilted by an angle about a horizontal axis.
fn bounces(step: f64, angle: f64) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 9.2
step = {step}
scheme = "energy-momentum"
[contact]
[[rigid]]
name = "box"
shape = {{ kind = "box", size = [0.2, 0.2, 0.2] }}
density = 1000.0
position = [0, 0, 1.1]
orientation = {{ axis = [1, 2, 0], angle = {angle} }}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
"#
    )
}

/// A ball that hits a soft block and rubs on it exchanges no energy but what friction takes, step by step, also where a pair opens for one step
/// and closes again: its bristle is then forgotten.
#[test]
fn a_bristle_is_forgotten_where_its_pair_opens() {
    let run = Program::run(
        r#"
[time]
end = 0.01
step = 5e-4
scheme = "energy-momentum"
[contact]
friction = 0.8
[output]
ledger = true
[[body]]
name = "block"
box = { size = [0.1, 0.1, 0.1], cells = [3, 3, 3], element = "wedge6", origin = [0, 0, 0] }
material = { law = "neo-hookean", young = 1178777.7764934134, poisson = 0.3, density = 1000 }
[[rigid]]
name = "ball"
shape = { kind = "sphere", radius = 0.03 }
density = 1000.0
position = [0.0615204151350356, 0.058189652305851006, 0.14]
velocity = [0.13887199999266087, -0.5748895253263384, -2.423281223617289]
angular_velocity = [18.57720676429205, -5.864481015582523, 3.511478606814213]
"#,
    )
    .history();
    let pairs = run.column("pairs");
    assert!(pairs.windows(3).any(|three| three == [1.0, 0.0, 0.0]), "{pairs:?}");
    let kept: Vec<f64> =
        run.column("total").iter().zip(run.column("friction")).map(|(e, work)| e - work).collect();
    for (step, two) in kept.windows(2).enumerate() {
        assert!((two[1] - two[0]).abs() < 1e-10 * kept[0], "step {}: {:e}", step + 1, two[1] - two[0]);
    }
}
