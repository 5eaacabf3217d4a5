"""What a person works on: what was learned, the draft made of it, and earlier trees."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.errors import InputError, OptionError, RebtError
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.learning_file import NAME, load_learning
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.text import read_text
from rebt_ros.studio.board import Board, Section
from rebt_ros.studio.draft import Change, Draft
from rebt_ros.studio.learning_view import draft_view, learning_view, levels_view
from rebt_ros.studio.tree_view import Json, published_view
from rebt_ros.trial.driven import NAME as TRIALS
from rebt_ros.trial.driven import read_driven
from rebt_ros.trial.tally import Tally
from rebt_ros.verification.rules import RuleSet

#: Hands a document to who publishes it; returns the number of the version.
Publish = Callable[[str], str]

_JOURNAL: Final = "journal.json"
_NAMES: Final = "names.json"

#: Longest name or note that is kept (characters).
_LONGEST: Final = 200


class Workbench:
    """Keeps the draft in step with what is learned and published, and shows both on the board.

    All methods may be called from any thread; one works at a time.

    Args:
        board: Where it shows.
        output: The learner's directory: learning.npz, and the trees published before in trees/.
        rules: What trees must keep; None: nothing.
        user: Who works here, for the list of versions.
    """

    def __init__(self, board: Board, output: Path, rules: RuleSet | None, user: str) -> None:
        self._board = board
        self._output = output
        self._own = output / "studio"
        self._rules = rules
        self._user = user
        self._lock = threading.RLock()
        self._draft: Draft | None = None
        self._levels: list[dict[str, Json]] = []
        self._published: LearnedTree | None = None
        self._driven: Mapping[str, Tally] = {}
        self._trials_seen = 0
        self._trial_problem = ""
        self._seen: tuple[int, int] | None = None
        self._versions_seen: tuple[tuple[str, int], ...] = ()
        self._names = _read_object(self._own / _NAMES)
        board.replace(Section.NAMES, self._names)

    @property
    def published(self) -> LearnedTree | None:
        """The tree that is published."""
        return self._published

    def take_published(self, document: str) -> LearnedTree:
        """Notes which tree is published.

        Raises:
            RebtError: It is none.
        """
        learned = loads(document)
        with self._lock:
            self._published = learned
            self._board.replace(Section.TREE, published_view(learned, fingerprint(document)))
            self._show_draft()
            self._versions_seen = ()
        return learned

    def learn(self, learn: Callable[[], str]) -> str:
        """Has a tree learned; the board says that it is awaited until it has been read.

        Args:
            learn: Has it learned and written.

        Raises:
            RebtError: It was refused.
        """
        seen = self._seen
        message = learn()
        with self._lock:
            if self._seen == seen:
                self._board.update(Section.LEARNING, {"awaited": True})
        return message

    def look(self) -> None:
        """Looks for what was learned or published since; to be called every now and then."""
        with self._lock:
            self._look_for_learning()
            self._look_for_trials()
            self._look_for_versions()

    def change(self, what: str, change: Change) -> str:
        """Changes the draft.

        Args:
            what: In words.
            change: What to do.

        Returns:
            What was done, in a sentence.

        Raises:
            RebtError: It cannot be done.
        """
        with self._lock:
            self._work_on(self._there().changed(what, change))
        return f"{what[:1].upper()}{what[1:]}: done. Publish to let the robot use it."

    def undo(self) -> str:
        """Takes the last change of the draft back.

        Raises:
            OptionError: There is none.
        """
        with self._lock:
            draft = self._there()
            what = draft.undoes
            self._work_on(draft.undone())
        return f"undone: {what}."

    def redo(self) -> str:
        """Makes the change again that was taken back last.

        Raises:
            OptionError: There is none.
        """
        with self._lock:
            draft = self._there()
            what = draft.redoes
            self._work_on(draft.redone())
        return f"redone: {what}."

    def reset(self) -> str:
        """Goes back to what was learned.

        Raises:
            OptionError: Nothing was learned.
        """
        with self._lock:
            self._work_on(self._there().reset())
        return "the draft is what was learned, again."

    @property
    def learning(self) -> Learning:
        """The policy of the draft.

        Raises:
            OptionError: Nothing was learned.
        """
        with self._lock:
            return self._there().learning

    def size_of(self, number: int) -> str:
        """A pruning level as people see it: its size in words; its number where it is not shown."""
        leaves = next((one["leaves"] for one in self._levels if one["number"] == number), None)
        if leaves is None:
            return f"level {number}"
        return f"the tree with {leaves} {'leaf' if leaves == 1 else 'leaves'}"

    def publish(self, publish: Publish, note: str) -> str:
        """Has the draft published.

        Args:
            publish: Does it.
            note: What it is, for the list of versions; may be empty.

        Raises:
            RebtError: It was refused, or there is none.
        """
        with self._lock:
            draft = self._there()
            changes = [step.what for step in draft.steps[1 : draft.place + 1]]
            document = dumps(draft.learning.learned)
        version = publish(document)
        self._enter(version, note or "; ".join(changes) or "as learned")
        return f"the robot has the draft now, as version {_number(version)}."

    def publish_version(self, publish: Publish, version: str) -> str:
        """Has a tree published again that was published before.

        Raises:
            RebtError: It was refused, or there is none.
        """
        if not version.isdecimal() or not version.isascii():
            raise OptionError(f"there is no version {version!r}.")
        document = read_text(self._output / "trees" / f"{version}.json")
        number = publish(document)
        self._enter(number, f"version {int(version)} again")
        return f"the robot has version {int(version)} again, as version {_number(number)}."

    def rename(self, name: str, shown: str) -> str:
        """Gives an action or a feature another name on the page; nothing else changes.

        Args:
            name: As it is.
            shown: As it is to be shown; empty for as it is.

        Raises:
            StorageError: It cannot be kept.
        """
        shown = " ".join(shown.split())[:_LONGEST]
        with self._lock:
            names = {key: value for key, value in self._names.items() if key != name}
            if shown and shown != name:
                names[name[:_LONGEST]] = shown
            write_text_atomically(self._own / _NAMES, json.dumps(names, indent=1))
            self._names = names
            self._board.replace(Section.NAMES, names)
        return f"{name} is shown as {shown or name}."

    def _work_on(self, draft: Draft) -> None:
        self._draft = draft
        self._show_draft()

    def _there(self) -> Draft:
        if self._draft is None:
            raise OptionError("there is nothing to change yet: learn a tree first.")
        return self._draft

    def _look_for_learning(self) -> None:
        path = self._output / NAME
        try:
            status = path.stat()
        except OSError:
            return
        seen = (status.st_mtime_ns, status.st_size)
        if seen == self._seen:
            return
        self._seen = seen
        self._board.update(Section.LEARNING, {"awaited": True})
        try:
            learning = load_learning(path)
        except InputError as err:
            self._draft = None
            self._board.replace(Section.LEARNING, {"problem": str(err)})
            self._board.replace(Section.DRAFT, {})
            return
        self._levels = self._levels_of(learning)
        self._work_on(Draft.begin(learning))

    def _look_for_trials(self) -> None:
        """Takes over what a driving trial has found since."""
        modified = _modified(self._output / TRIALS)
        if modified == self._trials_seen:
            return
        self._trials_seen = modified
        try:
            self._driven = read_driven(self._output)
        except InputError as err:
            self._driven, self._trial_problem = {}, str(err)
        else:
            self._trial_problem = ""
        if self._draft is not None:
            self._levels = self._levels_of(self._draft.steps[0].learning)
            self._show_learning(self._draft.learning)

    def _levels_of(self, learning: Learning) -> list[dict[str, Json]]:
        return levels_view(learning, self._driven)

    def _show_learning(self, learning: Learning) -> None:
        view = learning_view(learning, self._levels)
        if self._trial_problem:
            view["notes"] = [*view["notes"], self._trial_problem]
        self._board.replace(Section.LEARNING, view)

    def _show_draft(self) -> None:
        if self._draft is None:
            return
        learning = self._draft.learning
        self._show_learning(learning)
        view = draft_view(learning, self._published, self._rules)
        steps = {"undo": self._draft.undoes, "redo": self._draft.redoes}
        self._board.replace(Section.DRAFT, view | steps)

    def _look_for_versions(self) -> None:
        found = sorted((self._output / "trees").glob("[0-9]*.json"))
        mark = tuple((path.name, _modified(path)) for path in found)
        if mark == self._versions_seen:
            return
        self._versions_seen = mark
        journal = _read_object(self._own / _JOURNAL)
        current = dumps(self._published) if self._published else ""
        self._board.replace(
            Section.VERSIONS,
            {path.stem: _version_view(path, journal.get(path.stem), current) for path in found},
        )

    def _enter(self, version: str, what: str) -> None:
        """Notes who has published a version, and what it is."""
        with self._lock:
            known = {path.stem for path in (self._output / "trees").glob("*.json")}
            journal = _read_object(self._own / _JOURNAL)
            kept = {number: entry for number, entry in journal.items() if number in known}
            kept[version] = {"when": time.time(), "who": self._user, "what": what[:_LONGEST]}
            write_text_atomically(self._own / _JOURNAL, json.dumps(kept, indent=1))
            self._versions_seen = ()
            self._look_for_versions()


def _version_view(path: Path, entry: Any, current: str) -> dict[str, Json]:
    try:
        text = read_text(path)
        size = nodes.size(loads(text).tree)
    except RebtError as err:
        text, size = str(err), None
    noted = entry if isinstance(entry, Mapping) else {}
    return {
        "when": noted.get("when", _modified(path) / 1e9),
        "who": noted.get("who", "learner"),
        "what": noted.get("what", "learned"),
        "nodes": size,
        "current": text == current,
    }


def _number(version: str) -> str:
    return str(int(version)) if version.isdecimal() else version


def _modified(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _read_object(path: Path) -> dict[str, Any]:
    """A JSON object of our own; empty where there is none, or somebody has spoilt it."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
