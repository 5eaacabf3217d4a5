"""What was shown: the values that the features had in the rows of each leaf of a decision tree.

The leaves of a decision tree share out all states, also those that nobody ever demonstrated: a
tree has an answer to each of them, however far it lies from the rows that the answer was learned
from.  A `ShownLeaf` says where those rows were; `novelty` compares states with them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from rebt_ros.codec.bounds import Bounds, Count
from rebt_ros.demonstration.schema import Feature, FeatureKind

#: Leaves of a channel in a document; neighboring ones share their ranges where there are more.
MOST_SHOWN_LEAVES = 250


@dataclass(frozen=True, slots=True)
class Span:
    """The smallest and the largest value of a numeric or binary feature."""

    low: float
    high: float


#: Values of one feature: a span, the categories that occurred, or None where nothing is known: of
#: a feature that was missing in all rows, and of lagged ones, which repeat what was before.
ShownValues: TypeAlias = Span | tuple[str, ...] | None


@dataclass(frozen=True, slots=True)
class ShownLeaf:
    """The rows of one leaf, or of neighboring ones."""

    rows: Count
    values: tuple[ShownValues, ...]
    """In the order of the learned tree's features."""


@dataclass(frozen=True, slots=True)
class ShownChannel:
    """What was shown on one channel."""

    channel: str
    leaves: Annotated[tuple[ShownLeaf, ...], Bounds(most=MOST_SHOWN_LEAVES)]


def problems(shown: Sequence[ShownChannel], features: Sequence[Feature]) -> Iterator[str]:
    """What contradicts the features, in words."""
    known = [frozenset(feature.categories) for feature in features]
    for channel in shown:
        for leaf in channel.leaves:
            if len(leaf.values) != len(features):
                yield f"a leaf has the values of {len(leaf.values)} of {len(features)} features"
                return
            for feature, categories, values in zip(features, known, leaf.values, strict=True):
                if isinstance(values, Span):
                    if feature.kind is FeatureKind.CATEGORICAL or values.low > values.high:
                        yield f"{feature.name!r} cannot be {values.low:g} to {values.high:g}"
                elif values is not None and not categories.issuperset(values):
                    yield f"{feature.name!r} does not have all categories that a leaf has"
