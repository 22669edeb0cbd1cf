//! Reads nodes and elements in the layout of MSH 2.

use super::reading::{Reading, kind_of};
use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;
use crate::tags::TagIndex;

pub(super) fn nodes(cursor: &mut Cursor, reading: &mut Reading) -> Result<(), IoError> {
    let announced: u64 = cursor.text_number("the number of nodes")?;
    let bytes_each = if cursor.encoding == Encoding::Text { 8 } else { 28 };
    let count = cursor.count(announced, bytes_each, "nodes")?;
    if cursor.encoding != Encoding::Text {
        cursor.skip_line_end();
    }
    let start = cursor.position();
    let mut tags = Vec::with_capacity(count);
    reading.out.mesh.points.reserve_exact(count);
    for _ in 0..count {
        let at = cursor.start();
        let tag = positive(cursor, "a node tag")?;
        let mut x = [0.0; 3];
        for x in &mut x {
            *x = cursor.real("a node coordinate")?;
        }
        reading.push_point(cursor, at, tag, x)?;
        tags.push(tag);
    }
    reading.node_tags = TagIndex::new(&tags)
        .map_err(|i| cursor.inconsistent_at(start, format!("the node tag {} occurs twice", tags[i])))?;
    Ok(())
}

pub(super) fn elements(cursor: &mut Cursor, reading: &mut Reading) -> Result<(), IoError> {
    let announced: u64 = cursor.text_number("the number of elements")?;
    let text = cursor.encoding == Encoding::Text;
    let count = cursor.count(announced, 8, "elements")?;
    if !text {
        cursor.skip_line_end();
    }
    let mut done = 0;
    while done < count {
        let at = cursor.start();
        // Text has this header on every line, binary data once per run of elements.
        let (code, run, tag_count);
        let mut tag = 0;
        if text {
            tag = positive(cursor, "an element tag")?;
            code = cursor.int("an element type")?;
            run = 1;
            tag_count = cursor.int("the number of tags of an element")?;
        } else {
            code = cursor.int("an element type")?;
            run = cursor.int("a number of elements")?;
            tag_count = cursor.int("the number of tags of an element")?;
        }
        let kind = kind_of(cursor, at, code, tag)?;
        let run = usize::try_from(run).ok().filter(|&run| run > 0 && run <= count - done);
        let run =
            run.ok_or_else(|| cursor.inconsistent_at(at, "a run of elements is longer than their number"))?;
        let tag_count = u64::try_from(tag_count)
            .map_err(|_| cursor.inconsistent_at(at, "the number of tags of an element is negative"))?;
        let tag_count = cursor.count(tag_count, 2, "tags of an element")?;
        for _ in 0..run {
            let at = cursor.start();
            if !text {
                tag = positive(cursor, "an element tag")?;
            }
            let (mut physical, mut entity) = (0, 0);
            for i in 0..tag_count {
                let value = cursor.int("a tag of an element")?;
                match i {
                    0 => physical = value.saturating_abs(),
                    1 => entity = value,
                    _ => {}
                }
            }
            let mut nodes = [0; 27];
            let nodes = &mut nodes[..kind.node_count()];
            for node in nodes.iter_mut() {
                *node = positive(cursor, "a node of an element")?;
            }
            let cell = reading.push_element(cursor, at, kind, tag, nodes)?;
            reading.cell_entities.push(entity);
            if physical != 0 {
                reading.members.entry((kind.dimension(), physical)).or_default().push(cell);
            }
        }
        done += run;
    }
    Ok(())
}

fn positive(cursor: &mut Cursor, what: &str) -> Result<u64, IoError> {
    let at = cursor.start();
    let value = cursor.int(what)?;
    u64::try_from(value).map_err(|_| cursor.inconsistent_at(at, format!("{what} is negative ({value})")))
}
