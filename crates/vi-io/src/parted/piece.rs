//! The bytes of a piece, little-endian: the number of its nodes and the length of each region's list (64 bits), then its elements,
//! corners and nodes (32 bits), the points (64-bit real numbers), and the lists (32 bits).

use std::path::Path;

use vi_mesh::Piece;

use super::index::Index;
use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;

/// Returns the bytes of a piece.
pub(super) fn encode(piece: &Piece) -> Vec<u8> {
    let lists = [&piece.elements, &piece.corners, &piece.nodes];
    let counts = [&piece.nodes].into_iter().chain(&piece.regions).map(|list| list.len() as u64);
    let mut bytes: Vec<u8> = counts.flat_map(u64::to_le_bytes).collect();
    let numbers = |list: &Vec<u32>, bytes: &mut Vec<u8>| {
        bytes.extend(list.iter().flat_map(|number| number.to_le_bytes()));
    };
    lists.into_iter().for_each(|list| numbers(list, &mut bytes));
    bytes.extend(piece.points.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    piece.regions.iter().for_each(|list| numbers(list, &mut bytes));
    bytes
}

/// Returns piece number `number` of an index.
///
/// # Errors
/// Returns the fault in the bytes.
pub(super) fn decode(bytes: &[u8], file: &Path, (index, number): (&Index, usize)) -> Result<Piece, IoError> {
    let mut cursor = Cursor::new(bytes, file);
    cursor.encoding = Encoding::Little;
    let count = |cursor: &mut Cursor, what: &str| {
        let count = cursor.size(what)?;
        cursor.count(count, 4, what)
    };
    let node_count = count(&mut cursor, "nodes")?;
    let regions = &index.pieces.regions;
    let lengths = regions.iter().map(|(name, _)| count(&mut cursor, name)).collect::<Result<Vec<_>, _>>()?;
    let element_count = index.pieces.lengths[number];
    let elements = list(&mut cursor, (element_count, index.pieces.element_count()), "elements")?;
    let corner_count = element_count * index.pieces.kind.node_count();
    let corners = list(&mut cursor, (corner_count, node_count), "the nodes of its elements")?;
    let nodes = list(&mut cursor, (node_count, index.node_count), "nodes")?;
    let numbers = cursor.take(24 * node_count, "points")?.as_chunks().0.iter();
    let points: Vec<f64> = numbers.map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let mut members = Vec::with_capacity(regions.len());
    for ((name, dimension), length) in regions.iter().zip(lengths) {
        let below = if *dimension == 3 { index.pieces.element_count() } else { index.node_count };
        members.push(list(&mut cursor, (length, below), name)?);
    }
    if cursor.remaining() > 0 {
        return Err(cursor.inconsistent_at(cursor.position(), "there are bytes behind the last list"));
    }
    Ok(Piece { elements, corners, nodes, points: points.as_chunks().0.to_vec(), regions: members })
}

/// Reads numbers that are all below a bound.
fn list(cursor: &mut Cursor, (count, below): (usize, usize), what: &str) -> Result<Vec<u32>, IoError> {
    let at = cursor.position();
    let bytes = cursor.take(4 * count, what)?.as_chunks().0.iter();
    let numbers: Vec<u32> = bytes.map(|bytes| u32::from_le_bytes(*bytes)).collect();
    match numbers.iter().find(|number| **number as usize >= below) {
        Some(number) => {
            let problem = format!("{what}: {number} is out of range (there are {below})");
            Err(cursor.inconsistent_at(at, problem))
        }
        None => Ok(numbers),
    }
}
