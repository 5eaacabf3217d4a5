"""Rules as they are written in YAML.

What is accepted is described, for other programs, by the JSON Schema beside this module.  Only the
structure of the YAML is read: no tags, and every scalar is the text that stands there.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib import resources
from typing import Any, Final, NoReturn

import yaml

from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.grammar import ConditionSyntaxError, parse
from rebt_ros.verification.rules import Place, Rule, RuleKind, RuleSet

#: Longest file that is read, in characters.
LARGEST_FILE: Final = 200_000
#: Most rules of a file.
MOST_RULES: Final = 500

_KINDS: Final = tuple(kind.value for kind in RuleKind)
_FIELDS: Final = (*_KINDS, "when", "channel")
_EXAMPLE: Final = "such as 'never: go' with 'when: front < 0.3'"


def json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a file of rules."""
    source = resources.files(__package__).joinpath("rules.schema.json")
    schema: dict[str, Any] = json.loads(source.read_text(encoding="utf-8"))
    return schema


def loads(text: str, source: str = "rules") -> RuleSet:
    """The rules of a file.

    Args:
        text: What it holds.
        source: Its name, for messages.

    Raises:
        RuleError: It is malformed; the message says where and why.
    """
    return _Reader(text, source).rule_set()


class _Reader:
    def __init__(self, text: str, source: str) -> None:
        self._text = text
        self._source = source

    def rule_set(self) -> RuleSet:
        if len(self._text) > LARGEST_FILE:
            raise RuleError(
                f"{self._source} has {len(self._text)} characters: at most {LARGEST_FILE} are read."
            )
        root = self._root()
        if root is None:
            raise RuleError(f"{self._source} is empty: list rules under 'rules:', {_EXAMPLE}.")
        fields = self._fields(root, ("rules",), "the file")
        if "rules" not in fields:
            self._refuse(root, "there is no list 'rules'")
        listed = fields["rules"]
        if not isinstance(listed, yaml.SequenceNode):
            self._refuse(listed, "'rules' must be a list, with a dash before each rule")
        if len(listed.value) > MOST_RULES:
            self._refuse(listed, f"there are {len(listed.value)} rules where {MOST_RULES} are read")
        return RuleSet(self._source, tuple(map(self._rule, listed.value)))

    def _root(self) -> yaml.Node | None:
        try:
            root: yaml.Node | None = yaml.compose(self._text, Loader=yaml.SafeLoader)
        except yaml.MarkedYAMLError as err:
            mark = err.problem_mark or err.context_mark
            where = self._place(mark) if mark else self._source
            raise RuleError(f"{where}: this is not YAML ({err.problem}).") from err
        except yaml.YAMLError as err:
            why = " ".join(str(err).split())
            raise RuleError(f"{self._source} is not YAML ({why}).") from err
        except RecursionError as err:
            raise RuleError(f"{self._source} is nested too deeply to be read.") from err
        return root

    def _fields(self, node: yaml.Node, known: tuple[str, ...], what: str) -> dict[str, yaml.Node]:
        if not isinstance(node, yaml.MappingNode):
            self._refuse(node, f"{what} must have fields, {_EXAMPLE}")
        fields: dict[str, yaml.Node] = {}
        for key, value in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else ""
            if name not in known:
                self._refuse(key, f"the field {name!r} is unknown: {what} has {', '.join(known)}")
            if name in fields:
                self._refuse(key, f"the field {name!r} is there twice")
            fields[name] = value
        return fields

    def _rule(self, node: yaml.Node) -> Rule:
        fields = self._fields(node, _FIELDS, "a rule")
        kinds = [kind for kind in RuleKind if kind.value in fields]
        if len(kinds) != 1:
            self._refuse(node, f"a rule needs exactly one of {', '.join(_KINDS)}")
        kind = kinds[0]
        action = self._name(fields[kind.value], "an action")
        channel = self._name(fields["channel"], "a channel") if "channel" in fields else None
        text = f"{kind.value} {action}" + (f" @{channel}" if channel else "")
        place = self._place(fields[kind.value].start_mark)
        if "when" not in fields:
            if kind is RuleKind.ONLY:
                self._refuse(node, "an 'only' needs a 'when'")
            return Rule(kind, action, channel, None, text, place)
        condition = fields["when"]
        if not isinstance(condition, yaml.ScalarNode) or not condition.value.strip():
            self._refuse(condition, "'when' must be a condition, such as front < 0.3")
        places = tuple(self._places(condition))
        try:
            when = parse(condition.value)
        except ConditionSyntaxError as err:
            at = places[min(err.at, len(places) - 1)]
            raise RuleError(f"{at}: {err.why}.") from err
        words = " ".join(condition.value.split())
        return Rule(kind, action, channel, when, f"{text} when {words}", place, places)

    def _name(self, node: yaml.Node, what: str) -> str:
        if not isinstance(node, yaml.ScalarNode) or not node.value:
            self._refuse(node, f"{what} must be a name")
        return str(node.value)

    def _refuse(self, node: yaml.Node, why: str) -> NoReturn:
        raise RuleError(f"{self._place(node.start_mark)}: {why}.")

    def _place(self, mark: yaml.Mark) -> Place:
        return Place(self._source, mark.line + 1, mark.column + 1)

    def _places(self, node: yaml.ScalarNode) -> Iterator[Place]:
        """Where each character of a scalar stands, and its end.

        YAML folds lines and leaves out quotes; what is left stands in the same order in the file.
        """
        line, column = node.start_mark.line, node.start_mark.column
        source = self._text[node.start_mark.index : node.end_mark.index]
        at = 0

        def step() -> None:
            nonlocal line, column, at
            line, column = (line + 1, 0) if source[at] == "\n" else (line, column + 1)
            at += 1

        for character in node.value:
            if not character.isspace():
                while at < len(source) and source[at] != character:
                    step()
            yield Place(self._source, line + 1, column + 1)
            if at < len(source):
                step()
        yield Place(self._source, line + 1, column + 1)
