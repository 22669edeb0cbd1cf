//! The reference cases of cloth (D3), each on one mesh: hanging, swinging and vibrating sheets, and a rolled one.
//!
//! Sources: the catenary 2a sinh(1/2a) = L; zeros of Bessel's functions, of J₀(2ω√(L/g)) for the hanging
//! chain and of J_n(ωR/c) for the drum.

use vi_fem::Bending;
use vi_mesh::{Mesh, SheetPattern};

use super::cases::{Outcome, curve, held_nodes, law, mesh, relative, triangles};
use super::structure::Structure;

/// Strips of length 1.2, 1.5 and 2 between supports at distance 1. The values are the sag, and the horizontal force
/// divided by the weight per length. E h is 1e5 times the weight; the bending length √(D/H) is below 0.01.
pub(crate) fn catenary(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let (width, mut values, mut count) = (0.1, Vec::new(), 0);
    for (length, sag, force) in
        [(1.2, 0.292343798, 0.469541523), (1.5, 0.502633262, 0.308236470), (2.0, 0.796388356, 0.229640215)]
    {
        let thickness = 1e-4;
        let mesh = mesh([length, width], cells, pattern);
        let held = held_nodes(&mesh, &["x-min", "x-max"]);
        let law = law(1e5 / thickness, 0.0, thickness, 1.0);
        let mut structure =
            Structure::new(&mesh, &law, &[], |node, _| held[node], |node| mesh.points[node][0]);
        // Start from a parabola of about the right length.
        let depth = (0.375 * (length - 1.0_f64)).sqrt();
        for (x, p) in structure.x.chunks_exact_mut(3).zip(&mesh.points) {
            let s = p[0] / length;
            x[0] = s;
            x[2] = -4.0 * depth * s * (1.0 - s);
        }
        structure.longest_step = 0.05;
        let load = weight(&structure, [0.0, 0.0, -1.0]);
        structure.equilibrate(&load).unwrap();
        let lowest = structure.x.chunks_exact(3).map(|x| -x[2]).fold(0.0, f64::max);
        let inner = structure.internal_forces(&structure.x);
        let pull: f64 =
            mesh.region_nodes("x-max").unwrap().iter().map(|&node| inner[3 * node as usize]).sum();
        values.push(relative(format!("sag at L = {length}"), lowest, sag));
        values.push(relative(format!("H at L = {length}"), pull / width, force));
        count = triangles(&mesh);
    }
    Outcome { triangles: count, values }
}

fn weight(structure: &Structure, g: [f64; 3]) -> Vec<f64> {
    structure.masses.iter().flat_map(|m| g.map(|g| m * g)).collect()
}

/// Frequencies ω√(L/g) of a strip that hangs from one end. Its fibres swing in phase or against each other at the
/// same frequency, so each reference value belongs to a cluster of modes; the error is that of the worst mode of the cluster.
pub(crate) fn chain(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let mesh = mesh([1.0, 0.1], cells, pattern);
    let held = held_nodes(&mesh, &["x-min"]);
    let thickness = 1e-5;
    let law = law(1e5 / thickness, 0.0, thickness, 1.0);
    let is_held = |node: usize, axis: usize| held[node] || axis == 1;
    let mut structure = Structure::new(&mesh, &law, &[], is_held, |node| mesh.points[node][0]);
    let load = weight(&structure, [1.0, 0.0, 0.0]);
    structure.straight(&load);
    let references = [1.202412779, 2.760039055, 4.326863956];
    let fibres = cells[1] as usize + 1;
    let squares = structure.squared_frequencies(3 * fibres, 0.1);
    let mut values = Vec::new();
    for (k, reference) in references.into_iter().enumerate() {
        let cluster = squares[k * fibres..(k + 1) * fibres].iter().map(|square| square.sqrt());
        let far = |value: &f64| (value - reference).abs();
        let worst = cluster.max_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(f64::NAN);
        values.push(relative(format!("mode {}", k + 1), worst, reference));
    }
    Outcome { triangles: triangles(&mesh), values }
}

/// Returns the mesh of a square mapped to the unit disc, with its rim on the circle.
fn disc(cells: u32, pattern: SheetPattern) -> Mesh {
    let mut mesh = mesh([2.0, 2.0], [cells, cells], pattern);
    for p in &mut mesh.points {
        let (u, v) = (p[0] - 1.0, p[1] - 1.0);
        *p = [u * (1.0 - 0.5 * v * v).sqrt(), v * (1.0 - 0.5 * u * u).sqrt(), 0.0];
    }
    mesh
}

/// Frequencies ωR/c of a circular drum: a membrane without bending stiffness, stretched by 5 %.
pub(crate) fn drum(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let (young, thickness, stretch) = (1e3, 1e-2, 1.05);
    let mesh = disc(cells[0], pattern);
    let held = held_nodes(&mesh, &["x-min", "x-max", "y-min", "y-max"]);
    let law = law(young, 0.0, thickness, 1.0).with_bending(Bending::None);
    let is_held = |node: usize, axis: usize| held[node] || axis < 2;
    let mut structure = Structure::new(&mesh, &law, &[], is_held, |node| mesh.points[node][0]);
    structure.x.iter_mut().for_each(|x| *x *= stretch);
    // The tension is h S; the mass per area and R are those of the stretched drum.
    let tension = thickness * young * 0.5 * (stretch * stretch - 1.0);
    let speed = (tension * stretch * stretch).sqrt();
    let references = [2.404825558, 3.831705970, 3.831705970, 5.135622302, 5.135622302, 5.520078110];
    let squares = structure.squared_frequencies(6, 0.0);
    let value = |(k, (square, reference)): (usize, (&f64, &f64))| {
        relative(format!("mode {}", k + 1), square.sqrt() * stretch / speed, *reference)
    };
    let values = squares.iter().zip(&references).enumerate().map(value).collect();
    Outcome { triangles: triangles(&mesh), values }
}

/// A unit square rolled onto a cylinder of radius ½ in twelve directions. The value is the bending energy of the inner
/// triangles, divided by ½ D/R² times their area. Near a free edge the sheet may straighten.
pub(crate) fn rolled(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let radius = 0.5;
    let law = law(1e6, 0.3, 1e-2, 1.0);
    let mesh = mesh([1.0, 1.0], cells, pattern);
    let stiffness = law.parameters().common().thickness.powi(3) / 12.0 * law.parameters().moduli()[0][0];
    let structure = Structure::new(&mesh, &law, &curve(&mesh, "x-min")[..0], |_, _| false, |_| 0.0);
    let margin = 3.0 / f64::from(cells[0]);
    let mut values = Vec::new();
    for step in 0..12 {
        let (s, c) = (f64::from(step) * std::f64::consts::PI / 12.0).sin_cos();
        let roll = |p: &[f64; 3]| {
            let (along, across) = ((c * p[0] + s * p[1]) / radius, c * p[1] - s * p[0]);
            [radius * along.sin(), across, radius * (1.0 - along.cos())]
        };
        let x: Vec<f64> = mesh.points.iter().flat_map(roll).collect();
        let (mut energy, mut area) = (0.0, 0.0);
        for potential in structure.potentials.iter().skip(1) {
            let stencils = potential.stencils();
            let mut energies = vec![0.0; stencils.count()];
            potential.energies(0..stencils.count(), &x, 0.0, &mut energies);
            for (stencil, value) in energies.into_iter().enumerate() {
                // The corners of the triangle come first in its stencil.
                let [a, b, c] = [0, 1, 2].map(|k| mesh.points[stencils.of(stencil)[k] as usize]);
                let is_inside = (0..2)
                    .map(|i| (a[i] + b[i] + c[i]) / 3.0)
                    .all(|centre| centre > margin && centre < 1.0 - margin);
                if is_inside {
                    energy += value;
                    area += 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
                }
            }
        }
        let ratio = energy / (0.5 * stiffness * area / (radius * radius));
        values.push(relative(format!("at {}°", 15 * step), ratio, 1.0));
    }
    Outcome { triangles: triangles(&mesh), values }
}
