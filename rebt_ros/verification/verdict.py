"""What is known of rules after a proof was tried."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from rebt_ros.behavior_tree import nodes
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.rules import Demand
from rebt_ros.verification.states import Point


class Answer(Enum):
    """What is known of a rule."""

    PROVEN = "proven"
    """The tree keeps it in every state, whatever was done before."""
    BROKEN = "broken"
    """There is a state in which it does not."""
    UNKNOWN = "unknown"
    """Neither was shown."""


@dataclass(frozen=True, slots=True)
class ShownRow:
    """A row of a demonstration."""

    demonstration: str
    row: int
    """Its place in the demonstration, from 0."""
    action: str
    """What was done."""


@dataclass(frozen=True, slots=True)
class Witness:
    """A state in which a rule is broken: of all of them, the nearest to what was shown."""

    point: Point
    command: nodes.Action | None
    """What the tree commands there; None: nothing."""
    row: ShownRow | None
    """The row that is nearest; None where rows are not at hand."""
    distance: float
    """From what was shown: a sum over the features, in shares of all that was shown of each."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """How much of what a rule is about was shown."""

    rows: int
    """In the states that it is about."""
    all_rows: int
    breaking: int
    """Rows in which the demonstrator did what the rule forbids, or left what it demands."""


@dataclass(frozen=True, eq=False, slots=True)
class Verdict:
    """What is known of one rule."""

    demand: Demand
    answer: Answer
    witness: Witness | None = None
    """Of a broken rule."""
    region: Boxes | None = None
    """Of a broken rule, all states in which it is broken; None if they are too many."""
    why: str = ""
    """Of a rule that is unknown: what it depends on."""
    coverage: Coverage | None = None
    """None where rows are not at hand."""


@dataclass(frozen=True, eq=False, slots=True)
class ChannelProof:
    """The rules about one channel."""

    channel: str
    grid: Grid
    verdicts: tuple[Verdict, ...]


def verdicts(proofs: Sequence[ChannelProof], demands: Sequence[Demand]) -> tuple[Verdict, ...]:
    """The verdicts of all channels, in the order of the rules."""
    of: Mapping[int, Verdict] = {
        id(verdict.demand): verdict for proof in proofs for verdict in proof.verdicts
    }
    return tuple(of[id(demand)] for demand in demands)
