"""The package: import, types, documents."""

from __future__ import annotations

import pathlib
import re
import subprocess
import sys

import pytest
import variational_sim as vs
from conftest import ROOT


def python(code: str, *options: str) -> str:
    done = subprocess.run([sys.executable, *options, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.timing
def test_import_is_quick() -> None:
    # The processor's time, which other programs on the machine do not change.
    code = "import time; t = time.process_time(); import variational_sim; print(time.process_time() - t)"
    assert min(float(python(code)) for _ in range(5)) < 0.05


def test_import_needs_numpy_alone() -> None:
    code = "import sys; before = set(sys.modules); import variational_sim; print(*set(sys.modules) - before)"
    outside = {name.split(".")[0] for name in python(code).split()} - set(sys.stdlib_module_names)
    assert outside <= {"variational_sim", "numpy"}
    missing = "import sys; sys.modules['numpy'] = None; sys.path_importer_cache.clear()\n"
    missing += "import importlib.util as u; u.find_spec = lambda name, *_: None\n"
    missing += "try:\n    import variational_sim\nexcept ImportError as e:\n    print(e)"
    assert "pip install numpy" in python(missing)


def test_the_keys_are_those_of_the_schema() -> None:
    make = ROOT / "python" / "make_keys.py"
    code = f"import json, runpy, variational_sim as vs; m = runpy.run_path({str(make)!r}); "
    code += "print(m['text'](json.loads(vs.schema())), end='')"
    assert python(code) == (ROOT / "python" / "variational_sim" / "keys.py").read_text()


def test_types(tmp_path: pathlib.Path) -> None:
    pytest.importorskip("mypy")
    first, readme = tmp_path / "first.py", tmp_path / "readme.py"
    first.write_text(blocks(ROOT / "docs" / "python.md")[0])
    readme.write_text("\n".join(blocks(ROOT / "README.md")))
    # joblib has no types.
    without_types = "--disable-error-code=import-untyped"
    for command in (
        ["mypy", "--config-file", str(ROOT / "pyproject.toml"), "-p", "variational_sim"],
        ["mypy", "--strict", str(first)],
        ["mypy", "--strict", without_types, str(readme)],
        ["mypy.stubtest", "variational_sim._core"],
    ):
        done = subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, check=False, cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr


def blocks(path: pathlib.Path) -> list[str]:
    """The Python blocks of a document."""
    return re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("document", ["README.md", "docs/python.md"])
def test_the_blocks_of_the_documents_run(document: str, tmp_path: pathlib.Path) -> None:
    pytest.importorskip("joblib")
    found = blocks(ROOT / document)
    assert found
    text = "\n".join(found)
    if "to_pyvista" in text or "picture" in text:
        pytest.importorskip("pyvista")
    script = tmp_path / "blocks.py"
    script.write_text("try:\n    import pyvista\n    pyvista.OFF_SCREEN = True\nexcept ImportError:\n    pass\n" + text)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_public_name_is_documented() -> None:
    for name in vs.__all__:
        assert getattr(vs, name).__doc__, name
