"""Writes trees of dicts, lists and numbers as TOML."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any


def document(tree: Mapping[str, Any]) -> str:
    """Returns a TOML document. Lists of dicts become arrays of tables, so that problems name the entry: `load[0]`."""
    lines, tables = [], []
    for key, entry in tree.items():
        if isinstance(entry, (list, tuple)) and entry and all(isinstance(part, Mapping) for part in entry):
            for part in entry:
                tables += [f"[[{_key(key)}]]", *_pairs(part)]
        else:
            lines += _pairs({key: entry})
    return "\n".join(lines + tables) + "\n"


def _pairs(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {value(entry)}" for key, entry in table.items() if entry is not None]


def value(entry: Any) -> str:
    """Returns a value as TOML. Keys whose value is None are left out."""
    # Scalars and arrays of numpy become Python's own.
    if hasattr(entry, "tolist"):
        entry = entry.tolist()
    if isinstance(entry, bool):
        return "true" if entry else "false"
    if isinstance(entry, str):
        return _text(entry)
    if isinstance(entry, int):
        return str(entry)
    if isinstance(entry, float):
        return repr(entry)
    if isinstance(entry, os.PathLike):
        return _text(os.fsdecode(os.fspath(entry)))
    if isinstance(entry, Mapping):
        return "{ " + ", ".join(_pairs(entry)) + " }"
    if isinstance(entry, (list, tuple)):
        return "[" + ", ".join(value(part) for part in entry) + "]"
    raise TypeError(
        f"a scene holds numbers, strings, booleans, lists and dicts, not {type(entry).__name__}: {entry!r}"
    )


def _text(text: str) -> str:
    # JSON's escapes are TOML's, except that TOML also escapes DEL; surrogates have no TOML form.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(key: Any) -> str:
    text = str(key)
    is_bare = text.isascii() and text.replace("_", "").replace("-", "").isalnum()
    return text if is_bare else _text(text)
