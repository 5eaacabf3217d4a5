"""Guards that make a tree keep its rules."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Mended
from rebt_ros.behavior_tree.prediction import States, choose, history_columns
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Literal
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.formulas import AllOf, AnyOf, Formula, negated
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.proof import breaking, check, grid_of, policies_of
from rebt_ros.verification.reference import Reference, of_table
from rebt_ros.verification.rules import Demand
from rebt_ros.verification.states import StateFinder
from rebt_ros.verification.sweep import Results, Sweep, Ticks, remembers, sweep
from rebt_ros.verification.verdict import Answer, ChannelProof, Verdict, verdicts
from rebt_ros.verification.verdict_text import what_breaks

#: How often rules are gone through: a guard may let another branch act.
_ROUNDS: Final = 4


@dataclass(frozen=True, eq=False, slots=True)
class Repaired:
    """A tree that was mended."""

    learned: LearnedTree
    proofs: tuple[ChannelProof, ...]
    verdicts: tuple[Verdict, ...]
    """Of the mended tree: all rules are proven."""
    change: Mended
    """What guards have changed; `learned` carries the same."""


def repair(
    learned: LearnedTree,
    demands: Sequence[Demand],
    tables: Sequence[DemonstrationTable] = (),
    results: Results = Results.AT_ONCE,
) -> Repaired:
    """The tree with the smallest guards in front of actions that break rules.

    Where an action is forbidden, a guard stands before it in each branch that breaks the rule, so
    that the branches after it act there.  Where none does, what was done in the nearest rows that
    were shown is done, if there are rows.  Where an action is demanded, it has a branch before all
    others.

    Args:
        learned: The tree.
        demands: Its rules, which do not contradict each other.
        tables: What was shown, with the features of the tree.
        results: How actions end.

    Raises:
        RuleError: Guards do not make the tree keep its rules.
    """
    mended = learned
    for _ in range(_ROUNDS):
        proofs = check(mended, demands, tables, results)
        found = verdicts(proofs, demands)
        failed = [one.demand for one in found if one.answer is not Answer.PROVEN]
        if not failed:
            change = _change(learned, mended, tables)
            provenance = replace(mended.provenance, mended=change)
            return Repaired(replace(mended, provenance=provenance), proofs, found, change)
        for demand in failed:
            mended = _guarded(mended, demand, results, demands, tables)
    raise RuleError(f"the tree cannot be mended by guards: {what_breaks(mended, proofs, found)}.")


def _change(
    before: LearnedTree, after: LearnedTree, tables: Sequence[DemonstrationTable]
) -> Mended:
    """What is different, also in the rows that are at hand."""
    rows = sum(map(len, tables))
    chosen = [[_choices(learned, table) for table in tables] for learned in (before, after)]
    changed = sum(int(np.count_nonzero(old != new)) for old, new in zip(*chosen, strict=True))
    agreement: list[float] = []
    recall: list[float] = []
    for its in chosen:
        right = [table.chosen == one for table, one in zip(tables, its, strict=True)]
        agreement.append(sum(int(one.sum()) for one in right) / max(rows, 1))
        recalls = [
            float(one[table.chosen == code].mean())
            for table, one in zip(tables, right, strict=True)
            for code in np.unique(table.chosen).tolist()
        ]
        recall.append(sum(recalls) / max(len(recalls), 1))
    return Mended(
        nodes.size(after.tree) - nodes.size(before.tree),
        rows,
        changed,
        (agreement[0], agreement[1]) if rows else None,
        (recall[0], recall[1]) if rows else None,
    )


def _choices(learned: LearnedTree, table: DemonstrationTable) -> IntArray:
    """What a tree does in each row after what was shown before, in codes of the table's actions."""
    policy = policies_of(learned).get(table.channel)
    if policy is None:
        return np.full(len(table), NO_ACTION)
    columns = history_columns(table.actions, table.previous, table.last)
    actions = tuple(nodes.Action(label, table.channel) for label in table.actions)
    return choose(policy, actions, States(table.features, table.states, columns))


def _guarded(
    learned: LearnedTree,
    demand: Demand,
    results: Results,
    demands: Sequence[Demand],
    tables: Sequence[DemonstrationTable],
) -> LearnedTree:
    policies = policies_of(learned)
    channel = demand.action.channel
    policy = policies.get(channel)
    forbidden = demand.forbids
    if forbidden is None:
        first = _sequence(demand.when, demand.action)
        others = () if policy is None else _branches(policy)
        return _with_policy(learned, channel, nodes.Selector((first, *others)))
    if policy is None:
        return learned
    mended = _Guarding(learned, demand, policy, results).tree()
    if mended is None:
        raise RuleError(
            f"the tree cannot be mended: nothing is left of it without what breaks '{demand.rule}'."
        )
    for table in tables:
        if table.channel == channel:
            mended = _instead(learned, demand, policy, mended, results, demands, table)
    return _with_policy(learned, channel, mended)


def _instead(
    learned: LearnedTree,
    demand: Demand,
    policy: nodes.Node,
    guarded: nodes.Node,
    results: Results,
    demands: Sequence[Demand],
    table: DemonstrationTable,
) -> nodes.Node:
    """The guarded tree with a last branch, where guards have left states without a command.

    Args:
        learned: The tree before.
        demand: The rule that the guards are for.
        policy: The tree of the channel before.
        guarded: The same with guards.
        results: How actions end.
        demands: All rules, which the last branch must not break.
        table: The rows of the channel.
    """
    assert demand.forbids is not None
    others = [one.forbids for one in demands if one.forbids is not None]
    grid = grid_of(learned, [policy, guarded], others)
    done = sweep(guarded, grid, results, Ticks.FIRST)
    silent = done.boxes[:, done.commanding < 0]
    before = sweep(policy, grid, results, Ticks.FIRST, grid.within(silent, demand.forbids))
    if not before.boxes.shape[1] or (before.commanding < 0).any():
        return guarded
    for label in _nearest_actions(table, demand.action, before.boxes, grid, learned):
        action = nodes.Action(label, table.channel)
        forbidden = [one.forbids for one in demands if one.action == action and one.forbids]
        if not any(grid.within(before.boxes, one).shape[1] for one in forbidden):
            tests = _tests(_needed(AllOf((demand.forbids,)), silent, grid))
            last = nodes.Sequence((*tests, action)) if tests else action
            return nodes.Selector((*_branches(guarded), last))
    return guarded


def _nearest_actions(
    table: DemonstrationTable,
    besides: nodes.Action,
    boxes: Boxes,
    grid: Grid,
    learned: LearnedTree,
) -> list[str]:
    """The actions of a table, those first whose rows are nearest to some boxes."""
    scale = of_table(table).scale
    away = {}
    for code in np.unique(table.chosen).tolist():
        if table.actions[code] != besides.label:
            states = table.states[table.chosen == code]
            rows = Reference(states, states, scale, None)
            distances, _ = StateFinder(grid, learned.features, rows).closest(boxes)
            away[table.actions[code]] = float(np.mean(distances))
    return sorted(away, key=away.__getitem__)


def _branches(policy: nodes.Node) -> tuple[nodes.Node, ...]:
    reactive = isinstance(policy, nodes.Selector) and not policy.memory
    return policy.children if reactive and isinstance(policy, nodes.Selector) else (policy,)


def _with_policy(learned: LearnedTree, channel: str, policy: nodes.Node) -> LearnedTree:
    """The tree with another one for a channel, as it is executed."""
    policies = policies_of(learned) | {channel: policy}
    trees = tuple(policies.values())
    return replace(learned, tree=trees[0] if len(trees) == 1 else nodes.Parallel(trees))


def _sequence(when: Formula, action: nodes.Action) -> nodes.Node:
    return nodes.Sequence((*_tests(when), action)) if _tests(when) else action


def _tests(formula: Formula) -> tuple[nodes.Node, ...]:
    """Nodes that all succeed where a formula holds."""
    if isinstance(formula, AllOf):
        return tuple(test for part in formula.parts for test in _tests(part))
    return (_test(formula),)


def _test(formula: Formula) -> nodes.Node:
    """A node that succeeds where a formula holds."""
    match formula:
        case Literal():
            return nodes.Condition(formula)
        case AllOf():
            return nodes.Sequence(_tests(formula))
        case AnyOf(parts=parts):
            return nodes.Selector(tuple(map(_test, _flat(parts))))


def _flat(parts: Iterable[Formula]) -> list[Formula]:
    return [
        inner
        for part in parts
        for inner in (_flat(part.parts) if isinstance(part, AnyOf) else [part])
    ]


class _Guarding:
    """Guards for one rule that forbids an action.

    Args:
        learned: The tree.
        demand: The rule.
        policy: The tree of the rule's channel.
        results: How actions end.
    """

    def __init__(
        self, learned: LearnedTree, demand: Demand, policy: nodes.Node, results: Results
    ) -> None:
        assert demand.forbids is not None
        self._policy = policy
        self._action = demand.action
        self._allowed = negated(demand.forbids)
        self._grid = grid_of(learned, [policy], [self._allowed])
        ticks = Ticks.ANY if remembers(policy, results) else Ticks.FIRST
        self._done: Sweep = sweep(policy, self._grid, results, ticks)
        broken = breaking(demand, self._grid, self._done)
        self._broken = _leaves_in(self._done, broken, self._grid, demand.forbids)
        self._leaf = 0

    def tree(self) -> nodes.Node | None:
        """The policy with guards; None where nothing would be left of it."""
        self._leaf = 0
        mended = self._mended(self._policy, inserting=False)
        return mended[0] if mended else None

    def _mended(self, node: nodes.Node, *, inserting: bool) -> tuple[nodes.Node, ...]:
        """The node, or what stands in its place among the children of its parent.

        Args:
            node: It.
            inserting: Whether its parent is a Sequence that asks all conditions at every tick.
        """
        if isinstance(node, nodes.Action):
            leaf = self._leaf
            self._leaf += 1
            if node != self._action or leaf not in self._broken:
                return (node,)
            here = self._done.boxes[:, self._done.commanding == leaf]
            if not self._grid.within(here, self._allowed).shape[1]:
                # It acts nowhere but where it must not.
                return ()
            guard = _tests(_needed(self._allowed, here, self._grid))
            return (*guard, node) if inserting else (nodes.Sequence((*guard, node)),)
        open_to_guards = isinstance(node, nodes.Sequence) and not node.memory
        families = [self._mended(child, inserting=open_to_guards) for child in nodes.children(node)]
        if not all(families) and not isinstance(node, nodes.Selector | nodes.ParallelSelector):
            # What is left out fails, and so does what needs it; only what was asked is asked still.
            return () if nodes.children(node) else (node,)
        family = tuple(mended for one in families for mended in one)
        if not family:
            return (node,) if not nodes.children(node) else ()
        return (nodes.with_children(node, family),)


def _leaves_in(done: Sweep, broken: Boxes, grid: Grid, forbidden: Formula) -> frozenset[int]:
    """The leaves that act in a region."""
    if not broken.shape[1]:
        return frozenset()
    leaves = set(done.commanding.tolist()) - {-1}
    return frozenset(
        leaf
        for leaf in leaves
        if grid.within(done.boxes[:, done.commanding == leaf], forbidden).shape[1]
    )


def _needed(formula: Formula, here: Boxes, grid: Grid) -> Formula:
    """A smaller formula that is the same in some boxes."""
    if isinstance(formula, Literal):
        return formula
    parts = list(formula.parts)
    for part in list(parts):
        others = [one for one in parts if one is not part]
        if isinstance(formula, AllOf):
            # What holds anyway need not be asked.
            redundant = not grid.within(here, AllOf((*others, negated(part)))).shape[1]
        else:
            redundant = not grid.within(here, AllOf((part, *map(negated, others)))).shape[1]
        if redundant and (others or isinstance(formula, AllOf)):
            parts = others
    smaller = tuple(_needed(part, here, grid) for part in parts)
    if len(smaller) == 1:
        return smaller[0]
    return AllOf(smaller) if isinstance(formula, AllOf) else AnyOf(smaller)
