//! The modes that were found.

use vi_solvers::Mode;

/// A mode and the component that vibrates.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneMode {
    /// Number of the component.
    pub component: usize,
    /// The mode.
    pub mode: Mode,
}

/// The modes of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneModes {
    /// They, by ascending frequency.
    pub modes: Vec<SceneMode>,
    /// Mass of all components that can move along x, y and z, kg; with consistent mass without what couples free
    /// coordinates to held ones.
    pub free_mass: [f64; 3],
}
