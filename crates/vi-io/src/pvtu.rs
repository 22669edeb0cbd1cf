//! Writes a large frame as several VTU files (pieces) and a PVTU file that names them.
//!
//! Source: VTK file formats, "XML file formats", parallel unstructured grids.

use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use quick_xml::escape::escape;

use crate::error::IoError;
use crate::replace::replace_file;
use crate::vtk::groups::array_of;
use crate::vtu_frame::{Precision, VtuArray, VtuFrame, VtuValues, check, repeated};
use crate::vtu_write::{VtuOptions, write_vtu};
use vi_mesh::{CellBlock, Region};

/// Writes a frame to the PVTU file `path` and pieces `<stem>_p000.vtu` … beside it. A piece is a run of cells with at most
/// `most_points` points, or one cell. Points between two pieces are in both; points of no cell are left out. Pieces are written
/// first and one by one, so that the memory of one piece suffices.
///
/// # Errors
/// Returns the errors of [`write_vtu`]. Pieces that were written before the error remain.
pub fn write_pvtu(
    path: &Path,
    frame: &VtuFrame,
    options: VtuOptions,
    most_points: usize,
) -> Result<(), IoError> {
    let wrong = |what: String| IoError::BadOutput { file: path.into(), what };
    check(frame, options.precision).map_err(wrong)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut names = Vec::new();
    let mut piece = Piece { number_of: vec![NONE; frame.points.len()], ..Piece::default() };
    let mut cell = 0;
    frame.cells().each(|kind, nodes| {
        let new = nodes.iter().filter(|&&node| piece.number_of[node as usize] == NONE).count();
        if piece.points.len() + new > most_points && !piece.blocks.is_empty() {
            names.push(format!("{stem}_p{:03}.vtu", names.len()));
            piece.write(&sibling(path, &names[names.len() - 1]), frame, options, cell)?;
        }
        let nodes: Vec<u32> = nodes.iter().map(|&node| piece.number(node)).collect();
        match piece.blocks.last_mut() {
            Some(last) if last.kind == kind => last.nodes.extend(nodes),
            _ => piece.blocks.push(CellBlock { kind, nodes }),
        }
        cell += 1;
        Ok::<(), IoError>(())
    })?;
    names.push(format!("{stem}_p{:03}.vtu", names.len()));
    piece.write(&sibling(path, &names[names.len() - 1]), frame, options, cell)?;
    replace_file(path, |out| {
        frame.cells().are_read()?;
        out.write_all(list(frame, options, &names).as_bytes())
    })
}

fn sibling(path: &Path, name: &str) -> PathBuf {
    path.with_file_name(name)
}

const NONE: u32 = u32::MAX;

/// A run of the cells of a frame.
#[derive(Default)]
struct Piece {
    /// The number of each point of the frame in the piece.
    number_of: Vec<u32>,
    /// The points of the piece in the frame.
    points: Vec<u32>,
    blocks: Vec<CellBlock>,
    /// Its first cell in the frame.
    first: usize,
}

impl Piece {
    /// Returns the number of a point, and adds the point if it is new.
    fn number(&mut self, point: u32) -> u32 {
        let number = &mut self.number_of[point as usize];
        if *number == NONE {
            *number = self.points.len() as u32;
            self.points.push(point);
        }
        *number
    }

    /// Writes the piece, which ends before the cell `end` of the frame, and begins the next one.
    fn write(
        &mut self,
        path: &Path,
        frame: &VtuFrame,
        options: VtuOptions,
        end: usize,
    ) -> Result<(), IoError> {
        let cells = self.first..end;
        let at_points: Vec<Values> =
            frame.point_data.iter().map(|array| Values::at(array, &self.points)).collect();
        let points: Vec<[f64; 3]> = self.points.iter().map(|&point| frame.points[point as usize]).collect();
        let regions: Vec<Region> = frame.regions.iter().map(|region| region_in(region, &cells)).collect();
        let point_data: Vec<VtuArray> =
            frame.point_data.iter().zip(&at_points).map(|(array, values)| values.array(array)).collect();
        let cell_data: Vec<VtuArray> = frame.cell_data.iter().map(|array| of_cells(array, &cells)).collect();
        let piece = VtuFrame {
            points: &points,
            blocks: &self.blocks,
            far: &[],
            regions: &regions,
            point_data: &point_data,
            cell_data: &cell_data,
            ..*frame
        };
        write_vtu(path, &piece, options)?;
        self.points.drain(..).for_each(|point| self.number_of[point as usize] = NONE);
        self.blocks.clear();
        self.first = end;
        Ok(())
    }
}

/// The values of an array at some points.
enum Values {
    Real(Vec<f64>),
    Integer(Vec<i32>),
}

impl Values {
    fn at(array: &VtuArray, points: &[u32]) -> Self {
        fn chosen<T: Copy>(values: &[T], width: usize, points: &[u32]) -> Vec<T> {
            points.iter().flat_map(|&point| &values[width * point as usize..][..width]).copied().collect()
        }
        match array.values {
            VtuValues::Real(values) => Self::Real(chosen(values, array.components, points)),
            VtuValues::Integer(values) => Self::Integer(chosen(values, array.components, points)),
            VtuValues::Repeated { runs, skip, count } => {
                let values: Vec<i32> = repeated(runs).skip(skip).take(count).collect();
                Self::Integer(chosen(&values, array.components, points))
            }
        }
    }

    fn array<'a>(&'a self, whole: &VtuArray<'a>) -> VtuArray<'a> {
        let values = match self {
            Self::Real(values) => VtuValues::Real(values),
            Self::Integer(values) => VtuValues::Integer(values),
        };
        VtuArray { values, ..*whole }
    }
}

fn of_cells<'a>(array: &VtuArray<'a>, cells: &Range<usize>) -> VtuArray<'a> {
    let range = array.components * cells.start..array.components * cells.end;
    let values = match array.values {
        VtuValues::Real(values) => VtuValues::Real(&values[range]),
        VtuValues::Integer(values) => VtuValues::Integer(&values[range]),
        VtuValues::Repeated { runs, skip, .. } => {
            VtuValues::Repeated { runs, skip: skip + range.start, count: range.len() }
        }
    };
    VtuArray { values, ..*array }
}

fn region_in(region: &Region, cells: &Range<usize>) -> Region {
    let inside = region.cells.iter().filter(|&&cell| cells.contains(&(cell as usize)));
    Region { cells: inside.map(|&cell| cell - cells.start as u32).collect(), ..region.clone() }
}

/// Returns the PVTU file of pieces with these names.
fn list(frame: &VtuFrame, options: VtuOptions, names: &[String]) -> String {
    let real = if options.precision == Precision::Single { "Float32" } else { "Float64" };
    let line = |kind: &str, name: &str, components: usize| {
        let name = escape(name);
        format!("<PDataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"/>\n")
    };
    let of_array = |array: &VtuArray| {
        let kind = if matches!(array.values, VtuValues::Real(_)) { real } else { "Int32" };
        line(kind, array.name, array.components)
    };
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n<PUnstructuredGrid GhostLevel=\"0\">\n<PPointData>\n",
    );
    text.extend(frame.point_data.iter().map(of_array));
    text += "</PPointData>\n<PCellData>\n";
    text.extend(frame.cell_data.iter().map(of_array));
    text.extend(frame.regions.iter().map(|region| line("UInt8", &array_of(&region.name), 1)));
    text += "</PCellData>\n<PPoints>\n";
    text += &line(real, "Points", 3);
    text += "</PPoints>\n";
    text.extend(names.iter().map(|name| format!("<Piece Source=\"{}\"/>\n", escape(name))));
    text + "</PUnstructuredGrid>\n</VTKFile>\n"
}
