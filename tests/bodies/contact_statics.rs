//! Tests equilibria with friction and of rigid bodies: Coulomb's limit, history dependence, accounts, and failures by name.

use crate::contact::assert_same_bits;
use crate::program::Program;

/// A soft block of 4 kg on a plane, under gravity that is tilted by `angle`.
fn slope(angle: f64, friction: f64, element: &str) -> String {
    let [x, z] = [9.81 * angle.sin(), -9.81 * angle.cos()];
    format!(
        r#"
gravity = [{x}, 0.0, {z}]
[time]
end = 1.0
step = 1.0
[static]
smallest_increment = 0.1
[contact]
friction = {friction}
self = false
[[body]]
name = "block"
box = {{ size = [0.2, 0.2, 0.1], cells = [3, 3, 2], element = "{element}", origin = [0.0, 0.0, 0.001] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[rigid]]
name = "slope"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
position = [0.0, 0.0, 0.0]
fixed = true
[[probe]]
name = "foot"
between = ["block", "slope"]
sum = "contact_force"
[output]
ledger = true
"#
    )
}

/// Holds one side of the block of [`slope`] in the plane, where friction does not.
const HELD: &str = r#"
[[fix]]
body = "block"
region = "x-min"
axes = ["x", "y"]
"#;

/// Below the angle of friction a block holds, and the slope carries its weight to round-off of the solve. Above, no
/// equilibrium exists, and the run says so.
#[test]
fn a_block_holds_up_to_the_angle_of_friction() {
    let angle = 20.0_f64.to_radians();
    for element in ["hex8", "tet4"] {
        let program = Program::run(&slope(angle, 1.01 * angle.tan(), element));
        let history = program.history();
        let last = |name: &str| *history.column(name).last().unwrap();
        let weight = 1000.0 * 0.2 * 0.2 * 0.1 * 9.81;
        assert!((last("foot.fx") + weight * angle.sin()).abs() < 1e-6 * weight, "{element}");
        assert!((last("foot.fz") - weight * angle.cos()).abs() < 1e-6 * weight, "{element}");
        assert!(last("friction") <= 0.0, "{element}: {}", last("friction"));
    }
    let program = Program::try_run(&slope(angle, 0.99 * angle.tan(), "hex8"), &[]);
    let said = program.errors();
    assert_eq!(program.code(), Some(4), "{said}");
    for words in
        ["no equilibrium beyond", "of 'block' and the half-space 'slope'", "contact.friction", "step time"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// A block that is pressed with 200 N and pulled sideways by up to `pull` times the limit μN, back to zero, and on to the
/// same force in the other direction.
fn pulled(pull: f64) -> String {
    let traction = pull * 0.4 * 200.0 / 0.04;
    format!(
        r#"
[time]
end = 1.0
step = 0.05
[static]
[contact]
friction = 0.4
self = false
[[body]]
name = "block"
box = {{ size = [0.2, 0.2, 0.1], cells = [4, 4, 2], element = "hex8", origin = [0.0, 0.0, 0.001] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
position = [0.0, 0.0, 0.0]
fixed = true
[[load]]
kind = "traction"
body = "block"
region = "z-max"
traction = [0.0, 0.0, -5000.0]
amplitude = "min(10*t, 1)"
[[load]]
kind = "traction"
body = "block"
region = "z-min"
traction = [{traction}, 0.0, 0.0]
amplitude = "sin(2*pi*max(0, t - 0.1)/0.9)"
[[probe]]
name = "foot"
between = ["block", "floor"]
sum = "contact_force"
[[probe]]
name = "corner"
body = "block"
point = [0.2, 0.1, 0.001]
[output]
ledger = true
"#
    )
}

/// The reaction is opposite to the pull and within Coulomb's cone. The foot has slid where it was pressed least, so that it does
/// not return to its place when the pull does; the work of the loads is what is stored and what friction takes.
#[test]
fn a_pull_to_and_fro_leaves_a_displacement() {
    let program = Program::run(&pulled(0.95));
    let history = program.history();
    let [fx, fz, t, work] = ["foot.fx", "foot.fz", "t", "friction"].map(|name| history.column(name));
    for row in 3..t.len() {
        let pull = 0.95 * 0.4 * 200.0 * (std::f64::consts::TAU * (t[row] - 0.1) / 0.9).sin();
        assert!((fx[row] + pull).abs() < 1e-5 * 200.0, "{}: {} {pull}", t[row], fx[row]);
        assert!((fz[row] - 200.0).abs() < 1e-5 * 200.0, "{}: {}", t[row], fz[row]);
        assert!(fx[row].abs() <= 0.4 * fz[row] * (1.0 + 1e-6), "{}", t[row]);
        assert!(work[row] <= work[row - 1] + 1e-12, "{}", t[row]);
    }
    let ux = history.column("corner.ux");
    let row = |time: f64| t.iter().position(|t| (t - time).abs() < 1e-9).unwrap();
    let most = ux.iter().copied().fold(0.0, f64::max);
    // The pull is zero at .1 s and at .55 s.
    let back = ux[row(0.55)] - ux[row(0.1)];
    assert!(back > 0.01 * most, "{back:e} of {most:e}");
    let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
    assert!(unexplained.abs() < 1e-9, "{unexplained:e}");
}

/// Bristles are part of checkpoints, and results do not depend on the number of threads.
#[test]
fn equilibria_with_friction_resume_with_the_same_bits() {
    assert_same_bits("equilibria", &pulled(0.8), 0.2, 3);
}

/// Where no load changes, the last equilibrium is one: it is not solved for again, with friction and without, and forces and accounts
/// stay what they are. A run that is resumed there has the same bits.
#[test]
fn an_equilibrium_under_constant_loads_is_kept() {
    for friction in [0.0, 0.5] {
        let angle = 0.5 * friction;
        let one = slope(angle, friction, "hex8").replace("friction = 0\n", "");
        let one = if friction > 0.0 { one } else { one + HELD };
        let ten = one.replace("step = 1.0", "step = 0.1");
        let [one, run] = [Program::run(&one), Program::run(&ten)];
        let count = |program: &Program, name: &str| program.report()["work"][name].as_u64().unwrap();
        assert_eq!(count(&run, "skipped"), 9, "{friction}");
        assert_eq!(count(&run, "factorizations"), count(&one, "factorizations"), "{friction}");
        let history = run.history();
        for name in ["foot.fx", "foot.fz", "elastic", "contact", "friction", "smallest_gap"] {
            let column = history.column(name);
            let first = column[1];
            assert!(
                column[1..].iter().all(|value| (value - first).abs() <= 1e-9 * first.abs()),
                "{name}: {column:?}"
            );
        }
        assert_same_bits("kept", &ten, 0.2, 3);
    }
}

/// What does not apply to equilibria is refused with the way out.
#[test]
fn damping_and_paths_are_refused_with_friction() {
    for (from, to, words) in [
        ("friction = 0.4", "damping = 1e-3", "nothing is damped between equilibria"),
        ("[static]", "[static]\narc_steps = 10", "depends on the order of loads"),
    ] {
        let program = Program::try_run(&pulled(0.5).replace(from, to), &[]);
        assert_eq!(program.code(), Some(2), "{}", program.errors());
        assert!(program.errors().contains(words), "{}", program.errors());
    }
}

/// Free rigid bodies in equilibrium: a ball that lies on a soft block, and a plate that friction holds on it, press with their
/// weight; a rod on a hinge keeps its length and presses on a soft bar with half of it.
#[test]
fn rigid_bodies_find_their_equilibria() {
    let on_block = |contact: &str, shape: &str, height: f64| {
        format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[static]
[time]
end = 1.0
step = 0.25
[contact]
{contact}
[[body]]
name = "block"
box = {{ size = [0.2, 0.2, 0.1], cells = [4, 4, 2], element = "hex8" }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "block"
region = "z-min"
[[rigid]]
name = "weight"
shape = {shape}
mass = 4.0
position = [0.1, 0.1, {height}]
[[probe]]
name = "press"
between = ["block", "weight"]
sum = "contact_force"
[output]
history = 1
"#
        )
    };
    for (contact, shape, height) in [
        ("", "{ kind = \"sphere\", radius = 0.05 }", 0.1502),
        ("friction = 0.3", "{ kind = \"box\", size = [0.3, 0.3, 0.02] }", 0.11012),
    ] {
        let history = Program::run(&on_block(contact, shape, height)).history();
        let fz = history.last("press.fz");
        assert!((fz / (-4.0 * 9.81) - 1.0).abs() < 1e-6, "{fz}");
        assert!(history.column("smallest_gap").into_iter().skip(1).all(|gap| gap > 0.0));
    }
    let lever = r#"
gravity = [0.0, 0.0, -9.81]
[static]
[time]
end = 1.0
step = 0.25
[[body]]
name = "bar"
box = { size = [0.02, 0.02, 0.5], cells = [1, 1, 10], element = "hex8", origin = [0.99, -0.01, -0.5] }
material = { law = "linear", young = 1e6, poisson = 0.0, density = 1.0 }
[[fix]]
body = "bar"
region = "z-min"
[[rigid]]
name = "rod"
mass = 1.0
shape = { kind = "rod", length = 1.0, radius = 0.01 }
position = [0.5, 0.0, 0.0]
[[joint]]
kind = "ball"
body = "rod"
point = [0.0, 0.0, 0.0]
[[attach]]
body = "bar"
nodes = [NODES]
to = "rod"
"#;
    // The nodes of the end of the bar that the rod holds.
    let nodes: Vec<String> = (0..4).map(|k| (40 + k).to_string()).collect();
    let program = Program::run(&lever.replace("NODES", &nodes.join(", ")));
    let history = program.history();
    let (x, z) = (history.last("rod.x"), history.last("rod.z"));
    assert!((x.hypot(z) - 0.5).abs() < 1e-10, "{x} {z}");
    // The end of the rod sinks by F L/(E A) with half of its weight, 6.1 mm; bending of the bar adds to its stiffness.
    let sag = -2.0 * z / (0.5 * 9.81 * 0.5 / (1e6 * 0.02 * 0.02));
    assert!((0.95..1.0).contains(&sag), "{sag}");
}

/// A block under its weight that is pushed over the floor: the work of the push is what friction takes and what the block stores, with no
/// request for a ledger.
#[test]
fn the_work_of_a_push_is_what_friction_takes() {
    let program = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = 0.05
[static]
[contact]
friction = 0.4
self = false
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
position = [0, 0, 0]
fixed = true
[[body]]
name = "s"
box = { size = [0.1, 0.1, 0.05], cells = [3, 3, 2], element = "hex8", origin = [-0.05, -0.05, 0.002] }
material = { law = "neo-hookean", young = 2e5, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "s"
region = "x-min"
axes = ["x"]
motion = { kind = "translate", velocity = [0.01, 0, 0] }
"#,
    );
    let energy = &program.report()["energy"];
    let of = |name: &str| energy[name].as_f64().unwrap_or_else(|| panic!("{name}: {energy}"));
    let friction = of("friction_work");
    // The block slides with the friction of its weight, except at the beginning.
    let expected = 0.4 * 0.5 * 9.81 * 0.01;
    assert!((-friction / expected - 1.0).abs() < 0.05, "{energy}, expected {expected}");
    assert!((-of("prescribed_work") / friction - 1.0).abs() < 0.05, "{energy}");
    assert!(of("unexplained").abs() < 1e-12, "{energy}");
    assert!(of("scheme_error").abs() < 0.05 * expected, "{energy}");
}

/// A ball that is pressed into a block by fifty times the distance of the layer, in one load step and in forty. The
/// tangent predicts the deformation of the block under the motion of the ball, so increments need not be as small as
/// the layer.
#[test]
fn a_prescribed_motion_needs_no_increments_of_the_layer() {
    let press = |step: f64, friction: f64| {
        Program::run(&format!(
            r#"
[time]
end = 1.0
step = {step}
[static]
[contact]
self = false
distance = 1e-5
friction = {friction}
[[body]]
name = "block"
box = {{ size = [0.1, 0.1, 0.06], cells = [6, 6, 4], element = "hex8", origin = [-0.04, -0.045, -0.06] }}
material = {{ law = "linear", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "block"
region = "z-min"
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = 0.1 }}
position = [0, 0, 0.10001]
motion = {{ kind = "translate", velocity = [0, 0, -5e-4] }}
[[probe]]
name = "press"
between = ["ball", "block"]
sum = "contact_force"
"#
        ))
    };
    for friction in [0.0, 0.3] {
        let [coarse, fine] = [1.0, 0.025].map(|step| press(step, friction));
        let iterations = coarse.report()["work"]["newton_iterations"].as_u64().expect("a count");
        // Fifty increments of four iterations each at least, if each were as small as the layer.
        assert!(iterations < 100, "{iterations}");
        let [force, expected] = [coarse, fine].map(|program| program.history().last("press.fz"));
        // Friction depends on the path, to the order of the increments.
        let tolerance = if friction == 0.0 { 1e-8 } else { 2e-3 };
        assert!((force / expected - 1.0).abs() < tolerance, "{friction}: {force} {expected}");
    }
}

/// Two blocks on each other, the upper one of `width` (m), pressed together by 2 mm. The layer is .1 mm.
fn two_blocks(width: f64, friction: f64, cells: [&str; 2], poisson: f64) -> String {
    let half = 0.5 * width;
    let [low, high] = cells;
    format!(
        r#"
[time]
end = 1.0
step = 0.25
[static]
smallest_increment = 0.2
[contact]
self = false
friction = {friction}
distance = 1e-4
[[body]]
name = "low"
box = {{ size = [0.1, 0.1, 0.1], cells = {low}, element = "hex8", origin = [-0.05, -0.05, -0.1] }}
material = {{ law = "linear", young = 1e6, poisson = {poisson}, density = 1000.0 }}
[[body]]
name = "high"
box = {{ size = [{width}, {width}, 0.1], cells = {high}, element = "hex8", origin = [-{half}, -{half}, 1e-4] }}
material = {{ law = "linear", young = 4e6, poisson = {poisson}, density = 1000.0 }}
[[fix]]
body = "low"
region = "z-min"
[[fix]]
body = "high"
region = "z-max"
motion = {{ kind = "translate", velocity = [0.0, 0.0, -2.1e-3] }}
[[probe]]
name = "f"
between = ["high", "low"]
sum = "contact_force"
"#
    )
}

/// Without friction, nodes slide off rims that lie on each other: such blocks find no equilibrium in increments that serve others, and the error
/// says what to change. If it is changed, or if friction holds the nodes, they press straight down, with the force of two springs in series
/// and that of the sides that bulge.
#[test]
fn blocks_with_rims_on_each_other_are_named_and_narrower_ones_press_straight() {
    for (low, high, friction, poisson, most) in [
        ("[4, 4, 2]", "[2, 2, 1]", 0.0, 0.0, 0.06),
        ("[5, 5, 2]", "[4, 4, 2]", 0.0, 0.3, 0.15),
        ("[3, 3, 2]", "[2, 3, 2]", 0.3, 0.0, 0.06),
    ] {
        let press = |width: f64| {
            let program = Program::run(&two_blocks(width, friction, [low, high], poisson));
            let history = program.history();
            let [x, y, z] = ["f.fx", "f.fy", "f.fz"].map(|name| *history.column(name).last().unwrap());
            assert!(x.hypot(y) < 2e-6 * z, "{low} {high}: {x} {y} {z}");
            let springs = 2e-3 * width * width / (0.1 / 1e6 + 0.1 / 4e6);
            assert!((0.0..most).contains(&(z / springs - 1.0)), "{low} {high}: {z} {springs}");
        };
        press(0.0998);
        if friction > 0.0 {
            press(0.1);
            continue;
        }
        let program = Program::try_run(&two_blocks(0.1, friction, [low, high], poisson), &[]);
        let said = program.errors();
        assert_eq!(program.code(), Some(4), "{said}");
        assert!(said.contains("by this layer or more on each side, because rims of both lie on"), "{said}");
    }
}

/// Where no rims lie on each other, an error does not speak of them.
#[test]
fn a_narrow_block_that_finds_no_equilibrium_has_no_rims_on_others() {
    let scene = two_blocks(0.05, 0.0, ["[4, 4, 2]", "[2, 2, 1]"], 0.0).replace("-2.1e-3]", "-0.3]");
    let program = Program::try_run(&scene, &[]);
    let said = program.errors();
    assert_eq!(program.code(), Some(4), "{said}");
    assert!(said.contains("'high'") && !said.contains("rims"), "{said}");
}

/// A soft block that falls onto a floor by a fifth of its height, with friction, rests there with its weight and without a force along the
/// floor. So does one that falls onto a soft slab by its height, where its nodes meet edges of the slab. If it is pressed and pushed on a
/// slab, friction balances the push.
#[test]
fn blocks_with_friction_come_to_rest_from_afar() {
    let block = |name: &str, size: &str, cells: &str, origin: &str| {
        format!(
            "[[body]]\nname = \"{name}\"\nbox = {{ size = {size}, cells = {cells}, origin = {origin} }}\n\
             material = {{ law = \"neo-hookean\", young = 1e5, poisson = 0.3, density = 1000.0 }}\n"
        )
    };
    let common =
        "gravity = [0.0, 0.0, -9.81]\n[time]\nend = 1.0\nstep = 0.5\n[static]\n[contact]\nfriction = 0.5\n";
    let probe = |other: &str| {
        format!("[[probe]]\nname = \"f\"\nbetween = [\"top\", \"{other}\"]\nsum = \"contact_force\"\n")
    };
    let floor =
        "[[rigid]]\nname = \"floor\"\nfixed = true\nshape = { kind = \"plane\", normal = [0.0, 0.0, 1.0] }\n";
    let falls = format!(
        "{common}{}{floor}{}",
        block("top", "[0.1, 0.1, 0.1]", "[4, 4, 4]", "[0.0, 0.0, 0.02]"),
        probe("floor")
    );
    let pushed = format!(
        "{common}{}{}[[fix]]\nbody = \"slab\"\nregion = \"z-min\"\n[[load]]\nkind = \"force\"\nbody = \"top\"\n\
         region = \"z-max\"\nforce = [1.0, 0.0, -2.0]\namplitude = \"t\"\n{}",
        block("slab", "[0.3, 0.3, 0.05]", "[6, 6, 2]", "[0.0, 0.0, 0.0]"),
        block("top", "[0.1, 0.1, 0.1]", "[4, 4, 4]", "[0.11, 0.12, 0.0505]"),
        probe("slab")
    );
    let aligned = format!(
        "{common}{}{}[[fix]]\nbody = \"slab\"\nregion = \"z-min\"\n{}",
        block("slab", "[0.2, 0.2, 0.05]", "[4, 4, 1]", "[0.0, 0.0, 0.0]"),
        block("top", "[0.1, 0.1, 0.1]", "[2, 2, 2]", "[0.05, 0.05, 0.15]"),
        probe("slab")
    );
    let roughly = pushed.replace("[static]\n", "[static]\ntolerance = 0.1\n");
    for (scene, expected, accuracy) in [
        (falls, [0.0, 0.0, 9.81], 1e-5),
        (aligned, [0.0, 0.0, 9.81], 1e-5),
        (pushed, [-1.0, 0.0, 11.81], 1e-5),
        (roughly, [-1.0, 0.0, 11.81], 0.1),
    ] {
        let program = Program::run(&scene);
        let history = program.history();
        let force = ["f.fx", "f.fy", "f.fz"].map(|name| history.last(name));
        for (force, expected) in force.iter().zip(expected) {
            assert!((force - expected).abs() < accuracy * 9.81, "{force} N, expected {expected} N");
        }
        let iterations = program.report()["work"]["newton_iterations"].as_u64().unwrap();
        assert!(iterations < 2000, "{iterations} iterations");
    }
}
