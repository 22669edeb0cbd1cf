//! The slit annulus, lifted at one edge of the slit. It takes too long for a test, so an example runs it.
//!
//! Source: Sze, Liu & Lo (2004), *Popular benchmark problems for geometric nonlinear analysis of shells*.

use std::f64::consts::TAU;

use vi_mesh::SheetPattern;

use super::cases::{Outcome, curve, held_nodes, law, line_load, mesh, relative, triangles};
use super::structure::Structure;

/// Loads of the annulus as fractions of the largest, and the deflections of its inner and outer tip (Sze et al.,
/// table 4).
const ANNULUS: [(f64, f64, f64); 23] = [
    (0.025, 1.305, 1.789),
    (0.05, 2.455, 3.370),
    (0.075, 3.435, 4.720),
    (0.1, 4.277, 5.876),
    (0.125, 5.007, 6.872),
    (0.15, 5.649, 7.736),
    (0.2, 6.725, 9.160),
    (0.25, 7.602, 10.288),
    (0.3, 8.340, 11.213),
    (0.35, 8.974, 11.992),
    (0.4, 9.529, 12.661),
    (0.45, 10.023, 13.247),
    (0.5, 10.468, 13.768),
    (0.55, 10.876, 14.240),
    (0.6, 11.257, 14.674),
    (0.65, 11.620, 15.081),
    (0.7, 11.970, 15.469),
    (0.75, 12.310, 15.842),
    (0.8, 12.642, 16.202),
    (0.85, 12.966, 16.550),
    (0.9, 13.282, 16.886),
    (0.95, 13.590, 17.212),
    (1.0, 13.891, 17.528),
];

/// Sze's slit annulus: Ri = 6, Ro = 10, h = .03, E = 21e6, ν = 0, largest edge load .8 per length. One edge of the
/// slit is clamped, the other is lifted. `cells` are counted around and across.
pub(crate) fn slit_annulus(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let flat = mesh([TAU, 4.0], cells, pattern);
    let mut mesh = flat.clone();
    for p in &mut mesh.points {
        let (angle, radius) = (p[0], 6.0 + p[1]);
        *p = [radius * angle.cos(), radius * angle.sin(), 0.0];
    }
    let held = held_nodes(&mesh, &["x-min"]);
    let law = law(21e6, 0.0, 0.03, 1.0);
    let mut structure = Structure::new(
        &mesh,
        &law,
        &curve(&mesh, "x-min"),
        |node, _| held[node],
        |node| flat.points[node][0],
    );
    let inner = mesh.region_nodes("x-max-y-min").unwrap()[0] as usize;
    let outer = mesh.region_nodes("x-max-y-max").unwrap()[0] as usize;
    let mut values = Vec::new();
    for (factor, a, b) in ANNULUS {
        structure.equilibrate(&line_load(&mesh, "x-max", [0.0, 0.0, 0.8 * factor])).unwrap();
        values.push(relative(format!("WA at {factor}"), structure.x[3 * inner + 2], a));
        values.push(relative(format!("WB at {factor}"), structure.x[3 * outer + 2], b));
    }
    Outcome { triangles: triangles(&mesh), values }
}
