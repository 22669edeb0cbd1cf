//! Laws of contact in scenes: nothing crosses, energy is kept through every impact, and runs continue to the same bits.

mod program;

use program::Program;

/// A soft block that falls on a floor, 10 cm below it.
fn block(scheme: &str, more: &str) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.3
step = 1e-3
scheme = "{scheme}"
[contact]
{more}
[[body]]
name = "block"
box = {{ size = [0.2, 0.2, 0.2], cells = [2, 2, 2], element = "tet4", origin = [0.0, 0.0, 0.1] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
position = [0.0, 0.0, 0.0]
fixed = true
[solver]
tolerance = 1e-8
[output]
ledger = true
"#
    )
}

/// Largest |H − H₀ − what was dissipated| over the largest kinetic energy.
fn drift(program: &Program) -> f64 {
    let history = program.history();
    let [total, friction, damping] =
        ["total", "friction", "contact_damping"].map(|name| history.column(name));
    let kinetic = history.column("kinetic").into_iter().fold(0.0, f64::max);
    let kept = |row: usize| total[row] - friction[row] - damping[row];
    (0..total.len()).map(|row| (kept(row) - kept(0)).abs()).fold(0.0, f64::max) / kinetic
}

#[test]
fn a_block_bounces_on_a_floor_and_keeps_its_energy() {
    for (scheme, bound) in [("energy-momentum", 1e-9), ("implicit-midpoint", 2e-2), ("stormer-verlet", 2e-2)]
    {
        let program = Program::run(&block(scheme, ""));
        let history = program.history();
        let found = drift(&program);
        assert!(found < bound, "{scheme}: {found:e}");
        assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
        assert!(history.column("pairs").iter().any(|&pairs| pairs > 0.0), "{scheme}");
        let report = program.report();
        let unexplained = report["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-10, "{scheme}: {unexplained:e}");
    }
}
