"""The skirt of `meshes/skirt.obj`, cut into triangles, as a cloth for `looks.py`: mesh, lumped mass, hem, and our scene."""
import pathlib

import numpy as np
from flag import DENSITY, POISSON, cloth_scene

SOURCE = pathlib.Path(__file__).resolve().parents[2] / "meshes" / "skirt.obj"

# Number of folds, and their height over the radius, per metre below the waist.
FOLDS, FOLD = 8, 0.4


class Skirt:
    """Hangs from its waist, which is fixed. Writes its triangles to `skirt.obj` in the current directory."""

    def __init__(self, young):
        lines = [line.split() for line in SOURCE.read_text().splitlines()]
        self.points = np.array([[float(x) for x in line[1:4]] for line in lines if line[:1] == ["v"]])
        # Folds of the flare make the motion regular: a cone would stand until it buckles, at a time that round-off chooses.
        angle, drop = np.arctan2(self.points[:, 1], self.points[:, 0]), self.points[:, 2].max() - self.points[:, 2]
        self.points[:, :2] *= (1.0 + FOLD * drop * np.cos(FOLDS * angle))[:, None]
        faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[:1] == ["f"]]
        faces = np.array(faces)
        self.triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
        sides = self.points[np.roll(self.triangles, -1, axis=1)] - self.points[self.triangles]
        area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        self.mass = np.bincount(self.triangles.ravel(), np.repeat(DENSITY * area / 3, 3))
        self.shortest = np.linalg.norm(sides, axis=2).min()
        height = self.points[:, 2]
        self.waist = height.max()
        self.fixed, self.free = np.flatnonzero(height == self.waist), np.flatnonzero(height != self.waist)
        self.edge = np.flatnonzero(height == height.min())
        self.young = young
        self.lam, self.mu = young * POISSON / (1 - POISSON**2), young / (2 * (1 + POISSON))
        words = [f"v {x!r} {y!r} {z!r}" for x, y, z in self.points.tolist()]
        words += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in self.triangles.tolist()]
        self.mesh = pathlib.Path("skirt.obj").absolute()
        self.mesh.write_text("\n".join(words) + "\n")

    def scene(self, time_keys, tail):
        held = f"plane = {{ point = [0.0, 0.0, {float(self.waist)!r}], normal = [0.0, 0.0, 1.0] }}"
        return cloth_scene(f'mesh = "{self.mesh}"', held, self.young, time_keys, tail)
