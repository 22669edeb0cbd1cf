//! Estimates the memory of bodies before their meshes are made.

use vi_mesh::{CellKind, SheetMesh, SheetPattern};

use crate::scene::{Body, Problem, Refine, RefineAlong};

/// Bytes per node of each element: its number in the mesh, the element's shape at rest, forces, and the maps for
/// summing them. A run of a million linear tetrahedra takes 354 bytes per tetrahedron at its peak
/// (`docs/performance.md`); implicit steps and sheets take more.
const BYTES_PER_NODE_OF_ELEMENT: f64 = 80.0;
/// Elements and nodes are numbered in 32 bits.
const MOST_ELEMENTS: f64 = u32::MAX as f64;

/// The memory budget for the bodies of a scene.
pub(super) struct Budget {
    /// Bytes that are left.
    left: f64,
    available: f64,
}

impl Budget {
    /// Starts with the memory that the machine has available.
    pub(super) fn of_machine() -> Self {
        Self::new(available())
    }

    fn new(available: f64) -> Self {
        Self { left: available, available }
    }

    /// Takes the memory of body number `index` of the scene. `in_file` gives the number of elements of its dimension,
    /// by kind, in its mesh file; a generated body has no file.
    ///
    /// # Errors
    /// Returns a problem if the remaining memory is too small.
    pub(super) fn take(
        &mut self,
        body: &Body,
        index: usize,
        in_file: &[(CellKind, usize)],
    ) -> Result<(), Problem> {
        let refined = match &body.refine {
            Some(Refine::Along(RefineAlong { axes, .. })) => 2.0_f64.powi(axes.len() as i32),
            _ if body.dimension() == 3 => 8.0,
            _ => 4.0,
        };
        let times = body.refine.as_ref().map_or(0, Refine::levels);
        let refined = refined.powi(times as i32);
        let made = generated(body);
        let counts = in_file.iter().map(|&(kind, count)| (kind, count as f64)).chain(made);
        let (mut elements, mut bytes) = (0.0, 0.0);
        for (kind, count) in counts {
            elements += count * refined;
            bytes += count * refined * nodes(kind, body.order) as f64 * BYTES_PER_NODE_OF_ELEMENT;
        }
        self.left -= bytes;
        if self.left >= 0.0 && elements <= MOST_ELEMENTS {
            return Ok(());
        }
        let key = match (times, &body.box_shape, &body.sheet) {
            (0, Some(_), _) => "box.cells",
            (0, _, Some(_)) => "sheet.cells",
            (0, ..) => "mesh",
            _ => "refine",
        };
        let limit = match elements > MOST_ELEMENTS {
            true => "elements are numbered up to 4.29e9".to_owned(),
            false => format!("this machine has {} available", gigabytes(self.available)),
        };
        let message = format!(
            "makes {elements:.3e} elements, which take at least {} of memory, and {limit}; use fewer",
            gigabytes(bytes)
        );
        Err(Problem::new(format!("body[{index}].{key}"), message))
    }
}

/// Returns the number of elements of a generated body before refinement.
fn generated(body: &Body) -> Option<(CellKind, f64)> {
    if let Some(shape) = &body.box_shape {
        return Some((shape.element, shape.element_count()));
    }
    let SheetMesh { cells, pattern, .. } = body.sheet.as_ref()?;
    let a_cell = if *pattern == SheetPattern::Cross { 4.0 } else { 2.0 };
    Some((CellKind::Tri3, a_cell * cells.map(f64::from).iter().product::<f64>()))
}

/// Returns the nodes per element of a body of this order.
fn nodes(kind: CellKind, order: Option<u8>) -> usize {
    let is_lifted = order == Some(2) && kind.dimension() == 3 && kind.is_linear();
    kind.quadratic().filter(|_| is_lifted).unwrap_or(kind).node_count()
}

fn gigabytes(bytes: f64) -> String {
    format!("{:.3} GB", 1e-9 * bytes)
}

/// Returns the available memory (bytes), as Linux and the limit of the control group state it; infinite on other
/// systems.
fn available() -> f64 {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let available_kb = read("/proc/meminfo").and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("MemAvailable:"))?;
        line.split_whitespace().nth(1)?.parse::<f64>().ok()
    });
    let limit = read("/sys/fs/cgroup/memory.max").and_then(|text| text.trim().parse().ok());
    available_kb.map_or(f64::INFINITY, |kilobytes| 1024.0 * kilobytes).min(limit.unwrap_or(f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;

    fn body(shape: &str) -> Body {
        let thickness = if shape.contains("sheet") { r#", "thickness": 1e-3"# } else { "" };
        let law = format!(
            r#"{{ "law": "st-venant-kirchhoff", "young": 1e6, "poisson": 0.3, "density": 1e3{thickness} }}"#
        );
        serde_json::from_str(&format!(r#"{{ "name": "b", "material": {law}, {shape} }}"#)).unwrap()
    }

    /// The estimated number of elements equals the number made, for every element, order and refinement.
    #[test]
    fn elements_are_counted_as_they_are_made() {
        for shape in [
            r#""box": { "size": [1, 1, 1], "cells": [3, 2, 1], "element": "tet4" }, "refine": 1"#,
            r#""box": { "size": [1, 1, 1], "cells": [3, 2, 1], "element": "wedge6" }, "order": 2"#,
            r#""box": { "size": [1, 1, 1], "cells": [3, 2, 1], "element": "hex8" }, "order": 2, "refine": 2"#,
            r#""box": { "size": [1, 1, 1], "cells": [3, 2, 1], "element": "hex27" }"#,
            r#""box": { "size": [1, 1, 1], "cells": [3, 2, 1], "element": "hex8" }, "refine": { "axes": ["x", "y"], "levels": 2 }"#,
            r#""sheet": { "size": [1, 1], "cells": [5, 3], "pattern": "cross" }, "refine": 2"#,
            r#""sheet": { "size": [1, 1], "cells": [5, 3] }"#,
        ] {
            let body = body(shape);
            let mut budget = Budget::new(1e12);
            budget.take(&body, 0, &[]).unwrap();
            let counted = (budget.available - budget.left) / BYTES_PER_NODE_OF_ELEMENT;
            let scene = Scene::new(Time::new(1.0, 1.0, SchemeName::ImplicitMidpoint)).body(body);
            let simulation = Simulation::new(scene).unwrap();
            let mesh = &simulation.bodies()[0].mesh;
            let dimension = mesh.blocks[0].kind.dimension();
            let blocks = mesh.blocks.iter().filter(|block| block.kind.dimension() == dimension);
            let made: usize = blocks.map(|block| block.nodes.len()).sum();
            assert_eq!(counted, made as f64, "{shape}");
        }
    }

    #[test]
    fn bodies_share_the_memory() {
        let body = body(r#""box": { "size": [1, 1, 1], "cells": [10, 10, 10], "element": "tet4" }"#);
        let mut budget = Budget::new(4e6);
        budget.take(&body, 0, &[]).unwrap();
        budget.take(&body, 1, &[]).unwrap();
        let problem = budget.take(&body, 2, &[]).unwrap_err();
        assert_eq!(problem.key, "body[2].box.cells");
    }
}
