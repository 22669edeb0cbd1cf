//! Errors of contact surfaces.

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A node number that has no rest position.
    #[error("contact surface: node {node} does not exist (there are {count} rest positions)")]
    Node {
        /// The node.
        node: u32,
        /// Nodes that there are.
        count: usize,
    },
    /// A node that two bodies claim.
    #[error(
        "contact surface: node {node} belongs to bodies {first} and {second}; give each body its own nodes"
    )]
    Shared {
        /// The node.
        node: u32,
        /// The body that had it first.
        first: u32,
        /// The body that wants it too.
        second: u32,
    },
    /// A number outside its domain.
    #[error("contact of body {body}: {quantity} is {value}, but {domain}")]
    Value {
        /// The body.
        body: u32,
        /// Name of the quantity, e.g. "distance".
        quantity: &'static str,
        /// Value found.
        value: f64,
        /// The domain in words.
        domain: &'static str,
    },
    /// A cell without extent at rest.
    #[error(
        "contact of body {body}: the cell of nodes {nodes:?} has no extent at rest; remove it or part its nodes"
    )]
    Degenerate {
        /// The body.
        body: u32,
        /// Nodes concerned.
        nodes: Vec<u32>,
    },
}
