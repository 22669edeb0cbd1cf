//! Tests stiff bodies that turn: the forces of a step must not depend on its rotation.

use crate::program::Program;

/// A body in free rotation is as easy to solve as one at rest, however stiff it is. The gradient in the middle of a step has a stress
/// of E θ²/8, with which each of these steps had to be divided.
#[test]
fn energy_momentum_turns_stiff_bodies_without_cuts() {
    for (young, law) in [(1e7, "neo-hookean"), (1e9, "neo-hookean"), (1e9, "st-venant-kirchhoff")] {
        let program = Program::run(&format!(
            r#"
[time]
end = 0.2
step = 1e-2
scheme = "energy-momentum"
[[body]]
name = "block"
box = {{ size = [1.0, 0.2, 0.3], cells = [4, 1, 1], element = "hex8" }}
material = {{ law = "{law}", young = {young}, poisson = 0.3, density = 1000.0 }}
angular_velocity = [0.0, 0.0, 1.0]
"#
        ));
        let report = program.report();
        let work = |name: &str| report["work"][name].as_u64().unwrap();
        assert_eq!(work("steps"), 20, "{young} {law}");
        assert!(work("newton_iterations") <= 8 * 20, "{young} {law}: {}", work("newton_iterations"));
        let drift = report["energy"]["relative_drift"].as_f64().unwrap();
        assert!(drift < 1e-10, "{young} {law}: {drift:e}");
    }
}
