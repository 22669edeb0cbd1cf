//! Balls that come to rest on soft bodies with friction.

use crate::program::Program;

const COMMON: &str = "gravity = [0.0, 0.0, -9.81]\n[time]\nend = 1.0\nstep = 1.0\n[static]\n";

/// Returns a box of stable-neo-Hookean material that is held at its lower side.
fn block(name: &str, element: &str, size: &str, cells: &str, origin: &str, young: &str) -> String {
    format!(
        "[[body]]\nname = \"{name}\"\nbox = {{ size = {size}, cells = {cells}, element = \"{element}\", origin = {origin} }}\n\
         material = {{ law = \"stable-neo-hookean\", young = {young}, poisson = 0.3, density = 1000.0 }}\n\
         [[fix]]\nbody = \"{name}\"\nregion = \"z-min\"\n"
    )
}

fn ball(radius: &str, position: &str, mass: &str) -> String {
    format!(
        "[[rigid]]\nname = \"ball\"\nshape = {{ kind = \"sphere\", radius = {radius} }}\n\
         position = {position}\nmass = {mass}\n"
    )
}

/// A ball that falls onto a slab, and one that falls between four blocks, rest there with their weight. Friction holds them, so passes with
/// lagged friction come close to the equilibrium but converge slowly: the ball turns, which no stiffness resists.
#[test]
fn balls_with_friction_come_to_rest() {
    let falls = [
        block("slab", "hex8", "[0.3, 0.3, 0.1]", "[8, 8, 2]", "[0.0, 0.0, 0.0]", "8.6e5"),
        ball("0.05", "[0.15, 0.15, 0.21]", "2.0"),
    ];
    let corners = ["[0.0, 0.0, 0.0]", "[0.146, 0.0, 0.0]", "[0.0, 0.146, 0.0]", "[0.146, 0.146, 0.0]"];
    let pocket = corners
        .iter()
        .enumerate()
        .map(|(k, origin)| block(&format!("b{k}"), "tet4", "[0.1, 0.1, 0.1]", "[2, 2, 2]", origin, "6.8e4"));
    let pocket: Vec<String> = pocket.chain([ball("0.14", "[0.123, 0.123, 0.241]", "1.3")]).collect();
    let slab = ["slab".to_owned()];
    let blocks = [0, 1, 2, 3].map(|k| format!("b{k}"));
    for (bodies, friction, mass, others) in
        [(falls.concat(), 0.5, 2.0, slab.as_slice()), (pocket.concat(), 0.3, 1.3, &blocks)]
    {
        let probe = |other: &String| {
            format!(
                "[[probe]]\nname = \"{other}\"\nbetween = [\"ball\", \"{other}\"]\nsum = \"contact_force\"\n"
            )
        };
        let probes: String = others.iter().map(probe).collect();
        let program = Program::run(&format!("{COMMON}[contact]\nfriction = {friction}\n{bodies}{probes}"));
        let history = program.history();
        for (axis, expected) in [("fx", 0.0), ("fy", 0.0), ("fz", 9.81 * mass)] {
            let force: f64 = others.iter().map(|other| history.last(&format!("{other}.{axis}"))).sum();
            assert!(
                (force - expected).abs() < 1e-5 * 9.81 * mass,
                "{axis}: {force} N, expected {expected} N"
            );
        }
        let iterations = program.report()["work"]["newton_iterations"].as_u64().unwrap();
        assert!(iterations < 500, "{iterations} iterations");
    }
}
