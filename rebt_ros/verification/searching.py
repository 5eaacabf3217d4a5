"""States in which rules are broken, the nearest to what was shown.

Where branches overlap, a tree can do different things in more parts of all states than can be
looked at.  Most of them need not be: beside a row that was shown there mostly is a state that
breaks the rule, and then only what is nearer remains to be looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.verification.branches import Branch, where_some_act
from rebt_ros.verification.errors import TooManyPartsError
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.rules import Demand
from rebt_ros.verification.states import Near, Point, StateFinder, Unsettled

#: Into how many parts the states may fall that are nearer to what was shown than a known one.
_MOST_NEARER: Final = 20_000
#: ... and those that a rule is about.
_MOST_ASKED: Final = 50_000
#: Beside how many rows it is tried whether a state breaks a rule, at a time and in all.
_TRIED_AT_A_TIME: Final = 8
_MOST_TRIED: Final = 64

#: What a tree commands in each of some states.
_Commands: TypeAlias = Callable[[Sequence[Point]], Sequence[nodes.Action | None]]

_UNSETTLED: Final = "it depends on which combinations of features there are"
_OVERLAPPING: Final = (
    "the branches of the tree overlap in too many ways to look at each, and of the states that "
    "were tried, none breaks it"
)


@dataclass(frozen=True, eq=False, slots=True)
class Broken:
    """Where a first tick breaks a rule."""

    nearest: Near | str | None
    """The state that is nearest to what was shown, None: there is none, or why that is unknown."""
    region: Boxes | None
    """All such states; None where they are too many."""


def found_in(regions: Sequence[Boxes], finder: StateFinder) -> list[Broken]:
    """Of each region in which a rule is broken, the state that is nearest to what was shown."""
    # All at once: what numpy does once per call then does not matter.
    distances, rows = finder.closest(np.concatenate([finder.no_boxes, *regions], axis=1))
    found: list[Broken] = []
    end = 0
    for region in regions:
        start, end = end, end + region.shape[1]
        nearest: Near | str | None
        try:
            nearest = finder.first(region, distances[start:end], rows[start:end])
        except Unsettled:
            nearest = _UNSETTLED
        found.append(Broken(nearest, region))
    return found


def searched(
    demands: Sequence[Demand],
    branches: Sequence[Branch],
    leaves: Sequence[nodes.Action],
    grid: Grid,
    finder: StateFinder,
    commands: _Commands,
) -> list[Broken]:
    """Where the first tick of a list of branches breaks rules, without looking at all its parts.

    Args:
        demands: The rules.
        branches: The tree.
        leaves: Their actions.
        grid: Knows the conditions of both.
        finder: Finds states of the grid.
        commands: What the tree commands.
    """
    search = _Search(branches, grid, finder)
    asked = [_Asked.of(one, grid, leaves) for one in demands]
    beside = [_beside_rows(one, finder, commands) for one in asked]
    nearer = iter(
        search.nearer(
            [one for one, near in zip(asked, beside, strict=True) if near],
            [near.distance for near in beside if near],
        )
    )
    return [
        search.anywhere(one) if near is None else Broken(next(nearer) or near, None)
        for one, near in zip(asked, beside, strict=True)
    ]


@dataclass(frozen=True, eq=False, slots=True)
class _Asked:
    """What a rule asks of a list of branches."""

    demand: Demand
    boxes: Boxes
    """The states that it is about."""
    wanted: BoolArray
    """Which branches break it there, at last whether it is broken where none acts."""

    @classmethod
    def of(cls, demand: Demand, grid: Grid, leaves: Sequence[nodes.Action]) -> _Asked:
        """The rule, with what it is about in a grid."""
        takes = np.array([*(leaf == demand.action for leaf in leaves), False], dtype=bool)
        wanted = ~takes if demand.forbids is None else takes
        return cls(demand, grid.boxes(demand.region), wanted)


def _beside_rows(asked: _Asked, finder: StateFinder, commands: _Commands) -> Near | None:
    """A state that breaks a rule, of those nearest to each row in the region of the rule."""
    forbidden = asked.demand.forbids is not None
    tried = 0
    for some in finder.beside(asked.boxes, _TRIED_AT_A_TIME):
        of_each = commands([near.point for near in some])
        for near, command in zip(some, of_each, strict=True):
            if (command == asked.demand.action) is forbidden:
                return near
        tried += _TRIED_AT_A_TIME
        if tried >= _MOST_TRIED:
            break
    return None


@dataclass(frozen=True, slots=True)
class _Search:
    branches: Sequence[Branch]
    grid: Grid
    finder: StateFinder

    def nearer(self, asked: Sequence[_Asked], distances: Sequence[float]) -> list[Near | None]:
        """Of each rule, a state that breaks it and is nearer to what was shown than a distance.

        Returns:
            The nearest ones; None where there is none, as far as could be found out.
        """
        if not asked:
            return []
        boxes = np.concatenate([one.boxes for one in asked], axis=1)
        rule = np.repeat(np.arange(len(asked)), [one.boxes.shape[1] for one in asked])
        limits = np.array(distances)[rule]
        rows_near = self.finder.near(boxes, limits)
        if rows_near is None:
            return [None] * len(asked)

        def is_nearer(parts: Boxes, origin: IntArray) -> BoolArray:
            return rows_near.closest(parts)[0] < limits[origin]

        wanted = np.stack([one.wanted for one in asked])[rule]
        try:
            found, origin = where_some_act(
                self.branches, self.grid.mask, boxes, wanted, _MOST_NEARER, is_nearer
            )
        except TooManyPartsError:
            return [None] * len(asked)
        regions = [found[:, rule[origin] == one] for one in range(len(asked))]
        return [
            one.nearest if isinstance(one.nearest, Near) and one.nearest.distance < limit else None
            for one, limit in zip(found_in(regions, self.finder), distances, strict=True)
        ]

    def anywhere(self, asked: _Asked) -> Broken:
        """Where a rule is broken at all."""
        wanted = np.tile(asked.wanted, (asked.boxes.shape[1], 1))
        try:
            region, _ = where_some_act(
                self.branches, self.grid.mask, asked.boxes, wanted, _MOST_ASKED
            )
        except TooManyPartsError:
            return Broken(_OVERLAPPING, None)
        [found] = found_in([region], self.finder)
        return found
