"""States in which rules are broken, the nearest to what was shown.

Where branches overlap, a tree can do different things in more parts of all states than can be
looked at.  Most of them need not be: beside a row that was shown there mostly is a state that
breaks the rule, and then only what is nearer remains to be looked at.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.verification.branches import Branch, Order, where_some_act
from rebt_ros.verification.errors import TooManyPartsError
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.rules import Demand
from rebt_ros.verification.states import Near, Point, StateFinder, Unsettled

#: How many boxes may be split to find states that are nearer to what was shown than known ones.
_MOST_NEARER: Final = 20_000
#: ... and to find any state that breaks a rule.
_MOST_ASKED: Final = 50_000
#: ... and to find all such states.
_MOST_LISTED: Final = 1_000
#: Beside how many rows it is tried whether a state breaks a rule, one time after the other: mostly
#: the first one does.
_TRIED: Final = (1, 4, 24)

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
    found: list[Near | str | None] = [*_beside_rows(asked, finder, commands)]
    regions: list[Boxes | None] = [None] * len(found)
    for place, one in enumerate(asked):
        if found[place] is None:
            found[place], regions[place] = search.anywhere(one), search.everywhere(one)
    known = {place: near for place, near in enumerate(found) if isinstance(near, Near)}
    nearer = search.nearer([asked[place] for place in known], [*known.values()])
    for place, near in zip(known, nearer, strict=True):
        found[place] = near
    return [Broken(near, region) for near, region in zip(found, regions, strict=True)]


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


def _beside_rows(
    asked: Sequence[_Asked], finder: StateFinder, commands: _Commands
) -> list[Near | None]:
    """Of each rule, a state that breaks it, of those nearest to each row in its region."""
    found: list[Near | None] = [None] * len(asked)
    left = dict(enumerate(finder.beside([one.boxes for one in asked], _TRIED)))
    for _ in _TRIED:
        tried = [(place, near) for place, its in left.items() for near in next(its, ())]
        # All at once: a tree is asked about many states in little more time than about one.
        of_each = commands([near.point for _, near in tried])
        for (place, near), command in zip(tried, of_each, strict=True):
            forbidden = asked[place].demand.forbids is not None
            if place in left and (command == asked[place].demand.action) is forbidden:
                found[place] = near
                del left[place]
    return found


@dataclass(frozen=True, slots=True)
class _Search:
    branches: Sequence[Branch]
    grid: Grid
    finder: StateFinder

    def nearer(self, asked: Sequence[_Asked], known: Sequence[Near]) -> list[Near]:
        """Of each rule, a state that breaks it and is nearer to what was shown than a known one.

        Returns:
            The nearest ones, as far as could be found out; the known ones where there are none.
        """
        nearest = [*known]
        if not asked:
            return nearest
        boxes = np.concatenate([one.boxes for one in asked], axis=1)
        rule = np.repeat(np.arange(len(asked)), [one.boxes.shape[1] for one in asked])
        limits = np.array([one.distance for one in known])[rule]
        rows_near = self.finder.near(boxes, limits)
        if rows_near is None:
            return nearest
        order = Order(lambda parts: rows_near.closest(parts)[0], limits)
        wanted = np.stack([one.wanted for one in asked])[rule]
        with contextlib.suppress(TooManyPartsError):
            for parts, origin in where_some_act(
                self.branches, self.grid.mask, boxes, wanted, _MOST_NEARER, order
            ):
                distances, rows = self.finder.closest(parts)
                for place in np.argsort(distances, kind="stable").tolist():
                    if distances[place] >= limits[origin[place]]:
                        continue
                    near = self.finder.near_row(
                        parts[:, place], int(rows[place]), float(distances[place])
                    )
                    if near is not None:
                        its = int(rule[origin[place]])
                        nearest[its] = near
                        limits[rule == its] = near.distance
        return nearest

    def anywhere(self, asked: _Asked) -> Near | str | None:
        """A state that breaks a rule; None: there is none, or why that is unknown."""
        wanted = np.tile(asked.wanted, (asked.boxes.shape[1], 1))
        unsettled = False
        try:
            for parts, _ in where_some_act(
                self.branches, self.grid.mask, asked.boxes, wanted, _MOST_ASKED
            ):
                try:
                    near = self.finder.nearest(parts)
                except Unsettled:
                    unsettled = True
                    continue
                if near is not None:
                    return near
        except TooManyPartsError:
            return _OVERLAPPING
        return _UNSETTLED if unsettled else None

    def everywhere(self, asked: _Asked) -> Boxes | None:
        """All states that break a rule; None where they are too many to be listed."""
        wanted = np.tile(asked.wanted, (asked.boxes.shape[1], 1))
        try:
            found = where_some_act(self.branches, self.grid.mask, asked.boxes, wanted, _MOST_LISTED)
            return np.concatenate([self.finder.no_boxes, *(parts for parts, _ in found)], axis=1)
        except TooManyPartsError:
            return None
