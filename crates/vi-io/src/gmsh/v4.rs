//! Reads entities, nodes and elements in the layout of MSH 4.1. Text and binary data hold the same numbers in the same
//! order.

use super::reading::{Reading, kind_of};
use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;
use crate::tags::TagIndex;
use vi_mesh::CellKind;

/// Returns the least number of bytes per number: a digit and a separator, or four binary bytes.
fn number_bytes(cursor: &Cursor) -> usize {
    if cursor.encoding == Encoding::Text { 2 } else { 4 }
}

/// Reads geometric entities for their physical tags. Those of a partitioned mesh also name their parent.
pub(super) fn entities(cursor: &mut Cursor, reading: &mut Reading, partitioned: bool) -> Result<(), IoError> {
    let least = number_bytes(cursor);
    if partitioned {
        cursor.size("the number of partitions")?;
        let announced = cursor.size("the number of ghost entities")?;
        for _ in 0..2 * cursor.count(announced, 2 * least, "ghost entities")? {
            cursor.int("a ghost entity")?;
        }
    }
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = cursor.size("the number of geometric entities")?;
    }
    for (dimension, &announced) in counts.iter().enumerate() {
        // At least a tag, a point or a box, and the number of physical tags.
        for _ in 0..cursor.count(announced, 5 * least, "geometric entities")? {
            let tag = cursor.int("the tag of an entity")?;
            if partitioned {
                cursor.int("the dimension of a parent entity")?;
                cursor.int("the tag of a parent entity")?;
                skip_ints(cursor, "partitions of an entity")?;
            }
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                cursor.real("the bounding box of an entity")?;
            }
            let announced = cursor.size("the number of physical tags")?;
            let mut physical = Vec::new();
            for _ in 0..cursor.count(announced, least, "physical tags")? {
                physical.push(cursor.int("a physical tag")?.saturating_abs());
            }
            physical.sort_unstable();
            physical.dedup();
            if dimension > 0 {
                skip_ints(cursor, "bounding entities")?;
            }
            if !physical.is_empty() {
                reading.entities.insert((dimension, tag), physical);
            }
        }
    }
    Ok(())
}

fn skip_ints(cursor: &mut Cursor, what: &str) -> Result<(), IoError> {
    let announced = cursor.size(what)?;
    for _ in 0..cursor.count(announced, number_bytes(cursor), what)? {
        cursor.int(what)?;
    }
    Ok(())
}

pub(super) fn nodes(cursor: &mut Cursor, reading: &mut Reading) -> Result<(), IoError> {
    let least = number_bytes(cursor);
    let start = cursor.position();
    let announced_blocks = cursor.size("the number of node blocks")?;
    let announced = cursor.size("the number of nodes")?;
    cursor.size("the least node tag")?;
    cursor.size("the greatest node tag")?;
    let block_count = cursor.count(announced_blocks, 4 * least, "node blocks")?;
    let count = cursor.count(announced, 4 * least, "nodes")?;
    let mut tags: Vec<u64> = Vec::with_capacity(count);
    reading.out.mesh.points.reserve_exact(count);
    for _ in 0..block_count {
        let at = cursor.start();
        let dimension = cursor.int("the dimension of an entity")?;
        cursor.int("the tag of an entity")?;
        let parametric = cursor.int("whether nodes are parametric")?;
        let announced = cursor.size("the number of nodes in a block")?;
        let in_block = cursor.count(announced, 4 * least, "nodes in a block")?;
        if in_block > count - tags.len() {
            return Err(cursor
                .inconsistent_at(at, format!("the node blocks hold more than the {count} nodes announced")));
        }
        for _ in 0..in_block {
            let tag = cursor.size("a node tag")?;
            tags.push(tag);
        }
        let parameters = if parametric == 0 { 0 } else { dimension.clamp(0, 3) };
        for i in tags.len() - in_block..tags.len() {
            let at = cursor.start();
            let mut x = [0.0; 3];
            for x in &mut x {
                *x = cursor.real("a node coordinate")?;
            }
            for _ in 0..parameters {
                cursor.real("a node parameter")?;
            }
            reading.push_point(cursor, at, tags[i], x)?;
        }
    }
    if tags.len() != count {
        let what = format!("the node blocks hold {} nodes, {count} were announced", tags.len());
        return Err(cursor.inconsistent_at(start, what));
    }
    reading.node_tags = TagIndex::new(&tags)
        .map_err(|i| cursor.inconsistent_at(start, format!("the node tag {} occurs twice", tags[i])))?;
    Ok(())
}

pub(super) fn elements(cursor: &mut Cursor, reading: &mut Reading) -> Result<(), IoError> {
    let least = number_bytes(cursor);
    let start = cursor.position();
    let announced_blocks = cursor.size("the number of element blocks")?;
    let announced = cursor.size("the number of elements")?;
    cursor.size("the least element tag")?;
    cursor.size("the greatest element tag")?;
    let block_count = cursor.count(announced_blocks, 4 * least, "element blocks")?;
    let count = cursor.count(announced, 2 * least, "elements")?;
    // Memberships are the product of the tags of an entity and its elements, so they too are bounded by the file size.
    let mut memberships_left = cursor.remaining();
    let mut done = 0;
    for _ in 0..block_count {
        let at = cursor.start();
        let dimension = cursor.int("the dimension of an entity")?;
        let entity = cursor.int("the tag of an entity")?;
        let code = cursor.int("an element type")?;
        let announced = cursor.size("the number of elements in a block")?;
        let in_block = cursor.count(announced, 2 * least, "elements in a block")?;
        if in_block > count - done {
            return Err(cursor.inconsistent_at(
                at,
                format!("the element blocks hold more than the {count} elements announced"),
            ));
        }
        let kind: CellKind = kind_of(cursor, at, code, 0)?;
        let first = reading.cell_tags.len() as u32;
        for _ in 0..in_block {
            let at = cursor.start();
            let tag = cursor.size("an element tag")?;
            let mut nodes = [0; 27];
            let nodes = &mut nodes[..kind.node_count()];
            for node in nodes.iter_mut() {
                *node = cursor.size("a node of an element")?;
            }
            reading.push_element(cursor, at, kind, tag, nodes)?;
        }
        done += in_block;
        let physical =
            usize::try_from(dimension).ok().and_then(|dimension| reading.entities.get(&(dimension, entity)));
        for &physical in physical.into_iter().flatten() {
            memberships_left = memberships_left.checked_sub(in_block).ok_or_else(|| {
                cursor.unsupported_at(
                    at,
                    "so many physical groups on each element",
                    "put elements into fewer groups",
                )
            })?;
            let cells = reading.members.entry((kind.dimension(), physical)).or_default();
            cells.extend(first..first + in_block as u32);
        }
    }
    if done != count {
        return Err(cursor.inconsistent_at(
            start,
            format!("the element blocks hold {done} elements, {count} were announced"),
        ));
    }
    Ok(())
}
