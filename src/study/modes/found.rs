//! Computed modes of a scene.

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
    /// The modes, by ascending frequency.
    pub modes: Vec<SceneMode>,
    /// Mass of all components that can move along x, y and z, kg. With consistent mass it excludes the coupling of
    /// free and held coordinates.
    pub free_mass: [f64; 3],
}
