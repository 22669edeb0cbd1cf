//! Facets of a surface: shape functions, quadrature and orientation of triangles and quadrilaterals.

use crate::cell::CellKind;
use crate::error::MeshError;
use crate::mesh::Mesh;
use crate::vector::cross;

/// A quadrature point of a reference facet.
#[derive(Debug, Clone)]
pub struct FacetPoint {
    /// The weight; the sum over a rule is the area of the reference facet.
    pub weight: f64,
    /// N_a(ξ, η).
    pub values: Vec<f64>,
    /// ∂N_a/∂(ξ, η).
    pub gradients: Vec<[f64; 2]>,
}

impl FacetPoint {
    /// Returns position and tangents x, x,ξ, x,η at the point, for a facet whose nodes are at `nodes`.
    pub fn frame(&self, nodes: impl Iterator<Item = [f64; 3]>) -> [[f64; 3]; 3] {
        let mut out = [[0.0; 3]; 3];
        for ((x, value), gradient) in nodes.zip(&self.values).zip(&self.gradients) {
            for i in 0..3 {
                out[0][i] += value * x[i];
                out[1][i] += gradient[0] * x[i];
                out[2][i] += gradient[1] * x[i];
            }
        }
        out
    }
}

/// Returns the rule of a kind, which is exact for ∫ N_a (x,ξ × x,η) dξdη, the force of a pressure.
pub(crate) fn rule(kind: CellKind) -> Option<Vec<FacetPoint>> {
    let points: Vec<([f64; 2], f64)> = match kind {
        CellKind::Tri3 => triangle_degree_2(),
        CellKind::Tri6 => triangle_degree_4(),
        CellKind::Quad4 => square(&gauss_2()),
        CellKind::Quad8 | CellKind::Quad9 => square(&gauss_3()),
        _ => return None,
    };
    let point = |(xi, weight)| {
        let (values, gradients) = shapes(kind, xi).into_iter().unzip();
        FacetPoint { weight, values, gradients }
    };
    Some(points.into_iter().map(point).collect())
}

fn triangle_degree_2() -> Vec<([f64; 2], f64)> {
    let [a, b] = [1.0 / 6.0, 2.0 / 3.0];
    [[a, a], [b, a], [a, b]].map(|xi| (xi, 1.0 / 6.0)).to_vec()
}

/// Returns six points (Dunavant 1985, table II).
fn triangle_degree_4() -> Vec<([f64; 2], f64)> {
    let mut points = Vec::new();
    for (a, weight) in
        [(0.445_948_490_915_965, 0.223_381_589_678_011), (0.091_576_213_509_771, 0.109_951_743_655_322)]
    {
        let b = 1.0 - 2.0 * a;
        points.extend([[a, a], [b, a], [a, b]].map(|xi| (xi, 0.5 * weight)));
    }
    points
}

fn gauss_2() -> Vec<(f64, f64)> {
    let a = (1.0_f64 / 3.0).sqrt();
    vec![(-a, 1.0), (a, 1.0)]
}

fn gauss_3() -> Vec<(f64, f64)> {
    let a = 0.6_f64.sqrt();
    vec![(-a, 5.0 / 9.0), (0.0, 8.0 / 9.0), (a, 5.0 / 9.0)]
}

fn square(line: &[(f64, f64)]) -> Vec<([f64; 2], f64)> {
    line.iter().flat_map(|&(y, wy)| line.iter().map(move |&(x, wx)| ([x, y], wx * wy))).collect()
}

/// Returns (N_a, ∂N_a/∂(ξ, η)) in VTK's order. Triangles are on ξ, η ≥ 0, ξ + η ≤ 1, squares on [−1, 1]².
pub(crate) fn shapes(kind: CellKind, [x, y]: [f64; 2]) -> Vec<(f64, [f64; 2])> {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    match kind {
        CellKind::Tri3 => vec![(1.0 - x - y, [-1.0, -1.0]), (x, [1.0, 0.0]), (y, [0.0, 1.0])],
        CellKind::Tri6 => {
            let l = [1.0 - x - y, x, y];
            let d = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
            let mut out: Vec<_> =
                (0..3).map(|i| (l[i] * (2.0 * l[i] - 1.0), d[i].map(|d| (4.0 * l[i] - 1.0) * d))).collect();
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let gradient = [0, 1].map(|k| 4.0 * (d[i][k] * l[j] + l[i] * d[j][k]));
                out.push((4.0 * l[i] * l[j], gradient));
            }
            out
        }
        CellKind::Quad4 => corners
            .map(|[a, b]| {
                let (p, q) = (1.0 + a * x, 1.0 + b * y);
                (0.25 * p * q, [0.25 * a * q, 0.25 * b * p])
            })
            .to_vec(),
        CellKind::Quad8 => {
            let mut out: Vec<_> = corners
                .iter()
                .map(|&[a, b]| {
                    let (p, q, r) = (1.0 + a * x, 1.0 + b * y, a * x + b * y - 1.0);
                    (0.25 * p * q * r, [0.25 * a * q * (r + p), 0.25 * b * p * (r + q)])
                })
                .collect();
            for [a, b] in [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]] {
                out.push(if a == 0.0 {
                    let q = 1.0 + b * y;
                    (0.5 * (1.0 - x * x) * q, [-x * q, 0.5 * b * (1.0 - x * x)])
                } else {
                    let p = 1.0 + a * x;
                    (0.5 * (1.0 - y * y) * p, [0.5 * a * (1.0 - y * y), -y * p])
                });
            }
            out
        }
        _ => {
            // Products of Lagrange polynomials through −1, 0, 1, selected by the coordinates of the nodes.
            let line = |node: f64, x: f64| match node {
                -1.0 => (0.5 * x * (x - 1.0), x - 0.5),
                0.0 => (1.0 - x * x, -2.0 * x),
                _ => (0.5 * x * (x + 1.0), x + 0.5),
            };
            let middles = [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]];
            let nodes = corners.into_iter().chain(middles);
            nodes
                .map(|[a, b]| {
                    let ((p, dp), (q, dq)) = (line(a, x), line(b, y));
                    (p * q, [dp * q, p * dq])
                })
                .collect()
        }
    }
}

/// Facets of one kind with their quadrature rule, which is exact for ∫ N_a (x,ξ × x,η) dξdη, the force of a pressure.
#[derive(Debug, Clone)]
pub struct FacetBlock {
    /// The kind of the facets.
    pub kind: CellKind,
    /// `kind.node_count()` node numbers per facet.
    pub nodes: Vec<u32>,
    /// Quadrature points of the reference facet.
    pub rule: Vec<FacetPoint>,
}

impl FacetBlock {
    /// Returns the number of nodes per facet.
    pub fn arity(&self) -> usize {
        self.kind.node_count()
    }

    /// Returns the nodes of each facet.
    pub fn facets(&self) -> impl Iterator<Item = &[u32]> {
        self.nodes.chunks_exact(self.arity())
    }
}

/// A part of the boundary of a body: the facets of a named region.
#[derive(Debug, Clone)]
pub struct Surface {
    pub(crate) name: String,
    pub(crate) blocks: Vec<FacetBlock>,
}

impl Surface {
    /// Returns the facets of the surface region `name`. Facets that bound a solid element face away from it, whatever
    /// the order of their nodes in the mesh.
    ///
    /// # Errors
    /// Returns [`MeshError::UnknownRegion`] with the names that exist; [`MeshError::Invalid`] if the region has no
    /// facets.
    pub fn of_region(mesh: &Mesh, name: &str) -> Result<Self, MeshError> {
        mesh.region(name)?;
        let regions = mesh.regions.iter().filter(|region| region.name == name && region.dimension == 2);
        let mut cells: Vec<u32> = regions.flat_map(|region| region.cells.iter().copied()).collect();
        cells.sort_unstable();
        cells.dedup();
        if cells.is_empty() {
            let dimension = mesh.region(name)?.dimension;
            let problem =
                format!("region '{name}' has dimension {dimension} and no facets: name a surface region");
            return Err(MeshError::Invalid { what: "surface", problem });
        }
        let mut blocks: Vec<(CellKind, Vec<u32>)> = Vec::new();
        for cell in cells {
            let Some((kind, nodes)) = mesh.cell(cell as usize) else { continue };
            let index = blocks.iter().position(|block| block.0 == kind).unwrap_or_else(|| {
                blocks.push((kind, Vec::new()));
                blocks.len() - 1
            });
            blocks[index].1.extend(nodes);
        }
        let mut surface = Self::from_blocks(name, blocks)?;
        surface.look_outwards(mesh);
        Ok(surface)
    }

    /// Builds a surface from facets by kind, with their nodes.
    pub(crate) fn from_blocks(name: &str, blocks: Vec<(CellKind, Vec<u32>)>) -> Result<Self, MeshError> {
        let with_rule = |(kind, nodes)| {
            let rule = rule(kind).ok_or(MeshError::Unsupported { kind, used: "facets of a surface" })?;
            Ok(FacetBlock { kind, nodes, rule })
        };
        let blocks = blocks.into_iter().map(with_rule).collect::<Result<_, _>>()?;
        Ok(Self { name: name.into(), blocks })
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the facets by kind.
    pub fn blocks(&self) -> &[FacetBlock] {
        &self.blocks
    }

    /// Returns the facets all of whose nodes are in `nodes`.
    #[must_use]
    pub fn within(&self, nodes: &[u32]) -> Self {
        let nodes: std::collections::HashSet<u32> = nodes.iter().copied().collect();
        let part = |block: &FacetBlock| {
            let inside = block.facets().filter(|facet| facet.iter().all(|node| nodes.contains(node)));
            FacetBlock {
                kind: block.kind,
                nodes: inside.flatten().copied().collect(),
                rule: block.rule.clone(),
            }
        };
        Self { name: self.name.clone(), blocks: self.blocks.iter().map(part).collect() }
    }

    /// Returns the same facets with the node numbers of another mesh: node a becomes `number(a)`.
    #[must_use]
    pub fn renumbered(mut self, number: impl Fn(u32) -> u32) -> Self {
        self.blocks.iter_mut().flat_map(|block| &mut block.nodes).for_each(|node| *node = number(*node));
        self
    }

    /// Returns the normal at each node of the surface, in ascending order of nodes: the sum over its facets of the
    /// unit normal at the node times the area of the facet (m²).
    pub fn normals(&self, mesh: &Mesh) -> Vec<(u32, [f64; 3])> {
        let mut sums: std::collections::BTreeMap<u32, [f64; 3]> = Default::default();
        for block in &self.blocks {
            let places = block.kind.reference_nodes();
            let at_nodes: Vec<FacetPoint> = places
                .iter()
                .map(|xi| {
                    let (values, gradients) = shapes(block.kind, [xi[0], xi[1]]).into_iter().unzip();
                    FacetPoint { weight: 1.0, values, gradients }
                })
                .collect();
            for nodes in block.facets() {
                let at = || nodes.iter().map(|&node| mesh.points[node as usize]);
                let normal = |point: &FacetPoint| {
                    let [_, a, b] = point.frame(at());
                    let n = cross(a, b);
                    (n, (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt())
                };
                let area: f64 = block.rule.iter().map(|point| point.weight * normal(point).1).sum();
                for (&node, point) in nodes.iter().zip(&at_nodes) {
                    let (n, length) = normal(point);
                    let sum = sums.entry(node).or_default();
                    for i in 0..3 {
                        sum[i] += area * n[i] / length;
                    }
                }
            }
        }
        sums.into_iter().collect()
    }

    /// Returns the area at rest, m².
    pub fn area(&self, mesh: &Mesh) -> f64 {
        let mut area = 0.0;
        for block in &self.blocks {
            for nodes in block.facets() {
                for point in &block.rule {
                    let [_, a, b] = point.frame(nodes.iter().map(|&node| mesh.points[node as usize]));
                    let n = cross(a, b);
                    area += point.weight * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
                }
            }
        }
        area
    }

    /// Returns ⅓ ∫ x·n dA at rest, m³: the enclosed volume if the surface is closed.
    #[cfg(test)]
    pub(crate) fn enclosed_volume(&self, mesh: &Mesh) -> f64 {
        let mut volume = 0.0;
        for block in &self.blocks {
            for nodes in block.facets() {
                for point in &block.rule {
                    let [x, a, b] = point.frame(nodes.iter().map(|&node| mesh.points[node as usize]));
                    volume += point.weight * crate::vector::dot(x, cross(a, b)) / 3.0;
                }
            }
        }
        volume
    }
}

/// Reverses the orientation of a facet's nodes.
pub(crate) fn turn_over(kind: CellKind, nodes: &mut [u32]) {
    match kind {
        CellKind::Tri3 => nodes.swap(1, 2),
        CellKind::Tri6 => {
            nodes.swap(1, 2);
            nodes.swap(3, 5);
        }
        CellKind::Quad4 => nodes.swap(1, 3),
        _ => {
            nodes.swap(1, 3);
            nodes.swap(4, 7);
            nodes.swap(5, 6);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [CellKind; 5] =
        [CellKind::Tri3, CellKind::Tri6, CellKind::Quad4, CellKind::Quad8, CellKind::Quad9];

    fn reference_nodes(kind: CellKind) -> Vec<[f64; 2]> {
        kind.reference_nodes().iter().map(|&[x, y, _]| [x, y]).collect()
    }

    #[test]
    fn shapes_interpolate_and_gradients_are_theirs() {
        for kind in KINDS {
            for (a, xi) in reference_nodes(kind).into_iter().enumerate() {
                for (b, (value, gradient)) in shapes(kind, xi).into_iter().enumerate() {
                    assert!((value - if a == b { 1.0 } else { 0.0 }).abs() < 1e-14, "{kind} N_{b} at {a}");
                    for k in 0..2 {
                        let e = 1e-5;
                        let shifted = |by: f64| {
                            let mut xi = xi;
                            xi[k] += by;
                            shapes(kind, xi)[b].0
                        };
                        let slope = (shifted(e) - shifted(-e)) / (2.0 * e);
                        assert!((slope - gradient[k]).abs() < 1e-9, "{kind}");
                    }
                }
            }
        }
    }

    #[test]
    fn rules_integrate_what_they_promise() {
        // ∫ x^p y^q over the triangle is p! q!/(p + q + 2)!; over the square it is a product.
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        for (kind, degree) in [(CellKind::Tri3, 2), (CellKind::Tri6, 4)] {
            for p in 0..=degree {
                for q in 0..=degree - p {
                    let points = if degree == 2 { triangle_degree_2() } else { triangle_degree_4() };
                    let sum: f64 =
                        points.iter().map(|(xi, w)| w * xi[0].powi(p as i32) * xi[1].powi(q as i32)).sum();
                    let exact = factorial(p) * factorial(q) / factorial(p + q + 2);
                    assert!((sum - exact).abs() < 1e-14, "{kind} x^{p} y^{q}");
                }
            }
        }
        for (line, degree) in [(gauss_2(), 3), (gauss_3(), 5)] {
            for p in 0..=degree {
                let sum: f64 = line.iter().map(|(x, w)| w * x.powi(p)).sum();
                let exact = if p % 2 == 0 { 2.0 / f64::from(p + 1) } else { 0.0 };
                assert!((sum - exact).abs() < 1e-14);
            }
        }
    }
}
