"""Tasks of the tool that judges learned trees, ../shared/closed_loop, where that is there.

Their experts were written by nobody of this package.
"""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from driving.task import State, Task

#: Before the names of these tasks.
PREFIX = "shared-"
_FILE = Path(__file__).resolve().parents[4] / "shared" / "closed_loop" / "tasks.py"


class _Theirs(Protocol):
    """A task as that tool has it."""

    columns: tuple[str, ...]
    actions: tuple[str, ...]
    needs_memory: bool
    success: bool

    def reset(self, seed: int) -> State: ...

    def step(self, action: str) -> tuple[State, float, bool]: ...

    def expert(self) -> str: ...


class _Adapted:
    """Such a task as this benchmark needs it."""

    def __init__(self, name: str, theirs: _Theirs) -> None:
        self.name = name
        self.features, self.actions = theirs.columns, theirs.actions
        self.needs_memory = theirs.needs_memory
        self._theirs = theirs
        self.over = False

    def reset(self, seed: int) -> State:
        self.over = False
        return self._theirs.reset(seed)

    def step(self, action: str) -> State:
        state, _, self.over = self._theirs.step(action)
        return state

    @property
    def success(self) -> bool:
        return bool(self._theirs.success)

    def expert(self) -> str:
        return self._theirs.expert()


def is_there() -> bool:
    """Whether the tool is beside the checkout."""
    return _FILE.is_file()


def names() -> tuple[str, ...]:
    """Of the tasks, with their prefix."""
    return tuple(f"{PREFIX}{name}" for name in _tasks())


def shared_task(name: str) -> Task:
    """One of `names`, before its first episode."""
    task: Any = _Adapted(name, _tasks()[name.removeprefix(PREFIX)]())
    return task  # type: ignore[no-any-return]


@cache
def _tasks() -> dict[str, Any]:
    spec = importlib.util.spec_from_file_location("closed_loop_tasks", _FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: dict[str, Any] = module.TASKS
    return found
