"""The rules that stand in robot files."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from typing import Final

from rebt_ros.robot_file.robot_file import RobotFile, WrittenRule
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.expressions import Expression
from rebt_ros.verification.grammar import ConditionSyntaxError, parse
from rebt_ros.verification.rules import Place, Rule, RuleKind, RuleSet

#: Not known, as in a robot file that a tree carries.
_NOWHERE: Final = (0, 0)


def rules_of(robot: RobotFile | None) -> RuleSet | None:
    """The rules of a robot file; None where there are none.

    Raises:
        RuleError: A condition is malformed; the message says where and why.
    """
    if robot is None or not robot.rules:
        return None
    numbered = enumerate(robot.rules, 1)
    return RuleSet(robot.name, tuple(_rule(robot.name, number, one) for number, one in numbered))


def together(*rules: RuleSet | None) -> RuleSet | None:
    """The rules of several files; None where there are none at all.

    A rule that stands in two of them is asked once.
    """
    given = [one for one in rules if one is not None]
    if len(given) < 2:
        return given[0] if given else None
    all_of: dict[str, Rule] = {}
    for rule in chain.from_iterable(one.rules for one in given):
        all_of.setdefault(rule.text, rule)
    return RuleSet(" and ".join(one.source for one in given), tuple(all_of.values()))


def _rule(source: str, number: int, written: WrittenRule) -> Rule:
    text = f"{written.kind} {written.action}"
    text += f" @{written.channel}" if written.channel else ""
    place = Place(source, *(written.action_start or _NOWHERE), number)
    start = Place(source, *(written.when_start or _NOWHERE), number)
    when: Expression | None = None
    if written.when:
        text += f" when {' '.join(written.when.split())}"
        try:
            when = parse(written.when)
        except ConditionSyntaxError as err:
            raise RuleError(f"{_after(start, err.at)}: {err.why}.") from err
    places = tuple(_after(start, at) for at in range(len(written.when) + 1))
    channel = written.channel or None
    return Rule(RuleKind(written.kind), written.action, channel, when, text, place, places)


def _after(start: Place, characters: int) -> Place:
    return replace(start, column=start.column + characters) if start.line else start
