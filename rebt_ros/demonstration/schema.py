"""Features: the named columns of the state.

numeric
    Any finite number.
binary
    0 or 1.
categorical
    One of a list of categories; tables hold its position in that list.

A missing value is NaN in a table, whatever the kind.

A lagged feature is the value that another feature, its source, had some rows earlier (`lags`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

#: Maximum number of rows that a feature may look back.
LARGEST_LAG = 20

#: Number of categories that a message lists.
_LISTED = 3


class FeatureKind(Enum):
    """How a feature is tested."""

    NUMERIC = "numeric"
    BINARY = "binary"
    CATEGORICAL = "categorical"


#: Categories that are truth values, and the number that a topic carries for each.
TRUTH = {"False": 0.0, "True": 1.0}


@dataclass(frozen=True, slots=True)
class Feature:
    """A named column of the state.

    Raises:
        ValueError: A categorical feature has no categories, another one has some, or a lagged one
            does not say where its source is.
    """

    name: str
    kind: FeatureKind = FeatureKind.NUMERIC
    categories: tuple[str, ...] = ()
    """Of a categorical feature; numbers as text if they come from a topic."""
    topic: str | None = None
    """State topic that carries the feature; None if it came from a table."""
    index: int | None = None
    """Position in the topic's array; for a lagged feature without a topic, the position of its
    source in the table."""
    lag: int = 0
    """How many rows earlier its source had this value; topic and index are the source's."""

    @property
    def examples(self) -> str:
        """The first categories, in words."""
        more = ", …" if len(self.categories) > _LISTED else ""
        return ", ".join(self.categories[:_LISTED]) + more

    def __post_init__(self) -> None:
        if (self.kind is FeatureKind.CATEGORICAL) != bool(self.categories):
            raise ValueError(f"{self.name!r} is {self.kind.value} with {self.categories}")
        if not 0 <= self.lag <= LARGEST_LAG:
            raise ValueError(f"{self.name!r} looks {self.lag} rows back, not 0 to {LARGEST_LAG}")
        if self.lag and self.index is None:
            raise ValueError(f"{self.name!r} looks back without an index that says at what")
        if not self.lag and (self.topic is None) != (self.index is None):
            raise ValueError(f"{self.name!r} needs both a topic and an index, or neither")
        if self.topic is not None and self.index is None:
            raise ValueError(f"{self.name!r} has a topic without an index")


@dataclass(frozen=True, slots=True)
class Source:
    """Where messages carry the value of a feature, or of a lagged feature's source."""

    topic: str
    index: int
    """Position in the topic's array."""


def sources(features: Sequence[Feature], default_topic: str) -> tuple[Source, ...]:
    """Where messages carry each feature of a tree.

    Args:
        features: All features of the tree.
        default_topic: Topic of features that came from a table, in the order of the table.
    """
    return tuple(
        Source(feature.topic or default_topic, place if feature.index is None else feature.index)
        for place, feature in enumerate(features)
    )


def codes_of(feature: Feature, *, coded: bool = False) -> dict[float, int]:
    """The position of each category, by the number that messages carry for it.

    Args:
        feature: Any feature; if it is not categorical, the result is empty.
        coded: Whether messages carry the positions themselves.
    """
    return {
        number: code
        for code, name in enumerate(feature.categories)
        if (number := float(code) if coded else number_of(name)) is not None
    }


def number_of(category: str) -> float | None:
    """The number that a topic carries for a category; None if there is none."""
    if category in TRUTH:
        return TRUTH[category]
    try:
        return float(category)
    except ValueError:
        return None
