//! Tests candidates: complete compared with a search of all pairs, valid within the margin and along a path, the same
//! after a search of few nodes as after a search of all, and the same on any number of threads.

use std::sync::Arc;

use crate::support::{Numbers, Sheet, body};
use vi_contact::{Body, Contact, ContactTerm, Neighbours, Shape, Surface, SurfaceBuilder};
use vi_core::{Live, Tube};

fn folded(seed: u64, n: usize) -> (Surface, Vec<f64>, Numbers) {
    let mut numbers = Numbers::new(seed);
    let mut all = Sheet::default();
    let [first, second] = [0.0, 0.05].map(|z| all.join(&Sheet::grid(n, 0.0, 1.0, z)));
    let mut builder = SurfaceBuilder::new(&all.x);
    let edge = 1.0 / n as f64;
    for triangles in [first, second] {
        let number = builder.body(Body { meets_itself: true, ..body(0.1 * edge, 1e4) });
        builder.triangles(number, &triangles);
    }
    let surface = builder.build().expect("a valid surface");
    // Fold the sheets over themselves, with a ripple.
    let mut x = all.x;
    for node in x.chunks_exact_mut(3) {
        let angle = 3.0 * node[0];
        (node[0], node[2]) = ((0.3 + node[2]) * angle.sin(), (0.3 + node[2]) * angle.cos());
        node[2] += edge * (2.0 * numbers.unit() - 1.0);
    }
    (surface, x, numbers)
}

#[test]
fn no_near_pair_is_missed() {
    let (surface, x, _) = folded(1, 12);
    let margin = 0.05;
    let neighbours = Neighbours::find(&surface, &x, margin);
    let at = |node: u32| crate::support::at(&x, node);
    let mut count = 0;
    for (number, point) in surface.points().iter().enumerate() {
        for (cell, other) in surface.cells().iter().enumerate() {
            let [a, b, c] = other.nodes;
            let distance = Shape::PointTriangle.closest(&[at(point.node), at(a), at(b), at(c)]).distance();
            let near = !other.nodes.contains(&point.node) && distance < 0.1 / 12.0 + margin - 1e-9;
            let found = neighbours.cells_of(number).contains(&(cell as u32));
            count += usize::from(near);
            assert!(!near || found, "point {number}, cell {cell} at {distance}");
        }
    }
    let pairs = neighbours.edge_pairs();
    for (a, first) in surface.edges().iter().enumerate() {
        for (b, second) in surface.edges().iter().enumerate().skip(a + 1) {
            let nodes = [first.nodes, second.nodes].concat();
            let distance = Shape::EdgeEdge.closest(&[0, 1, 2, 3].map(|k: usize| at(nodes[k]))).distance();
            let apart = first.nodes.iter().all(|node| !second.nodes.contains(node));
            let near = apart && distance < 0.1 / 12.0 + margin - 1e-9;
            let key = [a as u32, b as u32];
            assert!(!near || pairs.binary_search(&key).is_ok(), "{key:?}");
        }
    }
    assert!(count > 1000, "{count}");
}

/// Sheets at a distance of some hundred roundings of their positions meet, however exactly the motion is their distance.
#[test]
fn gaps_near_round_off_are_not_excluded() {
    let mut numbers = Numbers::new(9);
    for round in 0..300 {
        let gap = 10_f64.powf(-14.0 + 4.0 * numbers.unit());
        let shift = [(); 3].map(|()| 2.0 * numbers.unit() - 1.0);
        let mut all = Sheet::default();
        let sheets = [0.0, gap].map(|z| all.join(&Sheet::grid(2, 0.0, 1.0, z)));
        // Turned and shifted, so that every position and distance is rounded.
        let axis = [(); 3].map(|()| numbers.unit());
        let rotation = nalgebra::Rotation3::from_scaled_axis(nalgebra::Vector3::from(axis));
        for x in all.x.chunks_exact_mut(3) {
            let turned = rotation * nalgebra::Vector3::new(x[0], x[1], x[2]);
            (0..3).for_each(|k| x[k] = turned[k] + shift[k]);
        }
        let mut builder = SurfaceBuilder::new(&all.x);
        for triangles in &sheets {
            let number = builder.body(body(0.01, 1e4));
            builder.triangles(number, triangles);
        }
        let surface = Arc::new(builder.build().expect("a valid surface"));
        let mut end = all.x.clone();
        let first_of_second = all.x.len() / 2;
        end[first_of_second..].copy_from_slice(&all.x[..first_of_second]);
        let term = ContactTerm::new(surface, 0.005);
        let tube = |reach: f64| {
            let motion = end.iter().zip(&all.x).map(|(end, x)| end - x).collect();
            Tube { start: all.x.clone(), motion, reach: vec![reach; all.x.len() / 3] }
        };
        let narrow = term.within(&tube(1e-3)).narrowed(&tube(0.0)).expect("contact chooses stencils");
        assert!(!narrow.meetings(&all.x, &end, 0.0).is_empty(), "{round}: {gap:e}");
    }
}

#[test]
fn lists_are_the_same_on_any_number_of_threads() {
    let (surface, x, _) = folded(2, 40);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let found = Neighbours::find(&surface, &x, 0.02);
            let cells: Vec<u32> =
                (0..surface.points().len()).flat_map(|point| found.cells_of(point).to_vec()).collect();
            let contact = vi_contact::Contact { surface: &surface, neighbours: &found };
            (cells, found.edge_pairs().to_vec(), contact.active(&x), contact.energy(&x).to_bits())
        })
    };
    let one = on(1);
    assert!(one.2.len() > 100);
    assert_eq!(one, on(2));
    assert_eq!(one, on(7));
}

/// Within half the margin, no pair acts that is not listed.
#[test]
fn lists_stay_valid_within_half_the_margin() {
    let (surface, x, mut numbers) = folded(3, 16);
    let margin = 0.04;
    let neighbours = Neighbours::find(&surface, &x, margin);
    let moved: Vec<f64> = x
        .chunks_exact(3)
        .flat_map(|x| {
            let step = numbers.vector().normalize() * (0.499 * margin);
            [x[0] + step.x, x[1] + step.y, x[2] + step.z]
        })
        .collect();
    assert!(neighbours.covers(&moved));
    let fresh = Neighbours::find(&surface, &moved, 0.0);
    let [old, new] = [&neighbours, &fresh]
        .map(|neighbours| vi_contact::Contact { surface: &surface, neighbours }.active(&moved));
    assert!(new.len() > 20);
    assert_eq!(old, new);
}

/// A path along which both sheets move far, and neighbouring nodes a little differently.
fn path(x: &[f64], numbers: &mut Numbers) -> Tube {
    let motion = x.chunks_exact(3).enumerate().flat_map(|(node, _)| {
        let common = if node < x.len() / 6 { [0.3, 0.0, -0.2] } else { [0.28, 0.02, -0.2] };
        let own = numbers.vector() * 0.01;
        [common[0] + own.x, common[1] + own.y, common[2] + own.z]
    });
    let motion: Vec<f64> = motion.collect();
    let reach = (0..x.len() / 3).map(|_| 0.004 + 0.01 * numbers.unit()).collect();
    Tube { start: x.to_vec(), motion, reach }
}

/// Near the path, no pair acts that is not listed, also if the list is chosen from one for a wider and longer path.
#[test]
fn lists_stay_valid_along_a_path() {
    let (surface, x, mut numbers) = folded(4, 16);
    let tube = path(&x, &mut numbers);
    let whole = Neighbours::within(&surface, tube.clone());
    for tau in [0.0, 0.4, 1.0] {
        let moved: Vec<f64> = (0..x.len())
            .collect::<Vec<_>>()
            .chunks_exact(3)
            .flat_map(|place| {
                let shift = numbers.vector().normalize() * (0.9 * tube.reach[place[0] / 3]);
                [0, 1, 2].map(|k: usize| x[place[k]] + tau * tube.motion[place[k]] + shift[k])
            })
            .collect();
        assert!(whole.covers(&moved), "{tau}");
        let fresh = Neighbours::find(&surface, &moved, 0.0);
        let [old, new] =
            [&whole, &fresh].map(|neighbours| Contact { surface: &surface, neighbours }.active(&moved));
        assert!(new.len() > 20);
        assert_eq!(old, new, "{tau}");
    }
}

/// If few nodes change their paths, their pairs alone are searched again, with the result of a search of all pairs.
#[test]
fn a_search_of_few_nodes_finds_the_same_as_one_of_all() {
    let (surface, x, mut numbers) = folded(5, 16);
    let surface = Arc::new(surface);
    let term = ContactTerm::new(Arc::clone(&surface), 0.01);
    let mut tube = path(&x, &mut numbers);
    let mut last = term.within(&tube).stencils().nodes.to_vec();
    for round in 0..20 {
        for _ in 0..5 {
            let node = (numbers.unit() * (x.len() / 3) as f64) as usize;
            tube.reach[node] *= 0.5 + numbers.unit();
            for k in 3 * node..3 * node + 3 {
                tube.start[k] += 0.04 * (numbers.unit() - 0.5);
                tube.motion[k] *= 0.9;
            }
        }
        let found = term.within(&tube).stencils().nodes.to_vec();
        let fresh = ContactTerm::new(Arc::clone(&surface), 0.01).within(&tube).stencils().nodes.to_vec();
        assert_eq!(found, fresh, "{round}");
        assert_ne!(found, last, "{round}");
        last = found;
    }
}

/// A list about one configuration stays valid wherever nodes are that no pair reads, such as the directors of a rigid body, and does
/// not if a node of a surface moves as far.
#[test]
fn nodes_that_no_pair_reads_may_be_anywhere() {
    let mut all = Sheet::default();
    let sheets = [0.0, 0.05].map(|z| all.join(&Sheet::grid(3, 0.0, 1.0, z)));
    let director = all.x.len();
    all.x.extend([1.0, 0.0, 0.0]);
    let mut builder = SurfaceBuilder::new(&all.x);
    for triangles in sheets {
        let number = builder.body(body(0.03, 1e4));
        builder.triangles(number, &triangles);
    }
    let term = ContactTerm::new(Arc::new(builder.build().expect("a valid surface")), 0.01);
    let near = term.at(&all.x);
    let shifted = |k: usize| {
        let mut x = all.x.clone();
        x[k] += 100.0;
        x
    };
    assert!(near.neighbours().covers(&shifted(director)));
    assert!(!near.neighbours().covers(&shifted(0)));
    // Lists along a path are the same for any path of such a node.
    let tube = |turn: f64| {
        let mut motion = vec![0.1; all.x.len()];
        motion[director] = turn;
        Tube { start: all.x.clone(), motion, reach: vec![0.01; all.x.len() / 3] }
    };
    let [still, turning] = [0.0, 9.0].map(|turn| term.within(&tube(turn)).stencils().nodes.to_vec());
    assert_eq!(still, turning);
}
