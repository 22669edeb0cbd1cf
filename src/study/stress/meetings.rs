//! Generates violent scenes in which bodies meet: each kind of meeting with random shapes, speeds, steps, laws and
//! schemes. The same seed and index give the same scene.

use serde_json::{Value, json};

use super::entries::{floor, held, moved, shape, with};
use super::kinds::Violence;
use super::random::Random;
use super::violence::{Case, CaseError};

/// Schemes that support contact. Some occur twice, to be drawn more often.
const SCHEMES: [&str; 9] = [
    "energy-momentum",
    "energy-momentum",
    "implicit-midpoint",
    "stormer-verlet",
    "stormer-verlet",
    "symplectic-euler-a",
    "symplectic-euler-b",
    "backward-euler",
    "newmark",
];

/// Number of schemes, from the start of the list, from which those of scenes with free rigid bodies are drawn.
const TAKE_RIGIDS: usize = 7;
/// Schemes that replace some of those with free rigid bodies, and some of those without friction and damping. They are drawn from
/// a sequence of their own, so that the other scenes keep their numbers.
const OF_RIGIDS: [&str; 2] = ["backward-euler", "bdf2"];
const OF_HIGH_ORDER: [&str; 3] = ["blanes-moan-4", "blanes-moan-6", "gauss"];
/// Seed of that sequence, as a change of the seed of the scenes. With this one, the scenes of seed 1 that comments and documents cite keep
/// their schemes.
const FURTHER: u64 = 116;

/// Material and size common to all bodies of a scene.
struct Matter {
    young: f64,
    density: f64,
    /// Speed of waves √(E/ρ), m/s.
    wave_speed: f64,
    /// Extent of a body, m.
    size: f64,
}

/// Generates case `index` of a seed, of the kinds in which bodies meet.
///
/// # Errors
/// Returns [`CaseError::Scene`] if the scene does not parse.
pub fn meeting(seed: u64, index: u64) -> Result<Case, CaseError> {
    let mut random = Random::of(seed, index);
    let random = &mut random;
    let kinds = Violence::of_contact();
    let violence = kinds[(index % kinds.len() as u64) as usize];
    let (young, density) = (random.decades(1e4, 1e7), random.decades(300.0, 3e3));
    let (wave_speed, size) = ((young / density).sqrt(), random.decades(0.02, 2.0));
    let matter = Matter { young, density, wave_speed, size };
    let has_free_rigids = !matches!(violence, Violence::Thrown | Violence::Crumpled | Violence::Driven);
    let drawn = random.of_all(if has_free_rigids { &SCHEMES[..TAKE_RIGIDS] } else { &SCHEMES });
    // Scenes of other schemes keep their numbers.
    let scheme = if drawn == "backward-euler" && random.once_in(3) { "bdf2" } else { drawn };
    let is_explicit = scheme.starts_with("s");
    // A wave crosses a fifth of a body, about the smallest element, in 0.5 to 20 implicit steps or in 7 to 50 explicit
    // ones, which stay below their stability limit.
    let element = 0.2 * size / wave_speed;
    let step = element * if is_explicit { random.decades(0.02, 0.15) } else { random.decades(0.05, 2.0) };
    let count = 10 + random.below(40);
    let friction = if !random.once_in(3) { random.between(0.0, 1.5) } else { 0.0 };
    let damping = if random.once_in(2) { step * random.decades(0.1, 10.0) } else { 0.0 };
    let further = &mut Random::of(seed ^ FURTHER, index);
    let scheme = match (has_free_rigids, friction == 0.0 && damping == 0.0) {
        (true, _) if further.once_in(8) => further.of_all(&OF_RIGIDS),
        (false, true) if further.once_in(2) => further.of_all(&OF_HIGH_ORDER),
        _ => scheme,
    };
    let gravity = if random.once_in(2) { 9.81 * random.decades(0.1, 100.0) } else { 0.0 };
    let mut scene = json!({
        "gravity": [0.0, 0.0, -gravity],
        "time": { "end": step * count as f64, "step": step, "scheme": scheme },
        "contact": { "friction": friction, "damping": damping },
        "assert": { "intersections": 0 },
    });
    let duration = step * count as f64;
    let (bodies, rigids, joints) = parts(random, violence, &matter, duration);
    if matches!(violence, Violence::Close) && random.once_in(2) {
        scene["contact"]["resolve"] = json!(true);
    }
    scene["body"] = json!(bodies);
    scene["rigid"] = json!(rigids);
    if !joints.is_empty() {
        scene["joint"] = json!(joints);
    }
    Case::of_meeting(index, violence, scene)
}

impl Matter {
    fn solid(&self, name: &str, size: [f64; 3], origin: [f64; 3], random: &mut Random) -> Value {
        let law = random.of_all(&["neo-hookean", "stable-neo-hookean", "corotated", "st-venant-kirchhoff"]);
        let element = random.of_all(&["tet4", "hex8", "tet10"]);
        let cells = size.map(|edge| (edge / (0.34 * self.size)).round().clamp(1.0, 3.0) as u64);
        json!({
            "name": name, "box": { "size": size, "cells": cells, "element": element, "origin": origin },
            "material": { "law": law, "young": self.young, "poisson": random.between(0.0, 0.4), "density": self.density },
        })
    }

    /// Returns a square sheet with edges of length `size`, whose corner of least coordinates is at `origin`.
    fn sheet(&self, name: &str, size: f64, origin: [f64; 3], random: &mut Random) -> Value {
        let cells = 3 + random.below(4) as u64;
        json!({
            "name": name, "sheet": { "size": [size, size], "cells": [cells, cells], "origin": origin },
            "material": { "law": "st-venant-kirchhoff", "young": self.young, "poisson": 0.3, "density": self.density,
                          "thickness": size * random.decades(1e-3, 2e-2) },
        })
    }

    fn rigid(&self, name: &str, shape: Value, position: [f64; 3]) -> Value {
        json!({ "name": name, "shape": shape, "density": self.density, "position": position })
    }
}

/// Returns the bodies, rigid bodies and joints of a scene whose bodies meet within `duration` (s).
fn parts(
    random: &mut Random,
    violence: Violence,
    matter: &Matter,
    duration: f64,
) -> (Vec<Value>, Vec<Value>, Vec<Value>) {
    let s = matter.size;
    // At this speed a body moves 0.3 to 2 times its size during the run, unless half the wave speed is less.
    let speed = (random.between(0.3, 2.0) * s / duration).min(0.5 * matter.wave_speed);
    let turn = |random: &mut Random| json!({ "axis": random.vector(1.0), "angle": random.between(0.0, 6.0) });
    let gap = 0.02 * s;
    match violence {
        Violence::Thrown => {
            let body = if random.once_in(2) {
                matter.solid("body", [s, 0.6 * s, 0.6 * s], [-0.5 * s, -0.3 * s, gap], random)
            } else {
                matter.sheet("body", s, [-0.5 * s, -0.5 * s, gap], random)
            };
            let velocity = [0.3 * speed, 0.0, -speed];
            let target = shape(random, s);
            let place = [0.0, 0.0, -0.52 * s];
            let target = with(held(matter.rigid("target", target, place)), "orientation", turn(random));
            (vec![with(body, "velocity", json!(velocity))], vec![target], vec![])
        }
        Violence::Stacked => {
            let mut bodies = Vec::new();
            let mut rigids = vec![floor()];
            let height = 0.5 * s;
            for k in 0..2 + random.below(3) {
                let (name, z) = (format!("block-{k}"), gap + k as f64 * (height + gap));
                let shift = random.between(-0.2, 0.2) * s;
                if random.once_in(2) {
                    bodies.push(matter.solid(&name, [s, s, height], [shift - 0.5 * s, -0.5 * s, z], random));
                } else {
                    let shape = json!({ "kind": "box", "size": [s, s, height] });
                    let block = matter.rigid(&name, shape, [shift, 0.0, z + 0.5 * height]);
                    rigids.push(with(block, "velocity", json!([0.2 * speed, 0.0, -speed])));
                }
            }
            (bodies, rigids, vec![])
        }
        Violence::Crumpled => {
            let sheet = matter.sheet("sheet", s, [0.0, 0.0, 0.0], random);
            let press = |name: &str, x: f64, towards: f64| {
                let shape = json!({ "kind": "box", "size": [0.1 * s, 2.0 * s, 2.0 * s] });
                let velocity = [towards * 0.35 * s / duration, 0.0, 0.0];
                moved(name, shape, [x, 0.5 * s, 0.0], velocity)
            };
            let sheet = with(sheet, "velocity", json!([0.0, 0.0, 0.2 * speed]));
            (vec![sheet], vec![press("left", -0.07 * s, 1.0), press("right", 1.07 * s, -1.0)], vec![])
        }
        Violence::Masses => {
            let light = matter.rigid(
                "light",
                json!({ "kind": "box", "size": [0.5 * s, 0.5 * s, 0.5 * s] }),
                [0.0, 0.0, 0.25 * s + gap],
            );
            let heavy = matter.rigid("heavy", shape(random, s), [0.0, 0.05 * s, 1.05 * s + 2.0 * gap]);
            let heavy = with(heavy, "density", json!(1e3 * matter.density));
            let heavy = with(heavy, "velocity", json!([0.0, 0.0, -speed]));
            (vec![], vec![floor(), light, heavy], vec![])
        }
        Violence::Knives | Violence::Needles => {
            let body = if random.once_in(2) {
                matter.sheet("body", s, [-0.5 * s, -0.5 * s, 0.0], random)
            } else {
                matter.solid("body", [s, s, 0.4 * s], [-0.5 * s, -0.5 * s, -0.4 * s], random)
            };
            let thin = s * random.decades(1e-3, 1e-2);
            let (shape, half) = match (violence, random.once_in(2)) {
                (Violence::Knives, _) => {
                    (json!({ "kind": "box", "size": [thin, 0.6 * s, 0.4 * s] }), 0.2 * s)
                }
                (_, true) => {
                    (json!({ "kind": "capsule", "length": 0.5 * s, "radius": thin }), 0.25 * s + thin)
                }
                (_, false) => (json!({ "kind": "rod", "length": 0.5 * s, "radius": thin }), 0.25 * s),
            };
            let place = [random.between(-0.3, 0.3) * s, 0.1 * s, half + 0.03 * s];
            let tool = with(matter.rigid("tool", shape, place), "density", json!(30.0 * matter.density));
            let tool = with(tool, "velocity", json!([0.0, 0.0, -speed]));
            let upright = json!({ "axis": [0.0, 1.0, 0.0], "angle": 1.5 });
            let tool = if violence == Violence::Needles { with(tool, "orientation", upright) } else { tool };
            (vec![body], vec![tool], vec![])
        }
        Violence::Driven => {
            let body = if random.once_in(2) {
                matter.sheet("body", s, [-0.5 * s, -0.5 * s, 0.0], random)
            } else {
                matter.solid("body", [s, 0.5 * s, 0.5 * s], [-0.5 * s, -0.25 * s, -0.5 * s], random)
            };
            let size = 0.5 * s;
            let shape = shape(random, size);
            let velocity = [0.0, 0.0, -random.between(0.2, 1.0) * s / duration];
            (vec![body], vec![moved("driven", shape, [0.0, 0.0, 0.6 * size], velocity)], vec![])
        }
        Violence::Close => {
            let below = matter.solid("below", [s, s, 0.5 * s], [0.0, 0.0, -0.5 * s], random);
            let above = if random.once_in(2) {
                matter.solid("above", [0.7 * s, 0.7 * s, 0.4 * s], [0.1 * s, 0.15 * s, 1e-9], random)
            } else {
                let shape = json!({ "kind": "box", "size": [0.7 * s, 0.7 * s, 0.2 * s] });
                let block = matter.rigid("above", shape, [0.5 * s, 0.5 * s, 0.1 * s + 1e-9]);
                return (
                    vec![below],
                    vec![with(block, "velocity", json!([0.0, 0.1 * speed, -speed]))],
                    vec![],
                );
            };
            (vec![below, with(above, "velocity", json!([0.1 * speed, 0.0, -speed]))], vec![], vec![])
        }
        Violence::Round => {
            let mut rigids = vec![floor()];
            for k in 0..2 + random.below(3) {
                let ball = random.once_in(2);
                let r = 0.2 * s;
                let shape = match ball {
                    true => json!({ "kind": "sphere", "radius": r }),
                    false => json!({ "kind": "capsule", "length": 0.5 * s, "radius": r }),
                };
                let place = [0.1 * s * random.unit(), 0.1 * s * random.unit(), 1.05 * r + 2.2 * r * k as f64];
                let body = matter.rigid(&format!("round-{k}"), shape, place);
                let body = with(body, "velocity", json!([0.5 * speed, 0.0, -speed]));
                rigids.push(with(body, "angular_velocity", json!(random.vector(speed / r))));
            }
            (vec![], rigids, vec![])
        }
        _ => {
            let leaf = |name: &str, z: f64| {
                matter.rigid(name, json!({ "kind": "box", "size": [s, 0.5 * s, 0.05 * s] }), [0.0, 0.0, z])
            };
            let upper = with(leaf("upper", 0.1 * s), "angular_velocity", json!([0.0, speed / s, 0.0]));
            let upper = with(upper, "velocity", json!([0.0, 0.0, -0.5 * speed]));
            let point = [-0.5 * s, 0.0, 0.05 * s];
            let hinge = json!({ "kind": "hinge", "body": "upper", "to": "lower", "point": point, "axis": [0.0, 1.0, 0.0] });
            let between = matter.sheet("sheet", 0.5 * s, [0.1 * s, -0.25 * s, 0.05 * s], random);
            (vec![between], vec![held(leaf("lower", 0.0)), upper], vec![hinge])
        }
    }
}
