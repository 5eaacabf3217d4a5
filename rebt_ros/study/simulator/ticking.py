"""Ticking a simulated tree, as py_trees would, without its bookkeeping.

A node that has succeeded or failed starts afresh at its next tick; one that runs goes on.  To halt
a running node is to let it start afresh.  `py_trees_form` is the same tree as py_trees objects.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum
from typing import Protocol

from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    Group,
    GroupKind,
    Inverted,
    SimulatedNode,
)


class Outcome(Enum):
    """What a tick of a node returns."""

    SUCCESS = "success"
    FAILURE = "failure"
    RUNNING = "running"


_SUCCESS, _FAILURE, _RUNNING = Outcome.SUCCESS, Outcome.FAILURE, Outcome.RUNNING


class Body(Protocol):
    """What the leaves of a simulated tree sense and act with."""

    def sense(self, check: Check) -> bool:
        """What the check says."""

    def attempt(self, act: Act) -> Outcome:
        """What the action returns at this tick."""


class Ticker(ABC):
    """A node that can be ticked."""

    __slots__ = ()

    @abstractmethod
    def tick(self) -> Outcome:
        """Ticks the node once."""

    def halt(self) -> None:
        """Makes a running node start afresh."""
        return


def ticker(node: SimulatedNode, body: Body, repeats: int) -> Ticker:
    """A tree that can be ticked.

    Args:
        node: Root of the tree.
        body: What its leaves sense and act with.
        repeats: How often Repeaters run their children.
    """
    match node:
        case Check():
            return _CheckTicker(node, body)
        case Act():
            return _ActTicker(node, body)
        case Inverted(child=child):
            return _InvertedTicker(ticker(child, body, repeats))
        case Group(kind=kind, children=children):
            tickers = [ticker(child, body, repeats) for child in children]
            match kind:
                case GroupKind.SEQUENCE:
                    return _SequenceTicker(tickers, 1)
                case GroupKind.REPEATER:
                    return _SequenceTicker(tickers, repeats)
                case GroupKind.SELECTOR:
                    return _SelectorTicker(tickers)
                case GroupKind.PARALLEL | GroupKind.PARALLEL_SELECTOR:
                    return _ParallelTicker(tickers)


class _CheckTicker(Ticker):
    __slots__ = ("_body", "_check")

    def __init__(self, check: Check, body: Body) -> None:
        self._check = check
        self._body = body

    def tick(self) -> Outcome:
        return _SUCCESS if self._body.sense(self._check) else _FAILURE


class _ActTicker(Ticker):
    __slots__ = ("_act", "_body")

    def __init__(self, act: Act, body: Body) -> None:
        self._act = act
        self._body = body

    def tick(self) -> Outcome:
        return self._body.attempt(self._act)


class _InvertedTicker(Ticker):
    __slots__ = ("_child",)

    def __init__(self, child: Ticker) -> None:
        self._child = child

    def tick(self) -> Outcome:
        outcome = self._child.tick()
        if outcome is _RUNNING:
            return outcome
        return _FAILURE if outcome is _SUCCESS else _SUCCESS

    def halt(self) -> None:
        self._child.halt()


class _SequenceTicker(Ticker):
    """A Sequence with memory, or a Repeater, which goes through its children several times.

    A round begins in the tick in which the one before it succeeded.
    """

    __slots__ = ("_children", "_place", "_round", "_rounds")

    def __init__(self, children: list[Ticker], rounds: int) -> None:
        self._children = children
        self._rounds = rounds
        self._round = 0
        self._place = 0

    def tick(self) -> Outcome:
        children = self._children
        while self._round < self._rounds:
            while self._place < len(children):
                outcome = children[self._place].tick()
                if outcome is not _SUCCESS:
                    if outcome is _FAILURE:
                        self._round = self._place = 0
                    return outcome
                self._place += 1
            self._place = 0
            self._round += 1
        self._round = 0
        return _SUCCESS

    def halt(self) -> None:
        if self._place < len(self._children):
            self._children[self._place].halt()
        self._round = self._place = 0


class _SelectorTicker(Ticker):
    """A Selector without memory."""

    __slots__ = ("_children", "_runs")

    def __init__(self, children: list[Ticker]) -> None:
        self._children = children
        self._runs: Ticker | None = None

    def tick(self) -> Outcome:
        for child in self._children:
            outcome = child.tick()
            if outcome is not _FAILURE:
                if self._runs is not None and self._runs is not child:
                    self._runs.halt()
                self._runs = child if outcome is _RUNNING else None
                return outcome
            if child is self._runs:
                self._runs = None
        return _FAILURE

    def halt(self) -> None:
        if self._runs is not None:
            self._runs.halt()
            self._runs = None


class _ParallelTicker(Ticker):
    """A Parallel that succeeds when all children have, each at a tick of its own."""

    __slots__ = ("_children", "_left")

    def __init__(self, children: list[Ticker]) -> None:
        self._children = children
        self._left = children

    def tick(self) -> Outcome:
        failed = False
        left = []
        for child in self._left:
            outcome = child.tick()
            if outcome is _RUNNING:
                left.append(child)
            elif outcome is _FAILURE:
                failed = True
        self._left = left
        if failed:
            self.halt()
            return _FAILURE
        if left:
            return _RUNNING
        self._left = self._children
        return _SUCCESS

    def halt(self) -> None:
        for child in self._left:
            child.halt()
        self._left = self._children
