"""What an executor's last tick did, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.verification.acting import Outcome
from rebt_ros.verification.explaining import explain_tick
from rebt_ros.verification.explanation_text import lines


@dataclass(frozen=True, eq=False, slots=True)
class LastTick:
    """The state of a tick, and what came of the nodes that were ticked."""

    learned: LearnedTree
    values: tuple[float, ...]
    """Of the features of the tree."""
    outcomes: Mapping[int, str]
    """From `TreeRuntime.outcomes`."""

    def explained(self) -> str:
        """Which branch acted and why, in lines; see docs/rules.md.

        Raises:
            RuleError: The tree cannot be explained.
        """
        outcomes = {place: Outcome[status] for place, status in self.outcomes.items()}
        found = explain_tick(self.learned, outcomes)
        text: list[str] = []
        for one in found:
            if len(found) > 1:
                text.append(f"Channel {one.channel}:")
            text += lines(self.learned, self.values, one)
        return "\n".join(text)
