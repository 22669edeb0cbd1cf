//! The reference cases of plates and shells, each on one mesh: computed values against references.
//!
//! Sources: Sze, Liu & Lo (2004), *Popular benchmark problems for geometric nonlinear analysis of shells*; the
//! elastica and the eigenvalues of Kirchhoff's plate were computed independently to the digits given.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use vi_core::{Account, HessianKind, Potential, Stencils, Traits, packed_len};
use vi_fem::{Bending, IsotropicSheet, SheetLaw};
use vi_mesh::{CellKind, Mesh, SheetMesh, SheetPattern};

use super::structure::Structure;

/// The results of a case on one mesh.
pub(crate) struct Outcome {
    /// Number of triangles.
    pub(crate) triangles: usize,
    /// (quantity, computed, reference, error relative to the scale by which the case is judged).
    pub(crate) values: Vec<(String, f64, f64, f64)>,
}

impl Outcome {
    pub(crate) fn worst(&self) -> f64 {
        self.values.iter().map(|value| value.3).fold(0.0, f64::max)
    }
}

pub(crate) fn law(young: f64, poisson: f64, thickness: f64, area_density: f64) -> SheetLaw {
    SheetLaw::StVenantKirchhoff(IsotropicSheet {
        young,
        poisson,
        density: None,
        area_density: Some(area_density),
        thickness,
        bending: Bending::Shell,
        tension_field: false,
    })
}

pub(crate) fn mesh(size: [f64; 2], cells: [u32; 2], pattern: SheetPattern) -> Mesh {
    let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    SheetMesh { size, cells, pattern, seed: 1, origin: [0.0; 3], directions }.build().unwrap()
}

pub(crate) fn triangles(mesh: &Mesh) -> usize {
    mesh.cells_of_dimension(2).len()
}

/// Returns the edges of a named curve.
pub(crate) fn curve(mesh: &Mesh, name: &str) -> Vec<[u32; 2]> {
    let cells = &mesh.region(name).unwrap().cells;
    let pair = |&cell: &u32| match mesh.cell(cell as usize) {
        Some((CellKind::Line2, &[a, b])) => [a, b],
        _ => unreachable!("curves are lines"),
    };
    cells.iter().map(pair).collect()
}

fn length(mesh: &Mesh, [a, b]: [u32; 2]) -> f64 {
    let (p, q) = (mesh.points[a as usize], mesh.points[b as usize]);
    (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt()
}

/// Returns a force per length along a curve, lumped to the nodes: N on every coordinate.
pub(crate) fn line_load(mesh: &Mesh, name: &str, force: [f64; 3]) -> Vec<f64> {
    let mut load = vec![0.0; 3 * mesh.points.len()];
    for edge in curve(mesh, name) {
        for node in edge {
            for i in 0..3 {
                load[3 * node as usize + i] += 0.5 * length(mesh, edge) * force[i];
            }
        }
    }
    load
}

pub(crate) fn held_nodes(mesh: &Mesh, names: &[&str]) -> Vec<bool> {
    let mut held = vec![false; mesh.points.len()];
    for name in names {
        for node in mesh.region_nodes(name).unwrap() {
            held[node as usize] = true;
        }
    }
    held
}

/// Returns a strip along x, clamped at x = 0.
fn cantilever(mesh: &Mesh, law: &SheetLaw) -> Structure {
    let held = held_nodes(mesh, &["x-min"]);
    Structure::new(mesh, law, &curve(mesh, "x-min"), |node, _| held[node], |node| mesh.points[node][0])
}

/// Returns the mean displacement of the nodes of a curve.
fn displacement(mesh: &Mesh, structure: &Structure, name: &str) -> [f64; 3] {
    let nodes = mesh.region_nodes(name).unwrap();
    [0, 1, 2].map(|i| {
        let of = |&node: &u32| structure.x[3 * node as usize + i] - mesh.points[node as usize][i];
        nodes.iter().map(of).sum::<f64>() / nodes.len() as f64
    })
}

pub(crate) fn relative(what: impl Into<String>, value: f64, reference: f64) -> (String, f64, f64, f64) {
    (what.into(), value, reference, (value - reference).abs() / reference.abs())
}

/// Sze's cantilever under end shear: L = 10, b = 1, h = .1, E = 1.2e6, ν = 0, P up to 4. The reference is the
/// elastica at α = P L²/(E I) = 1, 2, 4 (P = 1, 2, 4).
pub(crate) fn end_shear(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let mesh = mesh([10.0, 1.0], cells, pattern);
    let mut structure = cantilever(&mesh, &law(1.2e6, 0.0, 0.1, 1.0));
    let mut values = Vec::new();
    let reference =
        [(1.0, 0.05643324, 0.30172077), (2.0, 0.16064172, 0.49345748), (4.0, 0.32894124, 0.66996418)];
    for (force, shortening, deflection) in reference {
        structure.equilibrate(&line_load(&mesh, "x-max", [0.0, 0.0, force])).unwrap();
        let [u, _, w] = displacement(&mesh, &structure, "x-max");
        values.push(relative(format!("U at P = {force}"), -u, 10.0 * shortening));
        values.push(relative(format!("W at P = {force}"), w, 10.0 * deflection));
    }
    Outcome { triangles: triangles(&mesh), values }
}

/// A moment about −y on the last row of cells: V = −M Σ share ψ, where ψ is the slope angle of the grid lines that
/// end there.
struct EndMoment {
    /// The second to last and the last node of each line.
    nodes: Vec<u32>,
    shares: Vec<f64>,
    moment: f64,
}

impl EndMoment {
    fn line(&self, index: usize, x: &[f64]) -> [f64; 3] {
        let [a, b] = [0, 1].map(|k| 3 * self.nodes[2 * index + k] as usize);
        [0, 1, 2].map(|i| x[b + i] - x[a + i])
    }
}

impl Potential for EndMoment {
    fn name(&self) -> &str {
        "end moment"
    }
    fn account(&self) -> Account {
        Account::Load
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 2, block: 3, nodes: &self.nodes }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }
    /// The angle ranges from −½ to 2π − ½, so that it can pass π and reach nearly a full turn.
    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out) {
            let d = self.line(index, x);
            let turned = d[2].atan2(d[0]);
            let wrapped = if turned < -0.5 { turned + TAU } else { turned };
            *out = -self.moment * self.shares[index] * wrapped;
        }
    }
    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
        for (index, out) in range.zip(out.chunks_exact_mut(6)) {
            let d = self.line(index, x);
            let square = d[0] * d[0] + d[2] * d[2];
            let factor = -self.moment * self.shares[index] / square;
            for (corner, weight) in [-1.0, 1.0].into_iter().enumerate() {
                out[3 * corner] = -factor * weight * d[2];
                out[3 * corner + 2] = factor * weight * d[0];
            }
        }
    }
    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out.chunks_exact_mut(packed_len(6))) {
            let d = self.line(index, x);
            let fourth = (d[0] * d[0] + d[2] * d[2]).powi(2);
            let factor = -self.moment * self.shares[index] / fourth;
            let (same, cross) = (2.0 * d[0] * d[2], d[2] * d[2] - d[0] * d[0]);
            let second = [[same, 0.0, cross], [0.0; 3], [cross, 0.0, -same]];
            let weights = [-1.0, 1.0];
            let mut k = 0;
            for row in 0..6 {
                for column in 0..=row {
                    out[k] = factor * weights[row / 3] * weights[column / 3] * second[row % 3][column % 3];
                    k += 1;
                }
            }
        }
    }
    fn projected_hessians(&self, _range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// Sze's cantilever under an end moment: L = 12, bent to a full circle in quarters; errors relative to L.
pub(crate) fn end_moment(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let mesh = mesh([12.0, 1.0], cells, pattern);
    let law = law(1.2e6, 0.0, 0.1, 1.0);
    let held = held_nodes(&mesh, &["x-min"]);
    // Restrict the motion to the plane of bending (ν = 0): a dead moment about a fixed axis is unstable out of the
    // plane.
    let is_held = |node: usize, axis: usize| axis == 1 || held[node];
    let sweep = |node: usize| mesh.points[node][0];
    let mut structure = Structure::new(&mesh, &law, &curve(&mesh, "x-min"), is_held, sweep);
    structure.longest_step = 12.0 / f64::from(cells[0]) / 4.0;
    let lines: Vec<u32> = (0..=cells[1]).map(|j| cells[0] + j * (cells[0] + 1)).collect();
    let nodes: Vec<u32> = lines.iter().flat_map(|&last| [last - 1, last]).collect();
    let share = |j: u32| if j == 0 || j == cells[1] { 0.5 } else { 1.0 } / f64::from(cells[1]);
    let shares: Vec<f64> = (0..=cells[1]).map(share).collect();
    let none = vec![0.0; 3 * mesh.points.len()];
    let mut values = Vec::new();
    for quarter in 1..=4 {
        let moment = 50.0 * PI / 3.0 * f64::from(quarter) / 4.0;
        if quarter > 1 {
            structure.potentials.pop();
        }
        structure.add(Box::new(EndMoment { nodes: nodes.clone(), shares: shares.clone(), moment }));
        // Start from the circle that belongs to this moment.
        let curvature = moment / 100.0;
        let exact = |p: &[f64; 3]| {
            let s = p[0];
            [(curvature * s).sin() / curvature, p[1], (1.0 - (curvature * s).cos()) / curvature]
        };
        for (node, p) in mesh.points.iter().enumerate() {
            if !held[node] {
                structure.x[3 * node..][..3].copy_from_slice(&exact(p));
            }
        }
        structure.equilibrate(&none).unwrap();
        let [u, _, w] = displacement(&mesh, &structure, "x-max");
        let theta = 12.0 * curvature;
        let (u_exact, w_exact) = (12.0 * (1.0 - theta.sin() / theta), 12.0 * (1.0 - theta.cos()) / theta);
        let name = |what: &str| format!("{what} at {quarter}/4 of the circle");
        values.push((name("U"), -u, u_exact, (u + u_exact).abs() / 12.0));
        values.push((name("W"), w, w_exact, (w - w_exact).abs() / 12.0));
    }
    Outcome { triangles: triangles(&mesh), values }
}

/// A plate strip under its own weight with Γ = 12 (1 − ν²) ρ g L³/(E h²) and ν = 0: drop H and reach W, relative to
/// L.
pub(crate) fn self_weight(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    let mesh = mesh([1.0, 0.1], cells, pattern);
    let (young, thickness, gravity) = (1e7, 1e-2, 9.81);
    let mut values = Vec::new();
    let mut structure: Option<Structure> = None;
    let reference =
        [(1.0, 0.12347140, 0.99124640), (10.0, 0.70019972, 0.65635376), (100.0, 0.93752394, 0.15922338)];
    for (gamma, drop, reach) in reference {
        let density = gamma * young * thickness * thickness / (12.0 * gravity);
        let mut next = cantilever(&mesh, &law(young, 0.0, thickness, density * thickness));
        if let Some(last) = &structure {
            next.x.copy_from_slice(&last.x);
        }
        let load: Vec<f64> = (0..next.x.len())
            .map(|dof| if dof % 3 == 2 { -gravity * next.masses[dof / 3] } else { 0.0 })
            .collect();
        next.equilibrate(&load).unwrap();
        let [u, _, w] = displacement(&mesh, &next, "x-max");
        values.push(relative(format!("H/L at Γ = {gamma}"), -w, drop));
        values.push(relative(format!("W/L at Γ = {gamma}"), 1.0 + u, reach));
        structure = Some(next);
    }
    Outcome { triangles: triangles(&mesh), values }
}

/// Lateral buckling of a narrow strip clamped on edge: critical tip load P L²/√(EI·GJ) with EI = E d t³/12 and GJ = G
/// d t³/3, by bisection on the number of negative eigenvalues.
pub(crate) fn lateral_buckling(cells: [u32; 2], pattern: SheetPattern) -> Outcome {
    // The beam theory of the reference holds for L ≫ d ≫ t.
    let (depth, thickness, young, poisson): (f64, f64, f64, f64) = (0.01, 2e-4, 1e9, 0.3);
    let mesh = mesh([1.0, depth], cells, pattern);
    let cube = depth * thickness.powi(3);
    let bending = young * cube / 12.0;
    let torsion = young / (2.0 * (1.0 + poisson)) * cube / 3.0;
    let unit = (bending * torsion).sqrt();
    let mut structure = cantilever(&mesh, &law(young, poisson, thickness, 1.0));
    let (mut stable, mut unstable) = (3.0, 5.5);
    while unstable - stable > 1e-5 {
        let factor = 0.5 * (stable + unstable);
        structure.x.copy_from_slice(mesh.points.as_flattened());
        let load = line_load(&mesh, "x-max", [0.0, -factor * unit / depth, 0.0]);
        structure.straight(&load);
        if structure.instabilities() == 0 { stable = factor } else { unstable = factor }
    }
    Outcome { triangles: triangles(&mesh), values: vec![relative("P L²/√(EI·GJ)", stable, 4.01259934)] }
}

/// Square Kirchhoff plates: ω a² √(ρh/D) for named supports, ν = 0.3.
pub(crate) fn plate(supports: &str, cells: u32, pattern: SheetPattern) -> Outcome {
    let mesh = mesh([1.0, 1.0], [cells; 2], pattern);
    let all = ["x-min", "x-max", "y-min", "y-max"];
    let square = PI * PI;
    let (held, clamped, rigid, reference): (&[&str], &[&str], usize, Vec<f64>) = match supports {
        "free" => (&[], &[], 3, vec![13.4682, 19.5961, 24.2702, 34.8009]),
        "CFFF" => (&all[..1], &all[..1], 0, vec![3.471, 8.5066, 21.285, 27.199, 30.956]),
        "clamped" => (&all, &all, 0, vec![35.985, 73.394, 73.394, 108.22]),
        _ => (&all, &[], 0, vec![2.0 * square, 5.0 * square, 5.0 * square, 8.0 * square]),
    };
    let (young, poisson, thickness, area_density) = (1e9, 0.3, 1e-3, 1.0);
    let law = law(young, poisson, thickness, area_density);
    let stiffness = young * f64::powi(thickness, 3) / (12.0 * (1.0 - poisson * poisson));
    let held = held_nodes(&mesh, held);
    let clamped: Vec<[u32; 2]> = clamped.iter().flat_map(|name| curve(&mesh, name)).collect();
    let is_held = |node: usize, axis: usize| axis < 2 || held[node];
    let mut structure = Structure::new(&mesh, &law, &clamped, is_held, |node| mesh.points[node][0]);
    let unit = stiffness / area_density;
    let squares = structure.squared_frequencies(rigid + reference.len(), 10.0 * unit);
    let values = squares[rigid..].iter().zip(reference).enumerate();
    let values = values
        .map(|(mode, (square, reference))| {
            relative(format!("{supports}, mode {}", mode + 1), (square / unit).sqrt(), reference)
        })
        .collect();
    Outcome { triangles: triangles(&mesh), values }
}
