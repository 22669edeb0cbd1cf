//! Finds bodies so far from the origin that the spacing of floating-point numbers changes the shape of their elements.

use vi_mesh::{Bounds, Mesh};

/// Spacing of coordinates, relative to the smallest edge, above which a note is given. Strains have an error of about
/// this size, which is a stress of 1e-6 of the stiffness.
const NOTED: f64 = 1e-6;

/// Only bodies that are farther from the origin than this multiple of their extent are examined. Nearer ones would need
/// edges below 1e-7 of their extent.
const FAR: f64 = 1e3;

/// Returns a note if coordinates are spaced too coarsely for the smallest edge.
pub(super) fn note(name: &str, mesh: &Mesh) -> Option<String> {
    let bounds = Bounds::of(mesh.points.iter().copied());
    let reach = bounds.low.iter().chain(&bounds.high).fold(0.0_f64, |reach, x| reach.max(x.abs()));
    let extent = bounds.longest_side();
    let spacing = f64::EPSILON * reach;
    if reach < FAR * extent {
        return None;
    }
    let edge = smallest_edge(mesh);
    (spacing > NOTED * edge).then(|| {
        format!(
            "{name}: at {reach:.1e} m from the origin, coordinates are {spacing:.1e} m apart, and the smallest edge is {edge:.1e} m: \
             strains have errors of {:.0e}; move the bodies to the origin by `translate`",
            spacing / edge
        )
    })
}

/// Returns the smallest distance between two nodes of a cell, m; infinite without cells.
fn smallest_edge(mesh: &Mesh) -> f64 {
    let mut smallest = f64::INFINITY;
    for (_, nodes) in mesh.cells() {
        for (i, &a) in nodes.iter().enumerate() {
            for &b in &nodes[..i] {
                let (a, b) = (mesh.points[a as usize], mesh.points[b as usize]);
                smallest = smallest.min((0..3).map(|k| (a[k] - b[k]).powi(2)).sum());
            }
        }
    }
    smallest.sqrt()
}
