"""What an exported tree remembers of what was done before, in variables that its scripts keep.

The conditions of one tick all see what was done before it.  So each variable that they read has
another one that is written while actions are ticked, and a script at the beginning of a tick copies
it.  What is remembered is what `TreeRuntime` remembers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.export.identifiers import identifiers
from rebt_ros.export.scripts import text
from rebt_ros.logic.conditions import HistoryCondition, LastActionIs, PreviousActionIs

_NOTHING = "''"


@dataclass(frozen=True, slots=True)
class _Last:
    """The most recent action that is none of some."""

    deciding: frozenset[str]
    read: str
    written: str


@dataclass(frozen=True, slots=True)
class Memory:
    """What the tree of one channel remembers.

    Scripts are sequences of assignments, empty where there is nothing to remember.
    """

    labels: Mapping[str, str]
    """The text of each label."""
    row_kind: RowKind
    previous: str | None
    """The variable of the previous action, where it is tested."""
    ended: str
    """The action that ended last, also in this tick."""
    running: str
    """The action that runs; of trees that were learned from events."""
    ticked: str
    """Whether any action was ticked; of trees that were learned from events."""
    lasts: tuple[_Last, ...]

    def test(self, condition: HistoryCondition, positive: bool) -> str:
        """What is true where a condition holds or, if `positive` is false, where it does not."""
        sign = "==" if positive else "!="
        if isinstance(condition, PreviousActionIs):
            return f"{self.previous} {sign} {self._text(condition.action)}"
        its = frozenset(condition.deciding)
        read = next(last.read for last in self.lasts if last.deciding == its)
        return f"{read} {sign} {self._text(condition.action)}"

    @property
    def first(self) -> tuple[str, ...]:
        """What is assigned before the first tick."""
        names = [name for last in self.lasts for name in (last.read, last.written)]
        if self.previous is not None:
            names += [self.previous, self.ended]
            if self._of_events:
                return (
                    *(f"{name} := {_NOTHING}" for name in (*names, self.running)),
                    f"{self.ticked} := 0",
                )
        return tuple(f"{name} := {_NOTHING}" for name in names)

    @property
    def begin(self) -> tuple[str, ...]:
        """What is assigned at the beginning of each tick."""
        copied = tuple(f"{last.read} := {last.written}" for last in self.lasts)
        if self.previous is None:
            return copied
        now = f"{self.previous} := {self.ended}"
        if not self._of_events:
            return (*copied, now)
        # What ran and was not ticked was interrupted, and nothing has taken its place.
        stopped = f"({self.ticked} == 0) && ({self.running} != {_NOTHING})"
        return (
            *copied,
            f"{self.ended} := ({stopped}) ? {self.running} : {self.ended}",
            f"{self.running} := ({self.ticked} == 0) ? {_NOTHING} : {self.running}",
            f"{self.ticked} := 0",
            now,
        )

    def act(self, label: str) -> tuple[str, ...]:
        """What is assigned before an action is ticked."""
        its = self._text(label)
        noted = tuple(
            f"{last.written} := {its}" for last in self.lasts if label not in last.deciding
        )
        if self.previous is None:
            return noted
        if not self._of_events:
            return (*noted, f"{self.ended} := {its}")
        # Another action that runs ends here, as this one takes its place.
        other = f"({self.running} != {_NOTHING}) && ({self.running} != {its})"
        return (
            *noted,
            f"{self.ended} := ({other}) ? {self.running} : {self.ended}",
            f"{self.running} := {its}",
            f"{self.ticked} := 1",
        )

    def done(self, label: str) -> tuple[str, ...]:
        """What is assigned when an action has succeeded or failed."""
        if self.previous is None or not self._of_events:
            return ()
        return (f"{self.ended} := {self._text(label)}", f"{self.running} := {_NOTHING}")

    @property
    def halted(self) -> tuple[str, ...]:
        """What is assigned when the whole tree is interrupted."""
        return (f"{self.ticked} := 0",) if self.previous is not None and self._of_events else ()

    @property
    def _of_events(self) -> bool:
        return self.row_kind is RowKind.EVENT

    def _text(self, label: str) -> str:
        return text(self.labels[label])


def memories(
    trees: Mapping[str, nodes.Node],
    labels: Mapping[str, str],
    row_kind: RowKind,
) -> dict[str, Memory]:
    """What the tree of each channel remembers; nothing of those that test nothing.

    Args:
        trees: By their channels.
        labels: The text of each label.
        row_kind: What the previous action is.
    """
    tested = {channel: _tested(tree) for channel, tree in trees.items()}
    tested = {channel: conditions for channel, conditions in tested.items() if conditions}
    taken: list[str] = []
    found: dict[str, Memory] = {}
    for channel, conditions in tested.items():
        where = f" on {channel}" if len(tested) > 1 else ""
        groups = list(
            dict.fromkeys(
                frozenset(condition.deciding)
                for condition in conditions
                if isinstance(condition, LastActionIs)
            )
        )
        named = [f"last action{_before(group)}{where}" for group in groups]
        roles = [f"{role}{where}" for role in ("previous action", "ended", "running", "ticked")]
        wanted = [*named, *(f"next {name}" for name in named), *roles]
        plain = identifiers(wanted, "memory", taken).values()
        taken += plain
        # Names that begin so are private: no other tree on the same blackboard has them.
        names = [f"_{name}" for name in plain]
        previous, ended, running, ticked = names[2 * len(groups) :]
        remembers = any(isinstance(condition, PreviousActionIs) for condition in conditions)
        found[channel] = Memory(
            labels,
            row_kind,
            previous if remembers else None,
            ended,
            running,
            ticked,
            tuple(
                _Last(group, names[place], names[len(groups) + place])
                for place, group in enumerate(groups)
            ),
        )
    return found


def _before(group: frozenset[str]) -> str:
    # Other groups of labels have other texts, whatever the labels are.
    return f" before {sorted(group)}" if group else ""


def _tested(tree: nodes.Node) -> list[HistoryCondition]:
    return [
        node.literal.condition
        for node in nodes.conditions(tree)
        if isinstance(node.literal.condition, PreviousActionIs | LastActionIs)
    ]
