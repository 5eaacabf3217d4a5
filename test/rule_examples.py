"""Random rules over the vocabulary of `strategies`, and what they mean, spelt out.

Brute force looks at every combination of values that the conditions can tell apart.  It shares no
code with the proofs: conditions are read from their definitions, and trees are evaluated on plain
columns of states.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import strategies as some
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    PreviousActionIs,
    Threshold,
    features_of,
)

NAMES = [feature.name for feature in some.FEATURES]
KINDS = some.FEATURES[3].categories


@dataclass(frozen=True, eq=False)
class Everything:
    """All combinations of values and histories that can be told apart."""

    values: np.ndarray
    histories: tuple[ActionHistory, ...]
    history: np.ndarray
    _seen: dict[object, np.ndarray] = field(default_factory=dict)

    def column(self, name: str) -> np.ndarray:
        return self.values[:, NAMES.index(name)]

    def of_histories(self, holds: Callable[[ActionHistory], bool], key: object) -> np.ndarray:
        if key not in self._seen:
            self._seen[key] = np.array([holds(one) for one in self.histories])
        return self._seen[key][self.history]


def _histories() -> tuple[ActionHistory, ...]:
    found = []
    for length in range(len(some.LABELS) + 1):
        for taken in itertools.permutations(some.LABELS, length):
            for previous in (None, *taken):
                history = ActionHistory(taken)
                history.previous = previous
                found.append(history)
    return tuple(found)


def _values(numbers: tuple[float, ...]) -> np.ndarray:
    truth, kinds = (0.0, 1.0, math.nan), (0.0, 1.0, 2.0, math.nan)
    return np.array(list(itertools.product(numbers, numbers, truth, kinds)))


#: On each threshold, which is the end of a cell, and above all.
_NUMBERS = (*some.THRESHOLDS, 1.0, math.nan)
_STATES = _values(_NUMBERS)
#: With values between, so that most differences occur.
_FINE = tuple(
    sorted({*_NUMBERS[:-1], *(one + step for one in _NUMBERS[:-1] for step in (-0.05, 0.04, 0.6))})
)
_FINE_STATES = np.array(
    [
        (distance, battery, *other)
        for distance, battery in itertools.product((*_FINE, math.nan), repeat=2)
        for other in itertools.product((0.0, 1.0, math.nan), (0.0, 2.0, math.nan))
    ]
)
_HISTORIES = _histories()
_NO_HISTORY = (ActionHistory(),)


def everything(history: bool, fine: bool) -> Everything:
    states = _FINE_STATES if fine else _STATES
    histories = _HISTORIES if history else _NO_HISTORY
    if history:
        # Each state with a share of the histories, each history with a share of the states.
        state = np.repeat(np.arange(len(states)), len(histories))
        which = np.tile(np.arange(len(histories)), len(states))
        kept = (state * 7 + which) % 3 == 0 if fine else np.ones(len(state), dtype=bool)
        return Everything(states[state[kept]], histories, which[kept])
    return Everything(states, histories, np.zeros(len(states), dtype=np.int64))


def looks_back(tree: nodes.Node) -> bool:
    """Whether a tree tests what was done before."""
    return any(
        isinstance(one.literal.condition, LastActionIs | PreviousActionIs)
        for one in nodes.conditions(tree)
    )


def where(condition: object, states: Everything) -> np.ndarray:
    match condition:
        case PreviousActionIs(action=action):
            return states.of_histories(lambda one: one.previous == action, condition)
        case LastActionIs(action=action, deciding=deciding):
            return states.of_histories(lambda one: one.before(*deciding) == action, condition)
    columns = [states.column(name) for name in features_of(condition)]
    value = some.computed(condition, columns)
    match condition:
        case Threshold(value=most):
            return value <= most
        case Interval(above=above, at_most=most):
            return (above < value) & (value <= most)
        case IsTrue():
            return value == 1
        case HasCategory(category=category):
            return value == KINDS.index(category)
    raise AssertionError(condition)


def commands(tree: nodes.Node, states: Everything) -> np.ndarray:
    """What a first tick commands, with actions that succeed at once.

    Returns:
        Places in `strategies.ACTIONS`, -1: nothing.
    """
    count = len(states.values)
    return _tick(tree, np.ones(count, dtype=bool), states)[1]


_SUCCESS, _FAILURE, _RUNNING = 1, 2, 3


def _tick(
    node: nodes.Node, reached: np.ndarray, states: Everything
) -> tuple[np.ndarray, np.ndarray]:
    """The status in the states that are reached, elsewhere it means nothing; and the command."""
    nothing = np.full(len(reached), -1)
    match node:
        case nodes.Condition(literal=literal):
            holds = where(literal.condition, states) == literal.positive
            return np.where(holds, _SUCCESS, _FAILURE), nothing
        case nodes.Action():
            command = np.where(reached, some.ACTIONS.index(node), -1)
            return np.full(len(reached), _SUCCESS), command
        case nodes.Inverter(child=child):
            status, command = _tick(child, reached, states)
            return np.choose(status - 1, [_FAILURE, _SUCCESS, _RUNNING]), command
        case nodes.Parallel(children=children):
            ticks = [_tick(child, reached, states) for child in children]
            all_of = np.array([status for status, _ in ticks])
            failed, runs = (all_of == _FAILURE).any(axis=0), (all_of == _RUNNING).any(axis=0)
            command = nothing
            for _, its in ticks:
                # The first that acts has the channel.
                command = np.where(command < 0, its, command)
            return np.where(failed, _FAILURE, np.where(runs, _RUNNING, _SUCCESS)), command
        case nodes.Sequence() | nodes.Repeater():
            goes_on, final = _SUCCESS, _RUNNING if isinstance(node, nodes.Repeater) else _SUCCESS
        case nodes.Selector() | nodes.ParallelSelector():
            goes_on, final = _FAILURE, _FAILURE
    status, command = np.full(len(reached), final), nothing
    left = reached.copy()
    for child in nodes.children(node):
        own, its = _tick(child, left, states)
        # What is ticked later takes the place of what was ticked before.
        command = np.where(its >= 0, its, command)
        stops = left & (own != goes_on)
        status[stops] = own[stops]
        left &= own == goes_on
    return status, command


@dataclass(frozen=True)
class Written:
    """A condition in words, and where it holds."""

    text: str
    holds: Callable[[Everything], np.ndarray]
    differs: bool = False
    looks_back: bool = False


_SIGNS = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "=": np.equal,
    "!=": lambda one, other: ~np.isnan(one) & (one != other),
    "≤": np.less_equal,
    "≠": lambda one, other: ~np.isnan(one) & (one != other),
}
_numeric = st.sampled_from(("distance", "battery"))


@st.composite
def _atoms(draw: st.DrawFn, deciding: str) -> Written:
    kind = draw(
        st.sampled_from(("number", "number", "range", "truth", "kind", "pair", "sum", "back"))
    )
    name, value = draw(_numeric), draw(st.sampled_from(some.THRESHOLDS))
    sign = draw(st.sampled_from(sorted(_SIGNS)))
    compare = _SIGNS[sign]
    match kind:
        case "number":
            if draw(st.booleans()):
                return Written(f"{name} {sign} {value}", lambda s: compare(s.column(name), value))
            known = draw(st.booleans())
            word = "known" if known else "missing"
            return Written(f"{name} is {word}", lambda s: np.isnan(s.column(name)) != known)
        case "range":
            low, high = sorted((value, draw(st.sampled_from(some.THRESHOLDS))))
            return Written(
                f"{low} < {name} <= {high}",
                lambda s: (low < s.column(name)) & (s.column(name) <= high),
            )
        case "truth":
            true = draw(st.booleans())
            text = "docked" if true else "docked is false"
            return Written(text, lambda s: s.column("docked") == float(true))
        case "kind":
            code = draw(st.integers(0, 2))
            equal = draw(st.booleans())
            text = f"kind {'=' if equal else '!='} {KINDS[code]}"
            return Written(
                text,
                lambda s: ~np.isnan(s.column("kind")) & ((s.column("kind") == code) == equal),
            )
        case "pair":
            names = draw(st.permutations(("distance", "battery")))
            if draw(st.booleans()):
                return Written(
                    f"{names[0]} {sign} {names[1]}",
                    lambda s: compare(s.column(names[0]) - s.column(names[1]), 0.0),
                    differs=True,
                )
            return Written(
                f"{names[0]} - {names[1]} {sign} {value}",
                lambda s: compare(s.column(names[0]) - s.column(names[1]), value),
                differs=True,
            )
        case "sum":
            return draw(_sums(sign, value))
        case _:
            label = draw(st.sampled_from(some.LABELS))
            if draw(st.booleans()):
                previous = PreviousActionIs(label)
                return Written(f"doing {label}", lambda s: where(previous, s), looks_back=True)
            last = LastActionIs(label, (deciding,))
            return Written(f"last action = {label}", lambda s: where(last, s), looks_back=True)


@st.composite
def _sums(draw: st.DrawFn, sign: str, value: float) -> Written:
    """Weighted sums, also that of `strategies.SUM`, in either order and with either sign."""
    weights = draw(
        st.sampled_from(((-0.7, 1.3), (0.7, -1.3), (1.0, 0.5), (2.0, -1.0), (-1.0, -3.0), (1, 1)))
    )
    terms = list(zip(("distance", "battery"), weights, strict=True))
    (one, first), (other, second) = draw(st.permutations(terms))
    compare = _SIGNS[sign]

    def total(states: Everything) -> np.ndarray:
        return first * states.column(one) + second * states.column(other)

    if draw(st.booleans()):
        # The second term stands on the other side.
        text = f"{first} * {one} {sign} {-second} × {other}"
        return Written(text, lambda s: compare(total(s), 0.0), differs=True)
    minus, size = ("-" if second < 0 else "+"), abs(second)
    text = f"{first} * {one} {minus} {other} * {size} {sign} {value}"
    return Written(text, lambda s: compare(total(s), value), differs=True)


def conditions(deciding: str) -> st.SearchStrategy[Written]:
    def joined(inner: st.SearchStrategy[Written]) -> st.SearchStrategy[Written]:
        pairs = st.lists(inner, min_size=2, max_size=3)
        return st.one_of(
            pairs.map(lambda parts: _joined(" and ", np.logical_and, parts)),
            pairs.map(lambda parts: _joined(" or ", np.logical_or, parts)),
            inner.map(
                lambda one: Written(
                    f"not ({one.text})", lambda s: ~one.holds(s), one.differs, one.looks_back
                )
            ),
        )

    return st.recursive(_atoms(deciding), joined, max_leaves=4)


def _joined(word: str, join: np.ufunc, parts: list[Written]) -> Written:
    return Written(
        word.join(f"({one.text})" for one in parts),
        lambda s: join.reduce([one.holds(s) for one in parts]),
        any(one.differs for one in parts),
        any(one.looks_back for one in parts),
    )


@dataclass(frozen=True)
class WrittenRule:
    kind: str
    action: nodes.Action
    when: Written

    @property
    def text(self) -> str:
        return f"rules:\n  - {self.kind}: {self.action.label}\n    when: {self.when.text}\n"

    def broken(self, states: Everything, commanded: np.ndarray) -> np.ndarray:
        about, mine = self.when.holds(states), commanded == some.ACTIONS.index(self.action)
        if self.kind == "always":
            return about & ~mine
        return (about if self.kind == "never" else ~about) & mine


@st.composite
def rules(draw: st.DrawFn) -> WrittenRule:
    action = draw(st.sampled_from(some.ACTIONS))
    kind = draw(st.sampled_from(("never", "always", "only")))
    return WrittenRule(kind, action, draw(conditions(action.label)))
