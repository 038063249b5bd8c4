"""Writes `palpate/options.py`: types of request options, from the API's description.

Run `python3 python/options_of_api.py > python/palpate/options.py`, then `ruff format`.
"""

from __future__ import annotations

import json
import sys
import textwrap
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
#: Requests: their name here, and their fields that are arguments of their own.
REQUESTS = {
    "CreateSession": ("SessionOptions", ()),
    "StartTraining": ("TrainingOptions", ("sensor",)),
    "RecalibrateCatalogue": ("RecalibrationOptions", ()),
    "ShadowVersion": ("ComparisonOptions", ()),
    "AskNextTouches": ("NextTouchOptions", ("sensor", "candidates", "workspace")),
    "CreateSensor": ("SensorOptions", ("name", "preset", "description")),
}
#: Schemas that are called otherwise here.
NAMES = {"Pose": "PoseDocument"}
SCALARS = {"integer": "int", "number": "float", "string": "str", "boolean": "bool"}
HEAD = '''"""Types of the options of requests, which editors complete and type checkers check.

Written by `python/options_of_api.py` from the API's description; do not edit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from typing_extensions import Required
'''


class Writer:
    """Writes schemas in the order in which they are needed."""

    def __init__(self, schemas: dict[str, Any]) -> None:
        self.schemas = schemas
        self.written: dict[str, str] = {}

    def type_of(self, schema: dict[str, Any]) -> str:
        """The annotation of a schema."""
        if "$ref" in schema:
            name = schema["$ref"].rsplit("/", 1)[1]
            called = NAMES.get(name, name)
            self.write(name, called)
            return called
        for several in ("anyOf", "oneOf"):
            if several in schema:
                return " | ".join(dict.fromkeys(self.type_of(one) for one in schema[several]))
        if "const" in schema:
            return f"Literal[{json.dumps(schema['const'])}]"
        if "enum" in schema:
            return f"Literal[{', '.join(json.dumps(one) for one in schema['enum'])}]"
        kinds = schema.get("type", "any")
        found = [
            self.of_kind(kind, schema) for kind in ([kinds] if isinstance(kinds, str) else kinds)
        ]
        return " | ".join(dict.fromkeys(found))

    def of_kind(self, kind: str, schema: dict[str, Any]) -> str:
        """The annotation of one kind of a schema."""
        if kind == "array":
            return f"Sequence[{self.type_of(schema.get('items', {}))}]"
        if kind == "object":
            values = schema.get("additionalProperties")
            return f"Mapping[str, {self.type_of(values) if isinstance(values, dict) else 'Any'}]"
        return SCALARS.get(kind, "None" if kind == "null" else "Any")

    def write(self, name: str, called: str, left_out: tuple[str, ...] = ()) -> None:
        """Writes a schema after those that it needs."""
        if called in self.written:
            return
        self.written[called] = ""
        schema = self.schemas[name]
        if "properties" not in schema:
            type_ = self.type_of(schema)
            self.finish(called, f"{called} = {type_}\n{documented(schema, 0)}")
            return
        lines = [f"class {called}(TypedDict, total=False):\n{documented(schema, 4)}"]
        required = schema.get("required", [])
        for field, one in schema["properties"].items():
            if field in left_out:
                continue
            type_ = self.type_of(one)
            type_ = f"Required[{type_}]" if field in required else type_
            lines.append(f"    {field}: {type_}\n{documented(one, 4)}")
        self.finish(called, "".join(lines))

    def finish(self, called: str, text: str) -> None:
        """Puts a type behind those that it needs."""
        del self.written[called]
        self.written[called] = text


def documented(schema: dict[str, Any], indent: int) -> str:
    """The docstring of a schema."""
    text = schema.get("description")
    inner = [one.get("description") for one in schema.get("anyOf", []) if "description" in one]
    text = " ".join((text or (inner[0] if inner else "")).split())
    if not text:
        return ""
    lines = textwrap.wrap(text, 94 - indent)
    lines = [lines[0]] if len(lines) == 1 else [*lines, ""]
    body = f'"""{lines[0]}' + "".join(f"\n{line}" for line in lines[1:]) + '"""'
    return textwrap.indent(body, " " * indent) + "\n"


def written() -> str:
    """The whole file."""
    description = json.loads((ROOT / "schemas/openapi.json").read_text())
    writer = Writer(description["components"]["schemas"])
    for name, (called, left_out) in REQUESTS.items():
        writer.write(name, called, left_out)
    return "\n\n".join([HEAD, *writer.written.values()])


if __name__ == "__main__":
    sys.stdout.write(written())
