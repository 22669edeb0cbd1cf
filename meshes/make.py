#!/usr/bin/env python3
"""Makes every mesh of this directory with gmsh. What each one is: README.md.

    pip install gmsh==4.15.2 numpy
    python make.py                                  # all of them, written beside this file
    python make.py --only bracket
    python make.py --turek 8 --element tet10 --out flag-8.msh    # the flag, 8 cells across its height

Lengths are in metres. One thread and no random state: the same gmsh version writes the same files.
Every mesh is checked before it is written (positive volumes, no node without an element) and its
counts and quality are printed.
"""

import argparse
import math
import pathlib

import gmsh
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
MM = 1e-3

# --- Parameters -----------------------------------------------------------------------------------

BEAM = dict(size=(1.0, 0.25, 0.25), cells=(16, 4, 4))

# A steel fork (E = 206 GPa, nu = .29, rho = 7850 kg/m3) that rings at 440 Hz with the end of its stem
# held. Estimate: each prong is an Euler-Bernoulli cantilever from its tip along the centre line to the
# middle of the bend,
#     length = prong + (pi / 2) (gap + thickness) / 2,
#     f = (1.875104^2 / 2 pi) sqrt(E / rho) (thickness / sqrt 12) / length^2  =  436 Hz.
# Quadratic tetrahedra on this mesh give 440 Hz. Linear ones lock in bending and ring sharp (README.md).
FORK = dict(
    thickness=4.0 * MM,  # of a prong, in x, the direction in which it swings
    depth=6.0 * MM,      # of the U, in z
    gap=8.0 * MM,        # between the prongs; the bend is a half ring of inner radius gap / 2
    prong=77.7 * MM,     # straight part, in y
    stem=34.0 * MM,      # below the bend
    stem_diameter=4.0 * MM,  # 1 mm clear of both faces of the U: no thin ledge, so no small edge
    edge=1.1 * MM,       # target edge of the tetrahedra, the same everywhere
)
STEEL = dict(young=2.06e11, density=7850.0)

BRACKET = dict(
    width=60.0 * MM,         # in y
    foot=55.0 * MM,          # in x
    height=60.0 * MM,        # in z
    plate=7.0 * MM,          # thickness of both legs
    inner_fillet=8.0 * MM,
    outer_fillet=5.0 * MM,
    corner_radius=10.0 * MM, # of the four free corners
    bolt_diameter=9.0 * MM,
    bolt_pitch=34.0 * MM,    # between the two holes, in y
    bolt_at=36.0 * MM,       # their distance from the back, in x
    pin_diameter=16.0 * MM,
    pin_at=38.0 * MM,        # height of the pin hole in the upright leg
    edge=3.1 * MM,
    hole_edge=2.0 * MM,
)

# Turek & Hron's elastic flag: a bar behind a circle, so its clamped end is an arc.
TUREK = dict(centre=(0.2, 0.2), radius=0.05, right=0.6, bottom=0.19, top=0.21, thickness=0.005)
TUREK_COMMITTED = dict(cells=4, element="hex20")

CLOTH = dict(size=1.0, edge=0.042)
TABLECLOTH = {"size": 1.2, "ring": 0.35, "edge": 0.03}
ROLL = {"length": 1.2, "width": 0.3, "cells": (96, 8), "straight": 0.2, "outer": 0.1, "inner": 0.06}
SKIRT = {"waist": 0.12, "hem": 0.35, "height": 1.0, "length": 0.5, "cells": (48, 16)}

# Cook's membrane: cells grow geometrically from its singular corner (0, 44) to `largest`.
COOK = dict(least=0.06, growth=1.6, largest=5.0, thickness=0.1)
# The flag of Turek and Hron with cells that grow from the two singular ends of its clamp.
TUREK_GRADED = dict(least=0.0004, growth=1.8, largest=(0.013, 0.004))
# NAFEMS FV32, the upper half of its thickness of .05 m: z = 0 is its mid-plane.
TAPERED = dict(length=10.0, widths=(5.0, 1.0), cells=(12, 6), half_thickness=0.025)
# Thick shells of radii 1 and 2, in cells (round a quarter or a patch, across the wall).
CYLINDER = dict(radii=(1.0, 2.0), cells=(8, 6), thickness=0.125)
SPHERE = dict(radii=(1.0, 2.0), cells=(4, 5))
MIXED = dict(size=(2.0, 1.0, 0.5), edge=0.34)
# A ball of radius 1: cells from a pole to 45 degrees and on to the equator, and their growth from the pole.
HALF_BALL = dict(angle=math.pi / 2, layers=8, poles=[-1], cells=(22, 5), growth=1.15)
BALL_SLICE = dict(angle=math.pi / 18, layers=1, poles=[-1, 1], cells=(18, 5), growth=1.2)
DRUM = dict(radius=0.3, edge=0.028)
BALL = dict(edge=0.42)
# A strap over a cylinder with a horizontal axis, and its two hanging ends.
STRAP = dict(radius=0.1008, hanging=0.4, width=0.05, cells=(48, 50, 2))
# A thinner layer and shorter ends: friction acts at the radius .1, tension nearly there.
CAPSTAN = dict(radius=0.1003, hanging=0.1, width=0.05, cells=(48, 12, 1))
# A bolt for the pin hole of the bracket, with its axis along x.
BOLT = dict(diameter=15.8 * MM, length=24.0 * MM, head=24.0 * MM, head_length=6.0 * MM, edge=3.0 * MM)
# An input deck of Abaqus and CalculiX, in millimetres as these have it.
BAR = {"size": (100, 20, 10), "cells": (8, 2, 1)}


# --- The meshes -----------------------------------------------------------------------------------


def beam(path):
    """Kuhn tetrahedra, six to a cell, around the diagonal from the cell's lowest to its highest corner."""
    start()
    size, cells = BEAM["size"], BEAM["cells"]
    nx, ny, nz = (n + 1 for n in cells)

    def node(i, j, k):
        return 1 + i + nx * (j + ny * k)

    points = [
        (size[0] * i / cells[0], size[1] * j / cells[1], size[2] * k / cells[2])
        for k in range(nz) for j in range(ny) for i in range(nx)
    ]
    steps = np.eye(3, dtype=int)
    even = {(0, 1, 2), (1, 2, 0), (2, 0, 1)}
    tets, walls = [], {"clamp": [], "tip": []}
    for k in range(cells[2]):
        for j in range(cells[1]):
            for i in range(cells[0]):
                low = np.array((i, j, k))
                for a, b, c in [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]:
                    corners = [low, low + steps[a], low + steps[a] + steps[b], low + 1]
                    if (a, b, c) not in even:  # an odd order of the axes is a mirror image
                        corners[1], corners[2] = corners[2], corners[1]
                    tets.append([node(*corner) for corner in corners])
    for k in range(cells[2]):
        for j in range(cells[1]):
            # The Kuhn cell's faces x = const are cut along the diagonal (0,0)-(1,1), too.
            for name, i in [("clamp", 0), ("tip", cells[0])]:
                a, b, c, d = node(i, j, k), node(i, j + 1, k), node(i, j + 1, k + 1), node(i, j, k + 1)
                outward = [(a, b, c), (a, c, d)] if name == "tip" else [(a, c, b), (a, d, c)]
                walls[name] += outward

    volume = gmsh.model.addDiscreteEntity(3, 1)
    gmsh.model.mesh.addNodes(3, volume, range(1, len(points) + 1), np.ravel(points))
    gmsh.model.mesh.addElementsByType(volume, 4, [], np.ravel(tets))
    group(3, [volume], "beam")
    for tag, name in enumerate(walls, 1):
        gmsh.model.addDiscreteEntity(2, tag)
        gmsh.model.mesh.addElementsByType(tag, 2, [], np.ravel(walls[name]))
        group(2, [tag], name)
    point = gmsh.model.addDiscreteEntity(0, 1)
    gmsh.model.mesh.addElementsByType(point, 15, [], [node(cells[0], cells[1] // 2, cells[2] // 2)])
    group(0, [point], "tip_centre")
    gmsh.model.mesh.reclassifyNodes()
    finish(path)


def tuning_fork(path):
    """U of two prongs and a half ring, on a round stem. Prongs in +y, swinging in x."""
    start()
    occ, p = gmsh.model.occ, FORK
    inner, outer = p["gap"] / 2, p["gap"] / 2 + p["thickness"]
    z = -p["depth"] / 2
    ring = occ.cut(
        [(3, occ.addCylinder(0, 0, z, 0, 0, p["depth"], outer))],
        [(3, occ.addCylinder(0, 0, z, 0, 0, p["depth"], inner)),
         (3, occ.addBox(-2 * outer, 0, z, 4 * outer, 2 * outer, p["depth"]))],
    )[0]
    prongs = [(3, occ.addBox(x, 0, z, p["thickness"], p["prong"], p["depth"])) for x in (-outer, inner)]
    # The stem starts inside the bend, so that the two really join.
    root, end = -(inner + outer) / 2, -outer - p["stem"]
    stem = [(3, occ.addCylinder(0, root, 0, 0, end - root, 0, p["stem_diameter"] / 2))]
    fork = occ.fuse(ring, prongs + stem)[0]
    occ.synchronize()
    [(_, body)] = fork
    r = p["stem_diameter"] / 2

    group(3, [body], "fork")
    group(2, faces_in((-r, end, -r), (r, end, r)), "handle")
    for name, left, right in [("left_tip", -outer, -inner), ("right_tip", inner, outer)]:
        group(2, faces_in((left, p["prong"], z), (right, p["prong"], -z)), name)
    uniform_size(p["edge"])
    generate(3)
    print(f"  cantilever estimate of the pitch: {analytic_pitch():.1f} Hz")
    finish(path)


def analytic_pitch():
    """First bending frequency of a prong as an Euler-Bernoulli cantilever, Hz. See `FORK`."""
    wave_speed = math.sqrt(STEEL["young"] / STEEL["density"])
    gyration = FORK["thickness"] / math.sqrt(12)
    length = FORK["prong"] + math.pi / 2 * (FORK["gap"] + FORK["thickness"]) / 2
    return 1.8751040687**2 / (2 * math.pi) * wave_speed * gyration / length**2


def bracket(path):
    """L of two plates: foot in the plane z = 0 with two bolt holes, upright leg at x = 0 with a pin hole."""
    start()
    occ, p = gmsh.model.occ, BRACKET
    width, foot, height, plate = p["width"], p["foot"], p["height"], p["plate"]
    tiny = 0.01 * MM

    body = occ.fuse([(3, occ.addBox(0, 0, 0, foot, width, plate))],
                    [(3, occ.addBox(0, 0, 0, plate, width, height))])[0]
    occ.synchronize()
    [(_, tag)] = body

    def edge(x, z):
        return curves_in((x - tiny, -tiny, z - tiny), (x + tiny, width + tiny, z + tiny))

    corners = []
    for y in (0, width):
        corners += curves_in((foot - tiny, y - tiny, -tiny), (foot + tiny, y + tiny, plate + tiny))
        corners += curves_in((-tiny, y - tiny, height - tiny), (plate + tiny, y + tiny, height + tiny))
    inner, outer = edge(plate, plate), edge(0, 0)
    radii = [p["inner_fillet"]] * len(inner) + [p["outer_fillet"]] * len(outer) + [p["corner_radius"]] * len(corners)
    solid = occ.fillet([tag], inner + outer + corners, radii)

    holes = [
        (p["bolt_at"], width / 2 + side * p["bolt_pitch"] / 2, -plate, 0, 3 * plate, p["bolt_diameter"] / 2)
        for side in (-1, 1)
    ]
    tools = [(3, occ.addCylinder(x, y, z, dx, 0, dz, r)) for x, y, z, dx, dz, r in holes]
    tools.append((3, occ.addCylinder(-plate, width / 2, p["pin_at"], 3 * plate, 0, 0, p["pin_diameter"] / 2)))
    solid = occ.cut(solid, tools)[0]
    occ.synchronize()
    [(_, tag)] = solid

    group(3, [tag], "bracket")
    bolts = []
    for x, y, _, _, _, r in holes:
        bolts += faces_in((x - r, y - r, 0), (x + r, y + r, plate))
    r = p["pin_diameter"] / 2
    pin = faces_in((0, width / 2 - r, p["pin_at"] - r), (plate, width / 2 + r, p["pin_at"] + r))
    group(2, bolts, "bolts")
    group(2, pin, "pin")
    group(2, faces_in((0, 0, height), (plate, width, height)), "load_face")
    group(2, faces_in((0, 0, 0), (foot, width, 0)), "base")

    near = gmsh.model.mesh.field.add("Distance")
    gmsh.model.mesh.field.setNumbers(near, "SurfacesList", bolts + pin)
    gmsh.model.mesh.field.setNumber(near, "Sampling", 40)
    size = gmsh.model.mesh.field.add("Threshold")
    for key, value in [("InField", near), ("SizeMin", p["hole_edge"]), ("SizeMax", p["edge"]),
                       ("DistMin", 1 * MM), ("DistMax", 10 * MM)]:
        gmsh.model.mesh.field.setNumber(size, key, value)
    gmsh.model.mesh.field.setAsBackgroundMesh(size)
    uniform_size(p["edge"])
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0)
    generate(3)
    finish(path, binary=True)


def turek_flag(path, cells, element):
    """One layer of `cells` across the height; about square in the plane. The left end lies on the circle."""
    start()
    geo, p = gmsh.model.geo, TUREK
    (cx, cy), bottom, top, right = p["centre"], p["bottom"], p["top"], p["right"]
    left = cx + math.sqrt(p["radius"] ** 2 - (top - cy) ** 2)
    along = round((right - cx - p["radius"]) / (top - bottom) * cells)

    centre = geo.addPoint(cx, cy, 0)
    low_left, low_right = geo.addPoint(left, bottom, 0), geo.addPoint(right, bottom, 0)
    tip, high_right, high_left = geo.addPoint(right, cy, 0), geo.addPoint(right, top, 0), geo.addPoint(left, top, 0)
    lower = geo.addLine(low_left, low_right)
    end = [geo.addLine(low_right, tip), geo.addLine(tip, high_right)]
    upper = geo.addLine(high_right, high_left)
    arc = geo.addCircleArc(high_left, centre, low_left)
    face = geo.addPlaneSurface([geo.addCurveLoop([lower, *end, upper, arc])])
    for curve, count in [(lower, along), (upper, along), (end[0], cells // 2), (end[1], cells // 2), (arc, cells)]:
        geo.mesh.setTransfiniteCurve(curve, count + 1)
    geo.mesh.setTransfiniteSurface(face, "Left", [low_left, low_right, high_right, high_left])
    hexahedra = element.startswith("hex")
    if hexahedra:
        geo.mesh.setRecombine(2, face)
    made = geo.extrude([(2, face)], 0, 0, p["thickness"], numElements=[1], recombine=hexahedra)
    geo.synchronize()

    far, volume = made[0][1], made[1][1]
    sheet = p["thickness"]
    group(3, [volume], "flag")
    group(2, faces_in((left, bottom, 0), (cx + p["radius"], top, sheet)), "clamp")
    group(2, [face, far], "side")
    group(0, points_in((right, cy, 0), (right, cy, sheet)), "A")
    generate(3)
    if element != "hex8":
        # The new nodes of the arc go onto the circle.
        gmsh.option.setNumber("Mesh.SecondOrderLinear", 0)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", int(element == "hex20"))
        gmsh.model.mesh.setOrder(2)
    finish(path)


def cloth(path):
    """Unit square in the plane z = 0, Delaunay triangles. Corners a, b, c, d anticlockwise from the origin."""
    start()
    geo, side = gmsh.model.geo, CLOTH["size"]
    corners = [geo.addPoint(x, y, 0) for x, y in [(0, 0), (side, 0), (side, side), (0, side)]]
    edges = [geo.addLine(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    face = geo.addPlaneSurface([geo.addCurveLoop(edges)])
    geo.synchronize()
    group(2, [face], "cloth")
    for edge, name in zip(edges, ["bottom", "right", "top", "left"]):
        group(1, [edge], name)
    for corner, name in zip(corners, "abcd"):
        group(0, [corner], name)
    uniform_size(CLOTH["edge"])
    gmsh.option.setNumber("Mesh.Algorithm", 5)  # the frontal method would lay almost regular rows
    generate(2)
    finish(path)


def cook(path):
    """(0,0) (48,44) (48,60) (0,44), one layer; straight edges, so that it may be lifted and refined."""
    p = COOK

    def place(x):
        low, high = 44 * x[0], 44 + 16 * x[0]
        return 48 * x[0], low + x[1] * (high - low), x[2]

    along = graded(p["least"], p["growth"], p["largest"], 48)
    low, high = np.linspace(0, 0.5, 6), 1 - graded(p["least"], p["growth"], p["largest"], 22)[::-1] / 2
    cells = bricks(along, np.concatenate([low, high[1:]]), [0, p["thickness"]])
    surfaces = {
        "clamp": lambda x: x[0] == 0, "end": lambda x: x[0] == 1,
        "back": lambda x: x[2] == 0, "front": lambda x: x[2] == p["thickness"],
    }
    hexahedra(path, "membrane", cells, surfaces, place, order=1)


def turek_graded(path):
    """The flag of one layer in hex20, whose clamped end lies exactly on the circle."""
    p, g = TUREK, TUREK_GRADED
    (cx, cy), height = p["centre"], p["top"] - p["bottom"]
    along = graded(g["least"], g["growth"], g["largest"][0], p["right"] - cx - p["radius"])
    half = graded(g["least"], g["growth"], g["largest"][1], height / 2) / 2
    across = np.concatenate([half, 1 - half[-2::-1]])

    def place(x):
        y = p["bottom"] + height * x[1]
        left = cx + math.sqrt(p["radius"] ** 2 - (y - cy) ** 2)
        return left + x[0] * (p["right"] - left), y, x[2]

    cells = bricks(along, across, [0, p["thickness"]])
    surfaces = {
        "clamp": lambda x: x[0] == 0,
        "side": lambda x: x[2] in (0, p["thickness"]),
    }
    hexahedra(path, "flag", cells, surfaces, place, order=2, incomplete=True)


def tapered(path):
    p = TAPERED
    (wide, narrow), (along, across) = p["widths"], p["cells"]

    def place(x):
        width = wide + x[0] * (narrow - wide)
        return p["length"] * x[0], (x[1] - 0.5) * width, x[2]

    cells = bricks(np.linspace(0, 1, along + 1), np.linspace(0, 1, across + 1), [0, p["half_thickness"]])
    surfaces = {"clamp": lambda x: x[0] == 0, "middle": lambda x: x[2] == 0}
    hexahedra(path, "membrane", cells, surfaces, place, order=1)


def cylinder(path):
    """A quarter of a cylinder. Every node of a curved face lies on its cylinder."""
    p = CYLINDER
    around, through = p["cells"]

    def place(x):
        angle = math.pi / 2 * x[1]
        return x[0] * math.cos(angle), x[0] * math.sin(angle), x[2]

    cells = bricks(np.linspace(*p["radii"], through + 1), np.linspace(0, 1, around + 1), [0, p["thickness"]])
    surfaces = {
        "inner": lambda x: x[0] == p["radii"][0], "outer": lambda x: x[0] == p["radii"][1],
        "y0": lambda x: x[1] == 0, "x0": lambda x: x[1] == 1,
    }
    hexahedra(path, "wall", cells, surfaces, place, order=2)


def sphere(path):
    """An octant of a sphere in three patches. Every node of a curved face lies on its sphere."""
    p = SPHERE
    around, through = p["cells"]
    patch = np.linspace(0, 1, around + 1)
    first = bricks(patch, patch, np.linspace(*p["radii"], through + 1))
    # A cell of the patch z = max is (a r, b r, r); the others follow by turning x, y, z.
    first = np.stack([first[..., 0] * first[..., 2], first[..., 1] * first[..., 2], first[..., 2]], axis=-1)
    cells = np.concatenate([np.roll(first, k, axis=-1) for k in range(3)])

    def place(x):
        radius = max(x)
        direction = np.tan(math.pi / 4 * np.array(x) / radius)
        return tuple(radius * direction / np.linalg.norm(direction))

    surfaces = {
        "inner": lambda x: abs(max(x) - p["radii"][0]) < 1e-9, "outer": lambda x: abs(max(x) - p["radii"][1]) < 1e-9,
        "x0": lambda x: x[0] == 0, "y0": lambda x: x[1] == 0, "z0": lambda x: x[2] == 0,
    }
    hexahedra(path, "wall", cells, surfaces, place, order=2)


def mixed(path):
    """Hexahedra for x < 1 and wedges beyond, of second order."""
    start()
    geo, (length, width, height) = gmsh.model.geo, MIXED["size"]
    xs = [0, length / 2, length]
    low, high = ([geo.addPoint(x, y, 0) for x in xs] for y in (0, width))
    rungs = [geo.addLine(a, b) for a, b in zip(low, high)]
    made = []
    for k in range(2):
        sides = geo.addLine(low[k], low[k + 1]), geo.addLine(high[k], high[k + 1])
        face = geo.addPlaneSurface([geo.addCurveLoop([sides[0], rungs[k + 1], -sides[1], -rungs[k]])])
        if k == 0:
            for curve in [*sides, *rungs[:2]]:
                geo.mesh.setTransfiniteCurve(curve, 4)
            geo.mesh.setTransfiniteSurface(face)
            geo.mesh.setRecombine(2, face)
        made += geo.extrude([(2, face)], 0, 0, height, numElements=[2], recombine=True)
    geo.synchronize()
    group(3, [tag for d, tag in made if d == 3], "block")
    for name, (a, b) in {"x-min": ((0, 0, 0), (0, width, height)), "y-min": ((0, 0, 0), (length, 0, height)),
                         "z-min": ((0, 0, 0), (length, width, 0)), "x-max": ((length, 0, 0), (length, width, height))}.items():
        group(2, faces_in(a, b), name)
    uniform_size(MIXED["edge"])
    generate(3)
    gmsh.model.mesh.setOrder(2)
    finish(path)


def graded(least, growth, largest, length):
    """Places from 0 to 1 on a line of this length: steps from `least` that grow to `largest`."""
    steps = [least]
    while sum(steps) + steps[-1] * growth < length:
        steps.append(min(growth * steps[-1], largest))
    places = np.cumsum([0, *steps])
    return places / places[-1]


def bricks(xs, ys, zs):
    """Corners of all cells of a lattice, 8 each, in Gmsh's order."""
    around = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return np.array([
        [(xs[i + a], ys[j + b], zs[k + c]) for a, b, c in around]
        for k in range(len(zs) - 1) for j in range(len(ys) - 1) for i in range(len(xs) - 1)
    ])


def hexahedra(path, name, cells, surfaces, place, order, incomplete=False):
    """Hexahedra with these corners in a space where they are straight; `place` takes all nodes, those in the
    middles too, to where they belong. A boundary facet is of a surface whose condition all its corners keep."""
    start()
    keys = np.round(cells.reshape(-1, 3), 9)
    points, numbers = np.unique(keys, axis=0, return_inverse=True)
    cells = numbers.reshape(-1, 8) + 1
    volume = gmsh.model.addDiscreteEntity(3, 1)
    gmsh.model.mesh.addNodes(3, volume, range(1, len(points) + 1), np.ravel(points))
    gmsh.model.mesh.addElementsByType(volume, 5, [], np.ravel(cells))
    sides = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    seen = {}
    for cell in cells:
        for side in sides:
            facet = [cell[i] for i in side]
            seen.setdefault(tuple(sorted(facet)), []).append(facet)
    boundary = [facets[0] for facets in seen.values() if len(facets) == 1]
    for tag, (surface, holds) in enumerate(surfaces.items(), 1):
        facets = [facet for facet in boundary if all(holds(points[node - 1]) for node in facet)]
        gmsh.model.addDiscreteEntity(2, tag)
        gmsh.model.mesh.addElementsByType(tag, 3, [], np.ravel(facets))
        group(2, [tag], surface)
    group(3, [volume], name)
    gmsh.model.mesh.reclassifyNodes()
    if order == 2:
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", int(incomplete))
        gmsh.model.mesh.setOrder(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    for tag, x in zip(tags, coordinates.reshape(-1, 3)):
        gmsh.model.mesh.setNode(tag, [v + 0.0 for v in place(np.round(x, 12))], [])
    finish(path, binary=order == 2)


def bar(path):
    """A bar of hex20 as an input deck, in millimetres; `pressed` is a surface of it by the faces of its elements."""
    path, size = path.with_suffix(".inp"), BAR["size"]
    lattice = [np.linspace(0, length, count + 1) for length, count in zip(size, BAR["cells"])]
    surfaces = {"root": lambda x: x[0] == 0, "end": lambda x: x[0] == size[0]}
    hexahedra(path, "bar", bricks(*lattice), surfaces, lambda x: x, order=2, incomplete=True)
    # The heading names the file without its directory. Gmsh turns no cell: faces S2 of all of them look to +z.
    text = path.read_text().replace(str(path), path.name)
    path.write_text(text + "*SURFACE, NAME=pressed, TYPE=ELEMENT\nbar, S2\n")


def tablecloth(path):
    """Square about the origin in the plane z = 0 with a circle of nodes, on which it lies."""
    start()
    geo, half, radius = gmsh.model.geo, 0.5 * TABLECLOTH["size"], TABLECLOTH["ring"]
    centre = geo.addPoint(0, 0, 0)
    on_circle = [geo.addPoint(x, y, 0) for x, y in [(radius, 0), (0, radius), (-radius, 0), (0, -radius)]]
    arcs = [geo.addCircleArc(on_circle[i], centre, on_circle[(i + 1) % 4]) for i in range(4)]
    corners = [geo.addPoint(x, y, 0) for x, y in [(-half, -half), (half, -half), (half, half), (-half, half)]]
    edges = [geo.addLine(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    ring = geo.addCurveLoop(arcs)
    faces = [geo.addPlaneSurface([ring]), geo.addPlaneSurface([geo.addCurveLoop(edges), ring])]
    geo.synchronize()
    group(2, faces, "cloth")
    group(1, arcs, "ring")
    uniform_size(TABLECLOTH["edge"])
    gmsh.option.setNumber("Mesh.Algorithm", 5)
    generate(2)
    finish(path)


def roll(path):
    """A strip rolled up but for its first part, as OBJ; texture coordinates are the flat strip, m."""
    path = path.with_suffix(".obj")
    count, across = ROLL["cells"]
    step = ROLL["length"] / count
    x, z, angle = 0.0, 0.0, 0.0
    rim = [(x, z)]
    for k in range(count):
        x, z = x + step * math.cos(angle), z + step * math.sin(angle)
        rim.append((x, z))
        wound = (k + 1) * step - ROLL["straight"]
        if wound > 0:
            # Each cell is flat and keeps its length, so that the roll is bent and nowhere stretched.
            rolled = wound / (ROLL["length"] - ROLL["straight"])
            angle += step / (ROLL["outer"] + rolled * (ROLL["inner"] - ROLL["outer"]))
    lines = ["# made by meshes/make.py", "o roll"]
    rows = [ROLL["width"] * j / across for j in range(across + 1)]
    lines += [f"v {x:.9f} {y:.9f} {z:.9f}" for y in rows for x, z in rim]
    lines += [f"vt {step * k:.9f} {y:.9f}" for y in rows for k in range(count + 1)]
    at = lambda i, j: i + j * (count + 1) + 1
    for j in range(across):
        for i in range(count):
            a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
            triangles = [(a, b, c), (a, c, d)] if (i + j) % 2 else [(a, b, d), (b, c, d)]
            lines += ["f " + " ".join(f"{n}/{n}" for n in triangle) for triangle in triangles]
    lines += ["g start", "l " + " ".join(str(at(0, j)) for j in range(across + 1))]
    path.write_text("\n".join(lines) + "\n")
    print(f"{path.name}: {2 * count * across} triangles, {(count + 1) * (across + 1)} nodes")


def skirt(path):
    """A frustum hung from its waist, as OBJ, z up; texture coordinates are 0 to 1 around and along, with a seam."""
    path = path.with_suffix(".obj")
    around, along = SKIRT["cells"]
    angle = lambda i: 2 * math.pi * i / around
    radius = lambda j: SKIRT["waist"] + (SKIRT["hem"] - SKIRT["waist"]) * j / along
    lines = ["# made by meshes/make.py", "o skirt"]
    for j in range(along + 1):
        z = SKIRT["height"] - SKIRT["length"] * j / along
        lines += [f"v {radius(j) * math.cos(angle(i)):.9f} {radius(j) * math.sin(angle(i)):.9f} {z:.9f}"
                  for i in range(around)]
    # The first column has texture coordinates at both ends.
    lines += [f"vt {i / around:.9f} {1 - j / along:.9f}" for j in range(along + 1) for i in range(around + 1)]
    for j in range(along):
        for i in range(around):
            corners = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
            point = lambda i, j: around * j + i % around + 1
            texture = lambda i, j: (around + 1) * j + i + 1
            lines.append("f " + " ".join(f"{point(*corner)}/{texture(*corner)}" for corner in corners))
    path.write_text("\n".join(lines) + "\n")
    print(f"{path.name}: {around * along} quadrilaterals, {around * (along + 1)} nodes")


def ball_about_axis(path, angle, layers, poles, cells, growth):
    """The part of a ball of radius 1 between two planes through the axis z: hexahedra, and wedges at the axis. `poles`
    holds the signs of z of its halves; cells grow from both poles, or from one."""
    start()
    geo, (towards, beyond) = gmsh.model.geo, cells
    middle = math.sqrt(0.5)
    shared = {name: geo.addPoint(x, 0, 0) for name, x in [("centre", 0), ("rim", 1), ("equator", 0.5)]}
    on_equator = {pair: geo.addLine(shared[pair[0]], shared[pair[1]]) for pair in [("rim", "equator"), ("centre", "equator")]}
    made, faces, axis = [], [], []
    for sign in poles:
        places = dict(pole=(0, 1), arc=(middle, middle), axis=(0, 0.5), inside=(0.42, 0.42))
        points = shared | {name: geo.addPoint(x, 0, sign * z) for name, (x, z) in places.items()}
        curves = {}
        for a, b, count in [("pole", "axis", towards), ("pole", "arc", towards), ("arc", "inside", towards),
                            ("axis", "inside", towards), ("arc", "rim", beyond), ("inside", "equator", beyond),
                            ("axis", "centre", beyond), ("rim", "equator", towards), ("centre", "equator", towards)]:
            if {a, b} <= {"pole", "arc", "rim"}:
                curve = geo.addCircleArc(points[a], points["centre"], points[b])
            else:
                curve = on_equator.get((a, b)) or geo.addLine(points[a], points[b])
            geo.mesh.setTransfiniteCurve(curve, count + 1, "Progression", growth if count == towards else 1.0)
            curves[a, b], curves[b, a] = curve, -curve
        axis += [abs(curves["pole", "axis"]), abs(curves["axis", "centre"])]
        for corners in [("pole", "arc", "inside", "axis"), ("arc", "rim", "equator", "inside"),
                        ("axis", "inside", "equator", "centre")]:
            corners = corners[::-sign]
            loop = [curves[a, b] for a, b in zip(corners, corners[1:] + corners[:1])]
            faces.append(geo.addPlaneSurface([geo.addCurveLoop(loop)]))
            geo.mesh.setTransfiniteSurface(faces[-1])
            geo.mesh.setRecombine(2, faces[-1])
    made = [geo.revolve([(2, face)], 0, 0, 0, 0, 0, 1, angle, numElements=[layers], recombine=True) for face in faces]
    geo.synchronize()
    group(3, [tag for part in made for d, tag in part if d == 3], "ball")
    group(2, faces, "y0")
    group(2, [part[0][1] for part in made], "turned")
    if len(poles) == 1:
        group(2, faces_in((-1, -1, 0), (1, 1, 0)), "equator")
    group(1, axis, "axis")
    gmsh.model.mesh.generate(3)
    finish(path, binary=True)


def ball(path):
    """A ball of radius 1 about the origin, in tetrahedra."""
    start()
    gmsh.model.occ.addSphere(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    group(3, [1], "ball")
    uniform_size(BALL["edge"])
    generate(3)
    finish(path)


def drum(path):
    """A disc about the origin in the plane z = 0."""
    start()
    geo, radius = gmsh.model.geo, DRUM["radius"]
    centre = geo.addPoint(0, 0, 0)
    points = [geo.addPoint(x, y, 0) for x, y in [(radius, 0), (0, radius), (-radius, 0), (0, -radius)]]
    arcs = [geo.addCircleArc(points[i], centre, points[(i + 1) % 4]) for i in range(4)]
    face = geo.addPlaneSurface([geo.addCurveLoop(arcs)])
    geo.synchronize()
    group(2, [face], "skin")
    group(1, arcs, "rim")
    uniform_size(DRUM["edge"])
    gmsh.option.setNumber("Mesh.Algorithm", 5)
    generate(2)
    finish(path)


def bolt(path):
    """A bolt along x through the pin hole of the bracket; its head lies against the outer face of the upright leg."""
    start()
    occ, p = gmsh.model.occ, BOLT
    shank = occ.addCylinder(0, 0, 0, p["length"], 0, 0, 0.5 * p["diameter"])
    head = occ.addCylinder(0, 0, 0, -p["head_length"], 0, 0, 0.5 * p["head"])
    occ.fuse([(3, shank)], [(3, head)])
    occ.synchronize()
    group(3, [tag for _, tag in gmsh.model.getEntities(3)], "bolt")
    radius = p["diameter"]
    group(2, faces_in((p["length"], -radius, -radius), (p["length"], radius, radius)), "end")
    uniform_size(p["edge"])
    generate(3)
    finish(path)


def strap(path, p):
    """A strip over the upper half of a cylinder about the axis y, and straight down on both sides, as OBJ."""
    path = path.with_suffix(".obj")
    around, along, across = p["cells"]
    radius, hanging = p["radius"], p["hanging"]
    down = [hanging * (1 - k / along) for k in range(along)]
    arc = [math.pi * (1 - k / around) for k in range(around + 1)]
    line = [(-radius, -z) for z in down] + [(radius * math.cos(a), radius * math.sin(a)) for a in arc]
    line += [(radius, -z) for z in reversed(down)]
    rows = [p["width"] * (j / across - 0.5) for j in range(across + 1)]
    lines = ["# made by meshes/make.py", f"o {path.stem}"]
    lines += [f"v {x:.9f} {y:.9f} {z:.9f}" for y in rows for x, z in line]
    at = lambda i, j: i + j * len(line) + 1
    for j in range(across):
        for i in range(len(line) - 1):
            a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
            # With all diagonals parallel, tension in the strip loads the nodes in proportion to their areas.
            lines += ["f " + " ".join(map(str, triangle)) for triangle in [(a, b, c), (a, c, d)]]
    for name, i in [("left", 0), ("top", len(line) // 2), ("right", len(line) - 1)]:
        lines += [f"g {name}", "l " + " ".join(str(at(i, j)) for j in range(across + 1))]
    path.write_text("\n".join(lines) + "\n")
    print(f"{path.name}: {2 * (len(line) - 1) * across} triangles, {len(line) * len(rows)} nodes")


# --- Gmsh -----------------------------------------------------------------------------------------


def start():
    gmsh.option.restoreDefaults()
    for key, value in [("General.Terminal", 0), ("General.NumThreads", 1), ("Mesh.Algorithm", 6),
                       ("Mesh.Algorithm3D", 1), ("Mesh.Optimize", 1), ("Mesh.MshFileVersion", 4.1)]:
        gmsh.option.setNumber(key, value)
    gmsh.clear()


def group(dimension, tags, name):
    if not tags:
        raise SystemExit(f"no entity found for the group '{name}'")
    gmsh.model.addPhysicalGroup(dimension, tags, name=name)


def entities_in(low, high, dimension, slack):
    """Tags of the entities that lie wholly in a box. (OpenCASCADE's own boxes are larger by 1e-7.)"""
    low, high = (np.array(low, float) - slack).tolist(), (np.array(high, float) + slack).tolist()
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*low, *high, dim=dimension)]


def points_in(low, high, slack=1e-6):
    return entities_in(low, high, 0, slack)


def curves_in(low, high, slack=1e-6):
    return entities_in(low, high, 1, slack)


def faces_in(low, high, slack=1e-6):
    return entities_in(low, high, 2, slack)


def uniform_size(edge):
    gmsh.option.setNumber("Mesh.MeshSizeMin", edge)
    gmsh.option.setNumber("Mesh.MeshSizeMax", edge)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)


def generate(dimension):
    gmsh.model.mesh.generate(dimension)
    if dimension == 3:
        for _ in range(3):
            gmsh.model.mesh.optimize("")
            gmsh.model.mesh.optimize("Netgen")


def finish(path, binary=False):
    """Checks the mesh, prints its counts and quality, and writes the elements of the named groups."""
    dimension = max(d for d, _ in gmsh.model.getPhysicalGroups())
    groups = gmsh.model.getPhysicalGroups()
    saved = [gmsh.model.mesh.getNodesForPhysicalGroup(d, tag)[0] for d, tag in groups]
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    row = {tag: i for i, tag in enumerate(tags)}
    points = coordinates.reshape(-1, 3)
    used = set()
    print(path.name)
    for kind in gmsh.model.mesh.getElementTypes(dimension):
        name, _, order, count, _, corners = gmsh.model.mesh.getElementProperties(kind)
        elements, nodes = gmsh.model.mesh.getElementsByType(kind)
        used.update(nodes.tolist())
        if dimension == 3:
            least = gmsh.model.mesh.getElementQualities(elements, "minDetJac").min()
            if least <= 0:
                raise SystemExit(f"{path.name}: an element is inverted (least Jacobian {least:g})")
        cells = points[[row[tag] for tag in nodes]].reshape(-1, count, 3)[:, :corners]
        print(f"  {len(elements)} {name} of order {order}, {quality(cells, name)}")
    loose = set(np.concatenate(saved).tolist()) - used
    if loose:
        raise SystemExit(f"{path.name}: {len(loose)} nodes belong to no element")
    for (d, tag), nodes in zip(groups, saved):
        print(f"  {['point', 'curve', 'surface', 'volume'][d]} group {gmsh.model.getPhysicalName(d, tag)}: {len(nodes)} nodes")
    gmsh.option.setNumber("Mesh.Binary", int(binary))
    gmsh.write(str(path))
    print(f"  {len(used)} nodes, {path.stat().st_size / 1024:.0f} KiB")


def quality(cells, name):
    """Edge lengths; for simplices also the angles and the radius ratio (1 = regular)."""
    pairs = [(i, j) for i in range(cells.shape[1]) for j in range(i)]
    lengths = np.array([np.linalg.norm(cells[:, i] - cells[:, j], axis=1) for i, j in pairs])
    text = f"edges and diagonals {lengths.min():.3g} to {lengths.max():.3g} m"
    if cells.shape[1] == 3:
        angles = []
        for i in range(3):
            u, v = cells[:, (i + 1) % 3] - cells[:, i], cells[:, (i + 2) % 3] - cells[:, i]
            angles.append(np.degrees(np.arccos((u * v).sum(1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1))))
        text = f"edges {lengths.min():.3g} to {lengths.max():.3g} m, angles {np.min(angles):.1f} to {np.max(angles):.1f} degrees"
    if cells.shape[1] == 4 and "Tetra" in name:
        a, b, c, d = (cells[:, i] for i in range(4))
        volume = np.abs(np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a))) / 6
        faces = [(b, c, d), (a, d, c), (a, b, d), (a, c, b)]
        normals = [np.cross(q - p, r - p) for p, q, r in faces]
        areas = [np.linalg.norm(n, axis=1) / 2 for n in normals]
        angles = np.array([
            180 - np.degrees(np.arccos(np.clip((normals[i] * normals[j]).sum(1) / (4 * areas[i] * areas[j]), -1, 1)))
            for i, j in pairs
        ])
        height = 3 * volume / np.max(areas, axis=0)
        insphere = 3 * volume / np.sum(areas, axis=0)
        u, v, w = (np.linalg.norm(x, axis=1) * np.linalg.norm(y, axis=1)
                   for x, y in [(b - a, c - d), (c - a, b - d), (d - a, b - c)])
        heron = np.sqrt(np.maximum((u + v + w) * (u + v - w) * (u - v + w) * (v + w - u), 0))
        ratio = 3 * insphere / (heron / (24 * volume))
        text = (f"volume {volume.sum():.6g} m3, edges {lengths.min():.3g} to {lengths.max():.3g} m, "
                f"dihedral angles {angles.min():.1f} to {angles.max():.1f} degrees, "
                f"least height {height.min():.3g} m, radius ratio least {ratio.min():.3f}, mean {ratio.mean():.3f}")
    return text


def main():
    made = {
        "beam": beam,
        "tuning-fork": tuning_fork,
        "bracket": bracket,
        "turek-hron-flag": lambda path: turek_flag(path, **TUREK_COMMITTED),
        "cloth": cloth,
        "turek-hron-flag-graded": turek_graded,
        "cook": cook,
        "tapered": tapered,
        "cylinder": cylinder,
        "sphere": sphere,
        "mixed": mixed,
        "bar": bar,
        "tablecloth": tablecloth,
        "roll": roll,
        "skirt": skirt,
        "half-ball": lambda path: ball_about_axis(path, **HALF_BALL),
        "ball-slice": lambda path: ball_about_axis(path, **BALL_SLICE),
        "ball": ball,
        "drum": drum,
        "bolt": bolt,
        "strap": lambda path: strap(path, STRAP),
        "capstan": lambda path: strap(path, CAPSTAN),
    }
    parser = argparse.ArgumentParser(description="Makes the meshes of this directory.")
    parser.add_argument("--only", choices=made, help="make this one alone")
    parser.add_argument("--turek", type=int, metavar="N", help="make the flag alone, N (even) cells across its height")
    parser.add_argument("--element", choices=["hex8", "hex20", "hex27", "tet10"], default="hex20", help="for --turek")
    parser.add_argument("--out", type=pathlib.Path, help="for --turek (default: flag-ELEMENT-N.msh, here)")
    arguments = parser.parse_args()
    gmsh.initialize(readConfigFiles=False)
    if arguments.turek is None:
        for name in [arguments.only] if arguments.only else made:
            made[name](HERE / f"{name}.msh")
    else:
        if arguments.turek < 2 or arguments.turek % 2:
            parser.error("--turek: an even number, 2 or more, so that the point A is a node")
        path = arguments.out or pathlib.Path(f"flag-{arguments.element}-{arguments.turek}.msh")
        turek_flag(path, arguments.turek, arguments.element)
    gmsh.finalize()


if __name__ == "__main__":
    main()
