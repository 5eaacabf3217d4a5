"""Guards: the conditions under which a routine continues with its next step.

Whether it continued in a state is one bit, whose probability is high where the guard holds and low
elsewhere.  The search is over conjunctions of clauses, each a literal or an OR of two.  A clause is
worth its gain in likelihood, minus the cost of naming it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray
from rebt_ros.behavior_tree.condition_tests import StateTests
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import (
    Condition,
    HasCategory,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
)

Clause: TypeAlias = tuple[Literal, ...]
Guard: TypeAlias = tuple[Clause, ...]

#: Maximum number of states, of thresholds per feature, and of clauses of a guard.
_MOST_STATES = 6000
_THRESHOLDS = 37
_MOST_CLAUSES = 6
#: Maximum number of categories of a feature, and of conditions for clauses of two literals.
_MOST_CATEGORIES = 20
_MOST_PAIRED = 40
#: Minimum number of events as evidence.
_FEWEST = 15
#: Nats that a clause must gain beyond its price.
_GAIN = 5.0


@dataclass(frozen=True, eq=False, slots=True)
class _Clauses:
    """All clauses that a guard may consist of."""

    clauses: tuple[Clause, ...]
    holds: FloatArray
    """Where each clause holds, 0 or 1, shape (states, clauses)."""


def guard(
    states: FloatArray, went_on: BoolArray, features: Sequence[Feature], contrast: float
) -> Guard:
    """The conditions that decide whether something happens.

    Args:
        states: Shape (events, features).
        went_on: Whether it happened, shape (events,).
        features: The columns of `states`.
        contrast: Maximum ratio of how often it happens where a clause does not hold to how often it
            happens where the clause holds.

    Returns:
        Clauses that all have to hold; empty if the state does not decide.
    """
    if len(states) > _MOST_STATES:
        taken = np.linspace(0, len(states) - 1, _MOST_STATES).astype(np.int64)
        states, went_on = states[taken], went_on[taken]
    events, happened = len(went_on), float(went_on.sum())
    if min(happened, events - happened) < _FEWEST:
        return ()
    candidates = _clauses(states, went_on, features)
    if not candidates.clauses:
        return ()
    literals = len({literal for clause in candidates.clauses for literal in clause})
    size = np.array([len(clause) for clause in candidates.clauses])
    price = 1.5 * size * (np.log(literals) + 0.5 * np.log(events))
    inside = np.ones(events)
    known = float(_log_likelihood(np.array(happened), np.array(float(events))))
    chosen: list[Clause] = []
    while len(chosen) < _MOST_CLAUSES:
        within = inside @ candidates.holds
        hits = (inside * went_on) @ candidates.holds
        likelihood = _log_likelihood(hits, within) + _log_likelihood(
            happened - hits, events - within
        )
        dropped, dropped_hits = inside.sum() - within, (inside * went_on).sum() - hits
        rate, outside = _share(hits, within), _share(dropped_hits, dropped)
        gain = likelihood - price - known
        gain[(within < _FEWEST) | (dropped < _FEWEST) | (outside > contrast * rate)] = -np.inf
        best = int(gain.argmax())
        if not gain[best] > _GAIN:
            break
        chosen.append(candidates.clauses[best])
        inside = inside * candidates.holds[:, best]
        known = float(likelihood[best])
    return tuple(chosen)


def holds(guard: Guard, states: FloatArray, features: Sequence[Feature]) -> BoolArray:
    """The states in which a guard holds.

    Args:
        guard: Conditions on the features.
        states: Shape (states, features).
        features: The columns of `states`.

    Returns:
        Shape (states,).
    """
    tests = StateTests(features)
    result = np.ones(len(states), dtype=bool)
    for clause in guard:
        fulfilled = np.zeros(len(states), dtype=bool)
        for literal in clause:
            condition = literal.condition
            if isinstance(condition, PreviousActionIs | LastActionIs):
                raise ValueError(f"a guard has no condition such as {condition}")
            fulfilled |= tests.of(condition)(states.T) == literal.positive
        result &= fulfilled
    return result


def _share(some: FloatArray, of: FloatArray) -> FloatArray:
    return some / np.maximum(of, 1.0)


def _log_likelihood(hits: FloatArray, of: FloatArray) -> FloatArray:
    """Log likelihood of the number of hits, each with the same probability."""
    rate = np.clip(hits / np.maximum(of, 1e-9), 1e-4, 1 - 1e-4)
    likelihood: FloatArray = hits * np.log(rate) + (of - hits) * np.log(1 - rate)
    return likelihood


def _clauses(states: FloatArray, went_on: BoolArray, features: Sequence[Feature]) -> _Clauses:
    literals: list[tuple[int, Literal, BoolArray]] = []
    for column, feature in enumerate(features):
        for condition, holds in _conditions(feature, states[:, column], went_on):
            literals.append((column, Literal(condition), holds))
            literals.append((column, Literal(condition, positive=False), ~holds))
    clauses: list[Clause] = [(literal,) for _, literal, _ in literals]
    columns = [holds for _, _, holds in literals]
    if len(literals) <= 2 * _MOST_PAIRED:
        for (one, first, here), (other, second, there) in combinations(literals, 2):
            if one != other:
                clauses.append((first, second))
                columns.append(here | there)
    return _Clauses(tuple(clauses), np.array(columns, dtype=float).T)


def _conditions(
    feature: Feature, values: FloatArray, went_on: BoolArray
) -> list[tuple[Condition, BoolArray]]:
    """Conditions on one feature, with only the most informative threshold."""
    match feature.kind:
        case FeatureKind.BINARY:
            return [(IsTrue(feature.name), values == 1)]
        case FeatureKind.CATEGORICAL:
            return [
                (HasCategory(feature.name, name), values == position)
                for position, name in enumerate(feature.categories[:_MOST_CATEGORIES])
            ]
        case FeatureKind.NUMERIC:
            known = values[~np.isnan(values)]
            if not len(known):
                return []
            tried = np.unique(np.quantile(known, np.linspace(0.05, 0.95, _THRESHOLDS)))
            below = (values[:, None] <= tried).astype(float)
            hits, of = went_on @ below, below.sum(axis=0)
            told = _log_likelihood(hits, of) + _log_likelihood(
                went_on.sum() - hits, len(values) - of
            )
            threshold = float(tried[told.argmax()])
            return [(Threshold(feature.name, threshold), values <= threshold)]
