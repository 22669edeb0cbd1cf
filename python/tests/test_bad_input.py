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


def text(literal: str) -> str:
    """The value of a Rust string literal without its quotes."""
    joined = re.sub(r"\\\n\s*", "", literal)
    return str(json.loads(f'"{joined}"')).replace("MESHES", str(ROOT / "meshes"))


def cases() -> list[str]:
    """The scenes of the file: the good one with replacements, in one call or in a row of calls, or with tables after it."""
    pairs = re.findall(rf"(?:change)?\(\s*{STRING},\s*{STRING},\s*(?:&\[)?\"", SOURCE)
    chains = [[pair] for pair in pairs]
    one = rf"\.replace\(\s*{STRING},\s*{STRING}\s*\)"
    chains += [re.findall(one, chain) for chain in re.findall(rf"GOOD\s*((?:{one}\s*)+)", SOURCE) for chain in chain[:1]]
    found = []
    for chain in chains:
        scene = good()
        for before, after in chain:
            scene = scene.replace(text(before), text(after))
        found.append(scene)
    variables = {name: text(value) for name, value in re.findall(rf"let (\w+) = {STRING};", SOURCE)}
    for tail in re.findall(r'format!\(\s*"\{GOOD\}((?:[^"\\]|\\.)*)"', SOURCE):
        tail = re.sub(r"\{(\w+)\}", lambda name: variables.get(name[1], name[0]), text(tail))
        if not re.search(r"(?<!\{)\{\w*\}", tail):
            found.append(good() + tail.replace("{{", "{").replace("}}", "}"))
    return sorted(set(found) - {good()})


def test_the_cases_are_found_and_the_scene_itself_is_good() -> None:
    assert len(cases()) >= 30
    vs.Scene(good()).check()


@pytest.mark.parametrize("case", cases())
def test_a_wrong_scene_has_the_problems_that_the_program_reports(case: str, program: str, tmp_path: pathlib.Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(case)
    said = subprocess.run([program, "check", path, "--json"], capture_output=True, text=True, check=False, cwd=tmp_path)
    expected = json.loads(said.stdout)["scenes"][0]["problems"]
    if said.returncode == 0:
        vs.Scene(path).check()
        return
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
