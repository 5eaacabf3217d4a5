"""What all browsers show, as sections of keys and values, and what has changed of it.

The state is here and nowhere else, so that two browsers show the same, and one that comes back
after a break needs nothing but a snapshot.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, TypeAlias

#: A value is whatever JSON can hold; None takes its key away.
Changes: TypeAlias = dict[str, dict[str, Any]]


class Section(Enum):
    """What a part of the board is about; see docs/studio.md."""

    NODES = "nodes"
    TREE = "tree"
    RUN = "run"
    VALUES = "values"
    TIMELINE = "timeline"
    ACTIONS = "actions"
    DEMONSTRATIONS = "demonstrations"
    LEARNING = "learning"
    DRAFT = "draft"
    VERSIONS = "versions"
    NAMES = "names"


class Board:
    """Sections that several threads write and one reads."""

    def __init__(self) -> None:
        self._changed: Callable[[], None] = _nothing
        self._lock = threading.Lock()
        self._sections: dict[str, dict[str, Any]] = {section.value: {} for section in Section}
        self._changes: Changes = {}

    def listen(self, changed: Callable[[], None]) -> None:
        """Tells who reads from now on.

        Args:
            changed: Called, in the thread that writes, when there is a first change to take; at
                once if there is one already.
        """
        with self._lock:
            self._changed = changed
            waiting = bool(self._changes)
        if waiting:
            changed()

    def update(self, section: Section, values: Mapping[str, Any]) -> None:
        """Sets some keys of a section; a key whose value is None goes."""
        self._set(section, values, whole=False)

    def replace(self, section: Section, values: Mapping[str, Any]) -> None:
        """Sets a whole section."""
        self._set(section, values, whole=True)

    def section(self, section: Section) -> dict[str, Any]:
        """A section as it is now."""
        with self._lock:
            return dict(self._sections[section.value])

    def snapshot(self) -> Changes:
        """Everything, without the changes that were not taken yet: those follow."""
        with self._lock:
            return {name: dict(values) for name, values in self._sections.items()}

    def take_changes(self) -> Changes:
        """What has changed since the last call: of each key the newest value, None if it is gone.

        To a board as it was then, they lead to the board as it is; doing them twice does no harm.
        """
        with self._lock:
            changes, self._changes = self._changes, {}
            return changes

    def _set(self, section: Section, values: Mapping[str, Any], *, whole: bool) -> None:
        with self._lock:
            now = self._sections[section.value]
            gone = now.keys() - values.keys() if whole else ()
            news: dict[str, Any] = dict.fromkeys(gone)
            # A number that is not one differs from itself, and is none to JSON either.
            news |= {key: value for key, value in values.items() if now.get(key) != value}
            if not news:
                return
            for key, value in news.items():
                if value is None:
                    now.pop(key, None)
                else:
                    now[key] = value
            first = not self._changes
            self._changes.setdefault(section.value, {}).update(news)
        if first:
            self._changed()


def _nothing() -> None:
    """Nobody listens yet."""
