"""Writes variational_sim/keys.py, the TypedDicts of scenes, from the schema: `python python/make_keys.py`."""

from __future__ import annotations

import json
import keyword
import pathlib
from typing import Any

PATH = pathlib.Path(__file__).parent / "variational_sim" / "keys.py"
HEAD = '''"""The keys of scenes, made from the schema by make_keys.py: do not edit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypedDict, Union

from numpy.typing import NDArray

Numbers = Union[Sequence[float], NDArray[Any]]

'''


def text(schema: dict[str, Any]) -> str:
    """Returns the module."""
    definitions = schema["$defs"]
    out: list[str] = []
    made: set[str] = set()

    def kind(part: Any, name: str) -> str:
        """Returns the type of a part of the schema; makes the TypedDicts that it needs."""
        if part is True or not part:
            return "Any"
        if "$ref" in part:
            target = part["$ref"].rsplit("/", 1)[1]
            if target not in made:
                made.add(target)
                found = kind(definitions[target], target)
                if found != target:
                    out.append(f"{target} = {found}\n")
            return target
        if "const" in part:
            return f"Literal[{part['const']!r}]"
        if "enum" in part:
            return f"Literal[{', '.join(repr(value) for value in part['enum'])}]"
        for key in ("anyOf", "oneOf", "allOf"):
            if key in part:
                many = [kind(option, f"{name}{number}") for number, option in enumerate(part[key])]
                if key == "allOf" and "properties" in part:
                    return "Any"
                many = list(dict.fromkeys(many))
                return many[0] if len(many) == 1 else f"Union[{', '.join(many)}]"
        types = part.get("type", "object")
        if isinstance(types, list):
            many = [kind({**part, "type": one}, name) for one in types]
            return many[0] if len(many) == 1 else f"Union[{', '.join(dict.fromkeys(many))}]"
        simple = {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "null": "None"}
        if types in simple:
            return simple[types]
        if types == "array":
            items = kind(part.get("items", True), name + "Item")
            return "Numbers" if items in ("float", "int") else f"Sequence[{items}]"
        if "properties" not in part:
            return "dict[str, Any]"
        fields = {key: kind(value, name + key.title().replace("_", "")) for key, value in part["properties"].items()}
        if name == "Body":
            fields["mesh"] = "Any"
        if name == "Fix":
            fields["motion"] = "Any"
        if any(keyword.iskeyword(key) or not key.isidentifier() for key in fields):
            entries = ", ".join(f"{key!r}: {value!r}" for key, value in fields.items())
            out.append(f"{name} = TypedDict({name!r}, {{{entries}}}, total=False)\n")
            return name
        lines = [f"class {name}(TypedDict, total=False):"]
        for key, value in fields.items():
            words = str(part["properties"][key].get("description", "") if part["properties"][key] is not True else "")
            first = words.replace("\n", " ").replace("\\", "").replace('"', "'").strip()
            lines.append(f"    {key}: {value}")
            if first:
                lines.append(f'    """{first}"""')
        out.append("\n".join(lines) + "\n")
        return name

    kind({key: value for key, value in schema.items() if key != "$defs"}, "SceneKeys")
    return HEAD + "\n".join(out)


if __name__ == "__main__":
    from variational_sim import schema as made_from

    PATH.write_text(text(json.loads(made_from())), encoding="utf-8")
