//! Disjoint sets of numbers, for parts that are connected.

/// Disjoint sets of the numbers 0 … n − 1. The lowest number of a set represents it, so the result does not depend on
/// the order in which sets are joined.
///
/// ```
/// let mut sets = vi_core::DisjointSets::new(4);
/// sets.join(3, 1);
/// assert_eq!([0, 1, 2, 3].map(|number| sets.root(number)), [0, 1, 2, 1]);
/// ```
#[derive(Debug, Clone)]
pub struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// Returns `count` sets of one number each.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// Returns the lowest number of the set to which `number` belongs.
    ///
    /// # Panics
    /// Panics if there is no such number.
    pub fn root(&mut self, mut number: u32) -> u32 {
        let Self(parent) = self;
        while parent[number as usize] != number {
            parent[number as usize] = parent[parent[number as usize] as usize];
            number = parent[number as usize];
        }
        number
    }

    /// Joins the sets to which `a` and `b` belong.
    ///
    /// # Panics
    /// Panics if there are no such numbers.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
