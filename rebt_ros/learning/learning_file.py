"""The file beside tree.json from which a `Learning` comes back without learning again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.behavior_tree import document
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.beyond_the_paper.reductions import Reductions
from rebt_ros.decision_tree.encoding import Vocabulary, columns
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.grown import GrownTree
from rebt_ros.decision_tree.pruning import pruning_path
from rebt_ros.demonstration.last_action import NO_ACTION, History
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import InputError, RebtError
from rebt_ros.learning.chosen_policy import ChosenPolicy
from rebt_ros.learning.judged_levels import JudgedLevels
from rebt_ros.learning.learning import Learning, learned_as_asked
from rebt_ros.learning.levels import Evidence
from rebt_ros.learning.options import LearnOptions
from rebt_ros.logic.conditions import Difference
from rebt_ros.storage.array_file import read_arrays, write_arrays

#: Its name.
NAME = "learning.npz"

#: Of the words and arrays below.
VERSION = 1

#: Values of a table that are kept at most: 100,000 rows of 20 features.
MOST_VALUES = 2_000_000

_TREE = ("left", "right", "column", "threshold", "counts", "risk")
_TABLE = ("states", "chosen", "demonstration", "stamps", "previous")
_LEVELS = ("ccp_alphas", "hits", "shown", "leaves", "explanations")


def write_learning(directory: Path, learning: Learning) -> tuple[str, ...]:
    """Writes learning.npz, or takes an older one away where the table is too large for it.

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
    """A learned policy as it was when it was written, without learning again.

    Args:
        path: learning.npz, or the directory that `learn` wrote it to.

    Raises:
        InputError: There is no such file, or it cannot be used.
    """
    path = Path(path)
    if path.is_dir():
        path = path / NAME
    words, arrays = read_arrays(path)
    try:
        return restored(Saved(words, arrays))
    except InputError as err:
        raise InputError(f"{path} cannot be used: {err}") from err


@dataclass(frozen=True, eq=False, slots=True)
class Saved:
    """What a file of a learned policy holds."""

    words: dict[str, Any]
    """What JSON can hold."""
    arrays: dict[str, npt.NDArray[Any]]


def saved(learning: Learning) -> Saved | None:
    """A policy as plain values; None where its table is too large to be kept (`MOST_VALUES`)."""
    evidence, table = learning.evidence, learning.evidence.table
    if table.states.size > MOST_VALUES:
        return None
    arrays = {f"table.{name}": getattr(table, name) for name in _TABLE}
    arrays["held_out"] = evidence.held_out
    if table.before is not None:
        arrays["table.before"] = table.before
    for role, fitted in (("fitted", evidence.fitted), ("judge", evidence.judge)):
        arrays |= {f"{role}.{name}": getattr(fitted.grown, name) for name in _TREE}
    if learning.policy.levels is not None:
        arrays |= {f"levels.{name}": getattr(learning.policy.levels, name) for name in _LEVELS}
    words = {
        "version": VERSION,
        "plain": document.dumps(learning.plain),
        "channel": table.channel,
        "actions": list(table.actions),
        "demonstrations": list(table.demonstrations),
        "ccp_alpha": learning.policy.ccp_alpha,
        "psa": evidence.psa,
        "reasons": list(learning.policy.reasons),
        "late": list(learning.late),
        "further": list(learning.further),
        "options": _plain(asdict(evidence.options)),
        "fitted": _fit_words(evidence.fitted),
        "judge": _fit_words(evidence.judge),
    }
    return Saved(words, arrays)


def restored(kept: Saved) -> Learning:
    """The policy that was saved.

    Raises:
        InputError: It is of another version, or its parts do not fit each other.
    """
    if kept.words.get("version") != VERSION:
        raise InputError(
            f"it is of version {kept.words.get('version')!r}, where {VERSION} is read: learn again."
        )
    try:
        return _restored(kept.words, kept.arrays)
    except (RebtError, KeyError, TypeError, ValueError, IndexError, AttributeError) as err:
        raise InputError(f"its parts do not fit each other ({err}): learn again.") from err


def _restored(words: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]) -> Learning:
    plain = document.loads(words["plain"])
    options = _options(words["options"])
    channel, actions = words["channel"], _texts(words, "actions")
    if {Action(label, channel) for label in actions} != set(plain.actions):
        raise ValueError("the actions are not those of the tree")
    table = DemonstrationTable(
        channel,
        plain.features,
        _of(arrays, "table.states", np.float64, 2),
        actions,
        _of(arrays, "table.chosen", np.int64),
        _texts(words, "demonstrations"),
        _of(arrays, "table.demonstration", np.int64),
        _of(arrays, "table.stamps", np.int64),
        before=_of(arrays, "table.before", np.int64) if "table.before" in arrays else None,
        previous=_of(arrays, "table.previous", np.int64),
        row_kind=plain.row_kind,
        robot=plain.robot,
    )
    _check_table(table)
    held_out = _of(arrays, "held_out", np.bool_)
    if held_out.shape != (len(table),):
        raise ValueError("rows held out are not those of the table")
    fitted, judge = (
        _fitted(words[role], {name: arrays[f"{role}.{name}"] for name in _TREE}, table)
        for role in ("fitted", "judge")
    )
    evidence = Evidence(table, held_out, fitted, judge, bool(words["psa"]), options)
    levels = None
    if "levels.hits" in arrays:
        levels = JudgedLevels(
            _of(arrays, "levels.ccp_alphas", np.float64),
            _of(arrays, "levels.hits", np.int64, 3),
            _of(arrays, "levels.shown", np.int64, 2),
            _of(arrays, "levels.leaves", np.int64),
            _of(arrays, "levels.explanations", np.int64),
        )
    policy = ChosenPolicy(
        fitted, float(words["ccp_alpha"]), evidence.psa, levels, _texts(words, "reasons")
    )
    return learned_as_asked(
        plain,
        evidence.decision_tree_at(policy.ccp_alpha),
        policy,
        evidence,
        late=_texts(words, "late"),
        further=_texts(words, "further"),
    )


def _texts(words: Mapping[str, Any], name: str) -> tuple[str, ...]:
    found = words[name]
    if not isinstance(found, list) or not all(isinstance(text, str) for text in found):
        raise ValueError(f"{name} are no texts")
    return tuple(found)


def _options(words: Mapping[str, Any]) -> LearnOptions:
    reductions = words["reductions"]
    known = {field.name for field in fields(LearnOptions)}
    given = {name: value for name, value in words.items() if name in known}
    given["reductions"] = None if reductions is None else Reductions(**reductions)
    given["attach"] = tuple(given["attach"])
    return LearnOptions(**given)


def _plain(value: Any) -> Any:
    """Enums as their words, tuples as lists."""
    match value:
        case Enum():
            return value.value
        case dict():
            return {name: _plain(each) for name, each in value.items()}
        case tuple() | list():
            return [_plain(each) for each in value]
        case _:
            return value


def _fit_words(fitted: FittedTree) -> dict[str, Any]:
    return {
        "history": fitted.vocabulary.history.value,
        "differences": [
            [difference.minuend, difference.subtrahend]
            for difference in fitted.vocabulary.differences
        ],
        "max_depth": fitted.max_depth,
        "random_state": fitted.random_state,
        "notes": list(fitted.notes),
    }


def _fitted(
    words: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]], table: DemonstrationTable
) -> FittedTree:
    differences = tuple(Difference(*pair) for pair in words["differences"])
    vocabulary = Vocabulary(History(words["history"]), differences)
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
        words["max_depth"],
        int(words["random_state"]),
        _texts(words, "notes"),
    )


def _of(
    arrays: Mapping[str, npt.NDArray[Any]], name: str, kind: type[Any], axes: int = 1
) -> npt.NDArray[Any]:
    array = arrays[name]
    if array.ndim != axes or array.dtype.kind != np.dtype(kind).kind:
        raise ValueError(f"{name} is no array of its kind")
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
        # Children come after their parents, so that every walk ends.
        if (
            not ((child > nodes) & (child < len(grown)))[splits].all()
            or (child[~splits] >= 0).any()
        ):
            raise ValueError("a decision tree has nodes that are no tree")
    if not _within(grown.column[splits], 0, max(width, 1)):
        raise ValueError("a decision tree compares what there is not")


def _within(codes: IntArray | FloatArray, least: int, end: int) -> bool:
    return not len(codes) or (int(codes.min()) >= least and int(codes.max()) < end)
