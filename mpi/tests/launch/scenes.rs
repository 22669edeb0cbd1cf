//! Scenes of several tests.

/// The line of [`BLOCK`] that is its shape.
pub(crate) const BOX_OF_BLOCK: &str =
    "box = { size = [1.0, 0.25, 0.25], cells = [24, 6, 6], element = \"tet4\" }\n";

/// The lines of [`BLOCK`] that hold it.
pub(crate) const FIX_OF_BLOCK: &str = "[[fix]]\nbody = \"block\"\nregion = \"x-min\"\n";

/// A rubber block on a clamped end that falls and swings, with every kind of file.
pub(crate) const BLOCK: &str = r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.02
step = 2.5e-4
scheme = "stormer-verlet"
[[body]]
name = "block"
box = { size = [1.0, 0.25, 0.25], cells = [24, 6, 6], element = "tet4" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [1.0, 0.0, 2.0]
[[fix]]
body = "block"
region = "x-min"
[[probe]]
name = "tip"
body = "block"
point = [1.0, 0.125, 0.125]
[output]
interval = 0.01
history = 7
fields = ["displacement", "velocity", "stress", "reaction_force"]
"#;

/// The mesh of [`BRACKET`].
pub(crate) const BRACKET_MESH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../meshes/bracket.msh");

/// A rubber bracket of 11 632 tetrahedra from the file MESH, held at its bolts.
pub(crate) const BRACKET: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 2e-4
step = 1e-5
scheme = "stormer-verlet"
[[body]]
name = "bracket"
mesh = "MESH"
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [1.0, 0.0, 2.0]
[[fix]]
body = "bracket"
region = "bolts"
[output]
interval = 1e-4
history = 7
fields = ["displacement", "velocity", "stress", "reaction_force"]
"#;

/// Cloth of two layers of terms (membrane and bending) that hangs from two corners.
pub(crate) const CLOTH: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 5e-3
step = 1e-4
scheme = "blanes-moan-4"
[[body]]
name = "cloth"
sheet = { size = [1.0, 1.0], cells = [30, 30] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 200.0, thickness = 1e-3 }
[[fix]]
body = "cloth"
box = { min = [-1e-9, -1e-9, -1.0], max = [1e-9, 1.1, 1.0] }
[output]
interval = 2e-3
history = 20
fields = ["displacement", "velocity"]
"#;
