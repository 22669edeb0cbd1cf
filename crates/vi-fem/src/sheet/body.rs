//! Makes the potentials and the mass of a sheet from its triangles and law.

use vi_core::Potential;

use crate::error::FemError;
use crate::sheet::bending::BentSheet;
use crate::sheet::direction::CellField;
use crate::sheet::law::SheetLaw;
use crate::sheet::membrane::BuildMembrane;
use crate::small::tensor::{cross, dot};
use crate::solid::consistent_mass::triangle_mass;
use vi_mesh::{Mesh, Triangulation, sort_by_place};

/// A sheet of triangles with a law for stretching and bending, and a rest shape.
#[derive(Debug, Clone, Copy)]
pub struct Sheet<'a> {
    /// The mesh with the triangles. It also gives the rest shape, unless there is a `pattern`.
    pub mesh: &'a Mesh,
    /// Cell numbers of the sheet's triangles.
    pub elements: &'a [u32],
    /// The law and its parameters.
    pub law: &'a SheetLaw,
    /// Node a of the mesh is node a + `node_offset` of the system.
    pub node_offset: usize,
    /// Name of the body: the potentials are called `name: membrane` and `name: bending`.
    pub name: &'a str,
    /// Whether the sheet is free of moments when flat, whatever the shape of the mesh.
    pub flat: bool,
    /// The flat pattern from which the sheet is cut, m: the corners of every cell of the mesh.
    pub pattern: Option<&'a [[[f64; 2]; 3]]>,
    /// Vectors on the cells of the mesh, which a law may name.
    pub fields: &'a [CellField],
    /// Boundary edges (pairs of nodes of the mesh) whose normal keeps the direction in space that it has in the mesh.
    /// If their nodes are prescribed too, they are clamped.
    pub clamped: &'a [[u32; 2]],
    /// Boundary edges (pairs of nodes of the mesh) in a mirror plane with this normal. They bend against the mirror
    /// image of the sheet, provided that their nodes stay in the plane.
    pub mirrored: &'a [([u32; 2], [f64; 3])],
}

impl<'a> Sheet<'a> {
    /// Returns a sheet whose rest shape is that of its mesh.
    pub fn new(
        mesh: &'a Mesh,
        elements: &'a [u32],
        law: &'a SheetLaw,
        node_offset: usize,
        name: &'a str,
    ) -> Self {
        Self {
            mesh,
            elements,
            law,
            node_offset,
            name,
            flat: false,
            pattern: None,
            fields: &[],
            clamped: &[],
            mirrored: &[],
        }
    }

    fn surface(&self) -> Result<Triangulation, FemError> {
        // Neighbours lie together in memory, whatever the order in the file.
        let mut elements = self.elements.to_vec();
        sort_by_place(self.mesh, &mut elements);
        let surface = Triangulation::new(self.mesh, &elements)?;
        match self.pattern {
            Some(pattern) => Ok(surface.with_pattern(pattern)?),
            None => Ok(surface),
        }
    }

    /// Returns the potential of the membrane and those of bending. `shell` has several of the same name, one for each
    /// size of stencil.
    ///
    /// # Errors
    /// Returns the first parameter out of its range ([`SheetLaw::check`] gives all). Returns an error for cells that do
    /// not exist, are not triangles, or have no area; for triangles folded onto each other at rest; for clamped edges
    /// that are not on the boundary; and for `quadratic` on a curved rest shape.
    pub fn potentials(&self) -> Result<Vec<Box<dyn Potential>>, FemError> {
        if let Err(problems) = self.law.check()
            && let Some(first) = problems.into_iter().next()
        {
            return Err(first);
        }
        let surface = self.surface()?;
        let parameters = self.law.parameters();
        let common = parameters.common();
        let directions = parameters.direction().map(|d| d.on(&surface, self.fields)).transpose()?;
        let directions = directions.as_deref();
        let membrane = BuildMembrane {
            surface: &surface,
            thickness: common.thickness,
            moduli: parameters.moduli(),
            directions,
            tension_field: common.tension_field,
            node_offset: self.node_offset,
            name: format!("{}: membrane", self.name),
        };
        let mut potentials = vec![self.law.visit(membrane)];
        let inertia = common.thickness.powi(3) / 12.0;
        let bent = BentSheet {
            surface: &surface,
            flat: self.flat || self.pattern.is_some(),
            moduli: parameters.moduli().map(|row| row.map(|modulus| inertia * modulus)),
            directions,
            clamped: self.clamped,
            mirrored: self.mirrored,
            node_offset: self.node_offset,
            name: format!("{}: bending", self.name),
        };
        potentials.extend(common.bending.potentials(&bent)?);
        Ok(potentials)
    }

    /// Adds the lumped mass (kg) of each node of the mesh to `masses`: a third of the mass of each of its triangles.
    ///
    /// # Errors
    /// Returns the errors of [`Sheet::potentials`].
    pub fn add_lumped_mass(&self, masses: &mut [f64]) -> Result<(), FemError> {
        let surface = self.surface()?;
        for (triangle, nodes) in surface.triangles.iter().enumerate() {
            let share = self.mass_of(&surface, triangle) / 3.0;
            for &node in nodes {
                masses[node as usize] += share;
            }
        }
        Ok(())
    }

    /// Returns the consistent mass of the triangles as a potential of the velocities; see
    /// [`consistent_mass`](crate::consistent_mass).
    ///
    /// # Errors
    /// Returns the errors of [`Sheet::potentials`].
    pub fn consistent_mass(&self) -> Result<Box<dyn Potential>, FemError> {
        let surface = self.surface()?;
        let moved = |nodes: &[u32; 3]| nodes.map(|node| node + self.node_offset as u32);
        let triangles = surface.triangles.iter().enumerate();
        let masses = triangles.map(|(number, nodes)| (moved(nodes), self.mass_of(&surface, number)));
        Ok(triangle_mass(masses, self.name))
    }

    /// Returns the volume at rest (thickness times area, m³) of each triangle with its cell number.
    ///
    /// # Errors
    /// Returns the errors of [`Sheet::potentials`].
    pub fn volumes(&self) -> Result<Vec<(u32, f64)>, FemError> {
        let surface = self.surface()?;
        let thickness = self.law.parameters().common().thickness;
        let volume = |triangle: usize| thickness * self.mass_of(&surface, triangle) / self.law.area_density();
        Ok((0..surface.triangles.len()).map(|triangle| (surface.cells[triangle], volume(triangle))).collect())
    }

    /// Returns the mass of a triangle, kg.
    fn mass_of(&self, surface: &Triangulation, triangle: usize) -> f64 {
        let [a, b, c] = surface.corners(triangle);
        let normal = cross([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
        self.law.area_density() * (0.5 * dot(normal, normal).sqrt())
    }
}
