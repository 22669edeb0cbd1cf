//! A run that is interrupted within its steps abandons them, and continues to the same bits as an uninterrupted one.

use std::time::{Duration, Instant};

use crate::resume::assert_same;
use variational::prelude::*;
use variational::run::checkpoint::newest;
use variational::run::report::Outcome;
use variational::run::resume;
use variational::scene::Scene;

/// Runs a scene to its end, then again with interruptions at later and later times, and compares the files. Every run
/// here either completes or ends by an abandoned step.
fn leaves_no_trace(text: &str, what: &str) {
    let parsed = Scene::parse(text, &[]);
    assert!(parsed.problems.is_empty(), "{what}: {:?}", parsed.problems);
    let scene = parsed.scene.unwrap();
    let whole = tempfile::tempdir().unwrap();
    let begin = Instant::now();
    run(scene.clone(), "test", whole.path(), &mut ()).unwrap();
    let duration = begin.elapsed();
    let parts = tempfile::tempdir().unwrap();
    let interrupt = Interrupt::new();
    let scene = scene.interruptible(interrupt.clone());
    let mut interruptions = 0;
    for share in 1.. {
        interrupt.withdraw();
        let delay = duration.mul_f64(0.04 * f64::from(share)) + Duration::from_millis(1);
        let alarm = interrupt.clone();
        let alarm = std::thread::spawn(move || {
            std::thread::sleep(delay);
            alarm.ask();
        });
        let report = match newest(parts.path()) {
            Ok(found) => resume(scene.clone(), &found.checkpoint, parts.path(), &mut ()),
            Err(_) => run(scene.clone(), "test", parts.path(), &mut ()),
        };
        alarm.join().unwrap();
        if report.unwrap().outcome != Some(Outcome::Interrupted) {
            break;
        }
        interruptions += 1;
    }
    assert!(interruptions > 0, "{what}: never interrupted");
    assert_same(whole.path(), parts.path(), what);
}

/// Two blocks, one of which falls on the other and slides.
const BLOCKS: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.02
step = 1e-3
scheme = "SCHEME"
[contact]
friction = 0.3
damping = 1e-4
[[body]]
name = "lower"
box = { size = [0.4, 0.4, 0.1], cells = [4, 4, 1], element = "tet4", origin = [-0.1, -0.1, -0.1] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
[[body]]
name = "upper"
box = { size = [0.2, 0.2, 0.2], cells = [3, 3, 3], element = "tet4", origin = [0.0, 0.0, 0.002] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
velocity = [0.5, 0.0, -1.0]
[[fix]]
body = "lower"
region = "z-min"
[output]
history = 1
interval = 5e-3
[checkpoint]
interval = 5e-3
"#;

#[test]
fn implicit_steps_with_contact_are_abandoned() {
    for scheme in ["implicit-midpoint", "energy-momentum"] {
        leaves_no_trace(&BLOCKS.replace("SCHEME", scheme), scheme);
    }
}

#[test]
fn explicit_steps_with_contact_are_abandoned() {
    let explicit = BLOCKS.replace("SCHEME", "stormer-verlet");
    let explicit = explicit.replace("step = 1e-3", "step = 1e-4").replace("end = 0.02", "end = 0.1");
    leaves_no_trace(&explicit, "stormer-verlet");
    // A rigid body with a joint: its drifts are solved for all coordinates.
    let rigid = explicit.replace(
        "[[fix]]",
        "[[rigid]]\nname = \"arm\"\nshape = { kind = \"rod\", length = 0.2, radius = 0.02 }\nmass = 0.3\n\
         position = [0.1, 0.1, 0.25]\n[[joint]]\nkind = \"ball\"\nbody = \"arm\"\npoint = [0.0, 0.1, 0.25]\n[[fix]]",
    );
    leaves_no_trace(&rigid, "stormer-verlet with a joint");
}

#[test]
fn load_steps_are_abandoned() {
    let free = BLOCKS.replace("friction = 0.3\ndamping = 1e-4\n", "").replace("[contact]\n", "");
    let still = free.replace("scheme = \"SCHEME\"\n", "").replace("velocity = [0.5, 0.0, -1.0]\n", "");
    let pressed = still.replace(
        "[output]",
        "[static]\n[[fix]]\nbody = \"upper\"\nregion = \"z-min\"\n[[fix]]\nbody = \"upper\"\nregion = \"z-max\"\n\
         motion = { kind = \"table\", times = [0.0, 0.02], displacements = [[0.0, 0.0, 0.0], [0.0, 0.0, -0.02]] }\n\
         [output]",
    );
    leaves_no_trace(&pressed, "statics");
}

#[test]
fn adaptive_steps_are_abandoned() {
    let free = BLOCKS.replace("friction = 0.3\ndamping = 1e-4\n", "").replace("[contact]\n", "");
    for scheme in ["stormer-verlet", "gauss"] {
        let adaptive =
            free.replace("step = 1e-3", "step = \"adaptive\"\nlargest_step = 5e-3\ntolerance = 1e-4");
        leaves_no_trace(&adaptive.replace("SCHEME", scheme), &format!("adaptive {scheme}"));
    }
}
