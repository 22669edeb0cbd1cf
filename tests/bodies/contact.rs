//! Tests contact in scenes: nothing crosses, energy is kept through every impact, and resumed runs give the same bits.

use crate::program::Program;

/// Describes a soft block that falls from a height of 10 cm onto a floor.
pub(crate) fn block(scheme: &str, more: &str) -> String {
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

#[test]
fn a_block_bounces_on_a_floor_and_keeps_its_energy() {
    for (scheme, bound) in [("energy-momentum", 1e-9), ("implicit-midpoint", 2e-2), ("stormer-verlet", 2e-2)]
    {
        let program = Program::run(&block(scheme, ""));
        let history = program.history();
        let found = history.imbalance();
        assert!(found < bound, "{scheme}: {found:e}");
        assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
        assert!(history.column("pairs").iter().any(|&pairs| pairs > 0.0), "{scheme}");
        let report = program.report();
        let unexplained = report["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-10, "{scheme}: {unexplained:e}");
    }
}

/// Describes two boxes that slide and tumble on a table, a cloth over a ball, and a solid on a solid.
pub(crate) fn heap(scheme: &str, more: &str) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.1
step = 1e-3
scheme = "{scheme}"
[contact]
friction = 0.3
[[rigid]]
name = "table"
shape = {{ kind = "box", size = [1.0, 1.0, 0.1] }}
position = [0.0, 0.0, -0.05]
fixed = true
[[rigid]]
name = "brick"
shape = {{ kind = "box", size = [0.1, 0.2, 0.05] }}
density = 1000.0
position = [0.0, 0.0, 0.03]
velocity = [1.0, 0.0, 0.0]
[[body]]
name = "jelly"
box = {{ size = [0.1, 0.1, 0.1], cells = [1, 1, 1], element = "tet10", origin = [-0.05, -0.05, 0.057] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
{more}
[[probe]]
name = "on-table"
between = ["brick", "table"]
sum = "contact_force"
[output]
interval = 0.02
precision = "f64"
fields = ["displacement", "contact_pressure", "contact_traction", "gap"]
ledger = true
[assert]
intersections = 0
smallest_gap = 1e-9
"#
    )
}

#[test]
fn rigid_and_quadratic_bodies_rub_and_their_accounts_close() {
    for (scheme, bound) in [("energy-momentum", 1e-6), ("implicit-midpoint", 2e-2), ("stormer-verlet", 5e-2)]
    {
        let program = Program::run(&heap(scheme, ""));
        let history = program.history();
        let found = history.imbalance();
        assert!(found < bound, "{scheme}: {found:e}");
        let friction = history.column("friction");
        assert!(friction.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12), "{scheme}");
        assert!(friction.last().is_some_and(|&last| last < -1e-4), "{scheme}: {:?}", friction.last());
        let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-9, "{scheme}: {unexplained:e}");
        // The table pushes upwards only, and its friction brakes the brick.
        let pushes = history.column("on-table.fz");
        assert!(
            pushes.iter().all(|&force| force >= 0.0) && pushes.iter().any(|&force| force > 1.0),
            "{scheme}"
        );
        assert!(history.column("on-table.fx").iter().any(|&force| force < -0.1), "{scheme}");
    }
}

#[test]
fn a_run_is_the_same_on_any_threads_and_after_a_resume_in_mid_slip() {
    for scheme in ["energy-momentum", "implicit-midpoint", "stormer-verlet"] {
        assert_same_bits(scheme, &heap(scheme, "").replace("end = 0.1\n", "end = 0.06\n"), 0.02, 2);
    }
}

/// Asserts that a scene gives the same bits on 1, 2 and 8 threads, and after it is resumed from checkpoint number `kept` of those after
/// each `interval` (s), which is not the last.
pub(crate) fn assert_same_bits(case: &str, scene: &str, interval: f64, kept: usize) {
    let scene = format!("{scene}[checkpoint]\ninterval = {interval}\nkeep = 9\n");
    let text = |program: &Program| std::fs::read(program.out().join("history.csv")).unwrap();
    let one = Program::run_with(&scene, &["--threads", "1"]);
    let two = Program::run_with(&scene, &["--threads", "2"]);
    let eight = Program::run_with(&scene, &["--threads", "8"]);
    assert!(text(&one) == text(&two) && text(&one) == text(&eight), "{case}");
    // Interrupts a run by deleting its newest checkpoints, and resumes it.
    let files = std::fs::read_dir(two.out()).unwrap().map(|entry| entry.unwrap().path());
    let is_saved = |file: &std::path::PathBuf| file.to_string_lossy().contains("checkpoint_");
    let mut saved: Vec<_> = files.filter(is_saved).collect();
    saved.sort();
    assert!(saved.len() > kept, "{case}: {saved:?}");
    for newest in &saved[kept..] {
        std::fs::remove_file(newest).unwrap();
    }
    let resumed =
        crate::program::command().current_dir(two.directory()).args(["resume", "out"]).output().unwrap();
    assert!(resumed.status.success(), "{case}: {}", String::from_utf8_lossy(&resumed.stderr));
    assert!(text(&one) == text(&two), "{case}: resumed");
}

#[test]
fn what_is_not_built_is_refused_by_name() {
    let refused = |scene: &str, words: &[&str]| {
        let program = Program::check(scene);
        let said = program.errors() + &String::from_utf8_lossy(&program.output.stdout);
        assert_eq!(program.code(), Some(2), "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{words:?}: {said}");
    };
    let guarded = block("stormer-verlet", "") + "[guard]\naction = \"halve\"\n";
    refused(&guarded, &["guard.action", "explicit steps must not change"]);
    let adaptive = block("stormer-verlet", "").replace("step = 1e-3", "step = \"adaptive\"");
    refused(&adaptive, &["time.step", "explicit steps must not change"]);
    refused(&block("generalized-alpha", ""), &["generalized-alpha", "backward-euler, bdf2 or newmark"]);
    refused(
        &block("energy-momentum", "exclude = [[\"block\", \"flor\"]]"),
        &["contact.exclude[0]", "'flor'"],
    );
    let without = block("energy-momentum", "").replace("[contact]\n", "");
    refused(&without, &["rigid[0].shape", "add the table [contact]"]);
}

/// A box read from a mesh file, placed off its origin and with faces turned inwards, flies and bounces like the
/// analytic box. A mesh with a hole is refused.
#[test]
fn a_rigid_mesh_moves_as_the_solid_that_it_encloses() {
    let directory = tempfile::TempDir::new().unwrap();
    let corner = |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 1 { [1.5, 2.0, 0.8][k] } else { 0.5 });
    let points = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect::<String>();
    let faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";
    let file = |name: &str, faces: &str| {
        let path = directory.path().join(name);
        std::fs::write(&path, format!("{points}{faces}")).unwrap();
        path.display().to_string()
    };
    let scene = |shape: &str, position: [f64; 3]| {
        format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.3
step = 1e-3
scheme = "energy-momentum"
[contact]
friction = 0.3
[[rigid]]
name = "brick"
{shape}
density = 700.0
position = {position:?}
velocity = [0.3, 0.0, 0.0]
angular_velocity = [3.0, 1.0, 2.0]
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
position = [0.0, 0.0, -0.4]
fixed = true
"#
        )
    };
    let mesh = |path: String| format!("shape = {{ kind = \"mesh\", file = {path:?}, scale = 0.2 }}");
    let of_box =
        Program::run(&scene(r#"shape = { kind = "box", size = [0.2, 0.3, 0.06] }"#, [0.2, 0.25, 0.13]));
    let of_mesh = Program::run(&scene(&mesh(file("box.obj", faces)), [0.0; 3]));
    let (a, b) = (of_box.history(), of_mesh.history());
    let landed = b.column("pairs").iter().position(|&pairs| pairs > 0.0).unwrap();
    assert!(landed > 100);
    for name in ["brick.x", "brick.y", "brick.z", "kinetic", "lx", "ly", "lz"] {
        let (a, b) = (a.column(name), b.column(name));
        // After the boxes have landed the motions differ, because the diagonals of their faces, and so the areas of
        // their corners, are not the same.
        let flight = a.iter().zip(&b).take(landed);
        assert!(flight.into_iter().all(|(a, b)| (a - b).abs() < 1e-12 * (1.0 + a.abs())), "{name}");
    }
    assert!(of_mesh.history().imbalance() < 1e-8);
    let open = Program::try_run(&scene(&mesh(file("open.obj", &faces[12..])), [0.0; 3]), &[]);
    assert_eq!(open.code(), Some(2));
    assert!(
        open.errors().contains("rigid[0].shape") && open.errors().contains("not closed"),
        "{}",
        open.errors()
    );
}

/// A sheet without weight and at rest has no energy to which errors could be relative. A moved ball sets it in motion, from
/// within the layer or in one step past it, and does all the work.
#[test]
fn a_body_at_rest_is_pushed_by_a_moved_one() {
    for (scheme, speed, count) in
        [("stormer-verlet", 0.3, 20), ("stormer-verlet", 3.0, 6), ("energy-momentum", 0.3, 20)]
    {
        let program = Program::run(&format!(
            r#"
[time]
end = {end}
step = 1e-3
scheme = "{scheme}"
[contact]
[[body]]
name = "sheet"
sheet = {{ size = [0.4, 0.4], cells = [4, 4], origin = [-0.2, -0.2, 0.0] }}
material = {{ law = "st-venant-kirchhoff", young = 3e4, poisson = 0.3, density = 900.0, thickness = 2.5e-3 }}
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = 0.05 }}
position = [0.0, 0.0, 0.0535]
motion = {{ kind = "translate", velocity = [0.0, 0.0, -{speed}] }}
[output]
ledger = true
"#,
            end = f64::from(count) * 1e-3,
        ));
        let history = program.history();
        assert!(history.last("pz") < 0.0 && history.last("kinetic") > 0.0, "{scheme} {speed}");
        assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme} {speed}");
        let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-9, "{scheme} {speed}: {unexplained:e}");
    }
}

/// `auto` chooses a scheme that accepts contact; `bench` ranks such schemes and reports why the others are excluded;
/// `convergence` and `time.estimate` accept scenes with contact.
#[test]
fn studies_take_scenes_with_contact() {
    let probed = |scheme: &str| {
        block(scheme, "").replace("end = 0.3", "end = 0.16")
            + "[[probe]]\nname = \"top\"\nbody = \"block\"\npoint = [0.1, 0.1, 0.3]\n"
    };
    let auto = Program::run(&probed("auto").replace("step = 1e-3\n", "step = 1e-3\ntolerance = 0.02\n"));
    let scheme = auto.report()["scheme"].as_str().unwrap_or_default().to_owned();
    let accepted = ["stormer-verlet", "implicit-midpoint", "blanes-moan-4", "blanes-moan-6", "gauss"];
    assert!(accepted.contains(&scheme.as_str()), "{scheme}");
    assert!(auto.history().column("pairs").iter().any(|&pairs| pairs > 0.0));
    let estimated =
        Program::run(&probed("stormer-verlet").replace("step = 1e-3\n", "step = 1e-3\nestimate = true\n"));
    assert!(estimated.report()["estimate"].is_object(), "{}", estimated.report());
    let study = |command: &[&str]| {
        let program = Program::check(&probed("implicit-midpoint"));
        let output =
            crate::program::command().current_dir(program.directory()).args(command).output().unwrap();
        assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let ranked =
        study(&["bench", "scene.toml", "--budget", "4", "--schemes", "stormer-verlet,blanes-moan-4"]);
    assert!(ranked.contains("stormer-verlet"), "{ranked}");
    study(&["convergence", "scene.toml", "--levels", "2"]);
}

/// With the schemes for comparison, which use the gradient at the end of a step, and with the Euler schemes nothing
/// crosses, and the ledger books their losses as scheme error.
#[test]
fn every_scheme_that_steps_contact_keeps_bodies_apart() {
    for (scheme, least, most) in [
        ("symplectic-euler-a", -0.1, 0.1),
        ("symplectic-euler-b", -0.1, 0.1),
        ("gauss\"\nstages = 1\n#\"", -0.02, 0.02),
        ("backward-euler", -1.0, 1e-9),
        ("bdf2", -1.0, 0.05),
        ("newmark", -0.3, 0.3),
    ] {
        let program = Program::run(&block(scheme, "").replace("end = 0.3", "end = 0.2"));
        let history = program.history();
        assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
        assert!(history.column("pairs").iter().any(|&pairs| pairs > 0.0), "{scheme}");
        let (total, kinetic) = (history.column("total"), history.column("kinetic"));
        let exchanged = kinetic.iter().copied().fold(0.0, f64::max);
        let gained = (total[total.len() - 1] - total[0]) / exchanged;
        assert!((least..=most).contains(&gained), "{scheme}: {gained}");
        let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-9, "{scheme}: {unexplained:e}");
    }
}

/// Equilibria with contact: a block rests on a floor under its weight, and the pressure between two blocks with
/// different meshes equals the pressure on top.
#[test]
fn equilibria_with_contact_carry_their_load() {
    let program = Program::run(
        r#"
[time]
end = 1.0
step = 1.0
[static]
[contact]
self = false
[[body]]
name = "lower"
box = { size = [1.0, 1.0, 0.2], cells = [6, 6, 1], element = "hex8" }
material = { law = "linear", young = 1e6, poisson = 0.0, density = 1000.0 }
[[body]]
name = "upper"
box = { size = [1.0, 1.0, 0.2], cells = [5, 5, 1], element = "hex8", origin = [0.0, 0.0, 0.201] }
material = { law = "linear", young = 1e6, poisson = 0.0, density = 1000.0 }
[[fix]]
body = "lower"
region = "z-min"
[[fix]]
body = "upper"
region = "z-max"
axes = ["x", "y"]
[[load]]
kind = "pressure"
body = "upper"
region = "z-max"
pressure = 1000.0
"#,
    );
    let history = program.history();
    let row = history.column("smallest_gap").len() - 1;
    // The layer has a thickness of 1 mm and κ = 1e5 Pa. Solves κ |B'(s)| = 1 kPa for s, the gap over the thickness.
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..60 {
        let s: f64 = 0.5 * (low + high);
        let q = 1.0 - s;
        let pressure = 1e5 * (3.0 * q * q * s + q * q * q) / (s * s);
        (low, high) = if pressure > 1e3 { (s, high) } else { (low, s) };
    }
    assert!((history.column("smallest_gap")[row] / (1e-3 * low) - 1.0).abs() < 5e-3);
    let said = String::from_utf8_lossy(&program.output.stdout).into_owned() + &program.errors();
    assert!(said.contains("1.0000e3) N"), "{said}");
}
