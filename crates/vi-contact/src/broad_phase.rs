//! Finds parts of surfaces that are near each other, with a tree of boxes and with lists of candidates that stay
//! valid while nodes move little.

mod boxes;
mod margins;
mod neighbours;
mod search;
mod tree;

pub use neighbours::Neighbours;
pub(crate) use search::Search;

use rayon::prelude::*;

use crate::distance::{Vec3, at};
use crate::surface::Surface;
use boxes::Bounds;
use tree::Tree;

/// Returns for each point the rest distance (m) to the nearest cell of its own body that does not contain it;
/// infinite if that is too far for contact at rest.
pub(crate) fn nearest_own_cells(surface: &Surface) -> Vec<f64> {
    let bodies = &surface.laws.bodies;
    if !bodies.iter().any(|body| body.meets_itself) {
        return vec![f64::INFINITY; surface.points.len()];
    }
    let meets_itself = |cell: &u32| bodies[surface.cells[*cell as usize].body as usize].meets_itself;
    let cells: Vec<u32> = surface.orders.cells.iter().copied().filter(meets_itself).collect();
    let bounds: Vec<Bounds> =
        cells.iter().map(|&cell| Bounds::of(surface.cells[cell as usize].nodes(), &surface.rest)).collect();
    let order: Vec<u32> = (0..cells.len() as u32).collect();
    let tree = Tree::new(&bounds, &order, Vec3::zeros());
    let nearest = |point: usize| {
        let owner = surface.points[point].body;
        let body = bodies[owner as usize];
        if !body.meets_itself {
            return f64::INFINITY;
        }
        let reach = (4.0 * body.radius).max(2.0 * (body.distance + body.radius));
        let mut least = f64::INFINITY;
        let bounds = Bounds::of(&[surface.points[point].node], &surface.rest).inflated(reach);
        tree.visit(&bounds, &mut |found| {
            let cell = cells[found as usize] as usize;
            if surface.cells[cell].body == owner && surface.admits_point(point, cell) {
                let [a, b, c] = surface.cells[cell].nodes;
                let x = [surface.points[point].node, a, b, c].map(|node| at(&surface.rest, node));
                least = least.min(surface.cells[cell].shape().closest(&x).distance());
            }
        });
        least
    };
    (0..surface.points.len()).into_par_iter().map(nearest).collect()
}
