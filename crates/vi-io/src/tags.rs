//! Maps the tags that a file gives to nodes and elements (any numbers, in any order) to indices of arrays.

use std::collections::HashMap;

/// The index of each tag.
#[derive(Default)]
pub(crate) struct TagIndex {
    /// Index by tag, or `NONE`; used while tags are dense.
    table: Vec<u32>,
    /// Tags too large for the table.
    others: HashMap<u64, u32>,
}

const NONE: u32 = u32::MAX;

impl TagIndex {
    /// Maps tag `tags[i]` to index `i`.
    ///
    /// # Errors
    /// Returns the index of the second occurrence of a tag.
    pub(crate) fn new(tags: &[u64]) -> Result<Self, usize> {
        let mut index = Self::with_room(tags.len());
        for (place, &tag) in tags.iter().enumerate() {
            if index.insert(tag, place as u32).is_some() {
                return Err(place);
            }
        }
        Ok(index)
    }

    /// Maps tags like `new`, but keeps the first index of a tag that occurs twice.
    pub(crate) fn with_first_of_copies(tags: &[u64]) -> Self {
        let mut index = Self::with_room(tags.len());
        for (place, &tag) in tags.iter().enumerate().rev() {
            index.insert(tag, place as u32);
        }
        index
    }

    pub(crate) fn get(&self, tag: u64) -> Option<u32> {
        match self.table.get(tag as usize) {
            Some(&place) => (place != NONE).then_some(place),
            None => self.others.get(&tag).copied(),
        }
    }

    fn with_room(count: usize) -> Self {
        Self { table: vec![NONE; 2 * count + 1], others: HashMap::new() }
    }

    fn insert(&mut self, tag: u64, place: u32) -> Option<u32> {
        match self.table.get_mut(tag as usize) {
            Some(entry) => {
                let before = std::mem::replace(entry, place);
                (before != NONE).then_some(before)
            }
            None => self.others.insert(tag, place),
        }
    }
}
