//! Tests steps that follow the motion of bodies in contact. Intervals are made again when their ends require another
//! number of steps, and nothing of the first attempt may remain in the friction, the forces or the ledger.

use crate::contact::assert_same_bits;
use crate::program::Program;

/// A soft block that turns falls on a floor, where it bounces, slides and shivers.
fn impact(scheme: &str, friction: f64) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.12
step = "adaptive"
largest_step = 4e-3
tolerance = 2e-3
scheme = "{scheme}"
[contact]
friction = {friction}
[[body]]
name = "block"
box = {{ size = [0.1, 0.1, 0.04], cells = [2, 2, 1], element = "hex8", origin = [0.0, 0.0, 2e-3] }}
material = {{ law = "neo-hookean", young = 3e4, poisson = 0.3, density = 1000.0 }}
velocity = [0.5, 0.0, "-1.0 - 4*x"]
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
[[probe]]
name = "push"
between = ["block", "floor"]
sum = "contact_force"
[solver]
tolerance = 1e-10
[output]
history = 1
ledger = true
[assert]
intersections = 0
smallest_gap = 1e-9
"#
    )
}

/// The impulse of the floor balances the change of momentum and the impulse of weight, the ledger is complete, and
/// friction only takes energy.
#[test]
fn repeated_intervals_leave_no_trace() {
    for (scheme, lost) in [("energy-momentum", 1e-6), ("implicit-midpoint", 5e-2), ("backward-euler", 1.0)] {
        let program = Program::run(&impact(scheme, 0.4));
        let report = program.report();
        let adaptive = &report["adaptive"];
        let count = |name: &str| adaptive[name].as_u64().unwrap();
        assert!(
            count("intervals_repeated") > 2 && count("steps") > count("intervals"),
            "{scheme}: {adaptive}"
        );
        let history = program.history();
        let (t, friction) = (history.column("t"), history.column("friction"));
        for (axis, weight) in [("x", 0.0), ("z", -0.4 * 9.81)] {
            let (force, momentum) =
                (history.column(&format!("push.f{axis}")), history.column(&format!("p{axis}")));
            let mut impulse = 0.0;
            for i in 1..t.len() {
                impulse += force[i] * (t[i] - t[i - 1]);
                let error = momentum[i] - momentum[0] - weight * t[i] - impulse;
                assert!(error.abs() < 1e-9, "{scheme}, {axis}, t = {}: {error:e} N s", t[i]);
            }
        }
        assert!(friction.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12), "{scheme}");
        assert!(history.last("friction") < -1e-3, "{scheme}: {}", history.last("friction"));
        let unexplained = report["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-9, "{scheme}: {unexplained:e}");
        assert!(history.imbalance() < lost, "{scheme}: {:e}", history.imbalance());
    }
}

#[test]
fn runs_are_the_same_on_any_threads_and_after_a_resume() {
    for scheme in ["energy-momentum", "backward-euler"] {
        assert_same_bits(scheme, &impact(scheme, 0.4), 0.03, 2);
    }
}
