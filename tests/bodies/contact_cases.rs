//! Tests reference cases of contact: the impact of a bar, a block that slides to rest and stays, a ball that begins to roll.
//!
//! These are cases H1, H2, H5, H9 and H11 of docs/validation-contact.md, which gives the sources of the numbers.

use crate::program::Program;

/// A bar of wave speed c = 31.6 m/s hits a wall, stays in contact for 2 L/c, pushes with p = ρ c v₀, and leaves with
/// the speed that it came with.
#[test]
fn a_bar_leaves_a_wall_as_fast_as_it_came() {
    let run = Program::run(
        r#"
[time]
end = 0.09
step = 3e-4
scheme = "energy-momentum"
[contact]
[[body]]
name = "bar"
box = { size = [1.0, 0.1, 0.1], cells = [100, 1, 1], element = "hex8", origin = [0.002, 0, 0] }
material = { law = "linear", young = 1e6, poisson = 0.0, density = 1000.0 }
velocity = [-0.316228, 0, 0]
[[rigid]]
name = "wall"
shape = { kind = "plane", normal = [1, 0, 0] }
fixed = true
"#,
    )
    .history();
    let (t, pairs, p, total) = (run.column("t"), run.column("pairs"), run.column("px"), run.column("total"));
    let touching: Vec<f64> =
        t.iter().zip(&pairs).filter(|(_, pairs)| **pairs > 0.0).map(|(t, _)| *t).collect();
    let duration = touching[touching.len() - 1] - touching[0];
    assert!((duration / 63.246e-3 - 1.0).abs() < 0.03, "{duration}");
    assert!(((p[p.len() - 1] - p[0]) / 6.3246 - 1.0).abs() < 5e-3, "{:?}", p.last());
    let drift = total.iter().map(|e| (e - total[0]).abs()).fold(0.0, f64::max);
    assert!(drift < 1e-10 * 0.5, "{drift:e}");
}

/// Damped blocks in a stack come to rest, and each interface carries the weight above it in every single step: velocities do not
/// alternate in the stiff layers and bristles. This is H11 with four blocks.
#[test]
fn a_damped_stack_comes_to_rest() {
    let block = |k: usize| {
        let below = if k == 1 { "floor".to_owned() } else { format!("block {}", k - 1) };
        format!(
            r#"
[[rigid]]
name = "block {k}"
shape = {{ kind = "box", size = [0.1, 0.1, 0.04] }}
density = 1000.0
position = [0, 0, {}]
[[probe]]
name = "under {k}"
between = ["block {k}", "{below}"]
sum = "contact_force"
"#,
            0.0402 * k as f64 - 0.02
        )
    };
    let scene = format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.15
step = 1e-3
scheme = "energy-momentum"
[contact]
friction = 0.3
damping = 1e-2
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
{}"#,
        (1..=4).map(block).collect::<String>()
    );
    let run = Program::run(&scene).history();
    let kinetic = run.column("kinetic");
    assert!(*kinetic.last().unwrap() < 1e-16, "{:e}", kinetic.last().unwrap());
    for k in 1..=4 {
        let (force, weight) = (run.column(&format!("under {k}.fz")), (5 - k) as f64 * 0.4 * 9.81);
        for force in &force[force.len() - 2..] {
            assert!((force / weight - 1.0).abs() < 1e-6, "{k}: {force}");
        }
    }
}

/// On a slope of 30° with μ = 0.7 a block of initial speed 1 m/s stops after v²/(2 g (μ cos − sin)) and does not creep
/// afterwards.
#[test]
fn a_block_stops_on_a_slope_and_stays() {
    let run = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 5.0
step = 1e-3
scheme = "energy-momentum"
[contact]
friction = 0.7
damping = 1e-3
[[rigid]]
name = "block"
shape = { kind = "box", size = [0.1, 0.1, 0.04] }
density = 1000.0
orientation = { axis = [0, 1, 0], angle = 0.5235987755982988 }
position = [0.0102, 0, 0.01766692]
velocity = [0.8660254037844387, 0.0, -0.5]
[[rigid]]
name = "slope"
shape = { kind = "plane", normal = [0.5, 0, 0.8660254037844387] }
fixed = true
"#,
    )
    .history();
    let (t, x, z) = (run.column("t"), run.column("block.x"), run.column("block.z"));
    let settled = t.iter().position(|t| *t > 1.5).unwrap();
    let distance = |i: usize, j: usize| (x[j] - x[i]).hypot(z[j] - z[i]);
    assert!((distance(0, settled) / 0.479848 - 1.0).abs() < 1e-3, "{}", distance(0, settled));
    assert!(distance(settled, t.len() - 1) < 1e-9, "{:e}", distance(settled, t.len() - 1));
    let (total, friction, damping) =
        (run.column("total"), run.column("friction"), run.column("contact_damping"));
    assert!(friction.windows(2).all(|pair| pair[1] <= pair[0]));
    for i in 0..t.len() {
        let balance = total[i] - friction[i] - damping[i] - total[0];
        assert!(balance.abs() < 1e-8, "t = {}: {balance:e}", t[i]);
    }
}

/// A solid ball that slides at v₀ = 2 m/s with μ = 0.3 rolls at 5 v₀/7 after the time 2 v₀/(7 μ g) and the distance
/// 12 v₀²/(49 μ g). From then on nothing is dissipated. The floor is a half-space or a box of triangles.
#[test]
fn a_ball_slides_until_it_rolls() {
    let floors = [
        r#"shape = { kind = "plane", normal = [0, 0, 1] }"#,
        "shape = { kind = \"box\", size = [4.0, 4.0, 0.2] }\nposition = [0.1, 0.2, -0.1]",
    ];
    for (scheme, floor) in
        [("energy-momentum", floors[0]), ("stormer-verlet", floors[0]), ("implicit-midpoint", floors[1])]
    {
        let run = Program::run(&format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.4
step = 5e-4
scheme = "{scheme}"
[contact]
friction = 0.3
damping = 1e-3
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = 0.1 }}
density = 1000.0
position = [0, 0, 0.1018]
velocity = [2.0, 0, 0]
[[rigid]]
name = "floor"
{floor}
fixed = true
"#
        ))
        .history();
        let (t, x, momentum, friction) =
            (run.column("t"), run.column("ball.x"), run.column("px"), run.column("friction"));
        let mass = momentum[0] / 2.0;
        let last = t.len() - 1;
        let speed = momentum[last] / mass;
        assert!((speed / (10.0 / 7.0) - 1.0).abs() < 5e-3, "{scheme}: {speed}");
        // At this time friction has done nine tenths of its work: (1 − t/t₁)² = 0.1.
        let tenth = friction.iter().position(|&work| work < 0.9 * friction[last]).unwrap();
        let [time, way] = [t[tenth] / (1.0 - 0.1_f64.sqrt()), x[last] - speed * (t[last] - 0.194165)];
        assert!((time / 0.194165 - 1.0).abs() < 2e-2, "{scheme}: {time}");
        assert!((way / 0.332855 - 1.0).abs() < 5e-3, "{scheme}: {way}");
        let lost = friction[last] / (0.5 * mass * 4.0);
        assert!((lost / (-2.0 / 7.0) - 1.0).abs() < 5e-3, "{scheme}: {lost}");
        let rolling = t.iter().position(|&t| t > 0.25).unwrap();
        assert!((friction[last] - friction[rolling]).abs() < 1e-6 * friction[last].abs(), "{scheme}");
    }
}

/// A capsule leans on a box by its side and lies on a plane by its ends, and balls collide: the energy balance closes,
/// friction never adds energy, and the contact force does not jump at facets.
#[test]
fn round_bodies_keep_their_balance() {
    for (scheme, bound) in [("energy-momentum", 1e-7), ("stormer-verlet", 1e-3)] {
        let run = Program::run(&format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.3
step = 5e-4
scheme = "{scheme}"
[contact]
friction = 0.4
damping = 1e-3
[[rigid]]
name = "capsule"
shape = {{ kind = "capsule", length = 0.3, radius = 0.05 }}
density = 1000.0
position = [0, 0, 0.06]
velocity = [0.0, 1.0, 0.0]
angular_velocity = [0.0, 0.3, 1.0]
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = 0.08 }}
density = 500.0
position = [0.05, 0.2, 0.085]
angular_velocity = [3.0, 0, 5.0]
[[rigid]]
name = "block"
shape = {{ kind = "box", size = [0.1, 0.1, 0.1] }}
density = 2000.0
position = [-0.1, 0.16, 0.052]
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
"#
        ))
        .history();
        let column = |name| run.column(name);
        assert!(run.imbalance() < bound, "{scheme}: {:e}", run.imbalance());
        let friction = column("friction");
        let kinetic = column("kinetic").into_iter().fold(0.0, f64::max);
        assert!(friction.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12), "{scheme}");
        assert!(friction[friction.len() - 1] < -1e-2 * kinetic, "{scheme}");
        assert!(column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
    }
}

/// A tall box tips over its edge with friction. While it slides, friction follows the pressure, which follows the motion;
/// and it alternates between sticking and sliding. Every step is solved in one piece, and the balance closes.
#[test]
fn a_box_that_tips_with_friction_is_solved_in_whole_steps() {
    for (scheme, bound) in [("energy-momentum", 1e-8), ("stormer-verlet", 1e-4)] {
        let run = Program::run(&format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.3
step = 1e-3
scheme = "{scheme}"
[contact]
friction = 0.3
damping = 1e-3
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
[[rigid]]
name = "box"
shape = {{ kind = "box", size = [0.02, 0.08, 0.16] }}
density = 600.0
position = [0.0, 0.0, 0.0802]
angular_velocity = [0.0, 3.0, 0.0]
"#
        ))
        .history();
        let column = |name| run.column(name);
        assert!(column("substeps").iter().all(|&cuts| cuts == 0.0), "{scheme}");
        let iterations = column("newton_iterations").iter().sum::<f64>() / 300.0;
        assert!(iterations < 20.0, "{scheme}: {iterations} iterations per step");
        assert!(run.imbalance() < bound, "{scheme}: {:e}", run.imbalance());
        assert!(column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
    }
}

/// Two cloths rest on a floor in steps much longer than the period of the layer. Each node slips by about 1e-9 m, ten times the range
/// in which friction sticks; which pairs stick is found without soft bristles and without shorter steps.
#[test]
fn a_stack_of_cloths_with_friction_is_solved_in_whole_steps() {
    let cloth = |name: &str, shift: f64, height: f64| {
        format!(
            r#"
[[body]]
name = "{name}"
sheet = {{ size = [1.0, 1.0], cells = [6, 6], origin = [{shift}, -{shift}, {height}] }}
material = {{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }}
"#
        )
    };
    let run = Program::run(&format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.03
step = 5e-3
scheme = "energy-momentum"
[contact]
friction = 0.3
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
{}{}
"#,
        cloth("lower", 0.0, 1.2e-3),
        cloth("upper", 3e-3, 2.4e-3)
    ))
    .history();
    let column = |name| run.column(name);
    assert!(column("substeps").iter().all(|&cuts| cuts == 0.0));
    let iterations = column("newton_iterations").iter().sum::<f64>();
    assert!(iterations < 240.0, "{iterations} iterations");
    assert!(run.imbalance() < 1e-9, "{:e}", run.imbalance());
    assert!(run.last("friction") < 0.0);
}

/// Case H15: a cloth that falls on a ball and slides on it crosses neither the ball nor itself. The energy balance of an
/// explicit run closes, with few iterations per step.
#[test]
fn a_cloth_falls_on_a_ball_explicitly() {
    let run = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.2
step = 4e-4
scheme = "stormer-verlet"
[contact]
friction = 0.3
[[body]]
name = "cloth"
sheet = { size = [1.0, 1.0], cells = [12, 12], origin = [-0.5, -0.5, 0.02] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }
[[rigid]]
name = "ball"
shape = { kind = "sphere", radius = 0.3 }
position = [0, 0, -0.3]
fixed = true
[assert]
intersections = 0
smallest_gap = 1e-9
"#,
    );
    let work = &run.report()["work"];
    let (steps, iterations) = (work["steps"].as_f64().unwrap(), work["newton_iterations"].as_f64().unwrap());
    assert!(iterations < 10.0 * steps, "{iterations} iterations of {steps} steps");
    assert_eq!(work["factorizations"], 0);
    let run = run.history();
    assert!(run.column("pairs").iter().any(|pairs| *pairs > 3.0));
    assert!(run.imbalance() < 5e-3, "{:e}", run.imbalance());
}

/// Free rigid bodies that hit a cloth are part of the small system of touching nodes: no matrix of the whole is factored, and while
/// nothing touches, nothing is solved. Both momenta are kept to round-off, with friction, a spinning body and a joint.
#[test]
fn free_bodies_hit_a_cloth_explicitly() {
    let ball = r#"
[[rigid]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
position = [-0.1, 0.05, 0.12]
velocity = [0.5, 0.0, -1.5]
angular_velocity = [0.0, 20.0, 5.0]
mass = 0.2
"#;
    let arms = r#"
[[rigid]]
name = "arm"
shape = { kind = "box", size = [0.3, 0.1, 0.05] }
position = [0.0, 0.05, 0.12]
orientation = { axis = [0.3, 1.0, 0.0], angle = 0.3 }
velocity = [0.3, 0.0, -1.5]
density = 100.0
[[rigid]]
name = "hand"
shape = { kind = "box", size = [0.1, 0.1, 0.02] }
position = [0.0, 0.05, 0.3]
velocity = [0.3, 0.0, -1.5]
density = 100.0
[[joint]]
kind = "ball"
body = "arm"
to = "hand"
point = [0.0, 0.05, 0.2]
"#;
    for bodies in [ball, arms] {
        let run = Program::run(&format!(
            r#"
[time]
end = 0.06
step = 2e-4
scheme = "stormer-verlet"
[contact]
friction = 0.3
[[body]]
name = "cloth"
sheet = {{ size = [1.0, 1.0], cells = [20, 20], origin = [-0.5, -0.5, 0.0] }}
material = {{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }}
{bodies}
[assert]
intersections = 0
smallest_gap = 1e-9
"#
        ));
        let work = run.report()["work"].clone();
        let run = run.history();
        assert_eq!(work["factorizations"], 0);
        let (pairs, iterations) = (run.column("pairs"), run.column("newton_iterations"));
        assert_eq!(iterations[1], 0.0);
        assert!(pairs.iter().any(|pairs| *pairs > 0.0));
        assert!(work["newton_iterations"].as_f64().unwrap() < 10.0 * work["steps"].as_f64().unwrap());
        for column in ["px", "py", "pz", "lx", "ly", "lz"] {
            let values = run.column(column);
            let change = values.iter().map(|value| (value - values[0]).abs()).fold(0.0, f64::max);
            assert!(change < 1e-11, "{column}: {change:e}");
        }
        assert!(run.last("friction") < 0.0);
        assert!(run.imbalance() < 5e-3, "{:e}", run.imbalance());
    }
}

/// A bar that falls on a floor stays for 2L/c, presses with ρ c (v₀ + g t), and leaves as fast as it came.
#[test]
fn a_bar_dropped_on_a_floor_leaves_as_fast_as_it_came() {
    let run = Program::run(
        r#"
gravity = [-9.81, 0.0, 0.0]
[time]
end = 0.2
step = 2.5e-4
scheme = "stormer-verlet"
[contact]
[[body]]
name = "bar"
box = { size = [1.0, 0.1, 0.1], cells = [100, 1, 1], element = "hex8", origin = [0.079638, 0, 0] }
material = { law = "linear", young = 1e6, poisson = 0.0, density = 1000.0 }
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [1, 0, 0] }
fixed = true
[[probe]]
name = "floor"
between = ["bar", "floor"]
sum = "contact_force"
"#,
    )
    .history();
    let (t, pairs, force, p) =
        (run.column("t"), run.column("pairs"), run.column("floor.fx"), run.column("px"));
    let touching: Vec<usize> = (0..t.len()).filter(|&row| pairs[row] > 0.0).collect();
    let [first, last] = [touching[0], touching[touching.len() - 1]];
    let duration = t[last] - t[first];
    assert!((duration / 63.246e-3 - 1.0).abs() < 0.02, "{duration}");
    let inside = |row: &usize| (0.1..0.9).contains(&((t[*row] - t[first]) / duration));
    let expected = |row: usize| 0.01 * 31.6228e3 * (1.25 + 9.81 * (t[row] - t[first]));
    let rows: Vec<usize> = touching.iter().copied().filter(inside).collect();
    let ratio =
        rows.iter().map(|&row| force[row]).sum::<f64>() / rows.iter().map(|&row| expected(row)).sum::<f64>();
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    // The layer is entered before the wall is reached, at a speed of 1.241 m/s.
    assert!((p[last + 1] / -p[first - 1] - 1.0).abs() < 0.01, "{} {}", p[last + 1], p[first - 1]);
}

/// A block without weight that starts at rest in the layer of a floor. Nothing moves it but the layer, which gives it all of its energy.
#[test]
fn a_block_at_rest_in_a_layer_is_pushed_out_of_it() {
    for (scheme, error) in [("stormer-verlet", 1e-3), ("energy-momentum", 1e-9)] {
        let run = Program::run(&format!(
            r#"
[time]
end = 0.02
step = 1e-4
scheme = "{scheme}"
[contact]
distance = 2e-3
[[body]]
name = "block"
box = {{ size = [0.1, 0.1, 0.1], cells = [2, 2, 2], element = "tet4", origin = [0, 0, 1e-3] }}
material = {{ law = "linear", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
"#
        ))
        .history();
        let stored = run.first("contact");
        assert!(stored > 0.0 && run.first("kinetic") == 0.0 && run.last("contact") == 0.0, "{scheme}");
        let freed = run.last("total");
        assert!((freed / stored - 1.0).abs() < error, "{scheme}: {freed} of {stored}");
        let momentum = run.last("pz");
        // Kinetic energy of the motion as a whole is a part of all energy.
        assert!(momentum > 0.0 && momentum * momentum / 2.0 < stored, "{scheme}: {momentum}");
    }
}
