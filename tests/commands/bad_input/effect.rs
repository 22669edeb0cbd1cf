//! Tests refusals of tables, keys and numbers that have no effect in a scene, or that no run could follow.

use super::{GOOD, refused};
use crate::program::Program;

/// A table that can have no effect is refused, with what to do instead.
#[test]
fn tables_without_effect() {
    let with = |table: &str| GOOD.to_owned() + table;
    let on = |table: &str, on: &str| with(&format!("[[{table}]]\nbody = \"beam\"\n{on}\n"));
    refused(
        &on("strike", "region = \"clamp\"\nimpulse = [0, 0, 1]"),
        &["scene.toml:13: strike[0]", "[[fix]]"],
    );
    assert_eq!(Program::check(&on("strike", "region = \"tip\"\nimpulse = [0, 0, 1]")).code(), Some(0));
    for (table, rest) in [
        ("fix", ""),
        ("strike", "impulse = [0, 0, 1]"),
        ("attach", "stiffness = 1.0"),
        ("probe", "name = \"p\"\nmax = \"displacement.x\""),
    ] {
        let key = if table == "fix" { "fix[1].nodes".to_owned() } else { format!("{table}[0].nodes") };
        refused(&on(table, &format!("nodes = []\n{rest}")), &[&key, "lists no node"]);
    }
    refused(
        &on("periodic", "from = { region = \"tip\" }\nto = { region = \"tip\" }"),
        &["scene.toml:13: periodic[0]", "are the same nodes"],
    );
    let rigid = r#"
[time]
end = 1.0
step = 0.01
scheme = "stormer-verlet"
[damping]
mass_rate = 2.5
[[rigid]]
name = "r"
shape = { kind = "sphere", radius = 0.1 }
density = 1000.0
"#;
    refused(rigid, &["scene.toml:6: damping", "deformable bodies", "remove this table"]);
    let body = &GOOD[GOOD.find("[[body]]").unwrap()..GOOD.find("[[fix]]").unwrap()];
    let contact =
        "[contact]\nexclude = [[\"beam\", \"other\"]]\n[[contact.pair]]\nbetween = [\"other\", \"beam\"]\n";
    refused(
        &format!(
            "{}{contact}",
            GOOD.replace("[[fix]]", &(body.replace("\"beam\"", "\"other\"") + "[[fix]]"))
        ),
        &["contact.pair[0].between", "`exclude`", "do not meet"],
    );
}

/// Values that could have no effect are refused, and those that act otherwise than they say are noted.
#[test]
fn values_without_effect() {
    let pair = "[contact]\n[[contact.pair]]\nbetween = [\"beam\", \"beam\"]\n";
    refused(&format!("{GOOD}{pair}"), &["contact.pair[0]", "no value", "`friction`"]);
    assert_eq!(Program::check(&format!("{GOOD}{pair}friction = 0.1\n")).code(), Some(0));
    let loaded = |region: &str, push: &str| {
        let statics = format!("[static]\n{push}");
        let scene = GOOD.replace("scheme = \"stormer-verlet\"\n", &statics);
        format!(
            "{scene}[[load]]\nkind = \"pressure\"\nbody = \"beam\"\nregion = \"{region}\"\npressure = 1.0\n"
        )
    };
    refused(&loaded("tip", "push = 1e-3\n"), &["static.push", "load[0]: pressure", "no potential"]);
    let notes = |scene: &str| {
        let program = Program::run(scene);
        program.report()["notes"].to_string()
    };
    let found = notes(&loaded("tip", ""));
    assert!(found.contains("not whether they are stable"), "{found}");
    let far = "[[probe]]\nname = \"p\"\nbody = \"beam\"\npoint = [-99.0, 0.0, 0.0]\n\
               [[probe]]\nname = \"near\"\nbody = \"beam\"\npoint = [0.1, 0.1, 0.1]\n";
    let found = notes(&format!("{GOOD}{far}"));
    assert!(found.contains("probe[0].point is") && !found.contains("probe[1].point is"), "{found}");
    let load = "[[load]]\nkind = \"force\"\nbody = \"beam\"\nregion = \"REGION\"\nforce = [0, 0, 1]\n";
    for (region, idle) in [("clamp", true), ("tip", false)] {
        let found = notes(&format!("{GOOD}{}", load.replace("REGION", region)));
        assert_eq!(found.contains("load[0] acts on held nodes alone"), idle, "{found}");
    }
    let rigid = "[damping]\nmass_rate = 2.5\n[[rigid]]\nname = \"r\"\nshape = { kind = \"sphere\", radius = 0.1 }\n\
                 density = 1000.0\n";
    let found = notes(&format!("{GOOD}{rigid}"));
    assert!(found.contains("not on rigid bodies, such as 'r'"), "{found}");
    let solver = "[solver]\nlinear = \"pcg\"\ntolerance = 1e-8\n";
    for (scheme, unread) in [("stormer-verlet", true), ("implicit-midpoint", false)] {
        let found = notes(&format!("{}{solver}", GOOD.replace("stormer-verlet", scheme)));
        for key in ["solver.linear", "solver.tolerance"] {
            let note = format!("{key} has no effect: '{scheme}' solves no equations");
            assert_eq!(found.contains(&note), unread, "{found}");
        }
    }
}

/// Pairs, probes and exclusions of bodies between which there is no contact are refused, with the key and the reason.
#[test]
fn contact_of_bodies_that_do_not_meet() {
    let rigids = r#"
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
position = [0.0, 0.0, -1.0]
fixed = true
[[rigid]]
name = "wall"
shape = { kind = "box", size = [0.1, 0.1, 0.1] }
position = [0.0, 0.0, 9.0]
fixed = true
[[rigid]]
name = "weight"
mass = 1.0
inertia = [1, 1, 1]
position = [0.0, 0.0, 5.0]
"#;
    let with = |contact: &str| format!("{GOOD}{rigids}[contact]\n{contact}\n");
    let pair = |[a, b]: [&str; 2]| format!("[[contact.pair]]\nbetween = [\"{a}\", \"{b}\"]\nfriction = 0.5");
    let probe = |[a, b]: [&str; 2]| {
        format!("[[probe]]\nname = \"p\"\nbetween = [\"{a}\", \"{b}\"]\nsum = \"contact_force\"")
    };
    for (bodies, reason) in [
        (["floor", "floor"], "does not meet itself"),
        (["weight", "beam"], "'weight' has no shape"),
        (["floor", "wall"], "is prescribed"),
    ] {
        refused(&with(&pair(bodies)), &["contact.pair[0].between", reason, "remove this pair"]);
    }
    refused(
        &with(&format!("self = false\n{}", pair(["beam", "beam"]))),
        &["contact.pair[0].between", "`contact.self` is false", "remove this pair"],
    );
    for (bodies, reason) in [
        (["beam", "beam"], "cancel"),
        (["weight", "beam"], "'weight' has no shape"),
        (["wall", "floor"], "is prescribed"),
    ] {
        refused(&with(&probe(bodies)), &["probe[0].between", reason, "remove this probe"]);
    }
    refused(
        &with(&format!("exclude = [[\"beam\", \"floor\"]]\n{}", probe(["floor", "beam"]))),
        &["probe[0].between", "`contact.exclude`", "remove this probe"],
    );
    refused(&with("exclude = [[\"weight\", \"beam\"]]"), &["contact.exclude[0]", "has no shape"]);
    refused(&with("[assert]\nsmallest_gap = -1.0"), &["assert.smallest_gap", "zero or positive"]);
    for sound in
        [pair(["beam", "beam"]), probe(["beam", "floor"]), "exclude = [[\"wall\", \"floor\"]]".into()]
    {
        assert_eq!(Program::check(&with(&sound)).code(), Some(0), "{sound}");
    }
}

/// Keys of motion are refused in search of equilibria, each by its name.
#[test]
fn keys_of_motion_with_statics() {
    let still = GOOD.replace("scheme = \"stormer-verlet\"\n", "") + "[static]\n";
    for (from, to, key) in [
        ("[static]", "[static]\n[damping]\nmass_rate = 1.0", "damping"),
        ("[static]", "[static]\n[assert]\nenergy_drift = 1e-3", "assert.energy_drift"),
        (
            "[static]",
            "[static]\n[[strike]]\nbody = \"beam\"\nregion = \"tip\"\nimpulse = [0, 0, 1]",
            "strike[0]",
        ),
        ("[[fix]]", "velocity = [1, 0, 0]\n[[fix]]", "body[0].velocity"),
        ("[[fix]]", "angular_velocity = [1, 0, 0]\n[[fix]]", "body[0].angular_velocity"),
        ("[[body]]", "estimate = true\n[[body]]", "time.estimate"),
        ("[[body]]", "substeps = false\n[[body]]", "time.substeps"),
        ("[[body]]", "scheme = \"gauss\"\nstages = 3\n[[body]]", "time.stages"),
    ] {
        refused(&still.replace(from, to), &[&format!(" {key}: belongs to motion"), "[static] has none"]);
    }
}

/// Steps and frames that no run could complete are refused before it starts.
#[test]
fn more_steps_or_frames_than_can_be_meant() {
    let steps = |step: &str| GOOD.replace("step = 0.01", step);
    let uncounted = "more steps than the program can count";
    refused(&steps("step = 1e-300"), &["scene.toml:4: time.step", uncounted]);
    refused(
        &steps("step = \"adaptive\"\nlargest_step = 1e-300"),
        &["scene.toml:5: time.largest_step", uncounted],
    );
    refused(
        &steps("step = \"adaptive\"").replace("stormer-verlet", "forward-euler"),
        &["scene.toml:4: time.step", "\"forward-euler\"", "write a step in s"],
    );
    let output = |key: &str| GOOD.to_owned() + "[output]\n" + key;
    refused(
        &output("fps = 1e8"),
        &["scene.toml:14: output.fps", "1.000e7 frames", "less than fps = 1.000e7"],
    );
    refused(
        &output("interval = 1e-9").replace("step = 0.01", "step = \"adaptive\""),
        &["scene.toml:14: output.interval", "1.000e8 frames", "more than interval = 1.000e-7"],
    );
    // Each of the ten steps has one frame at most.
    assert_eq!(Program::check(&output("interval = 1e-9")).code(), Some(0));
}

/// Equilibria have no scheme and no time step that a bench could compare.
#[test]
fn a_bench_refuses_statics() {
    let program = Program::check(
        "[time]\nend = 1.0\nstep = 0.5\n[static]\n[[body]]\nname = \"b\"\nbox = { size = [1.0, 0.2, 0.2], cells = [2, 1, 1] }\n\
         material = { law = \"linear\", young = 1e6, poisson = 0.3, density = 1000.0 }\n[[fix]]\nbody = \"b\"\nregion = \"x-min\"\n",
    );
    let output = crate::program::command()
        .current_dir(program.directory())
        .args(["bench", "scene.toml", "--budget", "2"])
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{errors}");
    assert!(errors.contains("[static]"), "{errors}");
}
