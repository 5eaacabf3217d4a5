"""What conditions mean: whether one holds in a state, in many states at once, or after a history.

All that evaluates conditions does it by these tests: the executor, predictions on whole tables,
decision trees with exact thresholds, guards of routines, and proofs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, cast, overload

from rebt_ros.arrays import BoolArray, FloatArray
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import (
    Difference,
    HasCategory,
    HistoryCondition,
    Interval,
    IsTrue,
    LastActionIs,
    PreviousActionIs,
    Quantity,
    StateCondition,
    Threshold,
    WeightedSum,
)


class StateTest(Protocol):
    """Whether a condition holds in a state, or where it does in many states."""

    @overload
    def __call__(self, values: FloatArray) -> BoolArray: ...
    @overload
    def __call__(self, values: Sequence[float]) -> bool: ...


class Reading(Protocol):
    """What a quantity is in a state, or in many states."""

    @overload
    def __call__(self, values: FloatArray) -> FloatArray: ...
    @overload
    def __call__(self, values: Sequence[float]) -> float: ...


class StateTests:
    """Makes tests of conditions on features that stand in a fixed order.

    A test takes the values of all features: numbers of one state, or columns, as in an array of
    shape (features, rows).

    Args:
        features: What the values are of; of features with the same name, the first is tested.
    """

    def __init__(self, features: Sequence[Feature]) -> None:
        self._features = {
            feature.name: (place, feature) for place, feature in reversed([*enumerate(features)])
        }

    def of(self, condition: StateCondition) -> StateTest:
        """The test of a condition.

        Raises:
            KeyError: It is on another feature.
            ValueError: It is about a category that its feature does not have.
        """
        return cast(StateTest, self._test(condition))

    def reading(self, quantity: Quantity) -> Reading:
        """What reads a quantity.

        Raises:
            KeyError: It is another feature, or computed from others.
        """
        return cast(Reading, self._read(quantity))

    # The executor runs these functions for each condition at each tick: they are as short as they
    # can be, without a call in between for the most frequent conditions.
    def _test(self, condition: StateCondition) -> Callable[[Any], Any]:
        match condition:
            case Threshold(quantity=str(name), value=value):
                place = self._place(name)
                return lambda values: values[place] <= value
            case Threshold(quantity=quantity, value=value):
                read = self._read(quantity)
                return lambda values: read(values) <= value
            case Interval(quantity=quantity, above=above, at_most=at_most):
                read = self._read(quantity)
                return lambda values: (above < (number := read(values))) & (number <= at_most)
            case IsTrue(feature=name):
                place = self._place(name)
                return lambda values: values[place] == 1
            case HasCategory(feature=name, category=category):
                place, feature = self._features[name]
                code = feature.categories.index(category)
                return lambda values: values[place] == code

    def _read(self, quantity: Quantity) -> Callable[[Any], Any]:
        match quantity:
            case Difference():
                minuend, subtrahend = map(self._place, (quantity.minuend, quantity.subtrahend))
                return lambda values: values[minuend] - values[subtrahend]
            case WeightedSum(terms=((first, weight), *others)):
                start = self._place(first)
                more = [(self._place(name), its) for name, its in others]

                def read(values: Any) -> Any:
                    total = weight * values[start]
                    for place, its in more:
                        total = total + its * values[place]
                    return total

                return read
            case str():
                place = self._place(quantity)
                return lambda values: values[place]
        raise AssertionError(quantity)

    def _place(self, name: str) -> int:
        return self._features[name][0]


def history_test(condition: HistoryCondition) -> Callable[[ActionHistory], bool]:
    """The test of a condition on what was done before."""
    match condition:
        case PreviousActionIs(action=action):
            return lambda history: history.previous == action
        case LastActionIs(action=action, deciding=deciding):
            return lambda history: history.before(*deciding) == action


def holds_after(history: ActionHistory, condition: HistoryCondition) -> bool:
    """Whether a condition holds after what was done."""
    return history_test(condition)(history)
