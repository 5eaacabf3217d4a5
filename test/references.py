"""Makes the reference pages in docs/ of what the code declares: ``make references``.

- docs/command_reference.md: every command and its options, of the parsers.
- docs/parameter_reference.md: every parameter of every node, of the descriptors.
- docs/api_reference.md: what ``import rebt_ros`` exports, of the docstrings.
- docs/document_reference.md: trees and rules, of their JSON Schemas.
- docs/robot_file_reference.md: of the JSON Schema of robot files.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
import json
import re
import tempfile
import textwrap
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from unittest import mock

import robot_file_reference

import rebt_ros

CHECKOUT: Final = Path(__file__).resolve().parents[1]
DOCS: Final = CHECKOUT / "docs"
_MADE: Final = "`make references` makes this page from {}: do not edit it.\n"


# --- commands ---


def commands() -> dict[str, str]:
    """The module of each command that is no node, by its name."""
    text = (CHECKOUT / "setup.py").read_text(encoding="utf-8")
    return dict(re.findall(r'"([\w-]+) = {PACKAGE}\.(commands\.\w+):main"', text))


def main_of(command: str) -> Callable[[list[str]], None]:
    """What runs a command."""
    main: Callable[[list[str]], None]
    main = importlib.import_module(f"rebt_ros.{commands()[command]}").main
    return main


class _ParserError(Exception):
    """The parser of a command, in place of what it would do."""

    def __init__(self, parser: argparse.ArgumentParser) -> None:
        super().__init__(parser.prog)
        self.parser = parser


def parser_of(command: str) -> argparse.ArgumentParser:
    """What parses the arguments of a command."""

    def caught(parser: argparse.ArgumentParser, *_: object) -> None:
        raise _ParserError(parser)

    main = main_of(command)
    with mock.patch.object(argparse.ArgumentParser, "parse_intermixed_args", caught):
        try:
            main([])
        except _ParserError as err:
            return err.parser
    raise AssertionError(f"{command} parses nothing")


def command_reference() -> str:
    """The page on commands."""
    lines = ["# Command reference", "", "Every command: `ros2 run rebt_ros COMMAND`."]
    lines.append(_MADE.format("the commands' parsers"))
    for command in sorted(commands()):
        parser = parser_of(command)
        lines += [f"## {command}", "", _cell(parser.description or ""), ""]
        for group in parser._action_groups:
            actions = [one for one in group._group_actions if one.help != argparse.SUPPRESS]
            rows = [_option(parser, one) for one in actions if "--help" not in one.option_strings]
            if rows:
                named = group.title not in ("positional arguments", "options")
                title = (group.title or "").capitalize()
                lines += [f"| {title if named else ''} | |", "| --- | --- |", *rows, ""]
    return "\n".join(lines).rstrip() + "\n"


def _option(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    value = "" if action.nargs == 0 else f" {_metavar(action)}"
    names = [f"{one}{value}" for one in action.option_strings] or [_metavar(action)]
    name = ", ".join(f"`{_code(one)}`" for one in names)
    more = {"*": " …, or none", "+": " …", "?": ", or none"}.get(str(action.nargs), "")
    words = parser._get_formatter()._expand_help(action) if action.help else ""
    return f"| {name}{more} | {_cell(words)} |"


def _metavar(action: argparse.Action) -> str:
    if action.metavar is not None:
        named = action.metavar
        return named if isinstance(named, str) else " ".join(named)
    if action.choices is not None:
        return "{" + ",".join(map(str, action.choices)) + "}"
    return action.dest.upper() if action.option_strings else action.dest


# --- parameters ---


def parameter_reference() -> str:
    """The page on parameters."""
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node
    from rclpy.parameter import Parameter
    from ros_processes import own_domain

    lines = ["# Parameter reference", "", "Every parameter of every node; see [nodes](nodes.md)."]
    lines.append(_MADE.format("the parameters' descriptors"))
    with tempfile.TemporaryDirectory() as directory, own_domain() as domain:
        config = Path(directory) / "tree.json"
        config.write_text('{"type_": "sequence", "child_list": [{"type_": "action", "name": "a"}]}')
        given = {"synthetic_robot": [Parameter("config", value=str(config))]}
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        try:
            for name, declare in _declaring().items():
                node = Node(name, context=context, parameter_overrides=given.get(name))
                before = set(node._parameters)
                declare(node)
                declared = [one for one in node._parameters if one not in before]
                defaults = dict.fromkeys((one.name for one in given.get(name, ())), "")
                lines += [f"## {name}", "", "| parameter | default | |", "| --- | --- | --- |"]
                lines += [_parameter(node, one, defaults) for one in sorted(declared)]
                lines.append("")
                node.destroy_node()
        finally:
            rclpy.shutdown(context=context)
    return "\n".join(lines).rstrip() + "\n"


def _declaring() -> dict[str, Callable[[Any], object]]:
    homes = {
        "recorder": "recorder.settings",
        "learner": "learner.settings",
        "executor": "executor.settings",
        "studio": "studio.settings",
        "robot": "robots.robot",
        "demonstrator": "robots.demonstrator",
        "synthetic_robot": "robots.synthetic_robot",
    }
    return {
        name: importlib.import_module(f"rebt_ros.ros.{home}").declare_settings
        for name, home in homes.items()
    }


def _parameter(node: Any, name: str, defaults: Mapping[str, object]) -> str:
    descriptor = node.describe_parameter(name)
    default = defaults.get(name, node.get_parameter(name).value)
    words = [descriptor.description]
    for one in (*descriptor.integer_range, *descriptor.floating_point_range):
        words.append(f"From {one.from_value} to {one.to_value}.")
    if descriptor.additional_constraints:
        words.append(f"{descriptor.additional_constraints.capitalize()}.")
    return f"| `{name}` | `{_yaml(default)}` | {_cell(' '.join(words))} |"


def _yaml(value: object) -> str:
    """A value as in a parameter file."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple):
        # ROS 2 cannot write down an empty list.
        value = [one for one in value if one]
        return "[" + ", ".join(map(_yaml, value)) + "]"
    return repr(value)


# --- Python ---


def api_reference() -> str:
    """The page on what can be imported."""
    lines = ["# API reference", "", "What `import rebt_ros` exports. All else may change."]
    lines.append(_MADE.format("the docstrings"))
    offered = {name: getattr(rebt_ros, name) for name in rebt_ros.__all__}
    functions = {name: one for name, one in offered.items() if inspect.isfunction(one)}
    lines += ["## Functions", ""]
    for name, function in functions.items():
        tree = _source(function)
        assert isinstance(tree, ast.FunctionDef)
        lines += [f"### {name}", "", "```python", _signature(tree), "```", ""]
        lines += ["```text", inspect.cleandoc(function.__doc__ or ""), "```", ""]
    lines += ["## Classes", ""]
    for name, kind in offered.items():
        if inspect.isclass(kind):
            lines += [f"### {name}", "", _paragraph(kind.__doc__), "", *_members(kind)]
    rest = [
        name for name in offered if name not in functions and not inspect.isclass(offered[name])
    ]
    lines += ["## Types", ""]
    for name in rest:
        lines.append(f"- `{name}`: `{_cell(str(offered[name]).replace('typing.', ''))}`")
    return "\n".join(lines).rstrip() + "\n"


def _members(kind: type) -> Iterator[str]:
    tree = _source(kind)
    assert isinstance(tree, ast.ClassDef)
    rows = list(_rows(tree))
    if rows:
        yield from ("| | |", "| --- | --- |")
        yield from rows
        yield ""


def _rows(tree: ast.ClassDef) -> Iterator[str]:
    for member, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        match member:
            case ast.AnnAssign(target=ast.Name(id=name)) if not name.startswith("_"):
                kind = ast.unparse(member.annotation)
                default = f" = {ast.unparse(member.value)}" if member.value else ""
                yield f"| `{_code(f'{name}: {kind}{default}')}` | {_paragraph(_text(after))} |"
            case ast.Assign(targets=[ast.Name(id=name)]) if not name.startswith("_"):
                value = ast.unparse(member.value)
                yield f"| `{_code(f'{name} = {value}')}` | {_paragraph(_text(after))} |"
            case ast.FunctionDef(name=name) if not name.startswith("_"):
                made = {ast.unparse(one) for one in member.decorator_list}
                shown = name if "property" in made else _signature(member)
                yield f"| `{_code(shown)}` | {_paragraph(ast.get_docstring(member))} |"


def _source(offered: Any) -> ast.stmt:
    return ast.parse(textwrap.dedent(inspect.getsource(offered))).body[0]


def _signature(tree: ast.FunctionDef) -> str:
    given = ast.unparse(tree.args)
    for first in ("self, ", "cls, ", "self", "cls"):
        if given.startswith(first):
            given = given.removeprefix(first)
            break
    return f"{tree.name}({given}) -> {ast.unparse(tree.returns) if tree.returns else 'None'}"


def _text(statement: ast.stmt | None) -> str:
    match statement:
        case ast.Expr(value=ast.Constant(value=str(text))):
            return text
    return ""


def _paragraph(docstring: str | None) -> str:
    return _cell(inspect.cleandoc(docstring or "").split("\n\n")[0])


# --- documents ---


def document_reference() -> str:
    """The page on JSON documents and rules."""
    lines = ["# Document reference", "", "JSON and YAML, as their schemas describe them. What they"]
    lines.append("mean is in [formats](formats.md) and [rules](rules.md).")
    lines.append(_MADE.format("the JSON Schemas"))
    for title, where in (
        ("Behavior tree", "behavior_tree/behavior_tree.schema.json"),
        ("Rules", "verification/rules.schema.json"),
    ):
        schema: Any = json.loads((CHECKOUT / "rebt_ros" / where).read_text(encoding="utf-8"))
        lines += [f"## {title}", "", _cell(schema["description"]), ""]
        lines += [f"[{Path(where).name}](../rebt_ros/{where})", "", *_keys(schema)]
        for name, form in schema["$defs"].items():
            lines += [f"### {title}: {name}", ""]
            variants = [one for one in form.get("oneOf", ()) if "type" in one.get("properties", {})]
            if variants:
                for one in variants:
                    lines += [f"`{one['properties']['type']['const']}`:", "", *_keys(one)]
            elif "properties" in form:
                lines += _keys(form)
            else:
                lines += [_kind(form), ""]
    return "\n".join(lines).rstrip() + "\n"


def _keys(form: Any) -> Iterator[str]:
    yield from ("| key | value | |", "| --- | --- | --- |")
    yield from _nested(form, "")
    yield ""


def _nested(form: Any, path: str) -> Iterator[str]:
    for name, its in form["properties"].items():
        needed = "" if name in form.get("required", ()) else ", may be missing"
        yield f"| `{path}{name}` | {_kind(its)}{needed} | {_cell(its.get('description', ''))} |"
        if "properties" in its:
            yield from _nested(its, f"{path}{name}.")
        elif "properties" in its.get("items", {}):
            yield from _nested(its["items"], f"{path}{name}[].")


def _kind(form: Any) -> str:
    if "const" in form:
        return f"`{json.dumps(form['const'])}`"
    if "enum" in form:
        return ", ".join(f"`{json.dumps(one)}`" for one in form["enum"])
    if "$ref" in form:
        return str(form["$ref"].rsplit("/", 1)[1])
    kinds = form.get("type", "anything")
    words = " or ".join(kinds) if isinstance(kinds, list) else str(kinds)
    if "items" in form:
        words += f" of {_kind(form['items'])}"
    bounds = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "maxItems": "most:"}
    return " ".join(
        [words, *(f"{word} {form[key]}" for key, word in bounds.items() if key in form)]
    )


# --- pages ---


def _code(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _cell(text: str) -> str:
    """A text as it can stand in a table."""
    return _code(text).replace("<", "&lt;")


#: What makes each page.
PAGES: Final[Mapping[str, Callable[[], str]]] = {
    "command_reference.md": command_reference,
    "parameter_reference.md": parameter_reference,
    "api_reference.md": api_reference,
    "document_reference.md": document_reference,
    "robot_file_reference.md": robot_file_reference.reference,
}


def main() -> None:
    """Writes all pages."""
    for name, made in PAGES.items():
        (DOCS / name).write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    main()
