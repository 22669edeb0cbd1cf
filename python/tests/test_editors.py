"""Editors complete and check scenes by the schema that `variational new` writes."""

from __future__ import annotations

import itertools
import json
import pathlib
import shutil
import subprocess
import sysconfig
import time
from types import TracebackType
from typing import Any

import pytest

class Server:
    """A language server that speaks over its standard streams."""

    def __init__(self, program: str, arguments: list[str]) -> None:
        self.process = subprocess.Popen([program, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self.numbers = itertools.count(1)

    def __enter__(self) -> Server:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.process.kill()
        self.process.wait()

    def send(self, message: dict[str, Any]) -> None:
        assert self.process.stdin
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self.process.stdin.flush()

    def read(self) -> dict[str, Any]:
        assert self.process.stdout
        length = 0
        while line := self.process.stdout.readline().strip():
            if line.lower().startswith(b"content-length:"):
                length = int(line.split(b":")[1])
        message: dict[str, Any] = json.loads(self.process.stdout.read(length))
        if "method" in message and "id" in message:
            # A request of the server, such as for the settings of the editor.
            items = message.get("params", {}).get("items") if isinstance(message.get("params"), dict) else None
            self.send({"id": message["id"], "result": [None for _ in items] if items else None})
        return message

    def ask(self, method: str, params: dict[str, Any]) -> Any:
        number = next(self.numbers)
        self.send({"id": number, "method": method, "params": params})
        while True:
            message = self.read()
            if message.get("id") == number and "method" not in message:
                assert "error" not in message, message
                return message["result"]

    def tell(self, method: str, params: dict[str, Any]) -> None:
        self.send({"method": method, "params": params})


def labels(server: Server, uri: str, line: int, character: int) -> set[str]:
    """Asks for completions until the server has read the document and its schema."""
    place = {"textDocument": {"uri": uri}, "position": {"line": line, "character": character}}
    for _ in range(100):
        found = server.ask("textDocument/completion", place)
        items = found["items"] if isinstance(found, dict) else found or []
        if items:
            return {item["label"].strip('"') for item in items}
        time.sleep(0.05)
    return set()


def installed(name: str) -> str:
    program = shutil.which(name, path=sysconfig.get_path("scripts"))
    if program is None:
        pytest.skip(f"{name} is not installed")
    return program


@pytest.fixture
def scene(program: str, tmp_path: pathlib.Path) -> pathlib.Path:
    """A scene of `variational new`."""
    subprocess.run([program, "new", "flag", "--quiet"], cwd=tmp_path, check=True)
    return tmp_path / "flag.toml"


# Scenes after the line of the schema; the cursor is at their end or before a closing quote.
UNFINISHED = [
    ("grav", {"gravity"}),
    ("[time]\nend = 1.0\nsch", {"scheme"}),
    ('[time]\nend = 1.0\nscheme = "', {"auto", "stormer-verlet"}),
    ("[[body]]\nmat", {"material"}),
]


@pytest.mark.parametrize("text, expected", UNFINISHED)
def test_tombi_completes_keys_and_values(text: str, expected: set[str], scene: pathlib.Path) -> None:
    head = scene.read_text().splitlines()[0]
    text = f"{head}\n\n{text}"
    lines = text.split("\n")
    closed = text + '"' * (text.count('"', len(head)) % 2) + "\n"
    scene.write_text(closed)
    uri = scene.as_uri()
    with Server(installed("tombi"), ["lsp", "--offline"]) as server:
        folder = {"uri": scene.parent.as_uri(), "name": "scenes"}
        abilities = {"textDocument": {"completion": {"completionItem": {"snippetSupport": True}}}}
        start = {"processId": None, "rootUri": folder["uri"], "workspaceFolders": [folder], "capabilities": abilities}
        server.ask("initialize", start)
        server.tell("initialized", {})
        document = {"uri": uri, "languageId": "toml", "version": 1, "text": closed}
        server.tell("textDocument/didOpen", {"textDocument": document})
        assert expected <= labels(server, uri, len(lines) - 1, len(lines[-1]))


@pytest.mark.parametrize("name, command", [("tombi", ["lint", "--offline"]), ("taplo", ["check", "--no-auto-config"])])
def test_editors_mark_wrong_keys(name: str, command: list[str], scene: pathlib.Path) -> None:
    def check() -> subprocess.CompletedProcess[str]:
        call = [installed(name), *command, scene.name]
        return subprocess.run(call, capture_output=True, text=True, cwd=scene.parent, check=False)

    assert check().returncode == 0
    scene.write_text(scene.read_text().replace("gravity", "gravty"))
    said = check()
    assert said.returncode == 1 and "gravty" in said.stdout + said.stderr
