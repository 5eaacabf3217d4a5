"""What tasks have in common whose worlds are written here."""

from __future__ import annotations

import random
from typing import ClassVar

from driving.task import State


class Scripted:
    """An episode of a task, which says how it begins, what actions do, and when it is over."""

    features: ClassVar[tuple[str, ...]]
    actions: ClassVar[tuple[str, ...]]
    most_steps: ClassVar[int]
    needs_memory = False

    def reset(self, seed: int) -> State:
        self._chance = random.Random(seed)
        self._steps = 0
        self._done = self._failed = False
        self._begin()
        return self._state

    def step(self, action: str) -> State:
        self._steps += 1
        self._act(action)
        return self._state

    def _begin(self) -> None:
        raise NotImplementedError

    def _act(self, action: str) -> None:
        raise NotImplementedError

    @property
    def _state(self) -> State:
        raise NotImplementedError

    @property
    def over(self) -> bool:
        return self._done or self._failed or self._steps >= self.most_steps

    @property
    def success(self) -> bool:
        return self._done and not self._failed
