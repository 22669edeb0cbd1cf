//! Notes by how much a filtered mass changes the inertia of the rotations of free bodies. Linear momentum is exact, but
//! momenta p = W⁻¹q̇ of a rotation are larger than M q̇ on a coarse mesh.

use nalgebra::{Matrix3, Vector3};

use super::{Component, Simulation};

/// Relative change of a moment of inertia above which a note is given. The moment of a beam about its axis changes by 4
/// % with eight elements across it, and by 570 % with two.
const NOTED: f64 = 0.03;

impl Simulation {
    /// Adds a note for each free component with a filtered mass that changes a moment of inertia.
    pub(super) fn note_inertia(&mut self) {
        let changes = self.components.iter().enumerate();
        let changes = changes.filter_map(|(number, component)| Some((number, change_of_inertia(component)?)));
        let notes: Vec<String> = changes
            .filter(|(_, change)| *change > NOTED)
            .map(|(number, change)| {
                let bodies = self.bodies.iter().filter(|body| body.component == number);
                let names: Vec<String> = bodies.map(|body| format!("'{}'", body.name)).collect();
                format!(
                    "mass = \"filtered\" makes a moment of inertia of {} larger by {:.1} %, and rotations slower: use a finer \
                     mesh, or leave it out",
                    names.join(", "),
                    100.0 * change
                )
            })
            .collect();
        self.notes.extend(notes);
    }
}

/// Returns the largest relative change of a moment of inertia about the centre of mass by the filter of a component; `None` if it has no
/// filter, if supports hold it, or if it has no inertia about a line.
fn change_of_inertia(component: &Component) -> Option<f64> {
    let system = &component.system;
    let coordinates = system.coordinates();
    if system.filter().is_none() || coordinates.free_count() < coordinates.dof_count() {
        return None;
    }
    let (x, mass) = (system.positions(&component.state), system.free_mass());
    let (points, _) = x.as_chunks::<3>();
    let total: f64 = mass.iter().step_by(3).sum();
    let sum: Vector3<f64> =
        points.iter().zip(mass.iter().step_by(3)).map(|(x, m)| *m * Vector3::from(*x)).sum();
    let centre = sum / total;
    let rotations = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis: Vector3<f64>| {
        let velocity = |x: &[f64; 3]| <[f64; 3]>::from(axis.cross(&(Vector3::from(*x) - centre)));
        points.iter().flat_map(velocity).collect::<Vec<f64>>()
    });
    let momenta = rotations.each_ref().map(|velocity| system.momentum(velocity));
    let lumped = rotations.each_ref().map(|v| v.iter().zip(mass).map(|(v, m)| v * m).collect::<Vec<f64>>());
    let moments = |momenta: &[Vec<f64>; 3]| {
        Matrix3::from_fn(|i, j| rotations[i].iter().zip(&momenta[j]).map(|(v, p)| v * p).sum::<f64>())
    };
    let root = moments(&lumped).cholesky()?.l().try_inverse()?;
    Some((root * moments(&momenta) * root.transpose()).symmetric_eigenvalues().max() - 1.0)
}
