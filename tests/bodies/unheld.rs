//! Tests statics of bodies that nothing holds: an error names the free motion, unless the loads balance.

use crate::program::Program;

const TIME: &str = "[time]\nend = 1.0\nstep = 0.5\n[static]\n";

fn block(name: &str, origin: &str, law: &str) -> String {
    format!(
        "[[body]]\nname = \"{name}\"\nbox = {{ size = [1.0, 0.2, 0.2], cells = [6, 2, 2], origin = {origin} }}\n\
         material = {{ law = \"{law}\", young = 1e7, poisson = 0.3, density = 1000.0 }}\n"
    )
}

fn fix(body: &str, axes: &str) -> String {
    format!("[[fix]]\nbody = \"{body}\"\nregion = \"x-min\"\naxes = {axes}\n")
}

/// Wherever a body may move freely and its loads along that motion do not balance, the run ends with exit code 4 and says which body,
/// which axis and how much force.
#[test]
fn a_free_motion_under_load_is_named() {
    let weight = "gravity = [0.0, -9.81, 0.0]\n";
    let sheet = "[[body]]\nname = \"b\"\nsheet = { size = [1.0, 0.5], cells = [8, 4] }\nmaterial = { law = \
                 \"st-venant-kirchhoff\", young = 1e6, poisson = 0.3, density = 1000.0, thickness = 2e-3 }\n";
    let pull = |force: &str, amplitude: &str| {
        format!(
            "[[load]]\nkind = \"force\"\nbody = \"b\"\nregion = \"x-max\"\nforce = {force}\namplitude = \"{amplitude}\"\n"
        )
    };
    let b = |law: &str| block("b", "[0.0, 0.0, 0.0]", law);
    let all = "[\"x\", \"y\", \"z\"]";
    for (scene, named) in [
        (
            format!("{weight}{TIME}{}", b("neo-hookean")),
            "'b' along y, and the loads along y sum to -3.924e2 N",
        ),
        (format!("{weight}{TIME}{}{}", b("st-venant-kirchhoff"), fix("b", "[\"x\"]")), "'b' along y"),
        (
            format!(
                "{weight}{TIME}{}{}{}",
                b("linear"),
                fix("b", "[\"x\", \"y\"]"),
                pull("[0.0, 0.0, 1.0]", "1")
            ),
            "'b' along z, and the loads along z sum to 1.000e0 N",
        ),
        (format!("{TIME}{}{}", b("neo-hookean"), pull("[0.4, 0.0, 0.0]", "t")), "'b' along x"),
        (format!("{weight}{TIME}{sheet}{}", fix("b", "[\"x\", \"z\"]")), "'b' along y"),
        (
            format!(
                "{weight}{TIME}{}{}{}",
                b("neo-hookean"),
                fix("b", all),
                block("c", "[3.0, 0.0, 0.0]", "neo-hookean")
            ),
            "'c' along y",
        ),
    ] {
        let program = Program::try_run(&scene, &[]);
        // The report counts the work of the step that failed.
        let iterations = &program.report()["work"]["newton_iterations"];
        assert!(iterations.as_u64() > Some(0), "{iterations}");
        let errors = program.errors();
        assert_eq!(program.code(), Some(4), "{scene}\n{errors}");
        assert!(errors.contains(&format!("nothing holds {named}")), "{scene}\n{errors}");
        assert!(errors.contains("[[fix]]"), "{errors}");
    }
}

/// A free body whose loads balance, or that has none, is in equilibrium; its free motions are no buckling.
#[test]
fn balanced_loads_need_no_support() {
    let b = block("b", "[0.0, 0.0, 0.0]", "st-venant-kirchhoff");
    let end = |region: &str, force: f64| {
        format!(
            "[[load]]\nkind = \"force\"\nbody = \"b\"\nregion = \"{region}\"\nforce = [{force}, 0.0, 0.0]\namplitude = \"t\"\n"
        )
    };
    let probe = |name: &str, region: &str| {
        format!(
            "[[probe]]\nname = \"{name}\"\nbody = \"b\"\nregion = \"{region}\"\nmean = \"displacement.x\"\n"
        )
    };
    let probes = format!("{}{}", probe("p", "x-max"), probe("q", "x-min"));
    let program = Program::run(&format!("{TIME}{b}{}{}{probes}", end("x-max", 100.0), end("x-min", -100.0)));
    let notes = program.report()["notes"].to_string();
    assert!(!notes.contains("buckles") && !notes.contains("limit point"), "{notes}");
    // The bar of 0.04 m² and 10 MPa is longer by F L/(E A).
    let history = program.history();
    let longer = history.last("p.mean.displacement.x") - history.last("q.mean.displacement.x");
    let expected = 100.0 / (1e7 * 0.04);
    assert!((longer / expected - 1.0).abs() < 2e-2, "{longer:e} m, expected {expected:e} m");
}
