"""Runs the code of notebooks, each in a process of its own and a temporary directory: `run_notebooks.py FILE …`."""

from __future__ import annotations

import json
import pathlib
import subprocess
import sys
import tempfile

OFF_SCREEN = "try:\n    import pyvista\n    pyvista.OFF_SCREEN = True\nexcept ImportError:\n    pass\n"


def code(path: pathlib.Path) -> str:
    """Returns the code cells of a notebook as one script."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


def main(paths: list[str]) -> int:
    """Runs all notebooks; returns the number of those that fail."""
    failed = 0
    for path in map(pathlib.Path, paths):
        with tempfile.TemporaryDirectory() as room:
            script = pathlib.Path(room) / f"{path.stem}.py"
            script.write_text(OFF_SCREEN + code(path), encoding="utf-8")
            done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=room, check=False)
        if done.returncode != 0:
            failed += 1
            print(f"{path}:\n{done.stdout}{done.stderr}", file=sys.stderr)
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
