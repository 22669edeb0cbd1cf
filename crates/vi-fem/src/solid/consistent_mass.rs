//! The consistent mass M_ab = ρ ∫ N_a N_b dV of solid elements and of linear triangles. It enters as the kinetic
//! energy ½ v·M v, a sum of quadratic local terms of the velocities.

use std::ops::Range;

use vi_core::{Account, HessianKind, Potential, Quadrature, Stencils, Traits, packed_len};

use crate::error::FemError;
use crate::small::tensor::determinant;
use crate::solid::element::contract::{Element, SolidVisitor};
use crate::solid::element::visit_solid;
use vi_mesh::{Bounds, CellKind, Mesh};

/// Number of Gauss points along each direction of the reference cell: more than any N_a N_b det J needs.
const POINTS: usize = 5;

/// Returns the kinetic energy of elements (numbers of solid cells) at a density (kg/m³), one term per element kind.
/// Node a of the mesh is node a + `node_offset` of the system.
///
/// A term is a potential of the velocities: its Hessians are the blocks of M.
///
/// # Errors
/// Returns [`FemError::Mesh`] and [`FemError::Unsupported`] for cells that are not solid elements.
pub fn consistent_mass(
    mesh: &Mesh,
    elements: &[u32],
    density: f64,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let mut terms: Vec<(CellKind, MassTerm)> = Vec::new();
    for &element in elements {
        let (kind, nodes) = mesh.element(element, "mass, element")?;
        let term = match terms.iter().position(|(other, _)| *other == kind) {
            Some(term) => term,
            None => {
                let name = name.to_owned();
                terms.push((
                    kind,
                    MassTerm { name, arity: nodes.len(), nodes: Vec::new(), blocks: Vec::new() },
                ));
                terms.len() - 1
            }
        };
        let term = &mut terms[term].1;
        term.nodes.extend(nodes.iter().map(|node| node + node_offset as u32));
        visit_solid(kind, AddBlock { kind, mesh, nodes, density, blocks: &mut term.blocks })
            .ok_or(FemError::Unsupported { kind, used: "solid elements" })?;
    }
    Ok(terms.into_iter().map(|(_, term)| Box::new(term) as Box<dyn Potential>).collect())
}

/// Returns the kinetic energy of linear triangles with these masses (kg): M_ab = m/12 (1 + δ_ab).
pub(crate) fn triangle_mass(
    triangles: impl Iterator<Item = ([u32; 3], f64)>,
    name: &str,
) -> Box<dyn Potential> {
    let mut term = MassTerm { name: name.to_owned(), arity: 3, nodes: Vec::new(), blocks: Vec::new() };
    for (nodes, mass) in triangles {
        let (same, other) = (mass / 6.0, mass / 12.0);
        term.nodes.extend(nodes);
        term.blocks.extend([same, other, same, other, other, same]);
    }
    Box::new(term)
}

/// Returns a quadrature rule with many points on the reference cell of a kind: a box, a prism over the triangle ξ + η
/// ≤ 1, a pyramid, or the simplex ξ + η + ζ ≤ 1 (collapsed coordinates).
pub(crate) fn high_order_rule<E: Element<N, Q>, const N: usize, const Q: usize>(
    kind: CellKind,
) -> Vec<([f64; 3], f64)> {
    let Bounds { low, high } = Bounds::of(E::nodes());
    // The rule with five points always exists.
    let Ok(line) = Quadrature::gauss_legendre(POINTS) else { return Vec::new() };
    let line: Vec<(f64, f64)> = line.nodes().iter().copied().zip(line.weights().iter().copied()).collect();
    let mut rule = Vec::with_capacity(POINTS * POINTS * POINTS);
    for &(u, a) in &line {
        for &(v, b) in &line {
            for &(w, c) in &line {
                let (unit, weight) = match kind.linear() {
                    CellKind::Tet4 => {
                        ([u, v * (1.0 - u), w * (1.0 - u) * (1.0 - v)], (1.0 - u) * (1.0 - u) * (1.0 - v))
                    }
                    CellKind::Wedge6 => ([u, v * (1.0 - u), w], 1.0 - u),
                    CellKind::Pyramid5 => {
                        let at = |u: f64| 0.5 + (u - 0.5) * (1.0 - w);
                        ([at(u), at(v), w], (1.0 - w) * (1.0 - w))
                    }
                    _ => ([u, v, w], 1.0),
                };
                let size = [0, 1, 2].map(|k| high[k] - low[k]);
                let point = [0, 1, 2].map(|k| low[k] + size[k] * unit[k]);
                rule.push((point, a * b * c * weight * size[0] * size[1] * size[2]));
            }
        }
    }
    rule
}

struct AddBlock<'a> {
    kind: CellKind,
    mesh: &'a Mesh,
    nodes: &'a [u32],
    density: f64,
    blocks: &'a mut Vec<f64>,
}

impl SolidVisitor for AddBlock<'_> {
    type Output = ();
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) {
        let x: [[f64; 3]; N] = std::array::from_fn(|a| self.mesh.points[self.nodes[a] as usize]);
        let first = self.blocks.len();
        self.blocks.resize(first + packed_len(N), 0.0);
        for (xi, weight) in high_order_rule::<E, N, Q>(self.kind) {
            let values = E::values(xi);
            let mass = self.density * weight * determinant(&E::reference_gradient(&x, &E::gradients(xi)));
            let mut k = first;
            for a in 0..N {
                for b in 0..=a {
                    self.blocks[k] += mass * values[a] * values[b];
                    k += 1;
                }
            }
        }
    }
}

/// The kinetic energy ½ Σ_ab M_ab v_a·v_b, one stencil per element.
struct MassTerm {
    name: String,
    arity: usize,
    nodes: Vec<u32>,
    /// Packed lower triangles of M_ab, kg, element by element.
    blocks: Vec<f64>,
}

impl MassTerm {
    fn block(&self, stencil: usize) -> &[f64] {
        &self.blocks[stencil * packed_len(self.arity)..][..packed_len(self.arity)]
    }

    /// Writes Σ_b M_ab v_b for every local node a, three numbers each.
    fn momenta(&self, stencil: usize, v: &[f64], out: &mut [f64]) {
        let block = self.block(stencil);
        let nodes = &self.nodes[stencil * self.arity..][..self.arity];
        let velocity = |a: usize| -> [f64; 3] {
            let first = 3 * nodes[a] as usize;
            [v[first], v[first + 1], v[first + 2]]
        };
        let (out, _) = out.as_chunks_mut::<3>();
        out.fill([0.0; 3]);
        for a in 0..self.arity {
            let (row, v_a) = (&block[packed_len(a)..], velocity(a));
            for b in 0..a {
                let v_b = velocity(b);
                for i in 0..3 {
                    out[a][i] += row[b] * v_b[i];
                    out[b][i] += row[b] * v_a[i];
                }
            }
            for i in 0..3 {
                out[a][i] += row[a] * v_a[i];
            }
        }
    }
}

impl Potential for MassTerm {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Constant, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, v: &[f64], _t: f64, out: &mut [f64]) {
        let mut momenta = vec![0.0; 3 * self.arity];
        for (stencil, out) in range.zip(out) {
            let nodes = &self.nodes[stencil * self.arity..][..self.arity];
            self.momenta(stencil, v, &mut momenta);
            let product =
                |(p, &node): (&[f64], &u32)| -> f64 { (0..3).map(|i| p[i] * v[3 * node as usize + i]).sum() };
            *out = 0.5 * momenta.chunks_exact(3).zip(nodes).map(product).sum::<f64>();
        }
    }

    fn gradients(&self, range: Range<usize>, v: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            self.momenta(stencil, v, out);
        }
    }

    fn hessians(&self, range: Range<usize>, _v: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(packed_len(3 * self.arity))) {
            out.fill(0.0);
            let block = self.block(stencil);
            for a in 0..self.arity {
                for b in 0..=a {
                    for i in 0..3 {
                        out[packed_len(3 * a + i) + 3 * b + i] = block[packed_len(a) + b];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::element::SOLIDS;
    use vi_mesh::BoxMesh;

    #[test]
    fn every_kind_of_solid_has_the_mass_of_its_volume() {
        for &kind in SOLIDS {
            let shape = BoxMesh { size: [1.0, 2.0, 0.5], cells: [2, 1, 1], element: kind, origin: [0.0; 3] };
            let Ok(mesh) = shape.build() else { continue };
            let all = mesh.cells_of_dimension(3);
            let terms = consistent_mass(&mesh, &all, 3.0, 0, "mass").unwrap();
            // For v = (1, y, 0) the kinetic energy is ½ ρ ∫ (1 + y²) dV = ½ · 3 · (1 + 8/6).
            let v: Vec<f64> = mesh.points.iter().flat_map(|x| [1.0, x[1], 0.0]).collect();
            let mut energy = 0.0;
            for term in &terms {
                let mut out = vec![0.0; term.stencils().count()];
                term.energies(0..out.len(), &v, 0.0, &mut out);
                energy += out.iter().sum::<f64>();
            }
            let exact = 1.5 * (1.0 + 4.0 / 3.0);
            assert!((energy - exact).abs() < 1e-13 * exact, "{kind}: {energy} {exact}");
        }
    }
}
