"""Scenes: everything that a run needs."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from . import _core, toml
from .meshes import as_mesh

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .keys import SceneKeys

# Stands in a text for a mesh from arrays.
_ARRAYS = "(arrays)"


class Scene:
    """A scene, from keywords, a dict, TOML text, or the path of a scene file.

        Scene("scenes/flag.toml")
        Scene(gravity=[0, 0, -9.81], time=dict(end=1.0, scheme="auto"), body=[dict(name="flag", …)])

    The keys are those of scene files; `variational_sim.schema()` lists them with units and ranges. Besides, the
    `mesh` of a body may be a `Mesh`, a pyvista data set, a meshio mesh or `(points, cells, regions)`, and the
    `motion` of a fix may be a callable `f(x, t)` that returns the positions (n, 3) at time t (s) of the points that
    start at x (n, 3); a method `velocity(x, t)` gives their velocities (without it, they are differenced).

    A scene does not change: `set` returns another one. Scenes can be pickled and compared.

    Raises SceneError with all problems, each with its key.
    """

    __slots__ = ("_core", "_name")

    def __init__(
        self,
        source: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        /,
        **keys: Unpack[SceneKeys],
    ) -> None:
        self._name = "scene"
        if source is None or isinstance(source, Mapping):
            self._core = _from_tree({**(source or {}), **keys})
            return
        if isinstance(source, str) and ("\n" in source or "=" in source):
            self._core = _core.Scene.parse(source, [], [], [], True)
        else:
            path = os.fsdecode(os.fspath(source))
            self._core = _core.Scene.read(path, [])
            self._name = os.path.splitext(os.path.basename(path))[0] or "scene"
        if keys:
            self._core = self.set(keys)._core

    @classmethod
    def _of(cls, core: _core.Scene, name: str) -> Scene:
        scene = cls.__new__(cls)
        scene._core, scene._name = core, name
        return scene

    @property
    def name(self) -> str:
        """The name of the scene file without its extension, else `scene`; output files begin with it."""
        return self._name

    def named(self, name: str) -> Scene:
        """Returns the scene with another name."""
        return Scene._of(self._core, name)

    def set(self, changes: Mapping[str, Any]) -> Scene:
        """Returns the scene with other values of keys, such as `{"body[0].material.young": 1e5}`."""
        overrides = [f"{key}={toml.value(value)}" for key, value in changes.items()]
        core = _core.Scene.parse(self._core.to_toml(), overrides, self._core.meshes, self._core.motions, False)
        return Scene._of(core, self._name)

    def check(self) -> None:
        """Reads the meshes and builds the systems without running; raises SceneError with all problems."""
        self._core.check()

    def to_toml(self) -> str:
        """Returns the scene as TOML, with absolute paths. It cannot hold arrays and callables."""
        return self._core.to_toml()

    def to_dict(self) -> dict[str, Any]:
        """Returns the scene as a dict, with all defaults."""
        tree: dict[str, Any] = json.loads(self._core.to_json())
        return tree

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scene):
            return NotImplemented
        return self.__reduce__()[1][0] == other.__reduce__()[1][0] and not (
            self._core.meshes or self._core.motions or other._core.meshes or other._core.motions
        )

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        meshes = [(i, (m.points, m.blocks, m.regions)) for i, m in self._core.meshes]
        return _restored, (self._core.to_toml(), meshes, self._core.motions, self._name)

    def __repr__(self) -> str:
        return f"<Scene '{self._name}': {', '.join(self._bodies()) or 'no bodies'}>"

    def _bodies(self) -> list[str]:
        tree = self.to_dict()
        return [body["name"] for key in ("body", "rigid") for body in tree.get(key, [])]

    def _repr_html_(self) -> str:
        from .html import table

        tree = self.to_dict()
        rows = []
        for body in tree.get("body", []):
            shape = next((key for key in ("mesh", "box", "sheet") if body.get(key) is not None), "arrays")
            material = body["material"]
            laws = material if isinstance(material, list) else [material]
            rows.append((body["name"], shape, ", ".join(law["law"] for law in laws)))
        rows += [(rigid["name"], "rigid", "") for rigid in tree.get("rigid", [])]
        time = tree["time"]
        caption = f"{tree.get('title') or self._name}: {time.get('scheme') or 'static'} to {time['end']} s"
        return table(caption, ("body", "shape", "law"), rows)


def _restored(text: str, meshes: list[Any], motions: list[Any], name: str) -> Scene:
    made = [(i, as_mesh((points, blocks, regions))) for i, (points, blocks, regions) in meshes]
    return Scene._of(_core.Scene.parse(text, [], made, motions, False), name)


def _from_tree(tree: Mapping[str, Any]) -> _core.Scene:
    """Makes a scene from a dict. Its meshes and callables are passed beside the text."""
    tree = dict(tree)
    meshes: list[tuple[int, _core.Mesh]] = []
    motions: list[tuple[int, Any]] = []
    bodies = tree.get("body")
    if isinstance(bodies, (list, tuple)):
        tree["body"] = list(bodies)
        for i, body in enumerate(tree["body"]):
            given = body.get("mesh") if isinstance(body, Mapping) else None
            # Numbers are wrong, and reported with all other problems.
            if given is not None and not isinstance(given, (str, os.PathLike, bool, int, float)):
                meshes.append((i, as_mesh(given)))
                tree["body"][i] = {**body, "mesh": _ARRAYS}
    fixes = tree.get("fix")
    if isinstance(fixes, (list, tuple)):
        tree["fix"] = list(fixes)
        for i, fix in enumerate(tree["fix"]):
            if isinstance(fix, Mapping) and callable(fix.get("motion")):
                motions.append((i, fix["motion"]))
                tree["fix"][i] = {**fix, "motion": None}
    return _core.Scene.parse(toml.document(tree), [], meshes, motions, False)
