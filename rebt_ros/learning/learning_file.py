"""learning.npz, the file beside tree.json that a `Learning` is loaded from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.behavior_tree import document
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.codec.form import MisfitError
from rebt_ros.codec.hints import record
from rebt_ros.decision_tree.encoding import Vocabulary, columns
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.grown import GrownTree
from rebt_ros.decision_tree.pruning import pruning_path
from rebt_ros.demonstration.last_action import NO_ACTION, History
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.demonstration.weights import LARGEST_WEIGHT
from rebt_ros.errors import InputError, RebtError
from rebt_ros.learning.chosen_policy import ChosenPolicy
from rebt_ros.learning.judged_levels import JudgedLevels
from rebt_ros.learning.learning import Learning, learned_as_asked
from rebt_ros.learning.levels import Evidence
from rebt_ros.learning.options import LearnOptions
from rebt_ros.logic.conditions import combination
from rebt_ros.storage.array_file import read_arrays, write_arrays

#: Its name.
NAME = "learning.npz"

#: Version of the contents below.
VERSION = 2

#: Maximum number of values of a table that is kept: 100,000 rows of 20 features.
MOST_VALUES = 2_000_000

_TREE = ("left", "right", "column", "threshold", "counts", "risk")
_TABLE = ("states", "chosen", "demonstration", "stamps", "previous")
_LEVELS = ("ccp_alphas", "hits", "shown", "leaves", "explanations")


def write_learning(directory: Path, learning: Learning) -> tuple[str, ...]:
    """Writes learning.npz, or removes an older one if the table is too large.

    Returns:
        Notes; no full stops.

    Raises:
        StorageError: It cannot be written.
    """
    path = directory / NAME
    kept = saved(learning)
    if kept is None:
        path.unlink(missing_ok=True)
        return (f"there is no {NAME}, as the table is too large for it",)
    write_arrays(path, kept.words, kept.arrays)
    return ()


def load_learning(path: str | Path) -> Learning:
    """Loads a learned policy, without learning again.

    Args:
        path: learning.npz, or the directory that `learn` wrote it to.

    Raises:
        InputError: There is no such file, or it cannot be used.
    """
    path = Path(path)
    if path.is_dir():
        path = _in_directory(path)
    words, arrays = read_arrays(path)
    try:
        return restored(Saved(words, arrays))
    except InputError as err:
        raise InputError(f"{path} cannot be used: {err}") from err


def _in_directory(directory: Path) -> Path:
    path = directory / NAME
    if path.exists():
        return path
    channels = sorted(one.parent for one in directory.glob(f"channels/*/{NAME}"))
    if channels:
        names = ", ".join(map(str, channels))
        raise InputError(f"{directory} has a tree for each of several channels: name one, {names}.")
    if (directory / "tree.json").exists():
        raise InputError(
            f"{directory} has a tree and no {NAME}: that is not written for more than "
            f"{MOST_VALUES} values (rows times features); learn from fewer rows."
        )
    raise InputError(f"{path} does not exist: name the directory that `learn` wrote to.")


@dataclass(frozen=True, slots=True)
class _Fit:
    """How a decision tree was fitted."""

    history: History
    combinations: tuple[tuple[tuple[str, float], ...], ...]
    """The terms of each combination; a difference has the weights 1 and -1."""
    max_depth: int | None
    random_state: int
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Words:
    """The contents of the file except arrays."""

    version: int
    plain: str
    """The document of the tree without suggestions attached."""
    channel: str
    actions: tuple[str, ...]
    demonstrations: tuple[str, ...]
    ccp_alpha: float
    psa: bool
    reasons: tuple[str, ...]
    late: tuple[str, ...]
    further: tuple[str, ...]
    options: LearnOptions
    fitted: _Fit
    judge: _Fit


_WORDS: Final = record(
    _Words, known={LearnOptions: record(LearnOptions, tolerant=True)}, tolerant=True
)


@dataclass(frozen=True, eq=False, slots=True)
class Saved:
    """The contents of a file of a learned policy."""

    words: dict[str, Any]
    """The contents that are JSON."""
    arrays: dict[str, npt.NDArray[Any]]


def saved(learning: Learning) -> Saved | None:
    """A policy as plain values; None if its table is too large (`MOST_VALUES`)."""
    evidence, table = learning.evidence, learning.evidence.table
    if table.states.size > MOST_VALUES:
        return None
    arrays = {f"table.{name}": getattr(table, name) for name in _TABLE}
    arrays |= {"held_out": evidence.held_out, "intended": evidence.intended}
    if table.before is not None:
        arrays["table.before"] = table.before
    if table.weights is not None:
        arrays["table.weights"] = table.weights
    for role, fitted in (("fitted", evidence.fitted), ("judge", evidence.judge)):
        arrays |= {f"{role}.{name}": getattr(fitted.grown, name) for name in _TREE}
    if learning.policy.levels is not None:
        arrays |= {f"levels.{name}": getattr(learning.policy.levels, name) for name in _LEVELS}
    words = _Words(
        version=VERSION,
        plain=document.dumps(learning.plain),
        channel=table.channel,
        actions=table.actions,
        demonstrations=table.demonstrations,
        ccp_alpha=learning.policy.ccp_alpha,
        psa=evidence.psa,
        reasons=learning.policy.reasons,
        late=learning.late,
        further=learning.further,
        options=evidence.options,
        fitted=_fit(evidence.fitted),
        judge=_fit(evidence.judge),
    )
    return Saved(_WORDS.encode(words), arrays)


def restored(kept: Saved) -> Learning:
    """The saved policy.

    Raises:
        InputError: Its version differs, or its parts do not fit together.
    """
    if kept.words.get("version") != VERSION:
        raise InputError(
            f"it is of version {kept.words.get('version')!r}, where {VERSION} is read: learn again."
        )
    try:
        return _restored(_WORDS.decode(kept.words), kept.arrays)
    except MisfitError as err:
        raise InputError(f"{err.sentence('what it says').rstrip('.')}: learn again.") from err
    except (RebtError, KeyError, TypeError, ValueError, IndexError, AttributeError) as err:
        raise InputError(f"its parts do not fit together ({err}): learn again.") from err


def _restored(words: _Words, arrays: Mapping[str, npt.NDArray[Any]]) -> Learning:
    plain = document.loads(words.plain)
    if {Action(label, words.channel) for label in words.actions} != set(plain.actions):
        raise ValueError("the actions are not those of the tree")
    table = DemonstrationTable(
        words.channel,
        plain.features,
        _of(arrays, "table.states", np.float64, 2),
        words.actions,
        _of(arrays, "table.chosen", np.int64),
        words.demonstrations,
        _of(arrays, "table.demonstration", np.int64),
        _of(arrays, "table.stamps", np.int64),
        before=_of(arrays, "table.before", np.int64) if "table.before" in arrays else None,
        previous=_of(arrays, "table.previous", np.int64),
        row_kind=plain.row_kind,
        weights=_of(arrays, "table.weights", np.int64) if "table.weights" in arrays else None,
        robot=plain.robot,
    )
    _check_table(table)
    held_out = _of(arrays, "held_out", np.bool_)
    if held_out.shape != (len(table),):
        raise ValueError("rows held out are not those of the table")
    intended = _of(arrays, "intended", np.int64)
    if intended.shape != (len(table),) or not _within(intended, 0, len(table.actions)):
        raise ValueError("intended actions are not those of the table")
    fitted, judge = (
        _fitted(fit, {name: arrays[f"{role}.{name}"] for name in _TREE}, table)
        for role, fit in (("fitted", words.fitted), ("judge", words.judge))
    )
    evidence = Evidence(table, held_out, intended, fitted, judge, words.psa, words.options)
    levels = None
    if "levels.hits" in arrays:
        levels = JudgedLevels(
            _of(arrays, "levels.ccp_alphas", np.float64),
            _of(arrays, "levels.hits", np.int64, 3),
            _of(arrays, "levels.shown", np.int64, 2),
            _of(arrays, "levels.leaves", np.int64),
            _of(arrays, "levels.explanations", np.int64),
        )
    policy = ChosenPolicy(fitted, words.ccp_alpha, words.psa, levels, words.reasons)
    return learned_as_asked(
        plain,
        evidence.decision_tree_at(policy.ccp_alpha),
        policy,
        evidence,
        late=words.late,
        further=words.further,
    )


def _fit(fitted: FittedTree) -> _Fit:
    vocabulary = fitted.vocabulary
    return _Fit(
        vocabulary.history,
        tuple(one.terms for one in vocabulary.combinations),
        fitted.max_depth,
        fitted.random_state,
        fitted.notes,
    )


def _fitted(
    fit: _Fit, arrays: Mapping[str, npt.NDArray[Any]], table: DemonstrationTable
) -> FittedTree:
    vocabulary = Vocabulary(fit.history, tuple(map(combination, fit.combinations)))
    asked = columns(table, vocabulary)
    grown = GrownTree(
        _of(arrays, "left", np.int64),
        _of(arrays, "right", np.int64),
        _of(arrays, "column", np.int64),
        _of(arrays, "threshold", np.float64),
        _of(arrays, "counts", np.int64, 2),
        _of(arrays, "risk", np.float64),
    )
    _check_tree(grown, len(asked), len(table.actions))
    return FittedTree(
        grown,
        pruning_path(grown),
        tuple(Action(label, table.channel) for label in table.actions),
        asked,
        vocabulary,
        fit.max_depth,
        fit.random_state,
        fit.notes,
    )


def _of(
    arrays: Mapping[str, npt.NDArray[Any]], name: str, kind: type[Any], axes: int = 1
) -> npt.NDArray[Any]:
    array = arrays[name]
    if array.ndim != axes or array.dtype.kind != np.dtype(kind).kind:
        raise ValueError(f"{name} is not an array of the right kind")
    return array.astype(kind)


def _check_table(table: DemonstrationTable) -> None:
    rows = len(table)
    if table.states.shape != (rows, len(table.features)):
        raise ValueError("states are not those of the features")
    for name, codes, count, least in (
        ("actions", table.chosen, len(table.actions), 0),
        ("previous actions", table.previous, len(table.actions), NO_ACTION),
        ("demonstrations", table.demonstration, len(table.demonstrations), 0),
    ):
        if codes.shape != (rows,) or not _within(codes, least, count):
            raise ValueError(f"{name} are out of range")
    if table.weights is not None and (
        table.weights.shape != (len(table.demonstrations),)
        or not _within(table.weights, 1, LARGEST_WEIGHT + 1)
    ):
        raise ValueError("weights are not those of the demonstrations")
    for feature, column in zip(table.features, table.states.T, strict=True):
        codes = column[~np.isnan(column)]
        end = {FeatureKind.BINARY: 2, FeatureKind.CATEGORICAL: len(feature.categories)}
        if feature.kind in end and not (
            (codes % 1 == 0).all() and _within(codes, 0, end[feature.kind])
        ):
            raise ValueError(f"values of {feature.name} are out of range")
    if table.stamps.shape != (rows,) or (np.diff(table.demonstration) < 0).any():
        raise ValueError("rows are not in order")


def _check_tree(grown: GrownTree, width: int, actions: int) -> None:
    nodes = np.arange(len(grown))
    splits = grown.left >= 0
    sizes = {len(getattr(grown, name)) for name in _TREE}
    if sizes != {len(grown)} or not len(grown) or grown.counts.shape[1] != actions:
        raise ValueError("the arrays of a decision tree differ in length")
    for child in (grown.left, grown.right):
        # Children come after their parents, so every walk ends.
        if (
            not ((child > nodes) & (child < len(grown)))[splits].all()
            or (child[~splits] >= 0).any()
        ):
            raise ValueError("the nodes of a decision tree do not form a tree")
    if not _within(grown.column[splits], 0, max(width, 1)):
        raise ValueError("a decision tree compares a column that does not exist")


def _within(codes: IntArray | FloatArray, least: int, end: int) -> bool:
    return not len(codes) or (int(codes.min()) >= least and int(codes.max()) < end)
