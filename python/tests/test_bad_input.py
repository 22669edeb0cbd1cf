"""Wrong scenes: the cases of tests/commands/bad_input.rs, from files, texts and dicts."""

from __future__ import annotations

import json
import pathlib
import re
import subprocess

import pytest
import variational_sim as vs
from conftest import ROOT

SOURCE = (ROOT / "tests" / "commands" / "bad_input.rs").read_text(encoding="utf-8")
STRING = r'"((?:[^"\\]|\\.)*)"'


def good() -> str:
    found = re.search(r'const GOOD: &str = r#"(.*?)"#;', SOURCE, re.DOTALL)
    assert found
    return found[1].replace("MESHES", str(ROOT / "meshes"))


def cases() -> list[tuple[str, str]]:
    """The replacements in the good scene: `change("from", "to", …)` and rows `("from", "to", …)`."""
    found = re.findall(rf"(?:change)?\(\s*{STRING},\s*{STRING},\s*(?:&\[)?\"", SOURCE)
    pairs = [(json.loads(f'"{a}"'), json.loads(f'"{b}"')) for a, b in found]
    meshes = str(ROOT / "meshes")
    return [(a.replace("MESHES", meshes), b) for a, b in pairs if a.replace("MESHES", meshes) in good()]


def test_the_cases_are_found_and_the_scene_itself_is_good() -> None:
    assert len(cases()) >= 20
    vs.Scene(good()).check()


@pytest.mark.parametrize("case", cases())
def test_a_wrong_scene_has_the_problems_that_the_program_reports(
    case: tuple[str, str], program: str, tmp_path: pathlib.Path
) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(good().replace(*case))
    said = subprocess.run([program, "check", path, "--json"], capture_output=True, text=True, check=False, cwd=tmp_path)
    expected = json.loads(said.stdout)["scenes"][0]["problems"]
    assert said.returncode == 2 and expected
    for source in (path, path.read_text()):
        with pytest.raises(vs.SceneError) as caught:
            vs.Scene(source).check()
        found = [dict(line=p.line, key=p.key, message=p.message) for p in caught.value.problems]
        assert found == expected
    tomllib = pytest.importorskip("tomllib", reason="needs Python 3.11")
    try:
        tree = tomllib.loads(path.read_text())
    except tomllib.TOMLDecodeError:
        return
    with pytest.raises(vs.SceneError) as caught:
        vs.Scene(tree).check()
    # A dict has no lines.
    assert {(p.key, p.message) for p in caught.value.problems} == {(p["key"], p["message"]) for p in expected}
    assert all(p.line is None for p in caught.value.problems)
