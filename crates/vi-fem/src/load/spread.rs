//! Spreads a total force and moment over a part of a body at rest.

use nalgebra::{Matrix3, Vector3};

use crate::error::FemError;
use crate::small::tensor::{cross, dot};
use vi_mesh::Surface;
use vi_mesh::{CellKind, Mesh};

/// Principal moments of area below this fraction of the largest count as zero.
const NO_ARM: f64 = 1e-12;

/// A force and a moment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resultant {
    /// Total force, N.
    pub force: [f64; 3],
    /// Moment about the point `about`, N m.
    pub moment: [f64; 3],
    /// The point through which the force acts, m; by default the centroid of the part.
    pub about: Option<[f64; 3]>,
}

/// The quadrature points of a surface or of a curve.
#[derive(Debug, Clone)]
pub struct Spread {
    pub(crate) points: Vec<SpreadPoint>,
    /// Area, m², or length, m.
    measure: f64,
    centroid: [f64; 3],
}

/// A quadrature point.
#[derive(Debug, Clone)]
pub(crate) struct SpreadPoint {
    /// Area (m²) or length (m) that the point represents.
    pub(crate) measure: f64,
    pub(crate) position: [f64; 3],
    /// Nodes, and the values N_a at the point.
    pub(crate) nodes: Vec<(u32, f64)>,
}

impl Spread {
    /// Returns the quadrature points of a surface, weighted by area.
    pub fn of_surface(mesh: &Mesh, surface: &Surface) -> Self {
        let mut points = Vec::new();
        for block in surface.blocks() {
            for nodes in block.facets() {
                for point in &block.rule {
                    let at = nodes.iter().map(|&node| mesh.points[node as usize]);
                    let [position, a, b] = point.frame(at);
                    let n = cross(a, b);
                    let nodes = nodes.iter().copied().zip(point.values.iter().copied()).collect();
                    points.push(SpreadPoint { measure: point.weight * dot(n, n).sqrt(), position, nodes });
                }
            }
        }
        Self::new(points)
    }

    /// Returns the quadrature points of lines (cells of the mesh), weighted by length; other cells are ignored.
    pub fn of_lines(mesh: &Mesh, cells: &[u32]) -> Self {
        let gauss = (1.0_f64 / 3.0).sqrt();
        let mut points = Vec::new();
        for &cell in cells {
            let Some((kind, nodes)) = mesh.cell(cell as usize) else { continue };
            for s in [0.5 - 0.5 * gauss, 0.5 + 0.5 * gauss] {
                let (values, slopes) = match kind {
                    CellKind::Line2 => (vec![1.0 - s, s], vec![-1.0, 1.0]),
                    CellKind::Line3 => (
                        vec![(1.0 - s) * (1.0 - 2.0 * s), s * (2.0 * s - 1.0), 4.0 * s * (1.0 - s)],
                        vec![4.0 * s - 3.0, 4.0 * s - 1.0, 4.0 - 8.0 * s],
                    ),
                    _ => continue,
                };
                let sum = |weights: &[f64], i: usize| -> f64 {
                    nodes.iter().zip(weights).map(|(&node, w)| w * mesh.points[node as usize][i]).sum()
                };
                let tangent = [0, 1, 2].map(|i| sum(&slopes, i));
                let position = [0, 1, 2].map(|i| sum(&values, i));
                let measure = 0.5 * dot(tangent, tangent).sqrt();
                points.push(SpreadPoint {
                    measure,
                    position,
                    nodes: nodes.iter().copied().zip(values).collect(),
                });
            }
        }
        Self::new(points)
    }

    /// Returns the same points with the node numbers of another mesh: node a becomes `number(a)`.
    #[must_use]
    pub fn renumbered(mut self, number: impl Fn(u32) -> u32) -> Self {
        let nodes = self.points.iter_mut().flat_map(|point| &mut point.nodes);
        nodes.for_each(|(node, _)| *node = number(*node));
        self
    }

    fn new(points: Vec<SpreadPoint>) -> Self {
        let measure: f64 = points.iter().map(|point| point.measure).sum();
        let along = |i: usize| points.iter().map(|point| point.measure * point.position[i]).sum::<f64>();
        let centroid = [0, 1, 2].map(|i| along(i) / measure);
        Self { points, measure, centroid }
    }

    /// Returns the area (m²) or the length (m); zero if there are no points.
    pub fn measure(&self) -> f64 {
        self.measure
    }

    /// Returns the centroid, m.
    pub fn centroid(&self) -> [f64; 3] {
        self.centroid
    }

    /// Returns the traction F/A + θ × (X − c) as a function of the position X, per area (Pa) or per length (N/m).
    pub(crate) fn traction(
        &self,
        resultant: &Resultant,
    ) -> Result<impl Fn([f64; 3]) -> [f64; 3] + use<>, FemError> {
        let Resultant { force, moment, about } = *resultant;
        let arm = about.map_or([0.0; 3], |about| [0, 1, 2].map(|i| about[i] - self.centroid[i]));
        let carried = cross(arm, force);
        let moment = Vector3::from_fn(|i, _| moment[i] + carried[i]);
        let mut area = Matrix3::zeros();
        for point in &self.points {
            let r = Vector3::from_fn(|i, _| point.position[i] - self.centroid[i]);
            area += (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * point.measure;
        }
        let eigen = area.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let mut turn = Vector3::zeros();
        for (value, axis) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let along = axis.dot(&moment);
            if *value > NO_ARM * largest {
                turn += axis * (along / value);
            } else if along.abs() > 1e-9 * moment.norm() {
                let problem = "the region is a straight line or a point, and forces on it have no moment along it; choose a region \
                               with an area, or a moment normal to the line";
                return Err(FemError::Invalid { what: "load", problem: problem.to_owned() });
            }
        }
        let (mean, centroid) = (force.map(|f| f / self.measure), self.centroid);
        let turn = [turn[0], turn[1], turn[2]];
        Ok(move |x: [f64; 3]| {
            let by_turn = cross(turn, [0, 1, 2].map(|i| x[i] - centroid[i]));
            [0, 1, 2].map(|i| mean[i] + by_turn[i])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::dead::DeadLoad;
    use crate::path::amplitude::Amplitude;
    use crate::solid::element::SOLIDS;
    use vi_mesh::{BoxMesh, SheetMesh, SheetPattern};

    /// Tests that Σ f_a = F and Σ (X_a − a) × f_a = M to round-off, on every kind of facet and on curves.
    #[test]
    fn nodal_forces_have_the_resultant() {
        let (force, moment, about) = ([3.0, -2.0, 1.0], [0.4, 0.5, -0.6], [7.0, 0.2, -0.3]);
        let mut parts: Vec<(Mesh, Spread)> = Vec::new();
        for &element in SOLIDS {
            let mut mesh = BoxMesh { size: [1.0, 2.0, 0.5], cells: [2, 2, 1], element, origin: [0.0; 3] }
                .build()
                .unwrap();
            // Curve the face.
            mesh.points.iter_mut().for_each(|x| x[0] += 0.3 * x[1] * x[1] + 0.2 * x[2]);
            let surface = Surface::of_region(&mesh, "x-max").unwrap();
            let spread = Spread::of_surface(&mesh, &surface);
            assert!((spread.measure() - surface.area(&mesh)).abs() < 1e-13);
            parts.push((mesh, spread));
        }
        let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let shape = SheetMesh {
            size: [1.0, 1.0],
            cells: [3, 3],
            pattern: SheetPattern::Diagonal,
            seed: 0,
            origin: [0.0; 3],
            directions,
        };
        let mut mesh = shape.build().unwrap();
        let edge = mesh.region("x-max").unwrap().cells.clone();
        let straight = Spread::of_lines(&mesh, &edge);
        assert!((straight.measure() - 1.0).abs() < 1e-15);
        let along = Resultant { force, moment: [0.0, 1.0, 0.0], about: None };
        assert!(straight.traction(&along).err().unwrap().to_string().contains("straight line"));
        mesh.points.iter_mut().for_each(|x| x[2] = 0.3 * x[1] * x[1]);
        parts.push((mesh.clone(), Spread::of_lines(&mesh, &edge)));
        for (mesh, spread) in parts {
            for about in [None, Some(about)] {
                let resultant = Resultant { force, moment, about };
                let load =
                    DeadLoad::resultant_on(&mesh, &spread, &resultant, Amplitude::default(), 0, "pull")
                        .unwrap();
                let x: Vec<f64> = mesh.points.as_flattened().to_vec();
                let stencils = vi_core::Potential::stencils(&load);
                let mut gradients = vec![0.0; 3 * stencils.count()];
                vi_core::Potential::gradients(&load, 0..stencils.count(), &x, 0.0, &mut gradients);
                let centre = about.unwrap_or(spread.centroid());
                let (mut sum, mut turn) = ([0.0; 3], [0.0; 3]);
                for (&node, g) in stencils.nodes.iter().zip(gradients.as_chunks::<3>().0) {
                    let f = g.map(|g| -g);
                    let m = cross([0, 1, 2].map(|i| mesh.points[node as usize][i] - centre[i]), f);
                    for i in 0..3 {
                        sum[i] += f[i];
                        turn[i] += m[i];
                    }
                }
                for i in 0..3 {
                    assert!((sum[i] - force[i]).abs() < 1e-12, "{sum:?}");
                    assert!((turn[i] - moment[i]).abs() < 1e-11, "{turn:?}");
                }
            }
        }
    }
}
