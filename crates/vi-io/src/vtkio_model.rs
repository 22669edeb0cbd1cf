//! Converts meshes to and from the model of the crate `vtkio` (feature `vtkio`), for programs that use this crate.
//!
//! Points, cells and arrays are converted in both directions; regions become cell arrays `group:<name>`, as in VTU
//! files.

use std::path::Path;

use num_traits::FromPrimitive;
use vi_mesh::{CellBlock, Mesh};
use vtkio::IOBuffer;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataArray as VtkArray, DataSet, UnstructuredGridPiece,
    Version, VertexNumbers, Vtk,
};

use crate::error::{IoError, Place};
use crate::mesh::{DataArray, MeshFile};
use crate::vtk::cells::CellReader;
use crate::vtk::groups;
use crate::vtk::pieces::join;

impl From<&MeshFile> for Vtk {
    /// Returns an unstructured grid of one piece.
    fn from(file: &MeshFile) -> Self {
        let mut data = Attributes { point: attributes(&file.point_data), cell: attributes(&file.cell_data) };
        data.cell.extend(memberships(&file.mesh));
        let piece = UnstructuredGridPiece {
            points: IOBuffer::F64(file.mesh.points.as_flattened().to_vec()),
            cells: cells(&file.mesh.blocks),
            data,
        };
        Self {
            version: Version::new_xml(1, 0),
            title: String::new(),
            byte_order: ByteOrder::LittleEndian,
            data: DataSet::inline(piece),
            file_path: None,
        }
    }
}

impl TryFrom<&Vtk> for MeshFile {
    type Error = IoError;

    /// Converts every piece of an unstructured grid, as [`parse_vtu`](crate::parse_vtu) does for a file. It reads other
    /// files only if the grid refers to pieces in them.
    ///
    /// # Errors
    /// Returns [`IoError`] if the data set is not an unstructured grid, a piece cannot be loaded, or cells or arrays
    /// contradict the number of points.
    fn try_from(vtk: &Vtk) -> Result<Self, IoError> {
        let path = vtk.file_path.as_deref().unwrap_or(Path::new("data of vtkio"));
        let DataSet::UnstructuredGrid { pieces, .. } = &vtk.data else {
            let what = "a data set that is not an unstructured grid".to_owned();
            let (file, place) = (path.into(), Place::Piece(0));
            return Err(IoError::Unsupported {
                file,
                place,
                what,
                remedy: "convert it to an unstructured grid",
            });
        };
        let mut reader =
            Reader { path, piece: 0, cells: CellReader::default(), out: Self::default(), size: 0 };
        for (number, piece) in pieces.iter().enumerate() {
            reader.piece = number;
            let piece = piece.load_piece_data(vtk.file_path.as_deref());
            let piece =
                piece.map_err(|error| reader.inconsistent(format!("it cannot be loaded: {error}")))?;
            reader.push(piece)?;
        }
        let Reader { cells, mut out, size, .. } = reader;
        // The same bound as for a file with this number of values (`parse_vtu`).
        cells.finish(&mut out, 32 * size);
        groups::from_arrays(&mut out);
        Ok(out)
    }
}

fn cells(blocks: &[CellBlock]) -> Cells {
    let (mut connectivity, mut offsets, mut types) = (Vec::new(), Vec::new(), Vec::new());
    for block in blocks {
        let kind = CellType::from_u8(block.kind.vtk_code()).expect("vtkio has the kinds of VTK");
        for nodes in block.cells() {
            connectivity.extend(nodes.iter().map(|&node| u64::from(node)));
            offsets.push(connectivity.len() as u64);
            types.push(kind);
        }
    }
    Cells { cell_verts: VertexNumbers::XML { connectivity, offsets }, types }
}

fn attributes(arrays: &[DataArray]) -> Vec<Attribute> {
    let attribute = |array: &DataArray| {
        Attribute::generic(array.name.clone(), array.components as u32).with_data(array.values.clone())
    };
    arrays.iter().map(attribute).collect()
}

/// Returns one array per region: 1 in its cells, 0 in the others.
fn memberships(mesh: &Mesh) -> impl Iterator<Item = Attribute> {
    let count = mesh.cell_count();
    mesh.regions.iter().map(move |region| {
        let mut members = vec![0_i32; count];
        region.cells.iter().for_each(|&cell| members[cell as usize] = 1);
        Attribute::generic(groups::array_of(&region.name), 1).with_data(members)
    })
}

/// A grid that is converted piece by piece.
struct Reader<'a> {
    path: &'a Path,
    piece: usize,
    cells: CellReader,
    out: MeshFile,
    /// Number of values converted so far.
    size: usize,
}

impl Reader<'_> {
    fn inconsistent(&self, what: String) -> IoError {
        IoError::Inconsistent { file: self.path.into(), place: Place::Piece(self.piece), what }
    }

    fn push(&mut self, piece: UnstructuredGridPiece) -> Result<(), IoError> {
        let UnstructuredGridPiece { points, cells, data } = piece;
        let base = self.out.mesh.points.len();
        let values: Vec<f64> = points.cast_into().unwrap_or_default();
        let (points, rest) = values.as_chunks::<3>();
        if !rest.is_empty() || base + points.len() > u32::MAX as usize {
            return Err(self.inconsistent(format!("{} coordinates", values.len())));
        }
        if let Some(node) = points.iter().position(|x| x.iter().any(|x| !x.is_finite())) {
            let (file, place) = (self.path.into(), Place::Piece(self.piece));
            return Err(IoError::NotFinite { file, place, node: node as u64, x: points[node] });
        }
        self.out.mesh.points.extend_from_slice(points);
        self.cells.set_points(base, points.len());
        let cells_before = self.cells.file_cell_count();
        let (connectivity, offsets) = cells.cell_verts.into_xml();
        // The offsets may start with a zero: no cell is without nodes.
        let ends = offsets.strip_prefix(&[0]).unwrap_or(&offsets);
        if ends.len() != cells.types.len() {
            return Err(self.inconsistent(format!(
                "{} offsets for {} cells",
                offsets.len(),
                cells.types.len()
            )));
        }
        let mut start = 0;
        for (&end, &kind) in ends.iter().zip(&cells.types) {
            let nodes = connectivity.get(start..end as usize);
            let nodes = nodes
                .ok_or_else(|| self.inconsistent("the offsets of cells do not fit their nodes".into()))?;
            let nodes: Vec<i64> = nodes.iter().map(|&node| node as i64).collect();
            let place = || Place::Piece(self.piece);
            self.cells.push(&mut self.out, self.path, place, kind as i64, &nodes)?;
            start = end as usize;
        }
        self.size += values.len() + connectivity.len() + offsets.len();
        let counts = [points.len(), self.cells.file_cell_count() - cells_before];
        for (site, attributes) in [data.point, data.cell].into_iter().enumerate() {
            let arrays: Vec<DataArray> = attributes.into_iter().flat_map(arrays).collect();
            for array in &arrays {
                if array.components == 0 || array.values.len() != array.components * counts[site] {
                    let (name, count) = (&array.name, counts[site]);
                    return Err(
                        self.inconsistent(format!("the array \"{name}\" is not of {count} points or cells"))
                    );
                }
                self.size += array.values.len();
            }
            let all = if site == 0 { &mut self.out.point_data } else { &mut self.out.cell_data };
            join(all, arrays, self.piece, &mut self.out.notes);
        }
        Ok(())
    }
}

/// Returns the arrays of an attribute; arrays that do not contain numbers have no values.
fn arrays(attribute: Attribute) -> Vec<DataArray> {
    let array = |name: String, components: u32, data: IOBuffer| DataArray {
        name,
        components: components as usize,
        values: data.cast_into().unwrap_or_default(),
    };
    match attribute {
        Attribute::DataArray(VtkArray { name, elem, data }) => vec![array(name, elem.num_comp(), data)],
        Attribute::Field { data_array, .. } => {
            data_array.into_iter().map(|field| array(field.name, field.elem, field.data)).collect()
        }
    }
}
