//! Tests `variational convergence`: it finds known orders, and its error bars contain exact values.

use crate::program::command;
use serde_json::Value;
use tempfile::TempDir;

fn study(scene: &str, arguments: &[&str]) -> (i32, Value, String) {
    let directory = TempDir::new().unwrap();
    std::fs::write(directory.path().join("scene.toml"), scene).unwrap();
    let output = command()
        .current_dir(directory.path())
        .args(["convergence", "scene.toml", "--json", "--out", "out"])
        .args(arguments)
        .output()
        .unwrap();
    let code = output.status.code().unwrap();
    if code == 0 {
        let csv = std::fs::read_to_string(directory.path().join("out/convergence.csv")).unwrap();
        assert!(csv.starts_with("study,refined,nodes,steps,step,seconds,"));
        let chart = std::fs::read_to_string(directory.path().join("out/convergence.svg")).unwrap();
        assert!(chart.starts_with("<svg") && chart.ends_with("</svg>\n"));
    }
    let errors = String::from_utf8(output.stderr).unwrap();
    (code, serde_json::from_slice(&output.stdout).unwrap_or(Value::Null), errors)
}

fn row<'a>(report: &'a Value, of: &str, quantity: &str) -> &'a Value {
    let studies = report["studies"].as_array().unwrap();
    let study = studies.iter().find(|study| study["of"] == of).unwrap();
    study["rows"].as_array().unwrap().iter().find(|row| row["quantity"] == quantity).unwrap()
}

/// Returns whether a quantity is left out, or reported as zero to round-off with an error bar of that size.
fn is_absent_or_zero(report: &Value, of: &str, quantity: &str) -> bool {
    let studies = report["studies"].as_array().unwrap();
    let study = studies.iter().find(|study| study["of"] == of).unwrap();
    let found = study["rows"].as_array().unwrap().iter().find(|row| row["quantity"] == quantity);
    found.is_none_or(|row| row["verdict"] == "is-zero" && row["error"].as_f64().unwrap() < 1e-11)
}

const BAR: &str = r#"
    [time]
    end = 1.0
    step = 0.05
    scheme = "SCHEME"
    [solver]
    tolerance = 1e-12
    [[body]]
    name = "bar"
    box = { size = [1.0, 0.2, 0.2], cells = [4, 1, 1], element = "hex8" }
    material = { law = "linear", young = 1.0, poisson = 0.0, density = 1.0 }
    [[fix]]
    body = "bar"
    region = "x-min"
    [[load]]
    kind = "body-force"
    body = "bar"
    force = ["sin(pi*x/2)", 0.0, 0.0]
    [[probe]]
    name = "tip"
    body = "bar"
    point = [1.0, 0.0, 0.0]
"#;

/// The solution is u = sin(πx/2) (1 − cos ωt)/ω² with ω = π/2. It is smooth, so linear elements and midpoint are of
/// order 2.
#[test]
fn a_vibrating_bar_is_of_order_two_in_space_and_in_time() {
    for scheme in ["implicit-midpoint", "stormer-verlet"] {
        let (code, report, errors) = study(&BAR.replace("SCHEME", scheme), &[]);
        assert_eq!(code, 0, "{errors}");
        for of in ["space", "time"] {
            let order = row(&report, of, "tip.ux")["observed_order"].as_f64().unwrap();
            assert!((order - 2.0).abs() < 0.15, "{scheme} {of}: {order}");
        }
        // Nothing moves across the bar, and the round-off of that displacement does not show convergence.
        for of in ["space", "time"] {
            for across in ["tip.uy", "tip.uz"] {
                assert!(is_absent_or_zero(&report, of, across), "{scheme} {of} {across}: {report:#}");
            }
        }
        let exact = (2.0 / std::f64::consts::PI).powi(2);
        let estimates = report["estimates"].as_array().unwrap();
        let tip = estimates.iter().find(|estimate| estimate["quantity"] == "tip.ux").unwrap();
        let (value, bar) = (tip["value"].as_f64().unwrap(), tip["error"].as_f64().unwrap());
        assert_eq!(tip["verdict"], "converges");
        assert!((value - exact).abs() < bar && bar < 0.01 * exact, "{scheme}: {value} ± {bar}, {exact}");
    }
}

/// Statics and modes are studied in space alone, here for a bar under a load that its elements cannot represent
/// exactly.
#[test]
fn statics_and_modes_are_studied_in_space() {
    let scene = BAR
        .replace("SCHEME", "implicit-midpoint")
        .replace("[solver]", "[static]\n    tolerance = 1e-12\n    [solver]");
    let (code, report, errors) = study(&scene, &["--levels", "4"]);
    assert_eq!(code, 0, "{errors}");
    assert_eq!(report["studies"].as_array().unwrap().len(), 1);
    let energy = row(&report, "space", "elastic");
    // The exact energy is ½ ∫ u'² dx with u = sin(πx/2)/ω².
    let exact = 0.5 * 0.5 * (2.0 / std::f64::consts::PI).powi(2) * 0.04;
    let order = energy["observed_order"].as_f64().unwrap();
    assert!(
        (order - 2.0).abs() < 0.1 && (energy["value"].as_f64().unwrap() / exact - 1.0).abs() < 1e-4,
        "{energy}"
    );
    let (code, report, errors) = study(&scene, &["--modes", "1"]);
    assert_eq!(code, 0, "{errors}");
    let found = row(&report, "space", "mode 0")["value"].as_f64().unwrap();
    // The lowest mode of this thick beam is a bending mode, or the axial one at 1/4 Hz; the test needs only that it
    // converges.
    assert!(found > 0.0 && found < 0.26, "{found}");
    let (code, _, errors) = study(&scene, &["--time"]);
    assert!(code == 2 && errors.contains("no time study"), "{errors}");
}

/// Angular springs on edges do not converge to a plate: where their numbers are compared, a note says so and names what does.
#[test]
fn hinges_are_said_not_to_converge_to_a_plate() {
    let plate = |bending: &str| {
        format!(
            r#"
            [time]
            end = 1.0
            step = 1.0
            scheme = "implicit-midpoint"
            [[body]]
            name = "plate"
            sheet = {{ size = [1.0, 1.0], cells = [2, 2] }}
            material = {{ law = "st-venant-kirchhoff", young = 1e9, poisson = 0.3, area_density = 10.0, thickness = 0.01, bending = "{bending}" }}
            [[fix]]
            body = "plate"
            region = "x-min"
            "#
        )
    };
    for (bending, is_told) in [("hinge", true), ("shell", false)] {
        let (code, report, errors) = study(&plate(bending), &["--modes", "1", "--levels", "2"]);
        assert_eq!(code, 0, "{errors}");
        let notes = report["notes"].to_string();
        assert_eq!(
            notes.contains("not to a plate") && notes.contains("shell"),
            is_told,
            "{bending}: {notes}"
        );
    }
}
