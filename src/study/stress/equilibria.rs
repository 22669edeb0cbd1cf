//! Generates scenes in which bodies meet and come to rest (`[static]`): each kind with random shapes, elements, laws, gaps, friction and
//! increments. The same seed and index give the same scene.
//!
//! Every scene is meant to have an equilibrium: what friction cannot hold is supported, and loads along a surface stay below its friction.

use serde_json::{Value, json};

use super::entries::{floor, moved, shape, translation, with};
use super::kinds::Violence;
use super::random::Random;
use super::violence::{Case, CaseError};

/// What all bodies of a scene share.
struct Common {
    /// Young's modulus, Pa; density, kg/m³.
    young: f64,
    density: f64,
    /// Extent of a body, m, and its number of cells along an edge.
    size: f64,
    cells: u64,
    /// Gap at the start, m.
    gap: f64,
    /// Coefficient of friction.
    friction: f64,
}

/// The tables of a scene.
#[derive(Default)]
struct Tables {
    bodies: Vec<Value>,
    rigids: Vec<Value>,
    fixes: Vec<Value>,
    loads: Vec<Value>,
}

/// Generates case `index` of a seed, of the kinds in which bodies come to rest.
///
/// # Errors
/// Returns [`CaseError::Scene`] if the scene does not parse.
pub fn resting(seed: u64, index: u64) -> Result<Case, CaseError> {
    let mut random = Random::of(seed, index);
    let random = &mut random;
    let kinds = Violence::of_equilibria();
    let violence = kinds[(index % kinds.len() as u64) as usize];
    let (density, size) = (random.decades(300.0, 3e3), random.decades(0.02, 2.0));
    // Under its own weight a body is compressed by a ten-thousandth to a fiftieth of its height.
    let young = 9.81 * density * size * random.decades(50.0, 1e4);
    let gap = size * random.of_all(&[5e-3, 0.025, 0.1, 0.3]);
    let needs_friction = matches!(violence, Violence::Balls | Violence::Tilted);
    let friction = match random.once_in(3) && !needs_friction {
        true => 0.0,
        false => random.of_all(&[0.1, 0.3, 0.5, 0.8]),
    };
    let cells = 2 + random.below(3) as u64;
    let common = Common { young, density, size, cells, gap, friction };
    // Three quarters of the slope that friction holds.
    let slope = if violence == Violence::Tilted { 0.75 * friction } else { 0.0 };
    let weight = 9.81 / (1.0 + slope * slope).sqrt();
    let mut scene = json!({
        "gravity": [weight * slope, 0.0, -weight],
        "time": { "end": 1.0, "step": random.of_all(&[1.0, 0.5, 0.25]) },
        "static": {},
        "contact": { "friction": friction },
        "assert": { "intersections": 0 },
    });
    if random.once_in(4) {
        scene["contact"]["distance"] = json!(size * random.decades(3e-4, 1e-2));
    }
    let Tables { bodies, rigids, fixes, loads } = common.tables(random, violence);
    scene["body"] = json!(bodies);
    scene["rigid"] = json!(rigids);
    scene["fix"] = json!(fixes);
    scene["load"] = json!(loads);
    Case::of_meeting(index, violence, scene)
}

fn fix(body: &str, region: &str) -> Value {
    json!({ "body": body, "region": region })
}

impl Common {
    /// Returns a box whose corner of least coordinates is at `origin`, m.
    fn block(&self, name: &str, size: [f64; 3], origin: [f64; 3], random: &mut Random) -> Value {
        let law = random.of_all(&["neo-hookean", "stable-neo-hookean", "st-venant-kirchhoff", "linear"]);
        let element = random.of_all(&["hex8", "hex8", "tet4", "tet10"]);
        let edge = self.size / self.cells as f64;
        let cells = size.map(|length| (length / edge).round().max(1.0) as u64);
        json!({
            "name": name, "box": { "size": size, "cells": cells, "element": element, "origin": origin },
            "material": { "law": law, "young": self.young, "poisson": random.of_all(&[0.0, 0.3, 0.45]),
                          "density": self.density },
        })
    }

    /// Returns a slab that is held at its lower side, from z = 0 to z = s/2.
    fn slab(&self, random: &mut Random) -> (Value, Value) {
        let s = self.size;
        let slab = self.block("slab", [2.0 * s, 2.0 * s, 0.5 * s], [0.0; 3], random);
        (slab, fix("slab", "z-min"))
    }

    /// Returns a block above the slab, whose nodes lie on those of the slab or not.
    fn top(&self, size: [f64; 3], random: &mut Random) -> Value {
        let shift = 0.5 * self.size + if random.once_in(2) { 0.07 * self.size } else { 0.0 };
        self.block("top", size, [shift, shift, 0.5 * self.size + self.gap], random)
    }

    fn tables(&self, random: &mut Random, violence: Violence) -> Tables {
        match violence {
            Violence::Piled => self.piled(random),
            Violence::Balls => self.balls(random),
            Violence::Indented => self.indented(random),
            Violence::BroughtTogether => self.brought_together(random),
            _ => self.on_a_slab(random, violence),
        }
    }

    fn piled(&self, random: &mut Random) -> Tables {
        let s = self.size;
        let count = if self.friction == 0.0 { 1 } else { 1 + random.below(3) };
        let mut bodies = Vec::new();
        let mut z = self.gap;
        for k in 0..count {
            let edge = s * (1.0 - 0.15 * k as f64);
            let shift = s * random.of_all(&[0.0, 0.075]) * k as f64;
            bodies.push(self.block(&format!("block-{k}"), [edge, edge, 0.5 * s], [shift, shift, z], random));
            z += 0.5 * s + self.gap;
        }
        let held = with(fix("block-0", "z-max"), "axes", json!(["x", "y"]));
        let fixes = if self.friction == 0.0 { vec![held] } else { vec![] };
        Tables { bodies, rigids: vec![floor()], fixes, ..Tables::default() }
    }

    fn on_a_slab(&self, random: &mut Random, violence: Violence) -> Tables {
        let s = self.size;
        let (slab, held) = self.slab(random);
        let mut fixes = vec![held];
        let mut loads = Vec::new();
        let size = match violence {
            Violence::Loaded => [0.5 * s, 0.5 * s, s],
            Violence::Dragged => [s, 0.5 * s, 0.5 * s],
            _ => [s, s, 0.5 * s],
        };
        let top = self.top(size, random);
        let side = fix("top", "z-max");
        let load = |force: [f64; 3], amplitude: &str| json!({ "kind": "force", "body": "top", "region": "z-max", "force": force, "amplitude": amplitude });
        // The mean pressure is a fraction of Young's modulus.
        let force = size[0] * size[1] * self.young * random.decades(1e-3, 2e-2);
        match violence {
            Violence::Pressed => {
                let aside = if random.once_in(2) { random.between(0.0, 0.15) * s } else { 0.0 };
                let down = self.gap + random.between(0.02, 0.08) * s;
                fixes.push(with(side, "motion", translation([aside, 0.0, -down])));
            }
            Violence::Loaded => {
                // Beyond a quarter of the load, this punch, which is twice as high as it is wide, would tip over.
                let share = (0.5 * self.friction).min(0.15);
                let aside = if random.once_in(2) { share * force } else { 0.0 };
                loads.push(load([aside, 0.0, -force], "t"));
                if self.friction == 0.0 {
                    fixes.push(with(side, "axes", json!(["x", "y"])));
                }
            }
            Violence::Dragged => {
                loads.push(load([0.0, 0.0, -force], "min(2*t, 1.0)"));
                let end = with(fix("top", "x-max"), "axes", json!(["x"]));
                let velocity = [random.between(0.005, 0.05) * s, 0.0, 0.0];
                fixes.push(with(end, "motion", translation(velocity)));
                if self.friction == 0.0 {
                    fixes.push(with(fix("top", "x-max"), "axes", json!(["y"])));
                }
            }
            _ => {}
        }
        Tables { bodies: vec![slab, top], fixes, loads, ..Tables::default() }
    }

    fn indented(&self, random: &mut Random) -> Tables {
        let s = self.size;
        let (slab, held_below) = self.slab(random);
        let shape = shape(random, s);
        let down = self.gap + random.between(0.02, 0.3) * s;
        let aside = if random.once_in(2) { random.between(0.0, 0.1) * s } else { 0.0 };
        // No shape reaches farther than .5 s from its middle.
        let tool = moved("tool", shape, [s, s, s + self.gap], [aside, 0.0, -down]);
        Tables { bodies: vec![slab], rigids: vec![tool], fixes: vec![held_below], ..Tables::default() }
    }

    /// Returns a ball above a slab, or above the gap between four blocks.
    fn balls(&self, random: &mut Random) -> Tables {
        let s = self.size;
        let mass = self.density * s * s * s * random.decades(0.03, 1.0);
        let ball = |radius: f64, place: [f64; 3]| json!({ "name": "ball", "shape": { "kind": "sphere", "radius": radius }, "mass": mass, "position": place });
        if random.once_in(2) {
            let (slab, held_below) = self.slab(random);
            let radius = s * random.between(0.2, 0.5);
            let ball = ball(radius, [s, s, 0.5 * s + radius + self.gap]);
            return Tables {
                bodies: vec![slab],
                rigids: vec![ball],
                fixes: vec![held_below],
                ..Tables::default()
            };
        }
        let apart = random.between(0.3, 1.0) * s;
        let mut tables = Tables::default();
        for (k, [x, y]) in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].into_iter().enumerate() {
            let name = format!("block-{k}");
            let origin = [x * (s + apart), y * (s + apart), 0.0];
            tables.bodies.push(self.block(&name, [s; 3], origin, random));
            tables.fixes.push(fix(&name, "z-min"));
        }
        // The ball is too large to fall through.
        let radius = apart + random.between(0.0, 0.5) * s;
        let middle = s + 0.5 * apart;
        tables.rigids.push(ball(radius, [middle, middle, s + radius + self.gap]));
        tables
    }

    fn brought_together(&self, random: &mut Random) -> Tables {
        let s = self.size;
        let left = self.block("left", [s; 3], [0.0; 3], random);
        let shift = s * random.of_all(&[0.0, 0.25, 0.5]);
        let right = self.block("right", [s; 3], [s + self.gap, shift, 0.0], random);
        let aside = if random.once_in(2) { random.between(0.0, 0.05) * s } else { 0.0 };
        let velocity = [-self.gap - random.between(0.02, 0.1) * s, aside, 0.0];
        let fixes = vec![fix("left", "x-min"), with(fix("right", "x-max"), "motion", translation(velocity))];
        Tables { bodies: vec![left, right], fixes, ..Tables::default() }
    }
}
