//! Defines the error type of this crate.

/// Describes an invalid contact surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A node number has no rest position.
    #[error("contact surface: node {node} does not exist (there are {count} rest positions)")]
    Node {
        /// The node.
        node: u32,
        /// The number of rest positions.
        count: usize,
    },
    /// Two bodies contain the same node.
    #[error(
        "contact surface: node {node} belongs to bodies {first} and {second}; give each body its own nodes"
    )]
    Shared {
        /// The node.
        node: u32,
        /// The body that had the node first.
        first: u32,
        /// The second body with this node.
        second: u32,
    },
    /// A number lies outside its domain.
    #[error("contact of body {body}: {quantity} is {value}, but {domain}")]
    Value {
        /// The body.
        body: u32,
        /// Name of the quantity, e.g. "distance".
        quantity: &'static str,
        /// The value that was given.
        value: f64,
        /// The domain, in words.
        domain: &'static str,
    },
    /// A cell has no extent at rest.
    #[error(
        "contact of body {body}: the cell of nodes {nodes:?} has no extent at rest; remove it or give its nodes different positions"
    )]
    Degenerate {
        /// The body.
        body: u32,
        /// The nodes of the cell.
        nodes: Vec<u32>,
    },
}
