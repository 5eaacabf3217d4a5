"""What was never done, as rules to choose from."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray
from rebt_ros.behavior_tree.wording import name_text
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable

#: Least rows with other actions that speak for a rule.
_FEWEST_ROWS: Final = 10
#: Numbers that are not rounded.
_TINY: Final = 1e-9
#: Digits of a threshold.
_DIGITS: Final = 3


@dataclass(frozen=True, slots=True)
class SuggestedRule:
    """A rule that everything that was shown keeps."""

    action: str
    channel: str
    when: str
    """The condition, as it is written in a rule."""
    support: int
    """In how many rows the condition holds; all of them have other actions."""
    rows: int
    """How many rows there are."""
    margin: float
    """How far the nearest row with the action lies from the threshold, as a share of all that was
    shown of the feature; 0 of categories and truth."""
    strength: float
    """How surprising that would be if the action had nothing to do with the feature: the negative
    logarithm of its probability."""


def suggested_rules(table: DemonstrationTable, most: int = 10) -> tuple[SuggestedRule, ...]:
    """What was never done in the rows of a channel, the strongest first.

    Args:
        table: The rows.
        most: How many to suggest.
    """
    found = [
        one
        for code, action in enumerate(table.actions)
        for column, feature in enumerate(table.features)
        if not feature.lag
        for one in _about(table, action, table.chosen == code, feature, table.states[:, column])
    ]
    return tuple(sorted(found, key=lambda one: -one.strength)[:most])


def _about(
    table: DemonstrationTable,
    action: str,
    done: BoolArray,
    feature: Feature,
    values: FloatArray,
) -> Iterator[SuggestedRule]:
    """The rules about one action and one feature."""
    shown = values[done & ~np.isnan(values)]
    if not len(shown):
        return
    for when, holds, margin in _conditions(feature, values, shown):
        support = int(np.count_nonzero(holds))
        if support < _FEWEST_ROWS or (holds & done).any():
            continue
        share = np.count_nonzero(done) / len(done)
        strength = -support * math.log1p(-share) if share < 1 else math.inf
        yield SuggestedRule(
            action, table.channel, when, support, len(table), margin, float(strength)
        )


def _conditions(
    feature: Feature, values: FloatArray, shown: FloatArray
) -> Iterator[tuple[str, BoolArray, float]]:
    name = name_text(feature.name)
    match feature.kind:
        case FeatureKind.CATEGORICAL:
            for code, category in enumerate(feature.categories):
                yield f"{name} = {name_text(category)}", values == code, 0.0
        case FeatureKind.BINARY:
            yield name, values == 1, 0.0
            yield f"{name} is false", values == 0, 0.0
        case FeatureKind.NUMERIC:
            known = values[~np.isnan(values)]
            spread = float(known.max() - known.min()) or 1.0
            low, high = float(shown.min()), float(shown.max())
            least, most = _rounded(low, down=True), _rounded(high, down=False)
            yield f"{name} < {least!r}", values < least, (low - least) / spread
            yield f"{name} > {most!r}", values > most, (most - high) / spread


def _rounded(value: float, *, down: bool) -> float:
    """A number of few digits that is not past the value."""
    if abs(value) < _TINY:
        return value
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - _DIGITS + 1)
    rounded = round((math.floor if down else math.ceil)(value / unit) * unit, 12)
    return rounded if (rounded <= value if down else rounded >= value) else value
