//! The same scene gives the same bits on 1, 2 and 8 threads: history and frames, byte for byte.

mod program;

use program::Program;

const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = END
step = STEP
scheme = "SCHEME"
[[body]]
name = "bracket"
mesh = "MESHES/bracket.msh"
material = { law = "stable-neo-hookean", young = 1e6, poisson = 0.4, density = 1000.0 }
[[fix]]
body = "bracket"
region = "bolts"
[[probe]]
name = "edge"
body = "bracket"
point = [0.0, 0.0, 0.06]
[output]
interval = INTERVAL
fields = ["displacement", "velocity"]
"#;

fn same_bits(scheme: &str, end: f64, step: f64) {
    let scene = SCENE
        .replace("SCHEME", scheme)
        .replace("END", &end.to_string())
        .replace("STEP", &step.to_string())
        .replace("INTERVAL", &(end / 2.0).to_string());
    let runs = ["1", "2", "8"].map(|threads| Program::run_with(&scene, &["--threads", threads]));
    let mut files: Vec<_> =
        std::fs::read_dir(runs[0].out()).unwrap().map(|e| e.unwrap().file_name()).collect();
    files.retain(|file| file != "report.json");
    assert_eq!(files.len(), 5, "{files:?}");
    for file in files {
        let bytes = runs.each_ref().map(|run| std::fs::read(run.out().join(&file)).unwrap());
        assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2], "{scheme}: {file:?} differs");
    }
}

#[test]
fn explicit_runs() {
    same_bits("stormer-verlet", 2e-3, 1e-5);
}

#[test]
fn implicit_runs() {
    same_bits("implicit-midpoint", 0.02, 4e-3);
    same_bits("gauss", 0.01, 5e-3);
}
