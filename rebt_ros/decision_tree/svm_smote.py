"""Upsampling: rows made up for rare actions, only for fitting decision trees.

SVM-SMOTE (Nguyen et al., 2011) makes rows of an action from its rows that border on other actions,
and their neighbors of the same action, until it has about as many as the most frequent action.
Four things differ from plain SVM-SMOTE on an encoded table:

* Each column is scaled to its range first, so units of measurement do not decide what is near.
* A made-up row takes truth values, categories and LAT from the nearer of its two sources, instead
  of a fraction of both.  Its numbers lie within the range that was shown.
* Rows with a missing number are not used as sources: nothing lies between a number and none.
* An action that cannot be upsampled (too few rows, or none with a neighbor of its kind) stays as it
  is, and is named.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rebt_ros.arrays import Float32Array, FloatArray, IntArray
from rebt_ros.decision_tree.encoding import MISSING, Indicator, Number
from rebt_ros.errors import OptionError
from rebt_ros.logic.conditions import Condition, LastActionIs, PreviousActionIs, features_of

#: Neighbors of the same action that a row is made up with, and of any action that decide whether a
#: row is noise; fewer if there are fewer rows (SVM-SMOTE's defaults).
_NEIGHBOURS, _SURROUNDINGS = 5, 10


@dataclass(frozen=True, eq=False, slots=True)
class Upsampled:
    """The shown rows, followed by the made-up ones."""

    matrix: Float32Array
    """Shape (rows, columns)."""
    chosen: IntArray
    """Shape (rows,)."""
    left: tuple[int, ...]
    """Rare actions that could not be upsampled."""


def svm_smote(
    matrix: Float32Array,
    chosen: IntArray,
    asked: Sequence[Number | Indicator],
    random_state: int,
) -> Upsampled:
    """Adds rows, until each action has about as many as the most frequent one.

    Args:
        matrix: An encoded table, shape (rows, columns), at least one row.
        chosen: The action of each row, shape (rows,).
        asked: What each column asks.
        random_state: Decides which rows are made up.

    Raises:
        OptionError: imbalanced-learn is not installed.
    """
    sampler = _sampler()
    actions, counts = np.unique(chosen, return_counts=True)
    missing = matrix == MISSING
    # A column without any number says nothing, and must not exclude all rows.
    used = np.flatnonzero(~missing.all(axis=0))
    sources = ~missing[:, used].any(axis=1)
    scale = _Scale.of(matrix[np.ix_(sources, used)])
    made, made_for, left = [matrix], [chosen], []
    for action, count in zip(actions.tolist(), counts.tolist(), strict=True):
        wanted = int(counts.max()) - count
        if not wanted:
            continue
        new = _made_up(sampler, scale.scaled, chosen[sources], action, wanted, random_state)
        if not len(new):
            left.append(action)
        rows = np.full((len(new), matrix.shape[1]), MISSING, dtype=np.float32)
        rows[:, used] = scale.back(new)
        made.append(_with_whole_indicators(rows, asked))
        made_for.append(np.full(len(new), action))
    return Upsampled(np.concatenate(made), np.concatenate(made_for), tuple(left))


@dataclass(frozen=True, eq=False, slots=True)
class _Scale:
    """Columns between 0 and 1, and the way back."""

    scaled: FloatArray
    """Shape (rows, columns)."""
    low: FloatArray
    """Shape (columns,)."""
    span: FloatArray
    """Shape (columns,)."""

    @classmethod
    def of(cls, matrix: Float32Array) -> _Scale:
        rows = matrix.astype(np.float64)
        if not rows.size:
            return cls(rows, np.zeros(rows.shape[1]), np.zeros(rows.shape[1]))
        low = rows.min(axis=0)
        span = rows.max(axis=0) - low
        return cls((rows - low) / np.where(span == 0, 1, span), low, span)

    def back(self, scaled: FloatArray) -> Float32Array:
        """The inverse scaling, clipped: SVM-SMOTE also extrapolates beyond its rows."""
        return (self.low + np.clip(scaled, 0, 1) * self.span).astype(np.float32)


def _sampler() -> Callable[..., Any]:
    try:
        from imblearn.over_sampling import SVMSMOTE
    except ImportError as err:
        if isinstance(err, ModuleNotFoundError) and (err.name or "").startswith("imblearn"):
            raise OptionError(
                "upsampling needs imbalanced-learn, which is not installed: run "
                "'python3 -m pip install imbalanced-learn', or learn without upsampling."
            ) from err
        reason = " ".join(str(err).split()).rstrip(".")
        raise OptionError(
            f"upsampling needs imbalanced-learn, which cannot be imported ({reason}): install a "
            "version that fits your scikit-learn, or learn without upsampling."
        ) from err
    return SVMSMOTE  # type: ignore[no-any-return]


def _made_up(
    sampler: Callable[..., Any],
    scaled: FloatArray,
    chosen: IntArray,
    action: int,
    wanted: int,
    random_state: int,
) -> FloatArray:
    """About the requested number of new rows of an action, or none, shape (rows, columns)."""
    none = np.empty((0, scaled.shape[1]))
    count = int(np.sum(chosen == action))
    if count < 2 or not scaled.shape[1]:
        return none
    smote = sampler(
        sampling_strategy={action: count + wanted},
        k_neighbors=min(_NEIGHBOURS, count - 1),
        m_neighbors=min(_SURROUNDINGS, len(chosen) - 1),
        random_state=random_state,
    )
    with warnings.catch_warnings():
        # For example: an action has more rows without missing numbers than the others.
        warnings.simplefilter("ignore")
        try:
            matrix, _ = smote.fit_resample(scaled, chosen)
        except ValueError:
            # There is only one action, or other actions surround every row of this one.
            return none
    return np.asarray(matrix[len(chosen) :], dtype=np.float64)


def _with_whole_indicators(rows: Float32Array, asked: Sequence[Number | Indicator]) -> Float32Array:
    """The rows with one truth value, at most one category per feature and one action before."""
    groups: dict[str | None, list[int]] = {}
    for column, one in enumerate(asked):
        if isinstance(one, Indicator):
            groups.setdefault(_feature(one.condition), []).append(column)
    whole = rows.copy()
    for columns in groups.values():
        shares = rows[:, columns]
        # All zeros is a value too: false, missing, or nothing done before.
        none = 1 - shares.sum(axis=1, keepdims=True)
        nearest = np.argmax(np.hstack([shares, none]), axis=1)
        whole[:, columns] = np.equal(nearest[:, np.newaxis], np.arange(len(columns)))
    return whole


def _feature(condition: Condition) -> str | None:
    """The feature that an indicator asks about; None for what was done before."""
    return (
        None
        if isinstance(condition, PreviousActionIs | LastActionIs)
        else features_of(condition)[0]
    )
