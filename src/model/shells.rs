//! The shells of a closed surface: whether they bound a solid. Otherwise parts of the enclosed volume count twice, or not at all.

use vi_core::DisjointSets;
use vi_mesh::Bounds;

use crate::intersections::{intersections, is_inside};

/// A connected piece of a surface.
struct Shell {
    triangles: Vec<[u32; 3]>,
    /// Ends of its box, m.
    bounds: Bounds,
    /// Whether the front of its triangles faces outwards.
    is_outward: bool,
}

/// Returns why the shells of a closed surface bound no solid; `None` if they bound one. Triangles may cross, or a shell
/// within another one may face the same way. The signed volume of the whole surface must be positive.
pub(super) fn fault(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Option<String> {
    let place = |node: u32| points[node as usize];
    if let Some(found) = intersections(points, triangles, &[]).first() {
        let ([a, b], [i, j, k]) = (found.segment.map(place), found.triangle.map(place));
        return Some(format!(
            "its surface crosses itself, so that a part of the volume counts twice: the edge from {a:?} to {b:?} meets the triangle \
             of {i:?}, {j:?} and {k:?}; unite the parts in a modelling program, or make a body of each and join them"
        ));
    }
    let shells = shells(points, triangles);
    for (number, shell) in shells.iter().enumerate() {
        let inner = place(shell.triangles[0][0]);
        let holds = |other: &Shell| {
            let Bounds { low, high } = other.bounds;
            (0..3).all(|k| low[k] < inner[k] && inner[k] < high[k])
                && is_inside(inner, points, &other.triangles)
        };
        let others = shells.iter().enumerate().filter(|(other, _)| *other != number);
        let depth = others.filter(|(_, other)| holds(other)).count();
        if shell.is_outward != depth.is_multiple_of(2) {
            let (is, side) = match depth {
                0 => ("outside of all others".to_owned(), "inwards: turn its triangles"),
                1 => ("within another one".to_owned(), if shell.is_outward { OUT } else { IN }),
                _ => (format!("within {depth} others"), if shell.is_outward { OUT } else { IN }),
            };
            return Some(format!(
                "its surface has several shells, and the one at {inner:?} lies {is} and faces {side}"
            ));
        }
    }
    None
}

/// The end of the message for an inner shell that faces the wrong way: outwards, or inwards.
const OUT: &str =
    "outwards, so that its volume counts twice: remove it, or turn its triangles if it bounds a hollow";
const IN: &str = "inwards, as a hollow within a hollow: turn its triangles";

/// Returns the connected pieces of a surface.
fn shells(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<Shell> {
    let mut sets = DisjointSets::new(points.len());
    for &[a, b, c] in triangles {
        sets.join(a, b);
        sets.join(a, c);
    }
    let mut pieces: Vec<(u32, [u32; 3])> = triangles.iter().map(|&all| (sets.root(all[0]), all)).collect();
    pieces.sort_by_key(|(root, _)| *root);
    let of_piece = |piece: &[(u32, [u32; 3])]| {
        let triangles: Vec<[u32; 3]> = piece.iter().map(|(_, triangle)| *triangle).collect();
        let bounds = Bounds::of(triangles.as_flattened().iter().map(|&node| points[node as usize]));
        let is_outward = six_volumes(points, &triangles, bounds.low) > 0.0;
        Shell { triangles, bounds, is_outward }
    };
    pieces.chunk_by(|a, b| a.0 == b.0).map(of_piece).collect()
}

/// Returns six times the volume within triangles, seen from `origin`, m³.
fn six_volumes(points: &[[f64; 3]], triangles: &[[u32; 3]], origin: [f64; 3]) -> f64 {
    let part = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|node| [0, 1, 2].map(|k| points[node as usize][k] - origin[k]));
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    triangles.iter().map(part).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::shape;
    use crate::scene::RigidShape;

    /// Returns boxes with these sizes and middles; those that are not outward are turned inside out.
    fn boxes(all: &[(f64, f64, bool)]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for &(size, middle, is_outward) in all {
            let form = shape::form(&RigidShape::Box { size: [size; 3] });
            let first = points.len() as u32;
            points.extend(form.points.iter().map(|x| x.map(|x| x + middle)));
            triangles.extend(form.triangles.iter().map(|&[a, b, c]| {
                let turned = if is_outward { [a, b, c] } else { [a, c, b] };
                turned.map(|node| first + node)
            }));
        }
        (points, triangles)
    }

    #[test]
    fn shells_bound_a_solid_if_none_cross_and_fronts_alternate_inwards() {
        for all in [
            &[(1.0, 0.0, true)][..],
            &[(1.0, 0.0, true), (1.0, 3.0, true)],
            &[(1.0, 0.0, true), (0.5, 0.0, false)],
            &[(1.0, 0.0, true), (0.5, 0.0, false), (0.25, 0.0, true)],
        ] {
            let (points, triangles) = boxes(all);
            assert_eq!(fault(&points, &triangles), None, "{all:?}");
        }
        for (all, word) in [
            (&[(1.0, 0.0, true), (1.0, 0.5, true)][..], "crosses itself"),
            (&[(1.0, 0.0, true), (0.5, 0.0, true)], "faces outwards"),
            (&[(1.0, 0.0, true), (0.5, 3.0, false)], "faces inwards"),
            (&[(1.0, 0.0, true), (0.5, 0.0, false), (0.25, 0.0, false)], "faces inwards"),
        ] {
            let (points, triangles) = boxes(all);
            let message = fault(&points, &triangles).expect("they bound no solid");
            assert!(message.contains(word), "{message}");
        }
    }
}
