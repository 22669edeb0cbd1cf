//! Scenes of the invariance tests, without `[time]`.

/// A block clamped by a box, under weight, a traction with an amplitude, and a point load.
pub(crate) const SOLID: &str = r#"
gravity = [0.0, -9.81, 0.0]
[[body]]
name = "beam"
box = { size = [1.0, 0.25, 0.25], cells = [4, 1, 1], element = "tet4", origin = [0.1, 0.2, 0.3] }
material = { law = "neo-hookean", young = 2e5, poisson = 0.3, density = 900.0 }
[[fix]]
body = "beam"
box = { min = [0.1, 0.2, 0.3], max = [0.1, 0.45, 0.55] }
[[load]]
kind = "traction"
body = "beam"
region = "x-max"
traction = ["50*x", 20.0, "1e2*(y + z)"]
amplitude = "min(3*t, 1)"
[[load]]
kind = "point"
body = "beam"
point = [1.1, 0.2, 0.3]
force = [0.0, 0.0, 3.0]
amplitude = [[0.0, 0.0], [0.01, 1.0]]
"#;

/// A sheet with bending stiffness, held at a corner and thrown.
pub(crate) const SHEET: &str = r#"
gravity = [0.0, 0.0, -9.81]
[[body]]
name = "cloth"
sheet = { size = [1.0, 0.8], cells = [3, 3], pattern = "random" }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 400.0, thickness = 5e-3 }
velocity = [0.3, 0.0, 1.0]
[[fix]]
body = "cloth"
region = "x-min-y-min"
[[fix]]
body = "cloth"
region = "x-max-y-min"
"#;

/// Two blocks and a fixed point, joined by springs; one block spins.
pub(crate) const SPRINGS: &str = r#"
[[body]]
name = "one"
box = { size = [0.5, 0.5, 0.5], cells = [1, 1, 1], element = "hex8" }
material = { law = "corotated", young = 1e5, poisson = 0.3, density = 1000.0 }
angular_velocity = [1.0, 2.0, 0.5]
[[body]]
name = "two"
box = { size = [0.5, 0.5, 0.5], cells = [1, 1, 1], element = "hex20", origin = [0.0, 0.0, 1.0] }
material = { law = "stable-neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
[[spring]]
from = { body = "one", point = [0.5, 0.5, 0.5] }
to = { body = "two", point = [0.5, 0.5, 1.0] }
stiffness = 2e3
length = 0.4
[[spring]]
from = { body = "one", node = 0 }
to = { point = [0.0, 0.0, -0.5] }
stiffness = 1e3
[[spring]]
from = { body = "two", node = 1 }
to = { point = [0.0, 1.0, 1.5] }
stiffness = 1e3
[[fix]]
body = "two"
region = "z-max"
"#;

/// Sheets sewn to each other exactly. One is attached exactly to a held block, the other by springs.
pub(crate) const TIES: &str = r#"
gravity = [0.0, -9.81, 0.0]
[[body]]
name = "block"
box = { size = [1.0, 1.0, 0.5], cells = [2, 2, 1], element = "hex8", origin = [-1.0, 0.0, -0.25] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 100.0 }
[[body]]
name = "left"
sheet = { size = [0.5, 1.0], cells = [2, 3] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, area_density = 0.5, thickness = 1e-2 }
[[body]]
name = "right"
sheet = { size = [0.5, 1.0], cells = [2, 2], origin = [0.5, 0.0, 0.0] }
material = { law = "orthotropic", young_warp = 1e5, young_weft = 5e4, poisson = 0.2, shear = 1e4, area_density = 0.5, thickness = 1e-2 }
[[attach]]
body = "left"
region = "x-min"
to = "block"
[[seam]]
body = "left"
region = "x-max"
to = "right"
to_region = "x-min"
[[attach]]
body = "right"
region = "x-max"
stiffness = 200.0
[[fix]]
body = "block"
region = "x-min"
"#;

/// A chain of rigid bodies with every kind of joint, and a soft block at its end.
pub(crate) const RIGID: &str = r#"
gravity = [0.0, -9.81, 0.0]
[[rigid]]
name = "arm"
mass = 2.0
shape = { kind = "rod", length = 1.0, radius = 0.02 }
position = [0.5, 0.0, 0.0]
[[rigid]]
name = "plate"
density = 500.0
shape = { kind = "box", size = [0.5, 0.1, 0.3] }
position = [1.25, 0.0, 0.0]
orientation = { axis = [0.0, 1.0, 0.0], angle = 0.3 }
[[rigid]]
name = "ball"
mass = 0.5
inertia = [0.01, 0.012, 0.015]
position = [1.5, -0.5, 0.0]
[[rigid]]
name = "plug"
mass = 0.2
inertia = [0.001, 0.001, 0.001]
position = [1.5, -0.7, 0.0]
[[joint]]
kind = "hinge"
body = "arm"
point = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
[[joint]]
kind = "ball"
body = "plate"
to = "arm"
point = [1.0, 0.0, 0.0]
[[joint]]
kind = "distance"
body = "ball"
to = "plate"
point = [1.5, -0.4, 0.0]
to_point = [1.4, 0.0, 0.0]
[[joint]]
kind = "weld"
body = "plug"
to = "ball"
[[body]]
name = "bob"
box = { size = [0.2, 0.2, 0.2], cells = [1, 1, 1], element = "hex8", origin = [1.4, -1.0, -0.1] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 500.0 }
[[attach]]
body = "bob"
region = "y-max"
to = "plug"
"#;
