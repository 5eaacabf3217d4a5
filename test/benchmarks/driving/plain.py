"""Plain scikit-learn classifiers that drive: what a learner of behavior trees has to beat.

With a history they are told the action of the row before and the last other one before that, each
as a column per action.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from driving.demonstrating import Shown
from driving.task import State, Task
from rebt_ros.arrays import FloatArray


class PlainDriver:
    """A classifier with what it needs to know of each episode.

    Args:
        model: Of scikit-learn, a tree or a forest; is fitted here.
        task: What is learned.
        shown: The demonstrations.
        history: Whether it is told what was done before.
    """

    def __init__(self, model: Any, task: Task, shown: Sequence[Shown], history: bool) -> None:
        self._actions = task.actions if history else ()
        self._texts = _texts([state for one in shown for state in one.states])
        rows: list[list[float]] = []
        for one in shown:
            past = _Past()
            for state, action in zip(one.states, one.actions, strict=True):
                rows.append(self._row(state, past))
                past.take(action)
        labels = [action for one in shown for action in one.actions]
        model.fit(np.array(rows, dtype=np.float32), labels)
        self._labels = list(map(str, model.classes_))
        # Their prediction without what scikit-learn checks each time, which takes long.
        self._trees = [one.tree_ for one in getattr(model, "estimators_", [model])]
        self._past: list[_Past] = []

    @property
    def nodes(self) -> int:
        return sum(int(tree.node_count) for tree in self._trees)

    def reset(self, episodes: int) -> None:
        self._past = [_Past() for _ in range(episodes)]

    def act_many(self, states: Sequence[State], episodes: Sequence[int]) -> Sequence[str]:
        past = [self._past[place] for place in episodes]
        rows = np.array(list(map(self._row, states, past)), dtype=np.float32)
        shares: FloatArray = sum(tree.predict(rows).reshape(len(rows), -1) for tree in self._trees)
        chosen = [self._labels[code] for code in np.argmax(shares, axis=1).tolist()]
        for one, action in zip(past, chosen, strict=True):
            one.take(action)
        return chosen

    def _row(self, state: State, past: _Past) -> list[float]:
        row: list[float] = []
        for value, texts in zip(state, self._texts, strict=True):
            row += [float(value == text) for text in texts] if texts else [float(value)]
        for done in (past.previous, past.other):
            row += [float(done == action) for action in self._actions]
        return row


class _Past:
    """What was done in an episode."""

    def __init__(self) -> None:
        self.previous: str | None = None
        self.other: str | None = None

    def take(self, action: str) -> None:
        if action != self.previous:
            self.previous, self.other = action, self.previous


def _texts(states: Sequence[State]) -> list[list[str]]:
    """The categories of each feature, none of a number."""
    columns = zip(*states, strict=True)
    return [sorted({value for value in one if isinstance(value, str)}) for one in columns]
