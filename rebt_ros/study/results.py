"""What an experiment found out about one configuration, also as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rebt_ros.codec.form import MisfitError
from rebt_ros.codec.hints import record
from rebt_ros.codec.text import indented, parsed
from rebt_ros.errors import InputError
from rebt_ros.study.mode import Mode
from rebt_ros.study.reduction import SizeComparison


@dataclass(frozen=True, slots=True)
class Score:
    """What a mode reaches for one simulated subtree."""

    minimum: float
    """Least distance of all pruning levels."""
    minimum_at_least: float
    """No exact graph edit distance of all levels is below this."""
    median: float
    """Of the levels' scores."""
    levels: int
    exact_levels: int
    """Levels whose score is known to be the exact graph edit distance."""
    nodes: int
    """Of the minimum-scoring subtree as it is compared, as the next two: of several the one with
    the fewest nodes, and of these the first."""
    repeaters: int
    psa: int
    level: int
    """The pruning level that it comes from, 0 is not pruned."""
    found: str
    """The minimum-scoring subtree in words."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How often a tree did what was demonstrated."""

    right: int
    rows: int


@dataclass(frozen=True, slots=True)
class SubtreeResult:
    """A simulated subtree with the scores that the modes reach for it."""

    number: int
    """Its place under the simulated root, from 1."""
    shown: str
    """The subtree in words."""
    nodes: int
    """As it is compared."""
    repeaters: int
    psa: int
    scores: dict[Mode, Score]
    """Empty where it cannot be compared: none of its actions was ever done, or a single action is
    all that the configuration did."""

    @property
    def usable(self) -> bool:
        """Whether it is compared."""
        return bool(self.scores)


@dataclass(frozen=True, slots=True)
class LevelSizes:
    """What a mode offers at one pruning level, as a number."""

    subtrees: int
    """Generated subtrees."""
    suggestions: int
    """How many of them are suggestions."""


@dataclass(frozen=True, slots=True)
class ModeResult:
    """What a mode did, whatever was simulated."""

    offered: tuple[LevelSizes, ...]
    """For each pruning level."""
    sizes: tuple[SizeComparison, ...]
    """Against BT-Espresso, without SAES, for each pruning level that decides anything."""
    agreement: Agreement | None
    """None where there are too few rows."""
    mismatches: int
    """Rows on which the trees whose size is compared do not what the decision tree does, of all
    these levels; LAT is that of the demonstration."""


@dataclass(frozen=True, slots=True)
class Pairs:
    """How the pairs of a simulated and a generated subtree were compared."""

    compared: int
    """All, repeated ones counted again and again."""
    excluded: int
    """Of these, pairs whose labels differ too much to be nearest."""
    measured: int
    """Different pairs that were measured."""


@dataclass(frozen=True, slots=True)
class NetworkxPair:
    """A pair that the paper's measure was tried on."""

    nodes: tuple[int, int]
    lower: float
    upper: float
    """The measure of record."""
    networkx: float | None
    """None where it took too long."""


@dataclass(frozen=True, slots=True)
class ConfigurationResult:
    """All that is kept of one configuration."""

    configuration: str
    digest: str
    """Of the configuration."""
    fingerprint: str
    """Of settings and versions."""
    rows: int
    levels: int
    skipped: int
    """Nodes without meaning."""
    subtrees: tuple[SubtreeResult, ...]
    modes: dict[Mode, ModeResult]
    pairs: Pairs
    networkx: tuple[NetworkxPair, ...]
    seconds: float


_RESULT: Final = record(ConfigurationResult)


def encoded(result: ConfigurationResult) -> str:
    """The result as JSON."""
    return indented(_RESULT.encode(result)) + "\n"


def decoded(text: str, name: str) -> ConfigurationResult:
    """Reads what `encoded` wrote.

    Args:
        text: JSON.
        name: What to call it.

    Raises:
        InputError: It is something else.
    """
    try:
        return _RESULT.decode(parsed(text))
    except (MisfitError, ValueError, RecursionError) as err:
        raise InputError(f"{name} is no result of this experiment: delete it.") from err
