"""The behavior tree as a py_trees tree that can be ticked.

Every runtime holds its own state and history: py_trees' blackboard, which is one for the whole
process, is not used.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import py_trees
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.condition_tests import StateTests, history_test
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import Wording
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.schema import Feature, FeatureKind, codes_of, sources
from rebt_ros.logic.conditions import LastActionIs, Literal, PreviousActionIs

#: What a condition is about.
_Read = TypeVar("_Read")


class Commander(Protocol):
    """What carries out the actions of a tree."""

    def update(self, action: nodes.Action) -> Status:
        """Called at each tick that reaches the action: whether it runs, succeeded or failed."""

    def halt(self, action: nodes.Action) -> None:
        """Called when an action that is running is interrupted."""


class SucceedAtOnce:
    """A commander whose actions are done once they are chosen."""

    def update(self, action: nodes.Action) -> Status:
        """Success."""
        return Status.SUCCESS

    def halt(self, action: nodes.Action) -> None:
        """Never has anything to interrupt."""


class AlwaysRunning:
    """A commander whose actions never end."""

    def update(self, action: nodes.Action) -> Status:
        """Running."""
        return Status.RUNNING

    def halt(self, action: nodes.Action) -> None:
        """Has nothing to interrupt."""


@dataclass(frozen=True, slots=True)
class Tick:
    """What one tick did."""

    status: Status
    actions: tuple[nodes.Action, ...]
    """Actions that were ticked, in order."""
    commands: tuple[nodes.Action, ...]
    """Of each channel on which actions were ticked, the one that is its command: one that runs, if
    any does, and of several the one that `nodes.precedence` ranks highest."""


def executable(tree: nodes.Node) -> nodes.Node:
    """The tree as a robot runs it: a root Parallel becomes a memoryless Selector.

    A Parallel fails, and halts the actions that run, as soon as one child fails; under a root
    Parallel all rules but one fail at every tick.  A Parallel over channels stays one.
    """
    side_by_side = nodes.policies(tree)
    if len(side_by_side) > 1:
        return nodes.Parallel(tuple(map(executable, side_by_side.values())))
    return nodes.Selector(tree.children) if isinstance(tree, nodes.Parallel) else tree


class TreeRuntime:
    """A learned tree, ready to be ticked.

    The previous action, which conditions may test, is on each channel the command of the last tick
    where the tree was learned from samples.  Where it was learned from events, it is the action
    that ended last, be it that it was interrupted.  An action of a Parallel that had to leave the
    channel to another one was not done.

    Args:
        learned: The tree and its features.
        commander: Carries out the actions.
        tree: What to run instead of ``learned.tree``, such as its `executable` form.
        histories: Histories to go on with, by channel, as when one tree follows another.
        carry_out: Makes the behaviour that carries out an action, once for each of its places in
            the tree; instead of the commander.
    """

    def __init__(
        self,
        learned: LearnedTree,
        commander: Commander | None = None,
        tree: nodes.Node | None = None,
        histories: Mapping[str, ActionHistory] | None = None,
        carry_out: Callable[[nodes.Action], py_trees.behaviour.Behaviour] | None = None,
    ) -> None:
        self.learned = learned
        self.histories = {action.channel: ActionHistory() for action in learned.actions}
        """What was taken on each channel, by the tree or by others who note it here."""
        self.histories.update(histories or {})
        self._commander = SucceedAtOnce() if commander is None else commander
        self._carry_out = carry_out
        # Always the same list, which conditions hold on to.
        self._state: list[float] = []
        self._ticked: list[_Ticked] = []
        # Of trees that were learned from events, what runs on each channel.
        self._running: dict[str, str] = {}
        self._wording = Wording(learned)
        self._tests = StateTests(learned.features)
        tree = learned.tree if tree is None else tree
        # Actions are built in the order of `walk`.
        self._ranks = iter(nodes.precedence(tree))
        self._behaviours = self._build_root(tree)
        self.root = self._behaviours[0]
        self._places = {id(behaviour): place for place, behaviour in enumerate(self._behaviours)}
        self._visited: list[tuple[int | None, Status]] = []

    def tick(self, state: Sequence[float]) -> Tick:
        """Ticks the tree once.

        Args:
            state: Encoded values in the order of the learned tree's features (see `StateEncoder`).
        """
        self.begin(state)
        places = self._places
        self._visited = [(places.get(id(one)), one.status) for one in self.root.tick()]
        done = self.finish()
        return Tick(
            self.root.status,
            tuple([one.action for one in self._ticked]),
            tuple({one.action.channel: one.action for one in done}.values()),
        )

    def begin(self, state: Sequence[float]) -> None:
        """Begins a tick of `root` that something else does, as a tree that it is a part of."""
        self._state[:] = state
        self._ticked.clear()

    def finish(self) -> Sequence[_Ticked]:
        """Ends such a tick: what was done is noted.

        Returns:
            Those that had their channel one after the other.
        """
        done = _in_turn(self._ticked)
        # Afterwards, so that all conditions of one tick see the same history.
        for one in done:
            self._note(one.action, one.status)
        if self._running:
            # What ran and was not ticked was interrupted, and nothing has taken its place.
            self._end(self._running.keys() - {one.action.channel for one in done})
        return done

    def _note(self, action: nodes.Action, status: Status) -> None:
        history = self.histories[action.channel]
        if self.learned.row_kind is RowKind.SAMPLE:
            history.take(action.label)
            return
        running = self._running.pop(action.channel, action.label)
        if running != action.label:
            # Another action has taken its place, and so ended it.
            history.take(running)
        if status is Status.RUNNING:
            self._running[action.channel] = action.label
            history.begin(action.label)
        else:
            history.take(action.label)

    def _end(self, channels: set[str]) -> None:
        """Notes that what runs on these channels has been interrupted."""
        for channel in channels:
            self.histories[channel].previous = self._running.pop(channel)

    @property
    def tip(self) -> str:
        """What the deepest node that decided in the last tick says; empty where none did."""
        tip = self.root.tip()
        return tip.name if tip else ""

    def outcomes(self) -> dict[int, str]:
        """The status names of the nodes that the last `tick` ticked, by places in `nodes.walk`."""
        return {place: status.name for place, status in self._visited if place is not None}

    def behaviour(self, place: int) -> py_trees.behaviour.Behaviour:
        """What does the node at a place in `nodes.walk` of the tree that is run."""
        return self._behaviours[place]

    def halt(self) -> None:
        """Interrupts whatever runs; the next tick starts afresh, with the same histories."""
        self.root.stop(Status.INVALID)
        self.interrupted()

    def interrupted(self) -> None:
        """Notes that `root` was interrupted, and with it whatever ran."""
        self._end(set(self._running))

    def snapshot(self) -> tuple[str, ...]:
        """The status name of every node, each parent before its children."""
        return tuple(behaviour.status.name for behaviour in self._behaviours)

    def dismantle(self) -> None:
        """Takes it apart, so that its memory is free without a search for garbage; ends its use.

        Parents and children of py_trees refer to each other, and conditions to this runtime.
        """
        for behaviour in self._behaviours:
            vars(behaviour).clear()
        self._behaviours.clear()
        self._places.clear()

    def _build_root(self, tree: nodes.Node) -> list[py_trees.behaviour.Behaviour]:
        side_by_side = nodes.policies(tree)
        if len(side_by_side) < 2:
            channels = [*side_by_side, *self.histories]
            return self._build(tree, self.histories[channels[0]])
        families = [
            self._build(child, self.histories[channel]) for channel, child in side_by_side.items()
        ]
        # A channel that has nothing to do must not halt what runs on another one.
        never_failing: list[py_trees.behaviour.Behaviour] = [
            py_trees.decorators.FailureIsSuccess(name=channel, child=family[0])
            for channel, family in zip(side_by_side, families, strict=True)
        ]
        own = _parallel(self._wording.node(tree), never_failing)
        return [own, *(one for family in families for one in family)]

    def _build(
        self, node: nodes.Node, history: ActionHistory
    ) -> list[py_trees.behaviour.Behaviour]:
        """The behaviours of the node and all its descendants, each parent before its children."""
        families = [self._build(child, history) for child in nodes.children(node)]
        children = [family[0] for family in families]
        own = self._behaviour(self._wording.node(node), node, children, history)
        return [own, *(one for family in families for one in family)]

    def _behaviour(
        self,
        name: str,
        node: nodes.Node,
        children: list[py_trees.behaviour.Behaviour],
        history: ActionHistory,
    ) -> py_trees.behaviour.Behaviour:
        match node:
            case nodes.Condition(literal=literal):
                return self._test(name, literal, history)
            case nodes.Action():
                rank = next(self._ranks)
                if self._carry_out is not None:
                    return _Noted(name, self._carry_out(node), node, rank, self._ticked)
                return _Command(name, node, rank, self._commander, self._ticked)
            case nodes.Inverter():
                return py_trees.decorators.Inverter(name=name, child=children[0])
            case nodes.Sequence(memory=memory):
                return py_trees.composites.Sequence(name, memory, children)
            case nodes.Selector(memory=memory):
                return py_trees.composites.Selector(name, memory, children)
            case nodes.ParallelSelector():
                return py_trees.composites.Selector(name, False, children)
            case nodes.Parallel():
                return _parallel(name, children)
            case nodes.Repeater():
                sequence = py_trees.composites.Sequence(name, True, children)
                return py_trees.decorators.Repeat(name=name, child=sequence, num_success=-1)

    def _test(self, name: str, literal: Literal, history: ActionHistory) -> _Leaf:
        condition = literal.condition
        if isinstance(condition, PreviousActionIs | LastActionIs):
            return _Test(name, history_test(condition), history, positive=literal.positive)
        return _Test(name, self._tests.of(condition), self._state, positive=literal.positive)


def _parallel(
    name: str, children: list[py_trees.behaviour.Behaviour]
) -> py_trees.composites.Parallel:
    policy = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)
    return py_trees.composites.Parallel(name, policy, children)


class _Leaf(py_trees.behaviour.Behaviour):
    """A condition or an action.

    Most of a tree's nodes are leaves.  Ours have nothing to begin, and so leave out what py_trees
    does for behaviours that have, and what it would write to a log; what is seen from outside is
    the same.
    """

    def tick(self) -> Iterator[py_trees.behaviour.Behaviour]:
        self.status = self.update()
        yield self

    def stop(self, new_status: Status) -> None:
        self.terminate(new_status)
        self.status = new_status


class _Test(_Leaf, Generic[_Read]):
    """A condition, or its negation: succeeds or fails at once.

    Args:
        name: Its words.
        holds: Whether the condition holds.
        read: What it is about: the state or a history, as it is when the condition is ticked.
        positive: False for the negation.
    """

    def __init__(
        self, name: str, holds: Callable[[_Read], bool], read: _Read, *, positive: bool
    ) -> None:
        super().__init__(name)
        self._holds = holds
        self._read = read
        both = (Status.SUCCESS, Status.FAILURE)
        self._if_true, self._if_false = both if positive else reversed(both)

    def update(self) -> Status:
        return self._if_true if self._holds(self._read) else self._if_false


class _Ticked(NamedTuple):
    """An action in one tick."""

    action: nodes.Action
    status: Status
    rank: int
    """By `nodes.precedence`."""


def _in_turn(ticked: Sequence[_Ticked]) -> Sequence[_Ticked]:
    """Those that had their channel one after the other; the last one of each is its command."""
    if len(ticked) < 2:
        return ticked
    found: list[_Ticked] = []
    highest: dict[str, tuple[bool, int]] = {}
    for one in ticked:
        claim = (one.status is Status.RUNNING, one.rank)
        if claim >= highest.get(one.action.channel, claim):
            highest[one.action.channel] = claim
            found.append(one)
    return found


class _Command(_Leaf):
    """An action, carried out by the commander."""

    def __init__(
        self,
        name: str,
        action: nodes.Action,
        rank: int,
        commander: Commander,
        ticked: list[_Ticked],
    ) -> None:
        super().__init__(name)
        self._action = action
        self._rank = rank
        self._commander = commander
        self._ticked = ticked

    def update(self) -> Status:
        status = self._commander.update(self._action)
        self._ticked.append(_Ticked(self._action, status, self._rank))
        return status

    def terminate(self, new_status: Status) -> None:
        # py_trees may terminate a behaviour twice; only a running action is interrupted.
        if new_status is Status.INVALID and self.status is Status.RUNNING:
            self._commander.halt(self._action)


class _Noted(py_trees.decorators.Decorator):
    """An action that a behaviour from outside carries out."""

    def __init__(
        self,
        name: str,
        child: py_trees.behaviour.Behaviour,
        action: nodes.Action,
        rank: int,
        ticked: list[_Ticked],
    ) -> None:
        super().__init__(name=name, child=child)
        self._action = action
        self._rank = rank
        self._ticked = ticked

    def update(self) -> Status:
        status = self.decorated.status
        self._ticked.append(_Ticked(self._action, status, self._rank))
        return status


class StateEncoder:
    """Turns the latest messages of the state topics into the state that a tree reads.

    Lagged features are read from a sliding window over the last ticks: a tick stands for a row.

    Args:
        features: The learned tree's features.
        default_topic: Topic of features that came from a table, in their order there.
        coded: Whether messages hold positions of categories, not their numbers.
    """

    def __init__(
        self, features: Sequence[Feature], default_topic: str = "state", *, coded: bool = False
    ) -> None:
        self._lags = [feature.lag for feature in features]
        self._sources = sources(features, default_topic)
        self._codes = {
            place: {number: float(code) for number, code in codes_of(feature, coded=coded).items()}
            for place, feature in enumerate(features)
            if feature.kind is FeatureKind.CATEGORICAL
        }
        self._past: deque[list[float]] = deque(maxlen=max(self._lags, default=0))
        self.topics: dict[str, int] = {}
        """The least number of values that each topic must send."""
        for source in self._sources:
            self.topics[source.topic] = max(self.topics.get(source.topic, 0), source.index + 1)

    def encode(self, latest: Mapping[str, Sequence[float]]) -> list[float]:
        """The values of all features; NaN for a category that was never shown.

        To be called once per tick, as what it is given is what lagged features look back at; they
        are NaN for as many ticks as they look back.

        Args:
            latest: The newest message of every topic in `topics`, of at least that length.
        """
        # Of a lagged feature, what its source holds now.
        present = [latest[source.topic][source.index] for source in self._sources]
        for place, codes in self._codes.items():
            present[place] = codes.get(present[place], math.nan)
        state = [self._at(lag, place, present) for place, lag in enumerate(self._lags)]
        self._past.appendleft(present)
        return state

    def reset(self) -> None:
        """Forgets the ticks before, as at the start of a demonstration."""
        self._past.clear()

    def _at(self, lag: int, place: int, present: list[float]) -> float:
        if not lag:
            return present[place]
        return self._past[lag - 1][place] if lag <= len(self._past) else math.nan
