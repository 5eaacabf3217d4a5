"""Writes docs/robot_file_reference.md, which follows from the JSON Schema of robot files:

PYTHONPATH=. .venv/bin/python test/robot_file_reference.py
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from rebt_ros.robot_file.reading import json_schema

PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "robot_file_reference.md"

_HEAD: Final = """\
# Robot file reference

Every key of a [robot file](robot_file.md). `test/robot_file_reference.py` makes this page from the
[JSON Schema](../rebt_ros/robot_file/robot_file.schema.json): do not edit it.
"""

#: What the maps of the schema are called, and how they are told apart.
_TITLES: Final = {
    "feature": "A feature with more than a path",
    "path_actions": "Actions from a field",
    "joy_actions": "Actions from a joystick",
    "twist_actions": "Actions from a velocity",
    "log_actions": "Actions from another behavior tree",
    "rule": "A rule",
    "publish_command": "A command that publishes",
    "call_command": "A command that calls a service",
    "goal_command": "A command that sends a goal",
}


def reference() -> str:
    """The text of the page."""
    schema: Any = json_schema()
    parts = schema["properties"]
    lines = [_HEAD, "## Parts", "", "| part | |", "| --- | --- |"]
    for name, part in parts.items():
        needed = " (required)" if name in schema["required"] else ""
        lines.append(f"| `{name}`{needed} | {part['description']} |")
    settings = next(
        form for form in parts["topics"]["additionalProperties"]["oneOf"] if "properties" in form
    )
    lines += ["", "## A topic with more than a type", "", *_table(settings, schema)]
    for name, title in _TITLES.items():
        lines += ["", f"## {title}", "", *_table(schema["$defs"][name], schema)]
    return "\n".join(lines) + "\n"


def _table(form: Any, schema: Any) -> Iterator[str]:
    yield "| key | value | default | |"
    yield "| --- | --- | --- | --- |"
    for name, its in form["properties"].items():
        whole = _resolved(its, schema)
        needed = "required" if name in form.get("required", ()) else ""
        default = f"`{json.dumps(whole['default'])}`" if "default" in whole else needed
        yield f"| `{name}` | {_value(whole, schema)} | {default} | {whole.get('description', '')} |"


def _resolved(form: Any, schema: Any) -> Any:
    """A form with what it refers to."""
    found = {key: value for key, value in form.items() if key not in ("$ref", "allOf")}
    for other in [form, *form.get("allOf", ())]:
        if "$ref" in other:
            its = _resolved(schema["$defs"][other["$ref"].rpartition("/")[2]], schema)
            found = {**its, **found}
    return found


def _value(form: Any, schema: Any) -> str:
    """What may stand there, in words."""
    if "enum" in form:
        return ", ".join(f"`{value}`" for value in form["enum"])
    if "oneOf" in form:
        return " or ".join(_value(_resolved(one, schema), schema) for one in form["oneOf"])
    kinds = form["type"] if isinstance(form["type"], list) else [form["type"]]
    if "number" in kinds and "minimum" in form:
        return f"{form['minimum']:.15g} to {form['maximum']:.15g}"
    if "object" in kinds:
        inner = form.get("additionalProperties")
        return f"map of {_value(_resolved(inner, schema), schema)}" if inner else "map"
    if "array" in kinds:
        return f"list of {_value(_resolved(form['items'], schema), schema)}"
    return "text" if "string" in kinds else " or ".join(kinds)


if __name__ == "__main__":
    PAGE.write_text(reference(), encoding="utf-8")
