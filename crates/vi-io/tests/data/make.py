#!/usr/bin/env python3
"""Makes the sample files beside this script, each by the program whose dialect it stands for.

    pip install gmsh meshio vtk pyvista numpy && python make.py

Two shapes: "box", a small body in every Gmsh version, encoding and kind of cell, with physical groups; and "cells",
five fixed points or so with one cell of several kinds and arrays, in every VTK encoding. `cells.*` files all hold
the same mesh, which the tests know.
"""
import itertools
import os
import struct

import gmsh
import meshio
import numpy as np
import vtk

os.chdir(os.path.dirname(os.path.abspath(__file__)))


def box(kind, order):
    """A box of 1 × 0.5 × 0.5 with the groups "steel" (volume), "clamp", 7 (surfaces, overlapping) and "tip" (point)."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    model, occ = gmsh.model, gmsh.model.occ
    if kind == "wedge":
        base = occ.addRectangle(0, 0, 0, 1, 0.5)
        occ.extrude([(2, base)], 0, 0, 0.5, numElements=[1], recombine=True)
    else:
        occ.addBox(0, 0, 0, 1, 0.5, 0.5)
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", 1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1)
    if kind == "hex":
        for _, curve in model.getEntities(1):
            model.mesh.setTransfiniteCurve(curve, 2)
        for _, surface in model.getEntities(2):
            model.mesh.setTransfiniteSurface(surface)
            model.mesh.setRecombine(2, surface)
        model.mesh.setTransfiniteVolume(1)
    surfaces = [tag for _, tag in model.getEntities(2)]
    model.addPhysicalGroup(3, [tag for _, tag in model.getEntities(3)], name="steel")
    model.addPhysicalGroup(2, surfaces[:1], name="clamp")
    model.addPhysicalGroup(2, surfaces[:3], 7)
    model.addPhysicalGroup(0, [1], name="tip")
    model.mesh.generate(3)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1 if order == "serendipity" else 0)
    if order != "linear":
        model.mesh.setOrder(2)
    name = {
        ("tet", "linear"): "tetra",
        ("tet", "quadratic"): "tetra10",
        ("hex", "linear"): "hexahedron",
        ("hex", "serendipity"): "hexahedron20",
        ("hex", "quadratic"): "hexahedron27",
        ("wedge", "linear"): "wedge",
        ("wedge", "serendipity"): "wedge15",
    }[kind, order]
    full = name in ("tetra", "hexahedron27")
    for version, binary in itertools.product((2.2, 4.1), (0, 1)):
        if full or (version, binary) == (4.1, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(f"{name}-{version}-{'binary' if binary else 'text'}.msh")
    if name != "hexahedron27":
        gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
        gmsh.write(f"box-{name}.inp")
    if name == "tetra":
        # A view beside the mesh: displacement (x, 2 y, 3 z) at every node.
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.option.setNumber("Mesh.Binary", 0)
        tags, points, _ = model.mesh.getNodes()
        points = points.reshape(-1, 3)
        view = gmsh.view.add("displacement")
        gmsh.view.addModelData(view, 0, model.getCurrent(), "NodeData", tags, points * [1, 2, 3], time=0.5)
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.option.setNumber("PostProcessing.SaveMesh", 1)
            gmsh.view.write(view, f"view-{'binary' if binary else 'text'}.msh")
    gmsh.finalize()


POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], [0.5, 0.5, 2]], float)
CELLS = [("hexahedron", [[0, 1, 2, 3, 4, 5, 6, 7]]), ("pyramid", [[4, 5, 6, 7, 8]]), ("triangle", [[0, 1, 2], [0, 2, 3]])]
DISPLACEMENT = POINTS * [0.1, -0.2, 1 / 3]
MATERIAL = [3, 4, 3, 3]


def cells():
    """The known mesh by VTK (every writer mode) and by meshio."""
    mesh = meshio.Mesh(
        POINTS,
        CELLS,
        point_data={"displacement": DISPLACEMENT},
        cell_data={"material_id": [np.array([3]), np.array([4]), np.array([3, 3])]},
    )
    mesh.write("cells-meshio-text.vtu", binary=False)
    mesh.write("cells-meshio-zlib.vtu", binary=True, compression="zlib")
    mesh.write("cells-meshio-base64.vtu", binary=True, compression=None)
    mesh.write("cells-meshio-5.1-text.vtk", binary=False)
    mesh.write("cells-meshio-5.1-binary.vtk", binary=True)
    meshio.vtk.write("cells-meshio-4.2-text.vtk", mesh, fmt_version="4.2", binary=False)
    meshio.vtk.write("cells-meshio-4.2-binary.vtk", mesh, fmt_version="4.2", binary=True)

    import pyvista

    grid = pyvista.from_meshio(mesh)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    modes = {"text": writer.SetDataModeToAscii, "base64": writer.SetDataModeToBinary, "appended": writer.SetDataModeToAppended}
    for (name, mode), zlib, header, big in itertools.product(modes.items(), (True, False), (32, 64), (False, True)):
        if name == "text" and (not zlib or header == 64 or big) or big and header == 64:
            continue
        for encode in (True, False) if name == "appended" else (True,):
            mode()
            writer.SetEncodeAppendedData(encode)
            (writer.SetByteOrderToBigEndian if big else writer.SetByteOrderToLittleEndian)()
            (writer.SetHeaderTypeToUInt32 if header == 32 else writer.SetHeaderTypeToUInt64)()
            if zlib:
                writer.SetCompressorTypeToZLib()
            else:
                writer.SetCompressorTypeToNone()
            raw = "" if name != "appended" else "-base64" if encode else "-raw"
            packed = "" if name == "text" else "-zlib" if zlib else "-plain"
            writer.SetFileName(f"cells-vtk-{name}{raw}{packed}-{header}{'-big' if big else ''}.vtu")
            writer.Write()
    legacy = vtk.vtkUnstructuredGridWriter()
    legacy.SetInputData(grid)
    for version, binary in itertools.product((42, 51), (False, True)):
        legacy.SetFileVersion(version)
        (legacy.SetFileTypeToBinary if binary else legacy.SetFileTypeToASCII)()
        legacy.SetFileName(f"cells-vtk-{version / 10}-{'binary' if binary else 'text'}.vtk")
        legacy.Write()


def surfaces():
    """A cube of six squares as polygons, lines and points: legacy and XML poly-data; a cube as STL and OBJ."""
    faces = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
    points = POINTS[:8]
    data = vtk.vtkPolyData()
    vertices = vtk.vtkPoints()
    for point in points:
        vertices.InsertNextPoint(point)
    polygons, lines, spots, strips = (vtk.vtkCellArray() for _ in range(4))
    for face in faces:
        polygons.InsertNextCell(4, face.tolist())
    lines.InsertNextCell(3, [0, 1, 2])
    spots.InsertNextCell(1, [7])
    strips.InsertNextCell(4, [0, 1, 3, 2])
    data.SetPoints(vertices)
    data.SetPolys(polygons)
    data.SetLines(lines)
    data.SetVerts(spots)
    data.SetStrips(strips)
    number = vtk.vtkIntArray()
    number.SetName("file cell")
    for i in range(9):
        number.InsertNextValue(i)
    data.GetCellData().AddArray(number)
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetInputData(data)
    writer.SetFileName("surface.vtp")
    writer.Write()
    legacy = vtk.vtkPolyDataWriter()
    legacy.SetInputData(data)
    for version, binary in itertools.product((42, 51), (False, True)):
        legacy.SetFileVersion(version)
        (legacy.SetFileTypeToBinary if binary else legacy.SetFileTypeToASCII)()
        legacy.SetFileName(f"surface-{version / 10}-{'binary' if binary else 'text'}.vtk")
        legacy.Write()

    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    with open("cube-text.stl", "w") as out:
        out.write("solid cube\n")
        for t in triangles:
            n = np.cross(points[t[1]] - points[t[0]], points[t[2]] - points[t[0]])
            out.write("facet normal {} {} {}\n outer loop\n".format(*n))
            for i in t:
                out.write("  vertex {} {} {}\n".format(*points[i]))
            out.write(" endloop\nendfacet\n")
        out.write("endsolid cube\n")
    with open("cube-binary.stl", "wb") as out:
        out.write(b"solid or not".ljust(80) + struct.pack("<I", len(triangles)))
        for t in triangles:
            out.write(struct.pack("<12fH", 0, 0, 0, *points[list(t)].ravel(), 0))
    with open("cube.obj", "w") as out:
        out.write("# a cube\no cube\n" + "".join("v {} {} {}\n".format(*p) for p in points))
        out.write("".join("vt {} {}\n".format(p[0], p[1]) for p in points))
        out.write("vn 0 0 1\ng sides all\n")
        for i, face in enumerate(faces):
            if i == 3:
                out.write("g tops all\n")
            if i % 2:
                out.write("f " + " ".join(f"{k - 8}/{k - 8}/1" for k in face) + "\n")
            else:
                out.write("f " + " ".join(f"{k + 1}/{k + 1}" for k in face) + "\n")
        out.write("l 1 2 3\n")


if __name__ == "__main__":
    for shape in (("tet", "linear"), ("tet", "quadratic"), ("hex", "linear"), ("hex", "serendipity"), ("hex", "quadratic"), ("wedge", "linear"), ("wedge", "serendipity")):
        box(*shape)
    cells()
    surfaces()
