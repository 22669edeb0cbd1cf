//! The contents of a VTU file to write: points, cells and arrays over them.

use std::io;

use vi_mesh::{CellBlock, CellKind, FarBlock, Region};

/// Precision of real numbers in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Float32: for viewing.
    Single,
    /// Float64: bit for bit, for restarts.
    #[default]
    Double,
}

/// Contents of a VTU file to write.
#[derive(Clone, Copy, Debug, Default)]
pub struct VtuFrame<'a> {
    /// Coordinates in metres.
    pub points: &'a [[f64; 3]],
    /// Blocks of cells that are held in memory.
    pub blocks: &'a [CellBlock],
    /// Cells that are not held in memory; they follow those of `blocks`.
    pub far: &'a [FarBlock],
    /// Groups of cells. They become cell arrays `group:<name>` of 0 and 1, which the reader turns back into groups.
    pub regions: &'a [Region],
    /// Arrays over the points.
    pub point_data: &'a [VtuArray<'a>],
    /// Arrays over all cells, in their order.
    pub cell_data: &'a [VtuArray<'a>],
    /// Time in seconds, written as `TimeValue`.
    pub time: Option<f64>,
    /// Further named numbers of the whole frame, all finite.
    pub field_data: &'a [(&'a str, &'a [f64])],
}

impl<'a> VtuFrame<'a> {
    /// Returns the cells.
    pub(crate) fn cells(&self) -> Cells<'a> {
        Cells { blocks: self.blocks, far: self.far }
    }
}

/// The cells of a frame.
#[derive(Clone, Copy)]
pub(crate) struct Cells<'a> {
    pub(crate) blocks: &'a [CellBlock],
    pub(crate) far: &'a [FarBlock],
}

impl<'a> Cells<'a> {
    /// Returns the kind and the number of the cells of each block.
    pub(crate) fn kinds(self) -> impl Iterator<Item = (CellKind, usize)> + use<'a> {
        let far = self.far.iter().map(|far| (far.elements.kind(), far.elements.count()));
        self.blocks.iter().map(|block| (block.kind, block.cell_count())).chain(far)
    }

    pub(crate) fn count(self) -> usize {
        self.kinds().map(|(_, count)| count).sum()
    }

    pub(crate) fn node_count(self) -> usize {
        self.kinds().map(|(kind, count)| kind.node_count() * count).sum()
    }

    /// Returns the nodes of all cells.
    pub(crate) fn nodes(self) -> impl Iterator<Item = u32> + use<'a> {
        let far = self.far.iter().flat_map(FarBlock::nodes);
        self.blocks.iter().flat_map(|block| block.nodes.iter().copied()).chain(far)
    }

    /// Returns an error if cells that are not held in memory could not be read.
    pub(crate) fn are_read(self) -> io::Result<()> {
        let fault = self.far.iter().find_map(|far| far.elements.fault());
        fault.map_or(Ok(()), |fault| Err(io::Error::other(fault)))
    }

    /// Calls `see` with the kind and the nodes of every cell, until it returns an error.
    pub(crate) fn each<E>(self, mut see: impl FnMut(CellKind, &[u32]) -> Result<(), E>) -> Result<(), E> {
        let mut nodes = self.nodes();
        let mut cell = Vec::new();
        for (kind, count) in self.kinds() {
            for _ in 0..count {
                cell.clear();
                cell.extend(nodes.by_ref().take(kind.node_count()));
                see(kind, &cell)?;
            }
        }
        Ok(())
    }
}

/// A named array to write.
#[derive(Clone, Copy, Debug)]
pub struct VtuArray<'a> {
    /// The name.
    pub name: &'a str,
    /// Values per point or cell, at least 1.
    pub components: usize,
    /// The values, tuple after tuple.
    pub values: VtuValues<'a>,
}

/// Values of an array to write.
#[derive(Clone, Copy, Debug)]
pub enum VtuValues<'a> {
    /// Real numbers, all finite, written in the precision of the options.
    Real(&'a [f64]),
    /// Integers, written as Int32.
    Integer(&'a [i32]),
    /// Integers such as `material_id`, each with the number of its repetitions, written as Int32. The first `skip` are left out;
    /// `count` follow.
    Repeated {
        /// The integers.
        runs: &'a [(i32, usize)],
        /// Number of integers to leave out.
        skip: usize,
        /// Number of integers.
        count: usize,
    },
}

impl VtuValues<'_> {
    fn len(&self) -> usize {
        match *self {
            Self::Real(values) => values.len(),
            Self::Integer(values) => values.len(),
            Self::Repeated { runs, skip, count } => {
                let all: usize = runs.iter().map(|run| run.1).sum();
                count.min(all.saturating_sub(skip))
            }
        }
    }
}

/// Returns all integers of runs.
pub(crate) fn repeated(runs: &[(i32, usize)]) -> impl Iterator<Item = i32> {
    runs.iter().flat_map(|&(value, count)| std::iter::repeat_n(value, count))
}

/// Checks that the parts of a frame match each other.
pub(crate) fn check(frame: &VtuFrame, precision: Precision) -> Result<(), String> {
    let point_count = frame.points.len();
    for block in frame.blocks {
        if block.nodes.len() % block.kind.node_count() != 0 {
            return Err(format!(
                "a block of {} has {} nodes, not a multiple of {}",
                block.kind.name(),
                block.nodes.len(),
                block.kind.node_count()
            ));
        }
    }
    let cell_count = frame.cells().count();
    if let Some(node) = frame.cells().nodes().find(|&node| node as usize >= point_count) {
        return Err(format!("a cell uses node {node} of {point_count}"));
    }
    for region in frame.regions {
        if let Some(cell) = region.cells.iter().find(|&&cell| cell as usize >= cell_count) {
            return Err(format!("the group \"{}\" has cell {cell} of {cell_count}", region.name));
        }
    }
    let greatest = if precision == Precision::Single { f64::from(f32::MAX) } else { f64::MAX };
    let finite = |name: &str, values: &[f64]| match values
        .iter()
        .position(|value| value.is_nan() || value.abs() > greatest)
    {
        Some(i) => Err(format!("value {i} of \"{name}\" is {}, which this precision cannot hold", values[i])),
        None => Ok(()),
    };
    finite("Points", frame.points.as_flattened())?;
    if let Some(time) = frame.time.filter(|time| !time.is_finite()) {
        return Err(format!("the time is {time}"));
    }
    for (name, values) in frame.field_data {
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(format!("\"{name}\" holds {value}"));
        }
    }
    for (arrays, count, site) in
        [(frame.point_data, point_count, "points"), (frame.cell_data, cell_count, "cells")]
    {
        for array in arrays {
            let (found, components) = (array.values.len(), array.components);
            if components == 0 || found != count * components {
                return Err(format!(
                    "\"{}\" has {found} values for {count} {site} of {components} components",
                    array.name
                ));
            }
            if let VtuValues::Real(values) = array.values {
                finite(array.name, values)?;
            }
        }
    }
    Ok(())
}
