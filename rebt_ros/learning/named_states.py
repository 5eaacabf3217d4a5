"""States by the names of features, as programs have them, in the form that a tree reads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import category
from rebt_ros.errors import InputError

#: A value of a feature: a number, a truth value, a category, or None if it is missing.
Value: TypeAlias = float | bool | str | None
#: Values by the names of the features, or in the order of the features.
State: TypeAlias = Mapping[str, Value] | Sequence[Value]


class Encoding:
    """States as a tree reads them: numbers, 0 or 1, positions in a feature's categories, NaN.

    Args:
        features: Features of the tree.

    Raises:
        InputError: All of them are lagged, so a state has no feature to look back at.
    """

    def __init__(self, features: Sequence[Feature]) -> None:
        present = [feature for feature in features if not feature.lag]
        if features and not present:
            raise InputError(
                f"the tree has no feature of the current row besides {features[0].name!r}, "
                "which is lagged: learn it again."
            )
        self.names = tuple(feature.name for feature in present)
        self._present = present
        self._codes = [
            {name: float(code) for code, name in enumerate(feature.categories)}
            for feature in present
        ]
        # `with_lags` has the features of the current row, then all of one row earlier, and so on.
        self._count = len(present)
        self._sources = [
            (feature.lag, place % self._count) for place, feature in enumerate(features)
        ]

    def present(self, state: State) -> list[float]:
        """The values of the features that are not lagged."""
        if isinstance(state, Mapping):
            unknown = sorted(set(state) - set(self.names))
            if unknown:
                raise InputError(
                    f"the state has {unknown[0]!r}, which is not a feature of the tree: "
                    f"it has {', '.join(self.names)}."
                )
            values = [state.get(name) for name in self.names]
        else:
            values = list(state)
            if len(values) != self._count:
                raise InputError(
                    f"the state has {len(values)} values where the tree has {self._count} "
                    f"features: {', '.join(self.names)}."
                )
        return [
            self._number(feature, codes, value)
            for feature, codes, value in zip(self._present, self._codes, values, strict=True)
        ]

    def row(self, now: list[float], past: Sequence[list[float]]) -> list[float]:
        """The values of all features."""
        return [
            now[place] if not lag else past[lag - 1][place] if lag <= len(past) else math.nan
            for lag, place in self._sources
        ]

    def _number(self, feature: Feature, codes: Mapping[str, float], value: Value) -> float:
        if value is None:
            return math.nan
        if feature.kind is FeatureKind.CATEGORICAL:
            # Categories that were never shown count as missing, as on the robot.
            if isinstance(value, bool) and str(value) in codes:
                return codes[str(value)]
            text = value if isinstance(value, str) else category(float(value))
            return codes.get(text, math.nan)
        if isinstance(value, str):
            raise InputError(
                f"the feature {feature.name!r} is {feature.kind.value}, not the text {value!r}."
            )
        return float(value)
