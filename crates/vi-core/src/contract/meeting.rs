//! Nodes that a path would bring together.

/// Nodes that meet on a straight path of all nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    /// The nodes; the last one is repeated if there are fewer.
    pub nodes: [u32; 4],
    /// The fraction of the path that they may move, in [0, 1).
    pub part: f64,
    /// The distance between neighbouring nodes of the surface that meets, m; zero if there is no surface.
    pub size: f64,
}
