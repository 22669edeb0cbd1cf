//! The finite element body is an instance of the theory: a bar of tetrahedra whose cross sections are kept plane by
//! generalised coordinates equals the bar written by hand.

use nalgebra::{DMatrix, DVector};
use vi_core::discrete::DiscreteLagrangian;
use vi_core::lagrange::{Expand, Expansion};
use vi_core::problems::Bar;
use vi_core::{Coordinates, Scheme, State, System};
use vi_fem::{Isotropic, Law, add_lumped_mass, elastic};
use vi_mesh::{BoxMesh, CellKind};

const BAR: Bar = Bar { element_count: 6, length: 1.5, area: 0.04, young: 1e6, density: 1000.0 };

/// The body of tetrahedra with x = X + S q, where q is the axial displacement of each section but the first.
struct PlaneSections {
    system: System,
    rest: Vec<f64>,
    s: DMatrix<f64>,
}

impl PlaneSections {
    fn new() -> Self {
        let n = BAR.element_count;
        let mesh = BoxMesh {
            size: [BAR.length, BAR.area.sqrt(), BAR.area.sqrt()],
            cells: [n as u32, 1, 1],
            element: CellKind::Tet4,
            origin: [0.0; 3],
        }
        .build()
        .unwrap();
        let law = Law::Linear(Isotropic { young: BAR.young, poisson: 0.0, density: BAR.density });
        let solids = mesh.cells_of_dimension(3);
        let mut node_mass = vec![0.0; mesh.points.len()];
        add_lumped_mass(&mesh, &solids, BAR.density, &mut node_mass).unwrap();
        let potentials = elastic(&mesh, &solids, &law, 0, "bar").unwrap();
        let mass: Vec<f64> = node_mass.iter().flat_map(|&m| [m; 3]).collect();
        let rest: Vec<f64> = mesh.points.iter().flatten().copied().collect();
        let mut s = DMatrix::zeros(rest.len(), n);
        for (node, point) in mesh.points.iter().enumerate() {
            let section = (point[0] / BAR.length * n as f64).round() as usize;
            if section > 0 {
                s[(3 * node, section - 1)] = 1.0;
            }
        }
        let coordinates = Coordinates::all_free(rest.len());
        Self { system: System::new(mass, potentials, coordinates).unwrap(), rest, s }
    }

    fn lift(&self, q: &[f64], v: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let x = DVector::from_column_slice(&self.rest) + &self.s * DVector::from_column_slice(q);
        let x_dot = &self.s * DVector::from_column_slice(v);
        (x.as_slice().to_vec(), x_dot.as_slice().to_vec())
    }
}

/// Pulls back along S: gradients by Sᵀ, second derivatives by Sᵀ · S.
impl Expand for PlaneSections {
    fn coordinate_count(&self) -> usize {
        self.s.ncols()
    }
    fn lagrangian(&self, t: f64, q: &[f64], v: &[f64]) -> f64 {
        let (x, x_dot) = self.lift(q, v);
        self.system.lagrangian(t, &x, &x_dot)
    }
    fn gradient(&self, t: f64, q: &[f64], v: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let (x, x_dot) = self.lift(q, v);
        let (d_q, d_v) = self.system.gradient(t, &x, &x_dot);
        (self.s.transpose() * d_q, self.s.transpose() * d_v)
    }
    fn expansion(&self, t: f64, q: &[f64], v: &[f64]) -> Expansion {
        let (x, x_dot) = self.lift(q, v);
        let full = self.system.expansion(t, &x, &x_dot);
        let pull = |m: &DMatrix<f64>| self.s.transpose() * m * &self.s;
        Expansion {
            d_q: self.s.transpose() * full.d_q,
            d_v: self.s.transpose() * full.d_v,
            qq: pull(&full.qq),
            vq: pull(&full.vq),
            vv: pull(&full.vv),
        }
    }
}

#[test]
fn a_bar_by_hand_is_the_bar_of_finite_elements() {
    let body = PlaneSections::new();
    let n = BAR.element_count;
    let q: Vec<f64> = (0..n).map(|k| 0.01 * (1.3 * k as f64 + 0.4).sin()).collect();
    let v: Vec<f64> = (0..n).map(|k| 0.3 * (0.7 * k as f64).cos()).collect();
    let (by_hand, by_elements) = (BAR.expansion(0.0, &q, &v), body.expansion(0.0, &q, &v));
    let scale = by_hand.qq.amax();
    assert!((&by_hand.vv - by_elements.vv).amax() < 1e-14 * by_hand.vv.amax());
    assert!((&by_hand.qq - by_elements.qq).amax() < 1e-13 * scale);
    assert!((by_hand.d_q - by_elements.d_q).amax() < 1e-12 * scale * 0.01);
    let energy = (BAR.lagrangian(0.0, &q, &v), body.lagrangian(0.0, &q, &v));
    assert!((energy.0 - energy.1).abs() < 1e-12 * energy.0.abs());
}

#[test]
fn and_so_is_every_step() {
    let body = PlaneSections::new();
    let n = BAR.element_count;
    for scheme in [Scheme::stormer_verlet(), Scheme::implicit_midpoint(), Scheme::gauss(2).unwrap()] {
        let by_hand = DiscreteLagrangian::new(&BAR, &scheme, 2e-3).unwrap();
        let by_elements = DiscreteLagrangian::new(&body, &scheme, 2e-3).unwrap();
        let start = State { t: 0.0, q: vec![0.0; n], p: (1..=n).map(|k| 0.1 * k as f64).collect() };
        let (mut a, mut b) = (start.clone(), start);
        for _ in 0..100 {
            a = by_hand.step(&a).unwrap();
            b = by_elements.step(&b).unwrap();
        }
        for k in 0..n {
            assert!((a.q[k] - b.q[k]).abs() < 1e-12 && (a.p[k] - b.p[k]).abs() < 1e-10, "{scheme:?}");
        }
    }
}
