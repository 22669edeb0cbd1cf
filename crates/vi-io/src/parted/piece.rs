//! The bytes of a piece, little-endian: the number of its nodes and the length of each region's list (64 bits), then its elements,
//! corners and nodes (32 bits), the points (64-bit real numbers), and the lists (32 bits).

use std::io::{self, Write};

use vi_mesh::Piece;

use super::index::Index;
use super::numbers::{put_integers, put_points};
use super::sections::Sections;
use crate::error::IoError;

/// Writes a piece.
pub(super) fn encode(piece: &Piece, out: &mut impl Write) -> io::Result<()> {
    let mut counts = [&piece.nodes].into_iter().chain(&piece.regions).map(|list| list.len() as u64);
    counts.try_for_each(|count| out.write_all(&count.to_le_bytes()))?;
    [&piece.elements, &piece.corners, &piece.nodes]
        .into_iter()
        .try_for_each(|list| put_integers(list, out))?;
    put_points(&piece.points, out)?;
    piece.regions.iter().try_for_each(|list| put_integers(list, out))
}

/// Reads piece number `number` of an index from its file.
///
/// # Errors
/// Returns the fault in the file.
pub(super) fn decode(mut file: Sections, of_index: (&Index, usize)) -> Result<Piece, IoError> {
    let piece = lists(&mut file, of_index);
    file.finish(piece).map(|(piece, _)| piece)
}

fn lists(file: &mut Sections, (index, number): (&Index, usize)) -> Result<Piece, IoError> {
    let (pieces, regions) = (&index.pieces, &index.pieces.regions);
    let counts = file.longs(1 + regions.len(), "the lengths of its lists")?;
    // No list has more entries than 32 bits can number; a longer one is cut off, and does not end where the file does.
    let count = |count: u64| count.min(u64::from(u32::MAX)) as usize;
    let (node_count, lengths) = (count(counts[0]), counts[1..].iter().copied().map(count));
    let (element_count, elements) = (pieces.range(number).len(), pieces.element_count());
    let of_elements = file.integers((element_count, elements), "elements")?;
    let corner_count = element_count * pieces.kind.node_count();
    let corners = file.integers((corner_count, node_count), "the nodes of its elements")?;
    let nodes = file.integers((node_count, index.node_count), "nodes")?;
    let points = file.points(node_count)?;
    let mut members = Vec::with_capacity(regions.len());
    for ((name, dimension), length) in regions.iter().zip(lengths) {
        let below = if *dimension == 3 { elements } else { index.node_count };
        members.push(file.integers((length, below), name)?);
    }
    Ok(Piece { elements: of_elements, corners, nodes, points, regions: members })
}
