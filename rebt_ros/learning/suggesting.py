"""Which suggested alternate expressive subtrees (SAES) to offer with a tree."""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Suggestion
from rebt_ros.beyond_the_paper.reductions import MOST_LEAVES_MINIMIZED
from rebt_ros.beyond_the_paper.routines.found_routine import FoundRoutine
from rebt_ros.beyond_the_paper.single_loops import loop_trees
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.decision_tree.training import fit
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable, part_of
from rebt_ros.learning.fitting import fit_options
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.suggestions import lat_suggestions, psa_suggestions, routine_suggestions
from rebt_ros.paper.lat_occurrences import Occurrences, rows
from rebt_ros.paper.lat_trees import gen_lat_trees
from rebt_ros.paper.rule_trees import build_inv_set, logic_minimizer, reduce_floats
from rebt_ros.paper.rules import dt_to_rules_psa

#: Maximum number of suggestions, and of routines among them.
_MOST_SUGGESTIONS = 12
_MOST_ROUTINES = 8
#: Maximum number of Repeaters of single loops, in the paper's mode and beside routines.  Without
#: routines, rows are samples, and an action that is done for long is not a loop.
_MOST_LOOPS, _LOOPS_BESIDE_ROUTINES = 24, 4
_TOO_LARGE = (
    f"no PSA nodes and LAT trees are suggested for more than {MOST_LEAVES_MINIMIZED} leaves: prune "
    "more"
)

#: Rows in which LAT paths are counted: what has not occurred in this many is no habit, and in many
#: more, counting nested loops takes longer than learning.
_MOST_ROWS = 100_000
#: Maximum number of rows that the LAT-augmented tree is fitted to.
_MOST_ROWS_FITTED = 5_000


def occurrences_in(table: DemonstrationTable) -> Occurrences:
    """The actions of a table, row by row, which are the same at all pruning levels.

    In a large table, only those of the first rows.
    """
    return Occurrences(rows(table.where(np.arange(len(table)) < _MOST_ROWS)))


def suggest(
    table: DemonstrationTable,
    trained: TrainedTree,
    ccp_alpha: float,
    options: LearnOptions,
    routines: Sequence[FoundRoutine] = (),
    occurrences: Occurrences | None = None,
) -> tuple[tuple[Suggestion, ...], tuple[str, ...]]:
    """What to offer: PSA nodes, routines, and the sequences of a LAT-augmented tree.

    Args:
        table: The rows that were learned from.
        trained: The decision tree of the main tree.
        ccp_alpha: How far the LAT-augmented decision tree is pruned.
        options: How to learn.
        routines: The result of `find_routines` for the table.
        occurrences: The result of `occurrences_in` for the table, which saves time if several trees
            are learned from it.

    Returns:
        At most twelve suggestions, routines first, then those shown in most rows (all of them in
        the paper's mode), and notes on what was left out.
    """
    found = routine_suggestions(routines[:_MOST_ROUTINES])
    left_out = len(routines) - len(found)
    if _too_large(trained, options):
        return found, (_TOO_LARGE, *_on_left_out(left_out))
    with_lat = trained
    if trained.vocabulary.history is not History.LAST:
        fitted = fit(
            table if options.is_paper else part_of(table, _MOST_ROWS_FITTED),
            fit_options(options, Vocabulary(History.LAST)),
        )
        with_lat = fitted.at(ccp_alpha)
    if _too_large(with_lat, options):
        return found, (_TOO_LARGE, *_on_left_out(left_out))
    offered, loops, not_built = _of_rules(table, trained, with_lat, options, routines, occurrences)
    left_out += not_built
    room = _MOST_SUGGESTIONS - len(found)
    if not options.is_paper and len(offered) > room:
        ranked = sorted(offered, key=lambda one: (one.subtree not in loops, -one.rows))
        left_out += len(ranked) - room
        offered = tuple(ranked[:room])
    notes = _on_left_out(left_out)
    if len(table) > _MOST_ROWS:
        notes = (*notes, f"suggestions were counted in the first {_MOST_ROWS} rows alone")
    return (*found, *offered), notes


def _on_left_out(suggestions: int) -> tuple[str, ...]:
    """The note on suggestions that were left out."""
    if not suggestions:
        return ()
    return (f"{suggestions} more, less supported suggestions are left out",)


def _too_large(trained: TrainedTree, options: LearnOptions) -> bool:
    """Whether minimizing the rules of a tree would take minutes; the paper's mode does it."""
    return not options.is_paper and trained.tree.leaves > MOST_LEAVES_MINIMIZED


def _of_rules(
    table: DemonstrationTable,
    trained: TrainedTree,
    with_lat: TrainedTree,
    options: LearnOptions,
    routines: Sequence[FoundRoutine],
    occurrences: Occurrences | None,
) -> tuple[tuple[Suggestion, ...], Set[nodes.Node], int]:
    """PSA and LAT suggestions, which of their subtrees are single loops, and how many are left out.

    Args:
        table: The rows that were learned from.
        trained: The decision tree of the main tree.
        with_lat: The decision tree that may test LAT.
        options: How to learn.
        routines: The routines found.
        occurrences: Those of the table, if known.
    """
    psa_rules = reduce_floats(logic_minimizer(dt_to_rules_psa(trained.tree, options.delta)))
    rules = dt_to_rules_psa(with_lat.tree, options.delta)
    inv_set = build_inv_set(rules)
    rules = reduce_floats(logic_minimizer(rules))
    occurrences = occurrences or occurrences_in(table)
    lat = gen_lat_trees(
        rules, occurrences, inv_set=inv_set, least_support=0 if options.is_paper else 1
    )
    loops = loop_trees(
        rules,
        lat.trees,
        occurrences,
        inv_set=inv_set,
        most=_MOST_LOOPS if options.is_paper else _LOOPS_BESIDE_ROUTINES * bool(routines),
    )
    offered = (*psa_suggestions(psa_rules), *lat_suggestions((*lat.trees, *loops.trees)))
    left_out = lat.left_out.paths + loops.left_out
    return offered, frozenset(tree.subtree for tree in loops.trees), left_out
