"""The keys of scenes, made from the schema by make_keys.py: do not edit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypedDict, Union

from numpy.typing import NDArray

Numbers = Union[Sequence[float], NDArray[Any]]

class Assert(TypedDict, total=False):
    angular_momentum_drift: Union[float, None]
    """Largest change of angular momentum over the largest Σ m|x||v| (free bodies without gravity)."""
    energy_drift: Union[float, None]
    """Largest |H − H₀ − work of moving supports, forces and damping| over the largest kinetic energy."""
    intersections: Union[int, None]
    """Largest number allowed of edges that cross triangles of other bodies or of the same body, and of points within half-spaces, in any row of history.csv, found by exact predicates (needs `[contact]`). Bodies with prescribed motion count."""
    momentum_drift: Union[float, None]
    """Largest change of linear momentum over the largest Σ m|v| (free bodies without gravity)."""
    smallest_gap: Union[float, None]
    """Smallest gap allowed between surfaces in contact, at the start and after every step, m (≥ 0, needs `[contact]`). Surfaces that cross in a row of history.csv have none, those of bodies with prescribed motion too."""

class BoxRegion(TypedDict, total=False):
    max: Numbers
    """Largest coordinates, m; inf along an axis without an upper bound (default: all axes)."""
    min: Numbers
    """Smallest coordinates, m; -inf along an axis without a lower bound (default: all axes)."""

class Motion0(TypedDict, total=False):
    end: Union[float, None]
    """Time when the motion stops, s; default never."""
    kind: Literal['translate']
    start: float
    """Time when the motion starts, s; default 0."""
    velocity: Numbers
    """Velocity, m/s."""

class Motion1(TypedDict, total=False):
    axis: Numbers
    """Direction of the axis, of any length but zero. A positive rate turns right-handed about it."""
    end: Union[float, None]
    """Time when the motion stops, s; default never."""
    kind: Literal['rotate']
    point: Numbers
    """A point on the axis, m; default the origin."""
    rate: float
    """Angular velocity, rad/s."""
    start: float
    """Time when the motion starts, s; default 0."""

class Motion2(TypedDict, total=False):
    amplitude: Numbers
    """Amplitude along x, y and z, m."""
    end: Union[float, None]
    """Time when the motion stops, s; default never."""
    frequency: float
    """Frequency f, Hz; positive."""
    kind: Literal['sine']
    phase: float
    """Phase φ, rad; default 0. The displacement starts from zero for every φ."""
    start: float
    """Time when the motion starts, s; default 0."""

class Motion3(TypedDict, total=False):
    displacements: Sequence[Numbers]
    """Displacements, m, one per time."""
    kind: Literal['table']
    times: Numbers
    """Times, s; increasing."""

Motion = Union[Motion0, Motion1, Motion2, Motion3]

class PlaneRegion(TypedDict, total=False):
    distance: Union[float, None]
    """Largest distance of a node from the plane, m (≥ 0; default: 1e-6 of the body's extent)."""
    normal: Numbers
    """Normal, of any length but zero."""
    point: Numbers
    """A point of the plane, m."""

class SphereRegion(TypedDict, total=False):
    centre: Numbers
    """Centre, m."""
    radius: float
    """Radius, m (> 0)."""

class Attach(TypedDict, total=False):
    body: str
    """The body whose nodes are attached."""
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    length: Union[float, None]
    """Length L of a spring without force, m (≥ 0; default: the initial distance)."""
    motion: Union[Motion, None]
    """Motion of the points in space, without `to` (default: at rest)."""
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    region: Union[str, None]
    """A named region of its mesh …"""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""
    stiffness: Union[float, None]
    """Stiffness k of each node's spring, N/m (> 0). Without it the nodes, which must lie on the surface `to`, are held there exactly."""
    surface: Union[str, None]
    """A surface region of that body (default: its whole boundary)."""
    to: Union[str, None]
    """The body to whose surface they are attached; without it, they are attached to points in space."""

class BoxMesh(TypedDict, total=False):
    cells: Numbers
    """Cells along x, y, z; at least 1 each."""
    element: Literal['tet4', 'tet10', 'hex8', 'hex20', 'hex27', 'wedge6', 'wedge15', 'wedge18', 'pyramid5']
    """The kind of element. A cell is one hexahedron, 2 wedges or 6 tetrahedra. A mesh that is no body may also have 6 pyramids per cell."""
    origin: Numbers
    """The corner of smallest coordinates, m."""
    size: Numbers
    """Extents along x, y, z, m; positive."""

FieldComponent = Union[float, str]

LockingCure = Union[Literal['none'], Literal['mean-dilation']]

class Law0(TypedDict, total=False):
    density: float
    """Density ρ of the body at rest, kg/m³; positive."""
    law: Literal['linear']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    young: float
    """Young's modulus E, Pa; positive."""

class Law1(TypedDict, total=False):
    density: float
    """Density ρ of the body at rest, kg/m³; positive."""
    law: Literal['st-venant-kirchhoff']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    young: float
    """Young's modulus E, Pa; positive."""

class Law2(TypedDict, total=False):
    density: float
    """Density ρ of the body at rest, kg/m³; positive."""
    law: Literal['neo-hookean']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    young: float
    """Young's modulus E, Pa; positive."""

class Law3(TypedDict, total=False):
    density: float
    """Density ρ of the body at rest, kg/m³; positive."""
    law: Literal['stable-neo-hookean']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    young: float
    """Young's modulus E, Pa; positive."""

class Law4(TypedDict, total=False):
    density: float
    """Density ρ of the body at rest, kg/m³; positive."""
    law: Literal['corotated']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    young: float
    """Young's modulus E, Pa; positive."""

class Law5(TypedDict, total=False):
    bulk: float
    """Bulk modulus κ, Pa; positive."""
    c01: float
    """c₀₁, Pa; not negative."""
    c10: float
    """c₁₀, Pa; the shear modulus μ = 2 (c₁₀ + c₀₁) must be positive."""
    density: float
    """Density ρ of the body at rest, kg/m³; positive."""
    law: Literal['mooney-rivlin']

class Law6(TypedDict, total=False):
    constants: dict[str, Any]
    """Named constants of the formula, in the units that it needs."""
    density: float
    """Density ρ of the body at rest, kg/m³; positive."""
    energy: str
    """Ψ, J/m³ of the body at rest: a formula of I1 = tr C, I2 = (I1² − tr C²)/2 and J = det F, with C = FᵀF, and of the constants. It is zero and has no stress at rest (I1 = I2 = 3, J = 1). It may use `+ - * / ^ ( )`, `pi` and `sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs min max pow`."""
    law: Literal['formula']

Law = Union[Law0, Law1, Law2, Law3, Law4, Law5, Law6]

Bending = Union[Literal['none'], Literal['hinge'], Literal['quadratic'], Literal['shell']]

class SheetLaw0(TypedDict, total=False):
    area_density: Union[float, None]
    """Mass per area at rest, kg/m²; give this or `density`."""
    bending: Bending
    """The model of the resistance to bending."""
    density: Union[float, None]
    """Density ρ at rest, kg/m³; give this or `area_density`."""
    law: Literal['st-venant-kirchhoff']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    tension_field: bool
    """Whether wrinkles smaller than the elements relax compression."""
    thickness: float
    """Thickness h, m; positive."""
    young: float
    """Young's modulus E, Pa; positive."""

class SheetLaw1(TypedDict, total=False):
    area_density: Union[float, None]
    """Mass per area at rest, kg/m²; give this or `density`."""
    bending: Bending
    """The model of the resistance to bending."""
    density: Union[float, None]
    """Density ρ at rest, kg/m³; give this or `area_density`."""
    law: Literal['neo-hookean']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    tension_field: bool
    """Whether wrinkles smaller than the elements relax compression."""
    thickness: float
    """Thickness h, m; positive."""
    young: float
    """Young's modulus E, Pa; positive."""

class SheetLaw2(TypedDict, total=False):
    area_density: Union[float, None]
    """Mass per area at rest, kg/m²; give this or `density`."""
    bending: Bending
    """The model of the resistance to bending."""
    density: Union[float, None]
    """Density ρ at rest, kg/m³; give this or `area_density`."""
    law: Literal['corotated']
    poisson: float
    """Poisson's ratio ν, dimensionless; in (−1, ½)."""
    tension_field: bool
    """Whether wrinkles smaller than the elements relax compression."""
    thickness: float
    """Thickness h, m; positive."""
    young: float
    """Young's modulus E, Pa; positive."""

DirectionComponent = Union[float, str]

class CellDirection(TypedDict, total=False):
    cell_data: str
    """Name of the cell array, of three components."""

Direction = Union[Numbers, Sequence[DirectionComponent], CellDirection]

class SheetLaw3(TypedDict, total=False):
    area_density: Union[float, None]
    """Mass per area at rest, kg/m²; give this or `density`."""
    bending: Bending
    """The model of the resistance to bending."""
    density: Union[float, None]
    """Density ρ at rest, kg/m³; give this or `area_density`."""
    law: Literal['orthotropic']
    poisson: float
    """Poisson's ratio ν₁₂, the contraction of the weft under tension along the warp; ν₁₂² < E₁/E₂."""
    shear: float
    """Shear modulus G between warp and weft, Pa; positive."""
    tension_field: bool
    """Whether wrinkles smaller than the elements relax compression."""
    thickness: float
    """Thickness h, m; positive."""
    warp: Direction
    """Direction of the warp on the sheet at rest (default: along x)."""
    young_warp: float
    """Young's modulus E₁ along the warp, Pa; positive."""
    young_weft: float
    """Young's modulus E₂ along the weft, Pa; positive."""

SheetLaw = Union[SheetLaw0, SheetLaw1, SheetLaw2, SheetLaw3]

Substance = Union[Law, SheetLaw]

Materials = Union[Substance, Sequence[Any]]

Axis = Union[Literal['x'], Literal['y'], Literal['z']]

class RefineAlong(TypedDict, total=False):
    axes: Sequence[Axis]
    """The global axes along which elements are halved, one or two. With two, the body is extruded along the third axis; with one, along this axis. Each edge of an element is parallel or normal to the axis of extrusion."""
    levels: int
    """Number of refinements (0 to 6)."""

Refine = Union[int, RefineAlong]

RestShape = Union[Literal['mesh'], Literal['flat']]

SheetPattern = Union[Literal['diagonal'], Literal['cross'], Literal['random']]

class SheetMesh(TypedDict, total=False):
    cells: Numbers
    """Cells along the two directions; at least 1 each."""
    directions: Sequence[Numbers]
    """The directions of the two extents in space: of any length, at a right angle. The normal is their cross product."""
    origin: Numbers
    """The corner `x-min`, `y-min`, m."""
    pattern: SheetPattern
    """The pattern by which cells are cut into triangles."""
    seed: int
    """The seed of the mesh for `pattern = 'random'`; the same seed gives the same mesh."""
    size: Numbers
    """Extents along the two directions, m; positive."""

class Body(TypedDict, total=False):
    angular_velocity: Union[Numbers, None]
    """Initial angular velocity about the centre of mass, rad/s."""
    box: Union[BoxMesh, None]
    """A box, instead of a mesh. Regions: `box`, `x-min`, `x-max`, `y-min` … `z-max`."""
    displacement: Union[Sequence[FieldComponent], None]
    """Initial displacement, m: numbers, or formulas of x y z, the rest position (m). It is added to that of the mesh file."""
    locking: LockingCure
    """Treatment of a solid's locking near incompressibility (default none). `mean-dilation` gives each element one volume ratio, for hex8 and wedge6 with ν near ½; it has no effect on tet4."""
    material: Materials
    """Material: one, or a list by region. The material of a sheet has `thickness`."""
    mesh: Any
    """Mesh file (.msh, .vtk, .vtu, .vtp, .inp, .obj, .stl), relative to the scene file: volume cells for a solid, triangles for a sheet. Its point data `displacement` (m) and `velocity` (m/s) are the initial state. For a sheet, quadrilaterals are cut into triangles, coincident points welded, triangles oriented consistently, and points without a triangle removed, each with a note; nodes are numbered after that."""
    name: str
    """Name by which fixes, probes and springs refer to the body."""
    order: Union[int, None]
    """2: replace a solid's linear elements by quadratic ones (tet10, hex20, wedge15), with straight edges except where the mesh has curved ones; elements that are quadratic are kept (default 1: as in the mesh)."""
    part: Union[str, None]
    """Use only this group of the mesh file: a volume group for a solid, a surface group for a sheet."""
    refine: Union[Refine, None]
    """Halve every element this many times (0 to 6; default 0): into 8 smaller ones per volume, 4 per triangle. To halve along some axes alone, write `{ axes = ['x', 'y'], levels = 2 }`. Nodes keep their numbers, and regions cover the same part of the body."""
    rest: Union[RestShape, None]
    """Shape of a sheet at rest (default: that of its mesh)."""
    scale: Union[float, None]
    """Scale factor of the mesh coordinates, e.g. 0.001 for a mesh in millimetres (> 0)."""
    sheet: Union[SheetMesh, None]
    """A rectangle of cloth or shell, instead of a mesh. Regions: `sheet`, `x-min`, `x-max`, `y-min`, `y-max`, and the corners `x-min-y-min` … `x-max-y-max`."""
    translate: Union[Numbers, None]
    """Translation of the mesh after scaling, m."""
    uv_scale: Union[float, None]
    """Length of a unit of texture coordinates, m (> 0; default: the unit of the file), for rest = 'flat'."""
    velocity: Union[Sequence[FieldComponent], None]
    """Initial velocity, m/s: numbers, or formulas of x y z, the rest position (m). It is added to that of the mesh file."""
    weld: Union[float, None]
    """Distance below which points of a sheet's mesh file are welded, m (≥ 0; default: 1e-9 of its extent)."""

class Checkpoints(TypedDict, total=False):
    interval: float
    """Simulated time between checkpoints, s (> 0); each is written at the nearest step. Further ones are written at the start, and at the state at which Ctrl-C or a failed step ends the run."""
    keep: int
    """Number of checkpoints kept, the newest ones (≥ 1; default 2, so that one is left if the newest is damaged)."""

class ContactPair(TypedDict, total=False):
    between: Sequence[str]
    """Names of both bodies."""
    damping: Union[float, None]
    """Time constant of contact damping, s (≥ 0)."""
    distance: Union[float, None]
    """Gap d̂ below which the surfaces press on each other, m (> 0)."""
    friction: Union[float, None]
    """Coulomb's coefficient of friction (≥ 0)."""
    stiffness: Union[float, None]
    """Modulus κ of the layer between the surfaces, Pa (> 0)."""

class Contact(TypedDict, total=False):
    damping: float
    """Time constant of contact damping, s (≥ 0, default 0); without it a bouncing body never comes to rest."""
    distance: Union[float, None]
    """Gap d̂ below which surfaces press on each other, m (> 0; default: a tenth of the median edge of the finer surface; for a sheet at most its thickness)."""
    exclude: Sequence[Sequence[str]]
    """Pairs of bodies without contact; a pair of one body excludes its contact with itself."""
    friction: float
    """Coulomb's coefficient of friction (≥ 0, default 0)."""
    pair: Sequence[ContactPair]
    """Values for pairs of bodies."""
    resolve: bool
    """Separate bodies that touch or cross at the start (default false): they are translated as a whole, by the shortest way found, and report.json gives the distance. Without it such a start is refused."""
    self: bool
    """Whether bodies have contact with themselves (default true)."""
    stiffness: Union[float, None]
    """Modulus κ of the layer between surfaces, Pa (> 0; default: a tenth of Young's modulus of the softer side)."""

class Damping(TypedDict, total=False):
    bulk_viscosity: float
    """Kelvin–Voigt bulk viscosity ζ, Pa s."""
    mass_rate: float
    """Rayleigh's α, 1/s: f = −α m v, a drag that slows rigid motion too."""
    shear_viscosity: float
    """Kelvin–Voigt shear viscosity η, Pa s: S = 2η Ė + ζ tr(Ė) I in the material frame."""
    stiffness_time: float
    """Rayleigh's β, s: viscosities β μ and β λ of each material; rigid motion is not damped."""

class About(TypedDict, total=False):
    axis: Union[Numbers, None]
    """The axis of the cylinder, of any length but zero; without it, `about` is a sphere."""
    point: Numbers
    """The centre of the sphere, or a point on the axis of the cylinder, m (default: the origin)."""

LocalAxis = Union[Literal['normal'], Literal['tangent'], Literal['radial'], Literal['hoop'], Literal['axial']]

HeldAxis = Union[Axis, LocalAxis, Numbers]

class Fix(TypedDict, total=False):
    about: Union[About, None]
    """The cylinder or sphere for 'radial', 'hoop' and 'axial'."""
    axes: Sequence[HeldAxis]
    """Directions that are held (default: `['x', 'y', 'z']`): global axes 'x', 'y', 'z'; 'normal' and 'tangent' of the selected surface; 'radial', 'hoop', 'axial' of the cylinder `about`, 'radial' and 'tangent' of the sphere; or vectors such as `[1.0, 1.0, 0.0]`. All refer to the body at rest."""
    body: str
    """The body."""
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    motion: Any
    """Prescribed motion (default: at rest)."""
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    region: Union[str, None]
    """A named region of its mesh …"""
    rotation: bool
    """Clamp a sheet: hold the normal at its boundary edges between these nodes as in the mesh."""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""
    symmetry: bool
    """The nodes lie in a mirror plane, whose normal is the one direction in `axes`: boundary edges of a sheet between them bend as if the sheet continued as its mirror image. (A solid needs only `axes`.)"""

Amplitude = Union[float, str, Sequence[Numbers]]

GuardAction = Union[Literal['off'], Literal['warn'], Literal['halve'], Literal['switch'], Literal['stop']]

class Guard(TypedDict, total=False):
    action: GuardAction
    """Response of the guard."""
    bound: float
    """Largest growth allowed (> 0, default 1e-2), relative to the exchange: the largest energy given to motion and deformation by the initial state, by weight and by work."""

class Joint0(TypedDict, total=False):
    body: str
    """The rigid body."""
    kind: Literal['ball']
    point: Numbers
    """The point at the start, m."""
    to: Union[str, None]
    """The other body (default: the world)."""

class Joint1(TypedDict, total=False):
    axis: Numbers
    """Direction at the start, of any length but zero."""
    body: str
    """The rigid body."""
    kind: Literal['hinge']
    point: Numbers
    """A point of the line at the start, m."""
    to: Union[str, None]
    """The other body (default: the world)."""

class Joint2(TypedDict, total=False):
    body: str
    """The rigid body."""
    kind: Literal['weld']
    point: Union[Numbers, None]
    """A point of both at the start, m (default: the centre of `body`)."""
    to: Union[str, None]
    """The other body (default: the world)."""

class Joint3(TypedDict, total=False):
    body: str
    """The rigid body."""
    kind: Literal['distance']
    point: Numbers
    """The point of `body` at the start, m."""
    to: Union[str, None]
    """The other body (default: the world)."""
    to_point: Numbers
    """The point of `to` at the start, m."""

Joint = Union[Joint0, Joint1, Joint2, Joint3]

class Load0(TypedDict, total=False):
    amplitude: Amplitude
    """Time factor (default 1)."""
    body: str
    """The body."""
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    kind: Literal['traction']
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    region: Union[str, None]
    """A named region of its mesh …"""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""
    traction: Sequence[FieldComponent]
    """Traction, Pa."""

class Load1(TypedDict, total=False):
    amplitude: Amplitude
    """Time factor (default 1)."""
    body: str
    """The body."""
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    kind: Literal['pressure']
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    pressure: float
    """Pressure, Pa; positive pushes into the body."""
    region: Union[str, None]
    """A named region of its mesh …"""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""

class Load2(TypedDict, total=False):
    amplitude: Amplitude
    """Time factor (default 1)."""
    body: str
    """The body."""
    force: Numbers
    """Force, N."""
    kind: Literal['point']
    node: Union[int, None]
    """A node, instead of a point."""
    point: Union[Numbers, None]
    """A point, m: the nearest node is loaded."""

class Load3(TypedDict, total=False):
    about: Union[Numbers, None]
    """The point through which the force acts, m (default: the centroid of the part at rest)."""
    amplitude: Amplitude
    """Time factor (default 1)."""
    body: str
    """The body."""
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    force: Numbers
    """Total force, N (default zero)."""
    kind: Literal['force']
    moment: Numbers
    """Moment about the point `about`, N m (default zero)."""
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    region: Union[str, None]
    """A named region of its mesh …"""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""

class Load4(TypedDict, total=False):
    amplitude: Amplitude
    """Time factor (default 1)."""
    body: str
    """The body."""
    force: Sequence[FieldComponent]
    """Force per volume, N/m³."""
    kind: Literal['body-force']
    region: Union[str, None]
    """A volume region of its mesh, for a sheet a surface region (default: the whole body)."""

Load = Union[Load0, Load1, Load2, Load3, Load4]

Cache = Union[Literal['pc2'], Literal['mdd'], Literal['obj'], Literal['ply']]

Encoding = Union[Literal['raw'], Literal['base64']]

Field = Union[Literal['displacement'], Literal['velocity'], Literal['acceleration'], Literal['external_force'], Literal['reaction_force'], Literal['stress'], Literal['von_mises'], Literal['strain'], Literal['J'], Literal['energy_density'], Literal['nodal_stress'], Literal['nodal_von_mises'], Literal['nodal_strain'], Literal['nodal_J'], Literal['nodal_energy_density'], Literal['contact_traction'], Literal['contact_pressure'], Literal['slip'], Literal['gap'], Literal['body_id'], Literal['material_id']]

Precision = Union[Literal['f32'], Literal['f64']]

class Output(TypedDict, total=False):
    cache: Union[Cache, None]
    """Also write the surface of every body for animation programs, at `fps`: 'pc2' (a point cache and one OBJ file), 'mdd' (as 'pc2', and an MDD file at the end), 'obj' or 'ply' (a sequence)."""
    chart: bool
    """Draw the energies over time as `energy.svg` when the run ends (default false; `run --chart`)."""
    directory: Union[str, None]
    """Directory, relative to the working directory (default `out/<scene>`); `--out` overrides."""
    encoding: Encoding
    """Encoding of the frames."""
    fields: Sequence[Field]
    """Fields of the frames; only these are computed."""
    fps: Union[float, None]
    """Frames per second (> 0), instead of `interval`: at the times 0, 1/fps, 2/fps … for any step. Between steps, states are interpolated (docs/files.md); no step is changed."""
    history: int
    """Write a row of history.csv every n steps, and always the first and the last (default 1; 0: those two only)."""
    interval: Union[float, None]
    """Time between frames, s (> 0); without it there are no frames. A frame is written at the nearest step."""
    ledger: Union[bool, None]
    """Keep the full energy ledger: the work, scheme error and residual work of every step, each computed on its own. It costs an energy evaluation per step, and an extra residual in implicit steps. Default: if external work is done on a body (moving supports, wind, damping, loads that follow or change), because without the ledger that work would look like drift."""
    piece_points: int
    """Largest number of points of a frame in one file (≥ 1; default 50 000 000). A larger frame is a .pvtu file and pieces of at most this many points."""
    precision: Precision
    """Precision of the frames."""

class Selection(TypedDict, total=False):
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    region: Union[str, None]
    """A named region of its mesh …"""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""

Periodic = TypedDict('Periodic', {'body': 'str', 'from': 'Selection', 'to': 'Selection'}, total=False)

class Probe(TypedDict, total=False):
    between: Union[Sequence[str], None]
    """The force between two bodies, with `sum = 'contact_force'`: columns `name.fx` `name.fy` `name.fz`, the mean force of the second body on the first over the last step, N. Needs `[contact]`."""
    body: str
    """The body; not for a probe of contact force."""
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    max: Union[str, None]
    """The largest value of a field, component by component. An element belongs to the part if its region does, or if one of its nodes does."""
    mean: Union[str, None]
    """The mean of a field: over the nodes, or over the elements weighted by rest volume. Fields are those of `output.fields`. Components are `.x` `.y` `.z` `.magnitude` of vectors and `.xx` `.xy` … `.zz` of tensors; without one there is a column per component."""
    min: Union[str, None]
    """The smallest value of a field, component by component."""
    name: str
    """Prefix of its columns."""
    node: Union[int, None]
    """… or a node, from 0."""
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    pitch: Union[Axis, None]
    """Find the pitch (frequency of the strongest oscillation, Hz) of the displacement along this axis."""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    point: Union[Numbers, None]
    """The node nearest to this point at rest, m …"""
    region: Union[str, None]
    """A named region of its mesh …"""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""
    sum: Union[str, None]
    """The sum over the nodes of 'reaction_force' or 'external_force', N. It is one number with `.x`, `.y`, `.z` or `.magnitude` (of the sum), otherwise three."""

Inertia = Union[Numbers, Sequence[Numbers]]

class Turn(TypedDict, total=False):
    angle: float
    """Right-handed angle about it, rad."""
    axis: Numbers
    """The axis, of any length but zero."""

class RigidShape0(TypedDict, total=False):
    kind: Literal['plane']
    normal: Numbers
    """Direction out of the half-space in the body's local axes, of any length but zero."""

class RigidShape1(TypedDict, total=False):
    kind: Literal['box']
    size: Numbers
    """Edge lengths, m."""

class RigidShape2(TypedDict, total=False):
    kind: Literal['sphere']
    radius: float
    """Radius, m."""

class RigidShape3(TypedDict, total=False):
    kind: Literal['rod']
    length: float
    """Length, m."""
    radius: float
    """Radius, m."""

class RigidShape4(TypedDict, total=False):
    kind: Literal['cylinder']
    length: float
    """Length, m."""
    radius: float
    """Radius, m."""

class RigidShape5(TypedDict, total=False):
    kind: Literal['capsule']
    length: float
    """Length of the cylinder without the hemispheres, m."""
    radius: float
    """Radius, m."""

class RigidShape6(TypedDict, total=False):
    file: str
    """The file, relative to the scene."""
    kind: Literal['mesh']
    scale: Union[float, None]
    """Metres per unit of the file (> 0, default 1)."""

RigidShape = Union[RigidShape0, RigidShape1, RigidShape2, RigidShape3, RigidShape4, RigidShape5, RigidShape6]

class Rigid(TypedDict, total=False):
    angular_velocity: Union[Numbers, None]
    """Initial angular velocity in global axes, rad/s."""
    density: Union[float, None]
    """Density of its shape, kg/m³."""
    fixed: bool
    """Whether it is held at its initial position."""
    inertia: Union[Inertia, None]
    """Inertia about its centre of mass in its local axes, kg m²: three principal moments, or a symmetric 3 × 3 matrix by rows. Alternative to a shape."""
    mass: Union[float, None]
    """Mass, kg. Alternatives: `density` with a shape, or neither if only attached nodes have mass."""
    motion: Union[Motion, None]
    """Prescribed motion."""
    name: str
    """Name by which attachments and joints refer to the body. It heads the columns `name.x name.y name.z` (position of its centre, m) and `name.qw name.qx name.qy name.qz` (orientation) in history.csv."""
    orientation: Union[Turn, None]
    """Initial orientation of the body's axes (default: along the global axes)."""
    position: Numbers
    """Initial position of the centre of mass without attached nodes, m; for a mesh, of the origin of its file."""
    shape: Union[RigidShape, None]
    """Shape, which gives the inertia and is shown in frames."""
    velocity: Union[Numbers, None]
    """Initial velocity of its own centre of mass, m/s."""

class Seam(TypedDict, total=False):
    body: str
    """The first body."""
    length: Union[float, None]
    """Length L of a stitch without force, m (≥ 0; default 0)."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0."""
    region: Union[str, None]
    """A curve region of its mesh …"""
    reverse: bool
    """Reverse the direction of the second curve. Without this key it is the direction in which the ends are nearest."""
    stiffness: Union[float, None]
    """Stiffness k of each stitch, N/m (> 0); without it the edges, which must meet, are joined exactly."""
    to: Union[str, None]
    """The second body (default: the first)."""
    to_nodes: Union[Numbers, None]
    """A list of as many nodes, with `nodes`."""
    to_region: Union[str, None]
    """A curve region of its mesh, with `region`."""

LinearChoice = Union[Literal['auto'], Literal['cholesky'], Literal['cholesky-double'], Literal['pcg'], Literal['petsc']]

MassKind = Union[Literal['lumped'], Literal['consistent'], Literal['filtered']]

class Solver(TypedDict, total=False):
    linear: LinearChoice
    """The linear solver."""
    mass: Union[MassKind, None]
    """The mass matrix of deformable bodies: 'lumped', 'consistent' (implicit schemes only) or 'filtered' (explicit schemes only). The default is lumped for motion and consistent for `variational modes`."""
    tolerance: float
    """Relative tolerance of every implicit solve in the energy norm, 1e-14 to 1e-1 (default 1e-6); 1e-14 means: to round-off."""

class SpringEnd(TypedDict, total=False):
    body: Union[str, None]
    """A body, with `node` or `point`. Without a body, `point` is fixed in space."""
    node: Union[int, None]
    """A node of the body, from 0."""
    point: Union[Numbers, None]
    """The node nearest to this point at rest, m; without a body, the point itself."""

Spring = TypedDict('Spring', {'from': 'SpringEnd', 'length': 'Union[float, None]', 'stiffness': 'float', 'to': 'SpringEnd'}, total=False)

class Control0(TypedDict, total=False):
    axis: Axis
    """Axis."""
    kind: Literal['displacement']
    probe: str
    """Name of the probe."""
    to: float
    """Displacement at `time.end`, m."""

class Control1(TypedDict, total=False):
    body: str
    """The body."""
    kind: Literal['volume']
    region: str
    """A surface region of its mesh. It is closed, or its edges are clamped or slide in planes x, y or z = const."""
    to: float
    """Increase of the volume from rest at `time.end`, m³."""

Control = Union[Control0, Control1]

class Static(TypedDict, total=False):
    arc_steps: Union[int, None]
    """Follow the path of equilibria by its arc length, through limit points, until the load factor is `time.end`, in at most this many arc steps; each is a step of the run. `time.step` is the change of the load factor in the first arc step, whose length is also the largest."""
    control: Union[Control, None]
    """Follow the path of equilibria by a displacement or a volume instead of the load factor."""
    push: Union[float, None]
    """If the path becomes unstable, leave it along the critical mode: amplitude of the perturbation, m."""
    smallest_increment: Union[float, None]
    """Smallest increment of t before the solve fails (> 0; default: 1e-6 of the end)."""
    tolerance: float
    """Relative tolerance in the energy norm, 1e-14 to 0.1 (default 1e-8)."""

class Strike(TypedDict, total=False):
    body: str
    """The body."""
    box: Union[BoxRegion, None]
    """… or the nodes in a box …"""
    impulse: Numbers
    """Impulse, N s."""
    node_file: Union[str, None]
    """… or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas or line ends; text after a # in a line is ignored."""
    nodes: Union[Numbers, None]
    """… or a list of nodes, from 0 …"""
    plane: Union[PlaneRegion, None]
    """… or the nodes on a plane …"""
    region: Union[str, None]
    """A named region of its mesh …"""
    sphere: Union[SphereRegion, None]
    """… or the nodes in a ball …"""

SchemeName = Union[Literal['symplectic-euler-a'], Literal['symplectic-euler-b'], Literal['stormer-verlet'], Literal['blanes-moan-4'], Literal['blanes-moan-6'], Literal['implicit-midpoint'], Literal['gauss'], Literal['energy-momentum'], Literal['forward-euler'], Literal['backward-euler'], Literal['truncated-euler'], Literal['bdf2'], Literal['newmark'], Literal['generalized-alpha'], Literal['auto']]

AdaptiveWord = Literal['adaptive']

TimeStep = Union[float, AdaptiveWord]

class Time(TypedDict, total=False):
    end: float
    """End of the run, s (> 0)."""
    estimate: bool
    """Estimate the error of every probe by companion runs with other steps (5 to 10 times the cost)."""
    largest_step: Union[float, None]
    """With `step = 'adaptive'`: largest length of the intervals in which a body makes equal steps, s (> 0, default end/100). It is adjusted so that frames fall on the ends of intervals."""
    scheme: Union[SchemeName, None]
    """The time integrator. It is optional only in a scene with `[static]`."""
    solves: Union[int, None]
    """Linear solves per step of `truncated-euler`, 1 to 1000 (default 8)."""
    spectral_radius: Union[float, None]
    """Spectral radius at infinite frequency of `generalized-alpha`, 0 to 1 (default 0.8)."""
    stages: Union[int, None]
    """Stages of `gauss`, 1 to 5 (default 2)."""
    step: Union[TimeStep, None]
    """Step h, s (> 0), or 'adaptive'. A number is adjusted to end/round(end/step), so that a step lands on `end`. Scheme `auto` chooses the step; there the key is optional and not used. Adaptive steps follow the motion by a symmetric rule; `tolerance` and `largest_step` limit them."""
    substeps: bool
    """Cut a step that fails into halves, down to h/1024 (with contact h/16384), and return to h after it (default true); false ends the run at the first step that fails."""
    tolerance: Union[float, None]
    """Required relative error at `end`, 1e-9 to 0.5 (default 1e-2), for `auto` and `bench`. With `step = 'adaptive'`: the relative error per radian of the mean frequency of the motion."""

class Wind(TypedDict, total=False):
    density: float
    """Density ρ of the air, kg/m³; not negative."""
    normal: float
    """Coefficient C_n of the pressure drag, dimensionless; not negative. About 1.2 to 2 for a plate."""
    tangential: float
    """Coefficient C_t of the friction, dimensionless; not negative. About 0.01 for smooth cloth."""
    velocity: Numbers
    """Velocity of the air, m/s; zero gives drag in still air."""

SceneKeys = TypedDict('SceneKeys', {'assert': 'Assert', 'attach': 'Sequence[Attach]', 'body': 'Sequence[Body]', 'checkpoint': 'Union[Checkpoints, None]', 'contact': 'Union[Contact, None]', 'damping': 'Union[Damping, None]', 'fix': 'Sequence[Fix]', 'gravity': 'Numbers', 'gravity_amplitude': 'Union[Amplitude, None]', 'guard': 'Union[Guard, None]', 'joint': 'Sequence[Joint]', 'load': 'Sequence[Load]', 'output': 'Output', 'periodic': 'Sequence[Periodic]', 'probe': 'Sequence[Probe]', 'rigid': 'Sequence[Rigid]', 'seam': 'Sequence[Seam]', 'solver': 'Solver', 'spring': 'Sequence[Spring]', 'static': 'Union[Static, None]', 'strike': 'Sequence[Strike]', 'time': 'Time', 'title': 'str', 'wind': 'Union[Wind, None]'}, total=False)
