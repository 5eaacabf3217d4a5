"""A learned tree as an object that acts, in any program: from a state to an action.

Every episode has a history of its own, exactly as in the executor: the previous action, LAT, and
the states that lagged features look back at.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.condition_tests import holds_after
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.prediction import Plan, States
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.errors import InputError
from rebt_ros.learning.named_states import Encoding, State
from rebt_ros.logic.conditions import HistoryCondition
from rebt_ros.storage.tree_file import read_tree

#: A label, or None if the tree does nothing; with several channels, one for each.
Decision: TypeAlias = str | dict[str, str | None] | None


class Policy:
    """The actions of a learned tree, step by step, in one or several concurrent episodes.

    An action counts as done once it is chosen.

    >>> from rebt_ros.learning.policy import Policy
    >>> policy = Policy("learned/tree.json")  # doctest: +SKIP
    >>> policy.act({"front": 0.2, "docked": False})  # doctest: +SKIP
    'turn_left'

    Args:
        tree: A learned tree, or the file of one.

    Raises:
        RebtError: The file cannot be used.
    """

    def __init__(self, tree: LearnedTree | str | Path) -> None:
        self.learned = tree if isinstance(tree, LearnedTree) else read_tree(Path(tree))
        """The tree."""
        self._encoding = Encoding(self.learned.features)
        root = executable(self.learned.tree)
        self._channels = nodes.policies(root)
        self._ticked = not all(map(nodes.is_reactive, self._channels.values()))
        self._plans = {
            channel: Plan(its, self.learned.features) for channel, its in self._channels.items()
        }
        self.reset()

    @property
    def features(self) -> tuple[str, ...]:
        """The names of the features of a state, in order."""
        return self._encoding.names

    @property
    def actions(self) -> tuple[str, ...]:
        """The labels that the tree may answer with."""
        return tuple(dict.fromkeys(action.label for action in nodes.actions(self.learned.tree)))

    def reset(self, episodes: int | Sequence[int] = 1) -> None:
        """Begins episodes, without any history.

        Args:
            episodes: The number of episodes from now on; or which of the existing ones to restart.
        """
        if isinstance(episodes, int):
            self._episodes = [_Episode(self.learned, self._ticked) for _ in range(episodes)]
        else:
            for episode in episodes:
                self._episodes[episode] = _Episode(self.learned, self._ticked)

    def act(self, state: State) -> Decision:
        """What to do now in the first episode.

        Args:
            state: The current state; features that are not named are missing.

        Raises:
            InputError: The state does not fit the features.
        """
        return self.act_many([state], [0])[0]

    def act_many(
        self, states: Sequence[State], episodes: Sequence[int] | None = None
    ) -> list[Decision]:
        """What to do now in several episodes.

        Args:
            states: The current state of each.
            episodes: Numbers of the episodes, from 0, each once; all by default.

        Returns:
            A decision for each.

        Raises:
            InputError: The number of states is wrong, or one does not fit the features.
        """
        numbers = range(len(self._episodes)) if episodes is None else episodes
        if len(numbers) != len(states):
            raise InputError(
                f"there are {len(states)} states for {len(numbers)} episodes: call reset with the "
                "number of episodes, and give one state for each."
            )
        acting = [self._episodes[number] for number in numbers]
        present = [self._encoding.present(state) for state in states]
        values = np.array(
            [self._encoding.row(now, one.past) for now, one in zip(present, acting, strict=True)]
        ).reshape(len(acting), len(self.learned.features))
        for now, one in zip(present, acting, strict=True):
            one.past.appendleft(now)
        if self._ticked:
            chosen = [one.tick(row) for one, row in zip(acting, values.tolist(), strict=True)]
        else:
            chosen = self._chosen(acting, values)
        if len(self._channels) == 1:
            [channel] = self._channels
            return [one[channel] for one in chosen]
        return list(chosen)

    def _chosen(
        self, acting: Sequence[_Episode], values: FloatArray
    ) -> list[dict[str, str | None]]:
        """The actions of memoryless trees, for all episodes at once."""
        chosen: list[dict[str, str | None]] = [{} for _ in acting]
        for channel, plan in self._plans.items():
            histories = [one.histories[channel] for one in acting]

            def holds(
                condition: HistoryCondition, histories: Sequence[ActionHistory] = histories
            ) -> BoolArray:
                return np.array(
                    [holds_after(history, condition) for history in histories], dtype=bool
                )

            codes = plan.choose(plan.actions, States(self.learned.features, values, holds))
            for code, history, answer in zip(codes.tolist(), histories, chosen, strict=True):
                answer[channel] = None if code < 0 else plan.actions[code].label
                if code >= 0:
                    history.take(plan.actions[code].label)
        return chosen


class _Episode:
    """What has happened in one episode."""

    def __init__(self, learned: LearnedTree, ticked: bool) -> None:
        channels = {action.channel for action in learned.actions}
        self.histories = {channel: ActionHistory() for channel in channels}
        self.past: deque[list[float]] = deque(
            maxlen=max((feature.lag for feature in learned.features), default=0)
        )
        tree = executable(learned.tree)
        self._channels = tuple(nodes.policies(tree))
        self._runtime = TreeRuntime(learned, tree=tree) if ticked else None

    def tick(self, state: Sequence[float]) -> dict[str, str | None]:
        """The command of each channel after a tick, as the executor sends it."""
        assert self._runtime is not None
        commands = {
            command.channel: command.label for command in self._runtime.tick(state).commands
        }
        return {channel: commands.get(channel) for channel in self._channels}
