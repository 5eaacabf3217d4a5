"""What a tree does in all states at once: boxes of states are pushed through it, node by node.

A node splits the boxes that reach it into those in which it succeeds, fails or runs.  At the end,
every state lies in a box of which it is known what is commanded.

first tick
    Nothing is remembered.  The boxes share out all states, and what they say is exact: what
    `TreeRuntime` does, with every action done at once or, where their results are reported,
    running.
any tick
    Wherever a node may have been left running, it is entered as well, in every state; and where
    results are reported, an action may succeed, fail or run.  A box then says what can happen
    rather than what does, so that what is in no box cannot happen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import reduce
from typing import Final, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import Literal
from rebt_ros.verification.branches import branches_of, parted
from rebt_ros.verification.errors import TooManyPartsError
from rebt_ros.verification.grid import Boxes, Grid

#: Most parts that all states are looked at in.
_MOST_PARTS: Final = 200_000


class Results(Enum):
    """How actions end."""

    AT_ONCE = "at once"
    """They succeed in the tick that takes them, as where the robot reports no results."""
    REPORTED = "reported"
    """They run until the robot says that they succeeded or failed."""


class Ticks(Enum):
    """Which ticks are looked at; see the module."""

    FIRST = "first"
    ANY = "any"


@dataclass(frozen=True, slots=True)
class Visits:
    """Whether anything ever came of a node."""

    reached: bool = False
    succeeded: bool = False
    failed: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Sweep:
    """What a tree does, box by box."""

    grid: Grid
    leaves: tuple[nodes.Action, ...]
    """The action leaves of the tree in their order, again where an action occurs again."""
    boxes: Boxes
    """Shape (words, boxes)."""
    commanding: IntArray
    """The leaf whose action is the command (see `nodes.precedence`), -1: none, shape (boxes,)."""
    origin: IntArray
    """Which box of the start each one is a part of, shape (boxes,)."""
    visits: tuple[Visits, ...]
    """Of each node, each parent before its children; empty unless asked for."""

    def commands(self, action: nodes.Action) -> BoolArray:
        """In which boxes an action is the command, shape (boxes,)."""
        mine = [place for place, leaf in enumerate(self.leaves) if leaf == action]
        return np.isin(self.commanding, mine)

    def command(self, box: int) -> nodes.Action | None:
        """What is commanded in a box; None: nothing."""
        leaf = int(self.commanding[box])
        return self.leaves[leaf] if leaf >= 0 else None


def sweep(
    tree: nodes.Node | None,
    grid: Grid,
    results: Results,
    ticks: Ticks,
    start: Boxes | None = None,
    *,
    visits: bool = False,
    most: int = _MOST_PARTS,
) -> Sweep:
    """What a tree does.

    Args:
        tree: The tree of one channel; None: none, which does nothing.
        grid: Knows the conditions of the tree.
        results: How actions end.
        ticks: Which ticks to look at.
        start: The states to look at; by default all.
        visits: Whether to visit conditions also where it is clear what comes of their rule, which
            takes longer; otherwise there are no `Sweep.visits`.
        most: Into how many parts a list of branches may divide the states.

    Raises:
        TooManyPartsError: It does different things in more parts.
    """
    start = grid.everything() if start is None else start
    branches = branches_of(tree) if tree and ticks is Ticks.FIRST and not visits else None
    if tree is None or branches is None:
        return _Sweeper(tree, grid, results, ticks, visits).run(start)
    # The same answer, much sooner.
    found = parted(branches, grid.mask, start, most)
    leaves = tuple(node for node in nodes.walk(tree) if isinstance(node, nodes.Action))
    acting = np.where(found.acting == len(leaves), -1, found.acting)
    return Sweep(grid, leaves, found.boxes, acting, found.origin, ())


def remembers(tree: nodes.Node | None, results: Results) -> bool:
    """Whether a later tick can do in a state what the first one would not."""
    if tree is None:
        return False
    if results is Results.REPORTED and nodes.actions(tree):
        return True
    for node in nodes.walk(tree):
        resumes = isinstance(node, nodes.Repeater) or getattr(node, "memory", False)
        if resumes and any(may_run(child, results) for child in nodes.children(node)[1:]):
            return True
    return False


def may_run(node: nodes.Node, results: Results) -> bool:
    """Whether a node can be left running by a tick."""
    runs = (nodes.Repeater,) if results is Results.AT_ONCE else (nodes.Repeater, nodes.Action)
    return any(isinstance(one, runs) for one in nodes.walk(node))


#: Cells of fields, by the first word of each.
_Needs: TypeAlias = dict[int, Boxes]

#: Boxes on their way.  Below the words of the grid: the claim of the command so far, and which of
#: the boxes at the entry of a composite they come from.  A claim is one more than the rank of the
#: leaf, plus `_RUNS` where the action goes on; 0 where there is no command.
_Paths: TypeAlias = Boxes
_RUNS = np.uint64(1 << 40)


@dataclass(slots=True)
class _Ends:
    """Where the boxes that reached a node end."""

    success: _Paths
    failure: _Paths
    running: _Paths


class _Sweeper:
    def __init__(
        self,
        tree: nodes.Node | None,
        grid: Grid,
        results: Results,
        ticks: Ticks,
        visits: bool,
    ) -> None:
        self._tree = tree
        self._grid = grid
        self._results = results
        self._any = ticks is Ticks.ANY
        in_order = [] if tree is None else list(nodes.walk(tree))
        self._visits = [Visits()] * len(in_order) if visits else []
        self._leaves = tuple(one for one in in_order if isinstance(one, nodes.Action))
        self._ranks = () if tree is None else nodes.precedence(tree)
        self._claim = grid.words
        self._origin = self._claim + 1
        # Both count up as the tree is built, in its order.
        self._numbered = 0
        self._acted = 0
        self._root = None if tree is None else self._prepared(tree)

    def run(self, start: Boxes) -> Sweep:
        paths = np.zeros((self._origin + 1, start.shape[1]), dtype=np.uint64)
        paths[: self._grid.words] = start
        paths[self._origin] = np.arange(start.shape[1])
        if self._root is not None:
            ends = self._visit(self._root, paths)
            paths = _joined([ends.success, ends.failure, ends.running])
        of_rank = np.full(len(self._ranks) + 1, -1)
        for leaf, rank in enumerate(self._ranks):
            of_rank[rank + 1] = leaf
        return Sweep(
            self._grid,
            self._leaves,
            paths[: self._grid.words],
            of_rank[(paths[self._claim] & (_RUNS - np.uint64(1))).astype(np.int64)],
            paths[self._origin].astype(np.int64),
            tuple(self._visits),
        )

    def _prepared(self, node: nodes.Node) -> _Step:
        number = self._numbered
        self._numbered += 1
        leaf = self._acted
        self._acted += isinstance(node, nodes.Action)
        children = tuple([self._prepared(child) for child in nodes.children(node)])
        resumes = isinstance(node, nodes.Repeater) or getattr(node, "memory", False)
        entries = (False,) * len(children)
        if self._any and resumes:
            later = [may_run(child.node, self._results) for child in children[1:]]
            entries = (False, *later)
        acts = isinstance(node, nodes.Action) or any(child.acts for child in children)
        needs = self._needs(node, children, entries)
        return _Step(node, number, leaf, children, entries, needs, acts)

    def _needs(
        self, node: nodes.Node, children: Sequence[_Step], entries: Sequence[bool]
    ) -> _Needs:
        match node:
            case nodes.Condition(literal=literal):
                words, mask = self._grid.mask(literal.condition)
                return {words.start: mask if literal.positive else ~mask}
            case nodes.Inverter(child=nodes.Condition(literal=literal)):
                words, mask = self._grid.mask(literal.condition)
                return {words.start: ~mask if literal.positive else mask}
            case nodes.Sequence() | nodes.Repeater():
                return {} if any(entries) else _needs_of_all(children)
            case nodes.Selector() | nodes.ParallelSelector():
                return {} if any(entries) else _needs_of_any(children)
            case _:
                return {}

    def _visit(self, step: _Step, paths: _Paths) -> _Ends:
        if paths.shape[1] > _MOST_PARTS:
            raise TooManyPartsError
        match step.node:
            case nodes.Condition(literal=literal):
                ends = self._test(literal, paths)
            case nodes.Action():
                ends = self._act(step.leaf, paths)
            case nodes.Inverter():
                inner = self._visit(step.children[0], paths)
                ends = _Ends(inner.failure, inner.success, inner.running)
            case nodes.Parallel():
                ends = self._all_at_once(step, paths)
            case nodes.Sequence():
                ends = self._in_turn(step, paths, until_success=False)
            case nodes.Repeater():
                inner = self._in_turn(step, paths, until_success=False)
                again = _joined([inner.running, inner.success])
                ends = _Ends(_none(paths), inner.failure, again)
            case nodes.Selector() | nodes.ParallelSelector():
                ends = self._in_turn(step, paths, until_success=True)
        if self._visits:
            before = self._visits[step.number]
            self._visits[step.number] = Visits(
                before.reached or paths.shape[1] > 0,
                before.succeeded or ends.success.shape[1] > 0,
                before.failed or ends.failure.shape[1] > 0,
            )
        return ends

    def _test(self, literal: Literal, paths: _Paths) -> _Ends:
        words, mask = self._grid.mask(literal.condition)
        true, false = self._split(paths, words, mask)
        if not literal.positive:
            true, false = false, true
        return _Ends(true, false, _none(paths))

    def _split(self, paths: _Paths, words: slice, mask: Boxes) -> tuple[_Paths, _Paths]:
        if len(mask) == 1:
            part = paths[words.start]
            inside, outside = part & mask[0], part & ~mask[0]
            some, rest = inside != 0, outside != 0
        else:
            part = paths[words]
            inside, outside = part & mask[:, np.newaxis], part & ~mask[:, np.newaxis]
            some, rest = inside.any(axis=0), outside.any(axis=0)
        if not rest.any():
            return paths, _none(paths)
        if not some.any():
            return _none(paths), paths
        true, false = paths[:, some], paths[:, rest]
        true[words], false[words] = inside[..., some], outside[..., rest]
        return true, false

    def _act(self, leaf: int, paths: _Paths) -> _Ends:
        claim = np.uint64(self._ranks[leaf] + 1)
        ended = self._claimed(paths, claim)
        if self._results is Results.AT_ONCE:
            return _Ends(ended, _none(paths), _none(paths))
        running = self._claimed(paths, claim | _RUNS)
        if not self._any:
            return _Ends(_none(paths), _none(paths), running)
        return _Ends(ended, ended, running)

    def _claimed(self, paths: _Paths, claim: np.uint64) -> _Paths:
        claimed = paths.copy()
        np.maximum(claimed[self._claim], claim, out=claimed[self._claim])
        return claimed

    def _in_turn(self, step: _Step, paths: _Paths, *, until_success: bool) -> _Ends:
        """A Sequence, or a Selector."""
        concerned = self._concerned(step, paths)
        if concerned is not None:
            # Most rules concern few of the boxes that reach them.
            inner = self._all_in_turn(step, paths[:, concerned], until_success=until_success)
            left = _joined([inner.failure, paths[:, ~concerned]])
            return _Ends(inner.success, left, inner.running)
        return self._all_in_turn(step, paths, until_success=until_success)

    def _concerned(self, step: _Step, paths: _Paths) -> BoolArray | None:
        """Which boxes a node can do anything but fail in; None: maybe all."""
        if not step.needs or not paths.shape[1] or self._visits:
            return None
        concerned = None
        for start, mask in step.needs.items():
            if len(mask) == 1:
                there = (paths[start] & mask[0]) != 0
            else:
                there = (paths[start : start + len(mask)] & mask[:, np.newaxis]).any(axis=0)
            concerned = there if concerned is None else concerned & there
        return None if concerned is None or concerned.all() else concerned

    def _all_in_turn(self, step: _Step, paths: _Paths, *, until_success: bool) -> _Ends:
        if not paths.shape[1]:
            return _Ends(paths, paths, paths)
        own, before = self._marked(paths)
        current, ended, running = own, [_none(own)], [_none(own)]
        for child, entered in zip(step.children, step.entries, strict=True):
            if entered:
                current = _joined([current, own])
            if not current.shape[1]:
                # Nothing gets any further, unless a later child is entered.
                continue
            ends = self._visit(child, current)
            running.append(ends.running)
            current, over = (
                (ends.failure, ends.success) if until_success else (ends.success, ends.failure)
            )
            ended.append(over)
        if until_success:
            success, failure = _joined(ended), current
        else:
            success, failure = current, _joined(ended)
        return self._whole(_Ends(success, failure, _joined(running)), own, before)

    def _all_at_once(self, step: _Step, paths: _Paths) -> _Ends:
        """All children are ticked, whatever the others do; one that fails decides."""
        success, failure, running = paths, _none(paths), _none(paths)
        for child in step.children:
            after = [self._visit(child, one) for one in (success, failure, running)]
            success, failure, running = (
                after[0].success,
                _joined([one.failure for one in after] + [after[1].success, after[1].running]),
                _joined([after[0].running, after[2].running, after[2].success]),
            )
        return _Ends(success, failure, running)

    def _marked(self, paths: _Paths) -> tuple[_Paths, Boxes]:
        """The boxes as those that others come from, and which ones they come from themselves."""
        own = paths.copy()
        own[self._origin] = np.arange(paths.shape[1])
        return own, paths[self._origin]

    def _whole(self, ends: _Ends, own: _Paths, before: Boxes) -> _Ends:
        """The ends with boxes that were split for nothing whole again."""
        parts = (ends.success, ends.failure, ends.running)
        if sum(part.shape[1] for part in parts) > own.shape[1]:
            success = self._undivided(ends.success, (ends.failure, ends.running), own)
            failure = self._undivided(ends.failure, (ends.success, ends.running), own)
            parts = (success, failure, ends.running)
        marked = []
        for part in parts:
            # What was passed on as it came belongs to others as well.
            copy = part.copy()
            copy[self._origin] = before[part[self._origin].astype(np.int64)]
            marked.append(copy)
        return _Ends(*marked)

    def _undivided(self, end: _Paths, others: Sequence[_Paths], own: _Paths) -> _Paths:
        """An end in which each box that ended nowhere else, and did nothing, is whole again."""
        origin = end[self._origin].astype(np.int64)
        split = np.bincount(origin, minlength=own.shape[1]) > 1
        for other in others:
            split[other[self._origin].astype(np.int64)] = False
        split[origin[end[self._claim] != own[self._claim, origin]]] = False
        if not split.any():
            return end
        return _joined([end[:, ~split[origin]], own[:, split]])


@dataclass(frozen=True, slots=True)
class _Step:
    """A node, made ready."""

    node: nodes.Node
    number: int
    leaf: int
    """Of an action: its place among the leaves."""
    children: tuple[_Step, ...]
    entries: tuple[bool, ...]
    """Of each child, whether a tick can begin with it."""
    needs: _Needs
    """Cells without which it fails and ticks no action, by the first word of their field."""
    acts: bool
    """Whether there is an action in it."""


def _needs_of_all(children: Sequence[_Step]) -> _Needs:
    """What a Sequence needs: what its children do, up to the first one that can act."""
    needs: _Needs = {}
    for child in children:
        for start, mask in child.needs.items():
            needs[start] = needs[start] & mask if start in needs else mask
        if child.acts:
            break
    return needs


def _needs_of_any(children: Sequence[_Step]) -> _Needs:
    """What a Selector needs: of each field, the cells that some child needs, where all need any."""
    first, *others = (child.needs for child in children)
    return {
        start: reduce(np.bitwise_or, (other[start] for other in others), mask)
        for start, mask in first.items()
        if all(start in other for other in others)
    }


def _none(paths: _Paths) -> _Paths:
    return paths[:, :0]


def _joined(parts: Sequence[_Paths]) -> _Paths:
    full = [part for part in parts if part.shape[1]]
    if len(full) == 1:
        return full[0]
    return np.concatenate(full, axis=1) if full else parts[0][:, :0]
