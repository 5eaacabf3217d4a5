"""States and sets of states in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.wording import (
    distinct_texts,
    feature_text,
    name_text,
    quantity_text,
)
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.verification.grid import ANOTHER_ACTION, LARGEST, Boxes, Field, Grid, HistoryCell
from rebt_ros.verification.states import Point

#: How many characters shorter the number after another one must be to be written instead.
_SHORTER: Final = 3
#: Below 1, 1 and above.
_BINARY_CELLS: Final = 3
#: How many histories are listed.
_LISTED: Final = 4


def value_text(feature: Feature, value: float) -> str:
    """A value of a feature, such that it can be typed in again.

    >>> value_text(Feature("front"), 0.25)
    'front = 0.25'
    """
    name = feature_text(feature.name)
    if math.isnan(value):
        return f"{name} is missing"
    if feature.kind is FeatureKind.CATEGORICAL:
        return f"{name} = {name_text(feature.categories[int(value)])}"
    return f"{name} = {value:g}" if float(f"{value:g}") == value else f"{name} = {value!r}"


def before_text(before: HistoryCell) -> str:
    """What was done before."""
    doing = "nothing done before" if before.previous is None else f"doing {before.previous}"
    others = [one for one in reversed(before.taken) if one != before.previous]
    return f"{doing}, after {', '.join(others)}" if others else doing


def action_text(action: nodes.Action | None) -> str:
    """What is commanded."""
    return "nothing" if action is None else name_text(action.label)


def point_text(point: Point, grid: Grid, features: Sequence[Feature]) -> str:
    """A state, as far as a grid tells states apart."""
    texts = [
        value_text(feature, value)
        for feature, value in zip(features, point.values, strict=True)
        if grid.field(feature.name) is not None
    ]
    if point.before is not None:
        texts.append(before_text(point.before))
    return ", ".join(texts)


@dataclass(frozen=True, slots=True)
class _Ends:
    """The texts of the upper ends of a feature's cells."""

    texts: dict[float, str]

    def at_most(self, end: float) -> str:
        """What stands behind the name."""
        value = _readable(end)
        return f"{'≤' if value == end else '<'} {self.texts[value]}"

    def above(self, end: float) -> str:
        value = _readable(end)
        return f"{'>' if value == end else '≥'} {self.texts[value]}"

    def between(self, low: float, high: float, name: str) -> str:
        first, last = _readable(low), _readable(high)
        if low == math.nextafter(high, -math.inf):
            return f"{name} = {self.texts[last]}"
        return (
            f"{self.texts[first]} {'<' if first == low else '≤'} {name} "
            f"{'≤' if last == high else '<'} {self.texts[last]}"
        )


def _readable(end: float) -> float:
    """The number itself, or the next one where that is much shorter: ``x < 0.3``."""
    after = math.nextafter(end, math.inf)
    return after if len(repr(after)) + _SHORTER < len(repr(end)) else end


class BoxWords:
    """Boxes of one grid in words."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid

    def box(self, box: Boxes) -> str:
        """The states of one box, shape (words,), as conditions joined by "and"."""
        texts = []
        for field in self._grid.fields:
            cells = field.cells_of(box[:, np.newaxis])[0]
            if not cells.all():
                texts.append(_field_text(field, cells))
        return " and ".join(texts) or "every state"

    def boxes(self, boxes: Boxes, most: int) -> tuple[list[str], int]:
        """The largest boxes after those that lie side by side were joined.

        Args:
            boxes: Of the grid.
            most: How many to put in words.

        Returns:
            Their words, and how many there are beside them.
        """
        joined = simplified(boxes, self._grid)
        restricted = [
            sum(not field.cells_of(joined[:, [place]]).all() for field in self._grid.fields)
            for place in range(joined.shape[1])
        ]
        order = np.argsort(np.array(restricted), kind="stable")
        lines = [self.box(joined[:, place]) for place in order[:most]]
        return lines, max(joined.shape[1] - most, 0)


def simplified(boxes: Boxes, grid: Grid) -> Boxes:
    """The same states in fewer boxes, which may overlap."""
    count = boxes.shape[1] + 1
    while boxes.shape[1] < count:
        count = boxes.shape[1]
        for field in grid.fields:
            boxes = _joined_along(boxes, field)
    return boxes


def _joined_along(boxes: Boxes, field: Field) -> Boxes:
    if boxes.shape[1] < 2:
        return boxes
    others = boxes.copy()
    others[field.words] = 0
    different, which = np.unique(others, axis=1, return_inverse=True)
    which = np.asarray(which).reshape(-1)
    joined = np.zeros_like(different[field.words])
    for word in range(joined.shape[0]):
        np.bitwise_or.at(joined[word], which, boxes[field.words][word])
    different[field.words] = joined
    return different


def _field_text(field: Field, cells: BoolArray) -> str:
    if field.quantity is None:
        return _history_text(field, cells)
    name = quantity_text(field.quantity)
    kind = field.feature.kind if field.feature is not None else FeatureKind.NUMERIC
    missing, known = bool(cells[-1]), cells[:-1]
    if not known.any():
        return f"{name} is missing"
    if known.all():
        return f"{name} is known"
    if kind is FeatureKind.CATEGORICAL:
        assert field.feature is not None
        texts = [_categories_text(name, field.feature.categories, known)]
    elif kind is FeatureKind.BINARY and len(known) == _BINARY_CELLS and known[0] != known[1]:
        texts = [name if known[1] else f"not {name}"]
    else:
        texts = [*_ranges_text(name, field, known)]
    if missing:
        texts.append("missing")
    return f"({' or '.join(texts)})" if len(texts) > 1 else texts[0]


def _categories_text(name: str, categories: Sequence[str], known: BoolArray) -> str:
    there = [name_text(category) for category, has in zip(categories, known, strict=True) if has]
    absent = [
        name_text(category) for category, has in zip(categories, known, strict=True) if not has
    ]
    if len(absent) == 1 and len(there) > 1:
        return f"{name} ≠ {absent[0]}"
    return f"{name} = {' or '.join(there)}"


def _ranges_text(name: str, field: Field, known: BoolArray) -> Iterator[str]:
    values = field.ends[:-1]
    texts = _Ends(distinct_texts(_readable(float(end)) for end in values[values < LARGEST]))
    padded = np.concatenate([[False], known, [False]])
    borders = np.flatnonzero(padded[1:] != padded[:-1])
    for first, last in zip(borders[::2], borders[1::2], strict=True):
        low, high = field.below(int(first)), float(values[last - 1])
        if low == -math.inf:
            yield f"{name} {texts.at_most(high)}"
        elif high == LARGEST:
            yield f"{name} {texts.above(low)}"
        else:
            yield texts.between(low, high, name)


def _history_text(field: Field, cells: BoolArray) -> str:
    there = [field.histories[place] for place in np.flatnonzero(cells)]
    absent = [field.histories[place] for place in np.flatnonzero(~cells)]
    if len(absent) == 1 and absent[0].previous not in (None, ANOTHER_ACTION):
        return f"not {before_text(absent[0])}"
    if len(there) <= _LISTED:
        return " or ".join(before_text(one) for one in there)
    return f"one of {len(there)} of {field.cells} histories"
