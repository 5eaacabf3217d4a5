"""What an experiment found out about one configuration, also as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from rebt_ros.errors import InputError
from rebt_ros.study.mode import Mode
from rebt_ros.study.reduction import Size, SizeComparison


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


def encoded(result: ConfigurationResult) -> str:
    """The result as JSON."""
    return json.dumps(_plain(asdict(result)), ensure_ascii=False, indent=1) + "\n"


def decoded(text: str, name: str) -> ConfigurationResult:
    """Reads what `encoded` wrote.

    Args:
        text: JSON.
        name: What to call it.

    Raises:
        InputError: It is something else.
    """
    try:
        return _result(json.loads(text))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as err:
        raise InputError(f"{name} is no result of this experiment: delete it.") from err


def _plain(value: Any) -> Any:
    """Enums as their values, also in keys."""
    match value:
        case dict():
            return {
                key.value if isinstance(key, Mode) else key: _plain(one)
                for key, one in value.items()
            }
        case list() | tuple():
            return [_plain(one) for one in value]
        case _:
            return value


def _result(value: dict[str, Any]) -> ConfigurationResult:
    fields = dict(value)
    fields["subtrees"] = tuple(map(_subtree, value["subtrees"]))
    fields["modes"] = _by_mode(value["modes"], _mode)
    fields["pairs"] = Pairs(**value["pairs"])
    fields["networkx"] = tuple(
        NetworkxPair(**{**one, "nodes": tuple(one["nodes"])}) for one in value["networkx"]
    )
    return ConfigurationResult(**fields)


def _subtree(value: dict[str, Any]) -> SubtreeResult:
    return SubtreeResult(**{**value, "scores": _by_mode(value["scores"], lambda one: Score(**one))})


def _mode(value: dict[str, Any]) -> ModeResult:
    return ModeResult(
        tuple(LevelSizes(**one) for one in value["offered"]),
        tuple(
            SizeComparison(Size(**one["baseline"]), Size(**one["size"])) for one in value["sizes"]
        ),
        None if value["agreement"] is None else Agreement(**value["agreement"]),
        value["mismatches"],
    )


def _by_mode(value: Mapping[str, Any], read: Any) -> dict[Mode, Any]:
    return {Mode(key): read(one) for key, one in value.items()}
