//! Writes VTU files (VTK XML unstructured grids), streaming from slices.
//!
//! The size of compressed data is known only after compression, so headers and offsets are filled in afterwards. Only
//! one block of data is held in memory.
//!
//! Source: VTK file formats, "XML file formats"; the compressed layout is that of vtkXMLDataParser.

use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use flate2::{Compress, Compression, FlushCompress, Status};
use quick_xml::escape::escape;

use crate::error::IoError;
use crate::replace::replace_file;
use crate::vtk::groups::array_of;
use crate::vtu_frame::{Cells, Precision, VtuFrame, VtuValues, check, repeated};

/// Size of a block that is compressed separately, bytes.
const BLOCK: usize = 1 << 17;
/// Digits reserved for a 64-bit offset that is filled in later.
const OFFSET_DIGITS: usize = 20;

/// Position and encoding of the data in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VtuEncoding {
    /// After the XML, as raw bytes: small and fast.
    #[default]
    AppendedRaw,
    /// Inside the XML as base64: valid XML that more tools read.
    InlineBase64,
}

/// Encoding of a VTU file. The default is appended raw, compressed, in double precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VtuOptions {
    /// Position and encoding of the data in the file.
    pub encoding: VtuEncoding,
    /// Precision of points and real arrays.
    pub precision: Precision,
    /// Level of zlib from 1 (fast) to 9 (small); 0 writes uncompressed data.
    pub compression: u32,
}

impl Default for VtuOptions {
    fn default() -> Self {
        Self { encoding: VtuEncoding::AppendedRaw, precision: Precision::Double, compression: 1 }
    }
}

/// Writes a VTU file as a whole: `path` is replaced once everything is written.
///
/// # Errors
/// Returns [`IoError::BadOutput`] if lengths do not match, a node does not exist or a value is not finite;
/// [`IoError::System`] if the file cannot be written. In both cases an older file is unchanged.
pub fn write_vtu(path: &Path, frame: &VtuFrame, options: VtuOptions) -> Result<(), IoError> {
    let wrong = |what: String| IoError::BadOutput { file: path.into(), what };
    check(frame, options.precision).map_err(wrong)?;
    replace_file(path, |file| {
        encode_vtu(file, frame, options)?;
        frame.cells().are_read()
    })
}

/// Writes the bytes of a VTU file. The current position of `out` becomes the first byte of the file.
///
/// # Errors
/// Returns the errors of `out`, and [`io::ErrorKind::InvalidInput`] where [`write_vtu`] returns [`IoError::BadOutput`].
pub fn encode_vtu<W: Write + Seek>(out: &mut W, frame: &VtuFrame, options: VtuOptions) -> io::Result<()> {
    check(frame, options.precision).map_err(|what| io::Error::new(io::ErrorKind::InvalidInput, what))?;
    let cells = frame.cells();
    let cell_count = cells.count();
    let wide = needs_64_bits(frame.points.len(), cells.node_count());
    let mut writer = Writer { out, options, later: Vec::new() };
    let compressor = if options.compression > 0 { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
    writeln!(
        writer.out,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\"{compressor}>\n<UnstructuredGrid>"
    )?;
    let time = frame.time.as_slice();
    let fields = frame.field_data.iter().copied();
    let mut fields = (!time.is_empty()).then_some(("TimeValue", time)).into_iter().chain(fields).peekable();
    if fields.peek().is_some() {
        writeln!(writer.out, "<FieldData>")?;
        for (name, values) in fields {
            let (name, count) = (escape(name), values.len());
            let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
            writeln!(
                writer.out,
                "<DataArray type=\"Float64\" Name=\"{name}\" NumberOfTuples=\"{count}\" format=\"ascii\">{}\
                 </DataArray>",
                values.join(" ")
            )?;
        }
        writeln!(writer.out, "</FieldData>")?;
    }
    writeln!(writer.out, "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{cell_count}\">", frame.points.len())?;
    writeln!(writer.out, "<PointData>")?;
    for array in frame.point_data {
        writer.array(array.name, array.components, Data::Values(array.values))?;
    }
    writeln!(writer.out, "</PointData>\n<CellData>")?;
    for array in frame.cell_data {
        writer.array(array.name, array.components, Data::Values(array.values))?;
    }
    for region in frame.regions {
        writer.array(&array_of(&region.name), 1, Data::Member { cells: &region.cells, cell_count })?;
    }
    writeln!(writer.out, "</CellData>\n<Points>")?;
    writer.array("Points", 3, Data::Values(VtuValues::Real(frame.points.as_flattened())))?;
    writeln!(writer.out, "</Points>\n<Cells>")?;
    writer.array("connectivity", 1, Data::Connectivity { cells, wide })?;
    writer.array("offsets", 1, Data::Offsets { cells, wide })?;
    writer.array("types", 1, Data::Types(cells))?;
    writeln!(writer.out, "</Cells>\n</Piece>\n</UnstructuredGrid>")?;
    writer.appended()?;
    writeln!(writer.out, "</VTKFile>")
}

/// Returns whether 32 signed bits are too few for the nodes of cells (up to the number of points) or for the offsets
/// into them (up to the number of all nodes of all cells).
fn needs_64_bits(point_count: usize, node_count: usize) -> bool {
    node_count.max(point_count) > i32::MAX as usize
}

/// The data of one `DataArray`.
#[derive(Clone, Copy)]
enum Data<'a> {
    Values(VtuValues<'a>),
    Member { cells: &'a [u32], cell_count: usize },
    Connectivity { cells: Cells<'a>, wide: bool },
    Offsets { cells: Cells<'a>, wide: bool },
    Types(Cells<'a>),
}

struct Writer<'a, W> {
    out: &'a mut W,
    options: VtuOptions,
    /// Arrays to append, each with the position of its offset.
    later: Vec<(u64, Data<'a>)>,
}

impl<'a, W: Write + Seek> Writer<'a, W> {
    fn array(&mut self, name: &str, components: usize, data: Data<'a>) -> io::Result<()> {
        let kind = match data {
            Data::Values(VtuValues::Real(_)) if self.options.precision == Precision::Single => "Float32",
            Data::Values(VtuValues::Real(_)) => "Float64",
            Data::Values(_) => "Int32",
            Data::Connectivity { wide, .. } | Data::Offsets { wide, .. } if wide => "Int64",
            Data::Connectivity { .. } | Data::Offsets { .. } => "Int32",
            Data::Member { .. } | Data::Types(_) => "UInt8",
        };
        let name = escape(name);
        write!(
            self.out,
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\""
        )?;
        match self.options.encoding {
            VtuEncoding::AppendedRaw => {
                write!(self.out, "appended\" offset=")?;
                self.later.push((self.out.stream_position()?, data));
                writeln!(self.out, "{:width$}/>", "", width = OFFSET_DIGITS + 2)
            }
            VtuEncoding::InlineBase64 => {
                writeln!(self.out, "binary\">")?;
                self.payload(data)?;
                writeln!(self.out, "\n</DataArray>")
            }
        }
    }

    /// Writes the section of appended data, and the offsets into it.
    fn appended(&mut self) -> io::Result<()> {
        if self.later.is_empty() {
            return Ok(());
        }
        write!(self.out, "<AppendedData encoding=\"raw\">\n_")?;
        let origin = self.out.stream_position()?;
        for (place, data) in std::mem::take(&mut self.later) {
            let here = self.out.stream_position()?;
            self.patch(place, format!("\"{}\"", here - origin).as_bytes())?;
            self.payload(data)?;
        }
        writeln!(self.out, "\n</AppendedData>")
    }

    fn patch(&mut self, place: u64, bytes: &[u8]) -> io::Result<()> {
        let here = self.out.stream_position()?;
        self.out.seek(SeekFrom::Start(place))?;
        self.out.write_all(bytes)?;
        self.out.seek(SeekFrom::Start(here))?;
        Ok(())
    }

    fn payload(&mut self, data: Data) -> io::Result<()> {
        fn ends(cells: Cells<'_>) -> impl Iterator<Item = u64> {
            let sizes = cells.kinds().flat_map(|(kind, count)| std::iter::repeat_n(kind.node_count(), count));
            sizes.scan(0, |end, size| {
                *end += size as u64;
                Some(*end)
            })
        }
        match data {
            Data::Values(VtuValues::Real(values)) if self.options.precision == Precision::Single => {
                self.items(values.len(), values.iter().map(|&value| (value as f32).to_le_bytes()))
            }
            Data::Values(VtuValues::Real(values)) => {
                self.items(values.len(), values.iter().map(|value| value.to_le_bytes()))
            }
            Data::Values(VtuValues::Integer(values)) => {
                self.items(values.len(), values.iter().map(|value| value.to_le_bytes()))
            }
            Data::Values(VtuValues::Repeated { runs, skip, count }) => {
                let values = repeated(runs).skip(skip).take(count);
                self.items(count, values.map(i32::to_le_bytes))
            }
            Data::Member { cells, cell_count } => {
                let mut is_member = vec![0u8; cell_count];
                for &cell in cells {
                    is_member[cell as usize] = 1;
                }
                self.items(cell_count, is_member.iter().map(|&byte| [byte]))
            }
            Data::Connectivity { cells, wide: false } => {
                self.items(cells.node_count(), cells.nodes().map(|node| (node as i32).to_le_bytes()))
            }
            Data::Connectivity { cells, wide: true } => {
                self.items(cells.node_count(), cells.nodes().map(|node| i64::from(node).to_le_bytes()))
            }
            Data::Offsets { cells, wide: false } => {
                self.items(cells.count(), ends(cells).map(|end| (end as i32).to_le_bytes()))
            }
            Data::Offsets { cells, wide: true } => {
                self.items(cells.count(), ends(cells).map(|end| end.to_le_bytes()))
            }
            Data::Types(cells) => {
                let codes =
                    cells.kinds().flat_map(|(kind, count)| std::iter::repeat_n([kind.vtk_code()], count));
                self.items(cells.count(), codes)
            }
        }
    }

    /// Writes the header and data of an array of `count` items of `WIDTH` bytes.
    fn items<const WIDTH: usize>(
        &mut self,
        count: usize,
        mut items: impl Iterator<Item = [u8; WIDTH]>,
    ) -> io::Result<()> {
        let length = count * WIDTH;
        let mut next_block = |block: &mut Vec<u8>| {
            block.clear();
            block.extend(items.by_ref().take(BLOCK / WIDTH).flatten());
            !block.is_empty()
        };
        let mut block = Vec::with_capacity(BLOCK.min(length));
        if self.options.compression == 0 {
            let mut stream = Stream::new(&mut *self.out, self.options.encoding);
            stream.write_all(&(length as u64).to_le_bytes())?;
            while next_block(&mut block) {
                stream.write_all(&block)?;
            }
            return stream.finish();
        }
        // The header is: number of blocks, bytes of a whole block, bytes of a last partial block, then each compressed
        // size.
        let block_count = length.div_ceil(BLOCK);
        let mut header = vec![block_count as u64, BLOCK as u64, (length % BLOCK) as u64];
        header.resize(3 + block_count, 0);
        let place = self.out.stream_position()?;
        self.header(&header)?;
        let mut stream = Stream::new(&mut *self.out, self.options.encoding);
        let mut compress = Compress::new(Compression::new(self.options.compression.min(9)), true);
        let mut packed = Vec::new();
        let mut i = 3;
        while next_block(&mut block) {
            deflate(&mut compress, &block, &mut packed)?;
            header[i] = packed.len() as u64;
            i += 1;
            stream.write_all(&packed)?;
        }
        stream.finish()?;
        let end = self.out.stream_position()?;
        self.out.seek(SeekFrom::Start(place))?;
        self.header(&header)?;
        self.out.seek(SeekFrom::Start(end))?;
        Ok(())
    }

    fn header(&mut self, header: &[u64]) -> io::Result<()> {
        let bytes: Vec<u8> = header.iter().flat_map(|value| value.to_le_bytes()).collect();
        let mut stream = Stream::new(&mut *self.out, self.options.encoding);
        stream.write_all(&bytes)?;
        stream.finish()
    }
}

/// Compresses one block as a separate zlib stream.
fn deflate(compress: &mut Compress, block: &[u8], packed: &mut Vec<u8>) -> io::Result<()> {
    compress.reset();
    packed.clear();
    // This is zlib's own bound for incompressible data.
    packed.reserve(block.len() + block.len() / 1000 + 64);
    loop {
        let read = compress.total_in() as usize;
        match compress
            .compress_vec(&block[read..], packed, FlushCompress::Finish)
            .map_err(io::Error::other)?
        {
            Status::StreamEnd => return Ok(()),
            Status::Ok | Status::BufError => packed.reserve(1 << 12),
        }
    }
}

/// Writes bytes as they are, or as base64 with padding at the end.
enum Stream<'a, W: Write> {
    Raw(&'a mut W),
    Base64(Box<EncoderWriter<'static, base64::engine::GeneralPurpose, &'a mut W>>),
}

impl<'a, W: Write> Stream<'a, W> {
    fn new(out: &'a mut W, encoding: VtuEncoding) -> Self {
        match encoding {
            VtuEncoding::AppendedRaw => Self::Raw(out),
            VtuEncoding::InlineBase64 => Self::Base64(Box::new(EncoderWriter::new(out, &STANDARD))),
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Raw(out) => out.write_all(bytes),
            Self::Base64(encoder) => encoder.write_all(bytes),
        }
    }

    fn finish(self) -> io::Result<()> {
        match self {
            Self::Raw(_) => Ok(()),
            Self::Base64(mut encoder) => encoder.finish().map(|_| ()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Int32 holds at most 2³¹ − 1, but 10⁹ tetrahedra have 4 · 10⁹ nodes. The test does not build such a frame.
    #[test]
    fn indices_beyond_31_bits_are_written_in_64() {
        let most = i32::MAX as usize;
        assert!(!needs_64_bits(most, most));
        assert!(needs_64_bits(most + 1, most));
        assert!(needs_64_bits(200_000_000, 4_000_000_000));
        let mut bytes = io::Cursor::new(Vec::new());
        let options = VtuOptions { compression: 0, ..VtuOptions::default() };
        let mut writer = Writer { out: &mut bytes, options, later: Vec::new() };
        let blocks = [vi_mesh::CellBlock { kind: vi_mesh::CellKind::Tri3, nodes: vec![0, 1, u32::MAX - 1] }];
        let cells = Cells { blocks: &blocks, far: &[] };
        writer.array("connectivity", 1, Data::Connectivity { cells, wide: true }).unwrap();
        writer.array("offsets", 1, Data::Offsets { cells, wide: true }).unwrap();
        writer.appended().unwrap();
        let bytes = bytes.into_inner();
        let text = String::from_utf8_lossy(&bytes);
        assert_eq!(text.matches("type=\"Int64\"").count(), 2, "{text}");
        let last = i64::from(u32::MAX - 1).to_le_bytes();
        assert!(bytes.windows(8).any(|window| window == last));
    }
}
