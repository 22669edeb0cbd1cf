//! Tests the account of loads that change with time and have a potential: its error has the order of the scheme, so that the drift of
//! energy judges the scheme and not the account.

use crate::program::Program;

/// The support of loads that need one.
const FIXED: &str = "[[fix]]\nbody = \"b\"\nregion = \"x-min\"\n";
/// The loads by name, each with its text of the scene before the table of the body, and after it.
const LOADS: [(&str, &str, &str); 6] = [
    ("gravity", "gravity = [0.0, -9.81, 0.0]\ngravity_amplitude = \"cos(15*t)\"\n", FIXED),
    (
        "moving springs",
        "",
        "[[attach]]\nbody = \"b\"\nregion = \"x-min\"\nstiffness = 300.0\nmotion = { kind = \"rotate\", axis = [0, 0, 1], rate = 4.0 }\n",
    ),
    (
        "traction",
        "",
        "[[load]]\nkind = \"traction\"\nbody = \"b\"\nregion = \"x-max\"\ntraction = [0.0, \"2000*y\", 100.0]\namplitude = \"sin(30*t)\"\n",
    ),
    (
        "point force",
        "",
        "[[load]]\nkind = \"point\"\nbody = \"b\"\npoint = [0.4, 0.2, 0.2]\nforce = [0.0, 20.0, 5.0]\namplitude = \"sin(30*t)\"\n",
    ),
    (
        "body force",
        "",
        "[[load]]\nkind = \"body-force\"\nbody = \"b\"\nforce = [0.0, 2000.0, 5.0]\namplitude = \"sin(30*t)\"\n",
    ),
    (
        "pressure",
        "",
        "[[load]]\nkind = \"pressure\"\nbody = \"b\"\nregion = \"box\"\npressure = 3000.0\namplitude = \"sin(30*t)\"\n",
    ),
];

/// Returns the drift of energy of a body under a load over 0.2 s, relative to the largest kinetic energy.
fn drift((name, before, after): (&str, &str, &str), scheme: &str, step: f64) -> f64 {
    let fix = if after.contains("[[fix]]") || after.contains("[[attach]]") { "" } else { FIXED };
    let program = Program::run(&format!(
        r#"
{before}
[time]
end = 0.2
step = {step:e}
{scheme}
[[body]]
name = "b"
box = {{ size = [0.4, 0.2, 0.2], cells = [2, 1, 1] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
{fix}{after}
[output]
ledger = true
[solver]
tolerance = 1e-13
"#
    ));
    let energy = &program.report()["energy"];
    let number = |key: &str| energy[key].as_f64().unwrap();
    assert!(number("force_work").abs() > 1e-3, "{name}: the load does no work: {energy}");
    assert!(number("unexplained").abs() < 1e-12, "{name}, {scheme}: {energy}");
    number("relative_drift").abs()
}

/// The discrete gradient of energy–momentum acts at the middle of a step: the balance closes to round-off at any step.
#[test]
fn energy_momentum_balances_loads_to_round_off() {
    for load in LOADS {
        for step in [8e-3, 2e-3] {
            let drift = drift(load, "scheme = \"energy-momentum\"", step);
            assert!(drift < 1e-11, "{}, h = {step:e} s: {drift:e}", load.0);
        }
    }
}

/// Schemes with stages book the work by their own nodes and weights. The orders of Blanes and Moan hold for forces −∂V/∂q with a
/// potential V(q, t), and not for integrals along the motion, for which both schemes have order 4.
#[test]
fn the_account_of_loads_has_the_order_of_the_scheme() {
    let schemes = [
        ("scheme = \"gauss\"\nstages = 2", 4.0),
        ("scheme = \"gauss\"\nstages = 3", 6.0),
        ("scheme = \"blanes-moan-4\"", 4.0),
        ("scheme = \"blanes-moan-6\"", 4.0),
    ];
    for load in LOADS {
        for (scheme, order) in schemes {
            let [coarse, fine] = [4e-3, 2e-3].map(|step| drift(load, scheme, step));
            let observed = (coarse / fine).log2();
            // Errors near round-off have no order.
            assert!(
                coarse < 1e-11 || observed > order - 0.6,
                "{}, {scheme}: {coarse:e} and {fine:e}, order {observed}",
                load.0
            );
        }
    }
}

/// The supports of a body whose coordinates are all prescribed do what its energy takes, besides damping. A cube is sheared by γ = g t
/// while it is lifted: its rates Ė₁₃ = g/2 and Ė₃₃ = γ g dissipate 2η ∫ (g²/2 + γ² g²) dt, and the weight of its moved half takes m g
/// a half of the lift.
#[test]
fn the_supports_of_a_wholly_held_body_do_its_work() {
    let (rate, lift, end, viscosity) = (0.2_f64, 0.3_f64, 0.5_f64, 50.0_f64);
    for (time, damping) in [
        ("scheme = \"stormer-verlet\"", true),
        ("scheme = \"implicit-midpoint\"", true),
        ("scheme = \"backward-euler\"", false),
        ("scheme = \"gauss\"", false),
        ("[static]", false),
    ] {
        for other in [false, true] {
            // A second body, which flies, has its own energy.
            if other && (damping || time == "[static]") {
                continue;
            }
            let damped =
                if damping { format!("[damping]\nshear_viscosity = {viscosity}") } else { String::new() };
            let flying = match other {
                true => {
                    "[[body]]\nname = \"c\"\nbox = { size = [1, 1, 1], cells = [1, 1, 1], origin = [5, 0, 0] }\n\
                         material = { law = \"neo-hookean\", young = 2e5, poisson = 0.3, density = 1.0 }\n\
                         velocity = [1.0, 0.0, 0.0]\n"
                }
                false => "",
            };
            let gravity = if other { "" } else { "gravity = [0.0, 0.0, -9.81]" };
            let program = Program::run(&format!(
                r#"
{gravity}
[time]
end = {end}
step = 0.01
{time}
{damped}
[[body]]
name = "b"
box = {{ size = [1, 1, 1], cells = [1, 1, 1], element = "hex8" }}
material = {{ law = "neo-hookean", young = 2e5, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "b"
region = "z-min"
[[fix]]
body = "b"
region = "z-max"
motion = {{ kind = "translate", velocity = [{rate}, 0, {}] }}
{flying}
"#,
                if damping { 0.0 } else { lift }
            ));
            let energy = &program.report()["energy"];
            let of = |key: &str| energy[key].as_f64().unwrap_or_else(|| panic!("{key}: {energy}"));
            let change = of("final") - of("initial");
            assert!(change > 100.0, "{energy}");
            let lost = if damping {
                2.0 * viscosity * rate * rate * (end / 2.0 + rate * rate * end.powi(3) / 3.0)
            } else {
                0.0
            };
            assert!((of("damping_work") + lost).abs() < 1e-9 * change, "{time}: {lost}, {energy}");
            assert!((of("prescribed_work") - change - lost).abs() < 1e-9 * change, "{time}: {energy}");
            assert!(of("unexplained").abs() < 1e-10 * change, "{time}: {energy}");
            if !other && !damping {
                let history = program.history();
                let elastic = history.column("elastic").last().copied().unwrap_or_default();
                let weight = 1000.0 * 9.81 * 0.5 * lift * end;
                assert!(
                    (change - elastic - weight).abs() < 1e-9 * change,
                    "{time}: {elastic}, {weight}, {energy}"
                );
            }
        }
    }
}
