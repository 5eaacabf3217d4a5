"""What an executor's last tick did, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.verification.explaining import explain
from rebt_ros.verification.explanation_text import lines


@dataclass(frozen=True, eq=False, slots=True)
class LastTick:
    """The state of a tick, and what was done before it."""

    learned: LearnedTree
    values: tuple[float, ...]
    """Of the features of the tree."""
    taken: tuple[tuple[str, tuple[str, ...], str | None], ...]
    """Of each channel, what was done before: the distinct actions and the previous one."""

    def explained(self) -> str:
        """Which branch acts in that state and why, in lines; see docs/rules.md.

        Raises:
            RuleError: The tree cannot be explained.
        """
        histories = {channel: _history(taken, done) for channel, taken, done in self.taken}
        found = explain(self.learned, self.values, histories, changes=False)
        text: list[str] = []
        for one in found:
            if len(found) > 1:
                text.append(f"Channel {one.channel}:")
            text += lines(self.learned, self.values, one)
        return "\n".join(text)


def last_tick(
    learned: LearnedTree, values: Sequence[float], histories: Mapping[str, ActionHistory]
) -> LastTick:
    """Notes a state, before the tree is ticked.

    Args:
        learned: The tree.
        values: Of its features.
        histories: What was done before, by channel.
    """
    taken = tuple((name, one.taken, one.previous) for name, one in histories.items())
    return LastTick(learned, tuple(values), taken)


def _history(taken: Sequence[str], previous: str | None) -> ActionHistory:
    history = ActionHistory(taken)
    history.previous = previous
    return history
