//! Meshes from arrays, and arrays from meshes.

use std::sync::Arc;

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use variational::mesh::{self, CellBlock, CellKind};

use crate::arrays::{int_array, points_array};
use crate::errors;

/// A kind of cells and their nodes (m, nodes).
type Block<'py> = (&'static str, Bound<'py, PyArray2<i64>>);

/// Points, cells by kind, and named regions, which cannot change.
#[pyclass(frozen, module = "variational_sim._core")]
pub(crate) struct Mesh(pub(crate) Arc<mesh::Mesh>);

#[pymethods]
impl Mesh {
    /// Makes a mesh of points (n, 3), m, blocks of cells (kind, (m, nodes)) with nodes in VTK's order, and regions
    /// {name: cells}, whose numbers count the cells of all blocks in order.
    #[new]
    fn new(
        points: PyReadonlyArray2<'_, f64>,
        blocks: Vec<(String, PyReadonlyArray2<'_, i64>)>,
        regions: Vec<(String, Vec<u32>)>,
    ) -> PyResult<Self> {
        if points.shape()[1] != 3 {
            return Err(errors::value(format!("points: expected shape (n, 3), found {:?}", points.shape())));
        }
        let points = points.to_vec().map_err(errors::value)?.as_chunks::<3>().0.to_vec();
        let blocks: Vec<CellBlock> =
            blocks.iter().map(|(kind, cells)| block(kind, cells)).collect::<PyResult<_>>()?;
        let mut mesh = mesh::Mesh::from_arrays(points, blocks).map_err(|problems| {
            let problems: Vec<_> = problems.iter().map(ToString::to_string).collect();
            errors::value(problems.join("; "))
        })?;
        for (name, cells) in regions {
            mesh = mesh.with_region(name, &cells).map_err(errors::value)?;
        }
        Ok(Self(Arc::new(mesh)))
    }

    /// Positions at rest (n, 3), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        points_array(py, self.0.points.clone())
    }

    /// Blocks of cells in order, [(kind, (m, nodes))].
    #[getter]
    fn blocks<'py>(&self, py: Python<'py>) -> PyResult<Vec<Block<'py>>> {
        let array = |block: &CellBlock| {
            let nodes = block.nodes.iter().map(|&node| i64::from(node)).collect();
            Ok((block.kind.name(), int_array(py, nodes, block.kind.node_count())?))
        };
        self.0.blocks.iter().map(array).collect()
    }

    /// Regions, {name: cells}.
    #[getter]
    fn regions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let regions = PyDict::new(py);
        for region in &self.0.regions {
            regions.set_item(&region.name, &region.cells)?;
        }
        Ok(regions)
    }

    fn __repr__(&self) -> String {
        let mesh = &self.0;
        let cells = mesh.blocks.iter().map(|block| format!(", {} {}", block.cell_count(), block.kind.name()));
        let regions: Vec<&str> = mesh.regions.iter().map(|region| region.name.as_str()).collect();
        let regions = if regions.is_empty() { "no regions".to_owned() } else { regions.join(", ") };
        format!("<Mesh: {} points{}; {regions}>", mesh.points.len(), cells.collect::<String>())
    }
}

fn block(kind: &str, cells: &PyReadonlyArray2<'_, i64>) -> PyResult<CellBlock> {
    let kind = CellKind::ALL.iter().copied().find(|known| known.name() == kind).ok_or_else(|| {
        errors::value(format!("cells: unknown kind '{kind}'; there are {}", CellKind::NAMES))
    })?;
    if cells.shape()[1] != kind.node_count() {
        let (name, expected, found) = (kind.name(), kind.node_count(), cells.shape()[1]);
        return Err(errors::value(format!(
            "cells: {name} has {expected} nodes, the array has {found} columns"
        )));
    }
    let node = |&node: &i64| {
        u32::try_from(node).map_err(|_| errors::value(format!("cells: {node} is not the number of a node")))
    };
    let nodes = cells.to_vec().map_err(errors::value)?.iter().map(node).collect::<PyResult<_>>()?;
    Ok(CellBlock { kind, nodes })
}
