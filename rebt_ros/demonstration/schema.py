"""Features: the named columns of the state.

numeric
    Any finite number.
binary
    0 or 1.
categorical
    One of a list of categories; tables hold its position in that list.

A missing value is NaN in a table, whatever the kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class FeatureKind(Enum):
    """How a feature is tested."""

    NUMERIC = "numeric"
    BINARY = "binary"
    CATEGORICAL = "categorical"


@dataclass(frozen=True, slots=True)
class Feature:
    """A named column of the state.

    Raises:
        ValueError: A categorical feature without categories, or another one with some.
    """

    name: str
    kind: FeatureKind = FeatureKind.NUMERIC
    categories: tuple[str, ...] = ()
    """Of a categorical feature.  Those that come from a topic are numbers, written as text."""
    topic: str | None = None
    """State topic that carries the feature; None where it came from a table."""
    index: int | None = None
    """Position in the topic's array."""

    def __post_init__(self) -> None:
        if (self.kind is FeatureKind.CATEGORICAL) != bool(self.categories):
            raise ValueError(f"{self.name!r} is {self.kind.value} with {self.categories}")
        if (self.topic is None) != (self.index is None):
            raise ValueError(f"{self.name!r} needs both a topic and an index, or neither")
