//! Tests equilibria of rigid bodies and joints alone: what joints hold completely stays where it is, whatever its weight is.

use crate::program::Program;

/// Returns the columns of the last row that give the pose of `name`: x, y, z, qw, qx, qy, qz.
fn pose(program: &Program, name: &str) -> [f64; 7] {
    let history = program.history();
    ["x", "y", "z", "qw", "qx", "qy", "qz"].map(|column| history.last(&format!("{name}.{column}")))
}

fn is_near(found: [f64; 7], expected: [f64; 7]) -> bool {
    found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9)
}

/// Two boxes in a row, the first welded to the world and the second to the first, keep their poses under weights in several directions.
#[test]
fn welded_boxes_stay() {
    for gravity in [[0.5, -9.0, 2.0], [0.0, -9.81, 0.0], [-9.0, 0.3, 0.2], [0.0, 0.01, 400.0]] {
        let scene = Program::run(&format!(
            r#"
gravity = {gravity:?}
[time]
end = 1.0
step = 1.0
[static]
[[rigid]]
name = "a"
shape = {{ kind = "box", size = [0.5, 0.1, 0.2] }}
density = 500.0
position = [0.25, 0.0, 0.0]
[[rigid]]
name = "c"
shape = {{ kind = "box", size = [0.5, 0.1, 0.2] }}
density = 500.0
position = [0.75, 0.0, 0.0]
[[joint]]
kind = "weld"
body = "a"
point = [0.0, 0.0, 0.0]
[[joint]]
kind = "weld"
body = "c"
to = "a"
point = [0.5, 0.0, 0.0]
"#
        ));
        for (name, x) in [("a", 0.25), ("c", 0.75)] {
            let found = pose(&scene, name);
            assert!(is_near(found, [x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), "{gravity:?}: {name} {found:?}");
        }
    }
}

/// A three-hinged arch carries its weight in compression; it does not fall through its line of supports.
#[test]
fn a_three_hinged_arch_stands() {
    let half = 0.5 * std::f64::consts::FRAC_PI_4;
    let rod = |name: &str, x: f64, angle: f64| {
        format!(
            "[[rigid]]\nname = \"{name}\"\nshape = {{ kind = \"rod\", length = {:?}, radius = 0.02 }}\ndensity = 500.0\n\
             position = [{x:?}, 0.25, 0.0]\norientation = {{ axis = [0.0, 0.0, 1.0], angle = {angle:?} }}\n",
            0.5_f64.sqrt()
        )
    };
    let hinge = |body: &str, point: [f64; 3]| {
        format!("[[joint]]\nkind = \"hinge\"\n{body}\npoint = {point:?}\naxis = [0.0, 0.0, 1.0]\n")
    };
    let scene = Program::run(&format!(
        "gravity = [0.0, -9.81, 0.0]\n[time]\nend = 1.0\nstep = 1.0\n[static]\n{}{}{}{}{}",
        rod("a", 0.25, 2.0 * half),
        rod("c", 0.75, -2.0 * half),
        hinge("body = \"a\"", [0.0, 0.0, 0.0]),
        hinge("body = \"c\"\nto = \"a\"", [0.5, 0.5, 0.0]),
        hinge("body = \"c\"", [1.0, 0.0, 0.0]),
    ));
    for (name, x, sign) in [("a", 0.25, 1.0), ("c", 0.75, -1.0)] {
        let found = pose(&scene, name);
        let expected = [x, 0.25, 0.0, half.cos(), 0.0, 0.0, sign * half.sin()];
        assert!(is_near(found, expected), "{name}: {found:?}");
    }
}
