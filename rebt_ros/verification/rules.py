"""Rules: what a tree must never do, always do, or do in some states only."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from rebt_ros.behavior_tree import nodes
from rebt_ros.verification.expressions import Expression
from rebt_ros.verification.formulas import AllOf, Formula, negated


class RuleKind(Enum):
    """What a rule demands; the value is the word it is written with."""

    NEVER = "never"
    """The action is not commanded where the condition holds."""
    ALWAYS = "always"
    """The action is commanded wherever the condition holds."""
    ONLY = "only"
    """The action is commanded nowhere but where the condition holds."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where something is written."""

    source: str
    """Name of what it stands in, such as a file."""
    line: int
    """From 1; 0 where only `rule` is known."""
    column: int
    """From 1."""
    rule: int = 0
    """Which rule it is in, from 1."""

    def __str__(self) -> str:
        if not self.line:
            return f"{self.source}, rule {self.rule}"
        return f"{self.source}, line {self.line}, column {self.column}"


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule as it is written."""

    kind: RuleKind
    action: str
    """Its label."""
    channel: str | None
    """None where the label tells the channel."""
    when: Expression | None
    """None: everywhere."""
    text: str
    """The rule in a line."""
    place: Place
    """Of the action."""
    condition_places: tuple[Place, ...] = ()
    """Of each character of the condition, so that what is wrong in it can be pointed at."""

    def __str__(self) -> str:
        return self.text

    def place_at(self, character: int) -> Place:
        """The place of a character of the condition."""
        places = self.condition_places
        return places[min(character, len(places) - 1)] if places else self.place


@dataclass(frozen=True, slots=True)
class RuleSet:
    """The rules of a file, or of several."""

    source: str
    """Name of the file, for messages."""
    rules: tuple[Rule, ...]


@dataclass(frozen=True, slots=True)
class Demand:
    """A rule as it concerns one tree."""

    rule: Rule
    action: nodes.Action
    when: Formula

    @property
    def forbids(self) -> Formula | None:
        """Where the action must not be commanded; None if the rule demands that it is."""
        match self.rule.kind:
            case RuleKind.NEVER:
                return self.when
            case RuleKind.ONLY:
                return negated(self.when)
            case RuleKind.ALWAYS:
                return None

    @property
    def region(self) -> Formula:
        """Where the rule says something."""
        forbidden = self.forbids
        return self.when if forbidden is None else forbidden


#: Holds in every state.
EVERYWHERE = AllOf()
