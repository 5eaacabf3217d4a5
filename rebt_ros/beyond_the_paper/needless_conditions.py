"""Leaving out the conditions that no shown row needs.

A decision tree splits the rows from the top, so a rule repeats all tests on the way to it:
``charge`` while docked, with a low battery, *and with the target to the left*, because this was
tested first and the robot was never shown docked otherwise.  Nothing that was shown supports the
last condition.  Without it the rule does the same in every shown row, is shorter, and holds where
it should.  This is rule pruning (Quinlan, 1987, "Simplifying decision trees") for rules in priority
order: each is reached only if all earlier ones failed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rebt_ros.arrays import BoolArray, WordArray, in_parts
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.prediction import States, history_columns
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Condition, Interval, Literal, Threshold
from rebt_ros.paper.rule_trees import sequence

#: Conditions in a word.
_BITS: Final = 64
#: Of so many conditions, a bit for every combination takes no room (64 kB).
_FEW: Final = 16


def without_needless_conditions(
    tree: nodes.Node, table: DemonstrationTable, shown: BoolArray | None = None
) -> nodes.Node:
    """The tree without the conditions that none of the rows needs.

    Every rule acts in the same rows as before.  In states that no row shows, a rule may replace a
    later one.

    Args:
        tree: Rules in priority order, as `reduced_tree` makes them; other trees are unchanged.
        table: The rows, with the history of the demonstrator.
        shown: Which of them count, shape (rows,); None for all.
    """
    if not isinstance(tree, nodes.Selector) or tree.memory:
        return tree
    cells = _Cells(tree, table, shown)
    rules = tree.children
    # A shorter alternative can cover what another one was needed for.
    while (shorter := _shorter(rules, cells)) != rules:
        rules = shorter
    return nodes.Selector(rules)


def _shorter(rules: tuple[nodes.Node, ...], cells: _Cells) -> tuple[nodes.Node, ...]:
    """The rules, each without the conditions that no cell reaching it needs."""
    left = cells.all
    found: list[nodes.Node] = []
    for place, rule in enumerate(rules):
        match rule:
            case nodes.Sequence(children=(*conditions, acting), memory=False) if all(
                map(_is_formula, conditions)
            ):
                taken = left & cells.of_all(conditions)
                # No row shows what a rule without rows needs.
                needed = cells.needed_of_all(conditions, left) if taken else conditions
                found.append(nodes.Sequence((*_flat(needed), acting)))
                left &= ~taken
            case _:
                # It takes all remaining cells, or cannot be analyzed.
                found.extend(rules[place:])
                break
    return tuple(found)


def _is_formula(node: nodes.Node) -> bool:
    """Whether a node consists of conditions alone, without actions."""
    match node:
        case nodes.Condition():
            return True
        case nodes.Sequence(memory=False) | nodes.Selector(memory=False) | nodes.Inverter():
            return all(map(_is_formula, nodes.children(node)))
        case _:
            return False


class _Cells:
    """Cells of rows that satisfy the same conditions; sets of cells are bits of an integer.

    Args:
        tree: The tree with these conditions.
        table: The rows.
        shown: Which of them count; None for all.
    """

    def __init__(
        self, tree: nodes.Node, table: DemonstrationTable, shown: BoolArray | None
    ) -> None:
        tested = dict.fromkeys(
            node.literal.condition for node in nodes.walk(tree) if isinstance(node, nodes.Condition)
        )
        limits = (
            limit.condition
            for condition in tested
            if isinstance(condition, Interval)
            for limit in _limits(condition)
        )
        conditions = tuple(dict.fromkeys((*tested, *limits)))
        count, satisfied = _distinct(conditions, table, shown)
        self._satisfied = dict(zip(conditions, satisfied, strict=True))
        self.all = (1 << count) - 1
        """The set of all cells."""

    def of(self, node: nodes.Node) -> int:
        """The cells in which a formula succeeds."""
        match node:
            case nodes.Condition(literal=literal):
                satisfied = self._satisfied[literal.condition]
                return satisfied if literal.positive else self.all & ~satisfied
            case nodes.Inverter(child=child):
                return self.all & ~self.of(child)
            case nodes.Selector(children=alternatives):
                return self.all & ~self._none_of(alternatives)
            case _:
                return self.of_all(nodes.children(node))

    def of_all(self, formulas: Sequence[nodes.Node]) -> int:
        """The cells in which all formulas succeed."""
        found = self.all
        for formula in formulas:
            found &= self.of(formula)
        return found

    def _none_of(self, formulas: Sequence[nodes.Node]) -> int:
        found = self.all
        for formula in formulas:
            found &= ~self.of(formula)
        return found

    def needed_of_all(self, formulas: Sequence[nodes.Node], where: int) -> list[nodes.Node]:
        """The formulas of a conjunction that decide in which of the given cells it succeeds.

        Comparisons of numbers are left out first: one of many possible thresholds is likely to
        separate the same rows by chance.
        """
        trial = sorted(range(len(formulas)), key=lambda place: not _compares(formulas[place]))
        return self._needed(formulas, trial, where, self.of)

    def _needed(
        self,
        formulas: Sequence[nodes.Node],
        trial: Sequence[int],
        where: int,
        succeeds: Callable[[nodes.Node], int],
    ) -> list[nodes.Node]:
        """The formulas that decide in the given cells, at least one, each simplified.

        Args:
            formulas: A conjunction in terms of `succeeds`.
            trial: The order in which to try to leave them out.
            where: The cells.
            succeeds: Returns the cells in which a formula holds.
        """
        behind = [where] * (len(trial) + 1)
        for turn in range(len(trial) - 1, -1, -1):
            behind[turn] = behind[turn + 1] & succeeds(formulas[trial[turn]])
        kept: dict[int, nodes.Node] = {}
        before = where
        for turn, place in enumerate(trial):
            others = before & behind[turn + 1]
            is_last = turn == len(trial) - 1 and not kept
            if others & ~succeeds(formulas[place]) or is_last:
                kept[place] = self._shortened(formulas[place], others)
                before &= succeeds(kept[place])
        return [kept[place] for place in sorted(kept)]

    def _shortened(self, formula: nodes.Node, where: int) -> nodes.Node:
        """A simpler formula that succeeds in the same of the given cells."""
        match formula:
            case nodes.Sequence(children=steps):
                return sequence(_flat(self.needed_of_all(steps, where)))
            case nodes.Selector(children=alternatives):
                # A Selector fails where all children fail.
                needed = self._needed(
                    alternatives,
                    range(len(alternatives)),
                    where,
                    lambda alternative: self.all & ~self.of(alternative),
                )
                return needed[0] if len(needed) == 1 else nodes.Selector(tuple(needed))
            case nodes.Condition(literal=Literal(condition=Interval() as interval, positive=True)):
                same = where & self.of(formula)
                limits = map(nodes.Condition, _limits(interval))
                return next((one for one in limits if where & self.of(one) == same), formula)
            case _:
                return formula


def _flat(steps: Sequence[nodes.Node]) -> list[nodes.Node]:
    """The steps of a Sequence, with nested Sequences flattened."""
    return [
        step
        for one in steps
        for step in (one.children if isinstance(one, nodes.Sequence) else (one,))
    ]


def _limits(interval: Interval) -> tuple[Literal, Literal]:
    """The two comparisons of an interval."""
    return (
        Literal(Threshold(interval.quantity, interval.at_most)),
        Literal(Threshold(interval.quantity, interval.above), positive=False),
    )


def _compares(formula: nodes.Node) -> bool:
    return isinstance(formula, nodes.Condition) and isinstance(
        formula.literal.condition, Threshold | Interval
    )


def _distinct(
    conditions: Sequence[Condition], table: DemonstrationTable, shown: BoolArray | None
) -> tuple[int, list[int]]:
    """The number of cells that the conditions distinguish, and the set that satisfies each."""
    if len(conditions) <= _FEW:
        return _distinct_of_few(conditions, table, shown)
    kinds = np.empty((0, -(-len(conditions) // _BITS)), dtype=np.uint64)
    for rows, states in _in_parts(table):
        holds = np.empty((len(states), len(conditions)), dtype=bool)
        for place, condition in enumerate(conditions):
            holds[:, place] = states.satisfy(Literal(condition))
        kinds = _different(
            np.concatenate([kinds, _words(holds if shown is None else holds[shown[rows]])])
        )
    return _as_sets(np.unpackbits(kinds.view(np.uint8), axis=1, count=len(conditions)))


def _distinct_of_few(
    conditions: Sequence[Condition], table: DemonstrationTable, shown: BoolArray | None
) -> tuple[int, list[int]]:
    """The same for conditions of which every combination has a place in a short list."""
    occurs = np.zeros(1 << len(conditions), dtype=bool)
    for rows, states in _in_parts(table):
        kind = np.zeros(len(states), dtype=np.uint16)
        for place, condition in enumerate(conditions):
            kind |= states.satisfy(Literal(condition)).astype(np.uint16) << np.uint16(place)
        occurs[kind if shown is None else kind[shown[rows]]] = True
    kinds = np.flatnonzero(occurs)[:, np.newaxis]
    return _as_sets(((kinds >> np.arange(len(conditions))) & 1).astype(np.uint8))


def _in_parts(table: DemonstrationTable) -> Iterator[tuple[slice, States]]:
    """The rows of a large table part by part, and what is known of their states."""
    for rows in in_parts(len(table)):
        history = history_columns(table.actions, table.previous[rows], table.last[rows])
        yield rows, States(table.features, table.states[rows], history)


def _as_sets(satisfied: NDArray[np.uint8]) -> tuple[int, list[int]]:
    """Cells as bits of sets: how many there are, and which satisfy each condition.

    Args:
        satisfied: Whether a cell satisfies a condition, shape (cells, conditions).
    """
    sets = np.packbits(satisfied, axis=0, bitorder="little")
    return len(satisfied), [int.from_bytes(column.tobytes(), "little") for column in sets.T]


def _words(holds: BoolArray) -> WordArray:
    """Rows of bits as words, shape (rows, words)."""
    packed = np.packbits(holds, axis=1)
    words = np.zeros((len(packed), -(-holds.shape[1] // _BITS) * 8), dtype=np.uint8)
    words[:, : packed.shape[1]] = packed
    return words.view(np.uint64)


def _different(rows: WordArray) -> WordArray:
    """Each row once."""
    if rows.shape[1] <= 1:
        # Numbers are sorted, or hashed, many times as fast as rows.
        return np.unique(rows[:, 0]).reshape(-1, 1) if rows.size else rows[:1]
    ordered = rows[np.lexsort(rows.T)]
    first = np.ones(len(ordered), dtype=bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return ordered[first]
