//! The membrane energy Σ_T A h W(E(F)) of a sheet of linear triangles; F = ∂x/∂X (3 × 2) is constant on each.

mod kernel;

use std::ops::Range;

use pulp::Arch;
use vi_core::{Account, Fault, HessianKind, Patch, Potential, Stencils, Traits, binary_exponent, run_length};

use crate::lanes::pack::{GROUP, interleave, whole_groups};
use crate::sheet::material::{SheetMaterial, SheetVisitor};
use crate::sheet::triangle::{barycentric_gradients, flatten, frame};
use crate::small::tensor::{cross, dot};
use kernel::{Deformed, Energies, Gradients, Membrane, PatchForces, RestPack};
use vi_mesh::Triangulation;

/// Builds the potential of a law.
pub(crate) struct BuildMembrane<'a> {
    pub(crate) surface: &'a Triangulation,
    pub(crate) thickness: f64,
    /// Plane-stress moduli at rest, Pa.
    pub(crate) moduli: [[f64; 3]; 3],
    /// The first axis of the law in each triangle, if the law has axes.
    pub(crate) directions: Option<&'a [[f64; 3]]>,
    pub(crate) tension_field: bool,
    pub(crate) node_offset: usize,
    pub(crate) name: String,
}

impl SheetVisitor for BuildMembrane<'_> {
    type Output = Box<dyn Potential>;

    fn visit<M: SheetMaterial>(self, material: M) -> Self::Output {
        let surface = self.surface;
        let count = surface.triangles.len();
        // Sum neighbours together, and put triangles that share nodes into different groups.
        let mut order: Vec<u32> = (0..count as u32).collect();
        interleave(run_length(count, 9), &mut order);
        let mut frames = Vec::with_capacity(count);
        let mut rest = vec![RestPack::default(); count.div_ceil(GROUP)];
        // Fill the last group with copies of the last triangle.
        for place in 0..rest.len() * GROUP {
            let triangle = order[place.min(count - 1)] as usize;
            let corners = surface.corners(triangle);
            let frame = frame(&corners, self.directions.map(|all| all[triangle]));
            let (gradients, area) = barycentric_gradients(&flatten(&corners, &frame));
            let (pack, lane) = (&mut rest[place / GROUP], place % GROUP);
            for a in 0..2 {
                for j in 0..2 {
                    pack.gradients[a][j].0[lane] = gradients[a + 1][j];
                }
            }
            pack.volume.0[lane] = area * self.thickness;
            if place < count {
                frames.push(frame);
            }
        }
        let padded = (0..rest.len() * GROUP).map(|place| order[place.min(count - 1)] as usize);
        let offset = self.node_offset as u32;
        let nodes =
            padded.flat_map(|triangle| surface.triangles[triangle]).map(|node| node + offset).collect();
        let moduli: f64 = (0..3).map(|k| self.moduli[k][k]).sum();
        let weight = 2.0_f64.powi(binary_exponent(moduli));
        let relaxed = self.tension_field;
        let cells = order.iter().map(|&triangle| surface.cells[triangle as usize]).collect();
        Box::new(Membrane {
            arch: Arch::new(),
            material,
            relaxed,
            rest,
            frames,
            nodes,
            cells,
            weight,
            name: self.name,
        })
    }
}

impl<M: SheetMaterial> Potential for Membrane<M> {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 3, block: 3, nodes: &self.nodes[..3 * self.cells.len()] }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.arch.dispatch(Energies { membrane: self, range, x, out });
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.arch.dispatch(Gradients { membrane: self, range, x, out });
    }

    fn adds_gradients(&self) -> bool {
        true
    }

    fn add_gradients(&self, range: Range<usize>, _t: f64, patch: Patch<'_>) {
        let Patch { places, x, sums } = patch;
        whole_groups(range, places, 3, |groups, places| {
            self.arch.dispatch(PatchForces { membrane: self, groups, places, x, sums });
        });
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.blocks(range, x, false, out);
    }

    fn projected_hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.blocks(range, x, true, out);
    }

    fn element(&self, stencil: usize) -> usize {
        self.cells[stencil] as usize
    }

    /// Writes F, completed by the unit normal.
    fn mean_deformations(&self, range: Range<usize>, x: &[f64], out: &mut [f64]) -> bool {
        for (triangle, out) in range.zip(out.chunks_exact_mut(9)) {
            let (Deformed { f, .. }, _) = self.scalar(triangle, x);
            let frame = &self.frames[triangle];
            let weight = self.weight * self.rest[triangle / GROUP].volume.0[triangle % GROUP];
            let normal = cross(f[0], f[1]);
            let length = dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
            for i in 0..3 {
                for j in 0..3 {
                    let value = f[0][i] * frame[0][j] + f[1][i] * frame[1][j];
                    out[3 * i + j] = weight * (value + normal[i] / length * frame[2][j]);
                }
            }
        }
        true
    }

    fn fault(&self, stencil: usize, x: &[f64], _t: f64) -> Option<Fault> {
        let (Deformed { f, .. }, response) = self.scalar(stencil, x);
        if response.energy.is_finite() && response.stress.iter().all(|s| s.is_finite()) {
            return None;
        }
        let element = self.cells[stencil] as usize;
        let fault =
            |quantity, value, domain| Some(Fault { element, quantity, value, domain, at_any_state: false });
        // Report the first quantity between F and the stress that is outside its domain.
        let normal = cross(f[0], f[1]);
        let area = dot(normal, normal).sqrt();
        let determinant = dot(f[0], f[0]) * dot(f[1], f[1]) - dot(f[0], f[1]).powi(2);
        if !(area > 0.0 && area.is_finite()) {
            return fault("area over area at rest", area, "must be positive and finite");
        }
        if !(determinant > 0.0 && determinant.is_finite()) {
            let domain =
                "must be positive and finite: the triangle is a line, up to the round-off of its strain";
            return fault("det FᵀF", determinant, domain);
        }
        if !response.energy.is_finite() {
            return fault("energy density in J/m³", response.energy, "must be finite");
        }
        let stress = response.stress.into_iter().find(|stress| !stress.is_finite());
        fault("stress in Pa", stress?, "must be finite")
    }
}
