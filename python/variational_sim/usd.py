"""Films as USD, which Blender, Houdini, Maya and Omniverse read. Needs `pip install 'variational-sim[usd]'`."""

from __future__ import annotations

import os

from .run import Run
from .view import frames_of


def write_usd(
    source: Run | str | os.PathLike[str], path: str | os.PathLike[str], *, fps: float = 25.0, up: str = "Z"
) -> None:
    """Writes the surfaces of all frames of a run into a USD file (.usdc, .usda): the mesh once, positions (m) and
    velocities (m/s) by time sample, `fps` of which are one second. `up` is the axis that points up, "Y" or "Z"."""
    try:
        from pxr import Usd, UsdGeom, Vt
    except ImportError as error:
        raise ImportError("this needs usd-core: pip install 'variational-sim[usd]'") from error
    import numpy as np

    frames = frames_of(source).frames
    stage = Usd.Stage.CreateNew(os.fspath(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetStartTimeCode(frames[0].t * fps)
    stage.SetEndTimeCode(frames[-1].t * fps)
    mesh = UsdGeom.Mesh.Define(stage, "/bodies")
    stage.SetDefaultPrim(mesh.GetPrim())
    mesh.CreateSubdivisionSchemeAttr("none")
    for number, frame in enumerate(frames):
        surface = frame.to_pyvista().extract_surface(algorithm="dataset_surface").triangulate()
        if number == 0:
            triangles = surface.regular_faces.astype(np.int32)
            mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel()))
        time = Usd.TimeCode(frame.t * fps)
        points = np.asarray(surface.points, np.float32)
        mesh.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(points), time)
        if "velocity" in surface.point_data:
            velocities = np.asarray(surface.point_data["velocity"], np.float32)
            mesh.CreateVelocitiesAttr().Set(Vt.Vec3fArray.FromNumpy(velocities), time)
    stage.GetRootLayer().Save()
