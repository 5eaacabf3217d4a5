"""Rules that no tree can keep at the same time."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from itertools import combinations

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.verification.describing import point_text
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.formulas import AllOf, Formula
from rebt_ros.verification.proof import grid_of
from rebt_ros.verification.reference import of_tree
from rebt_ros.verification.resolving import demands
from rebt_ros.verification.rules import Demand, RuleSet
from rebt_ros.verification.states import Point, Unsettled, nearest


def agreeing_demands(rules: RuleSet, learned: LearnedTree) -> tuple[Demand, ...]:
    """What rules demand of a tree.

    Raises:
        RuleError: They do not fit the tree, or contradict each other.
    """
    asked = demands(rules, learned)
    refuse_contradictions(asked, learned)
    return asked


def refuse_contradictions(asked: Sequence[Demand], learned: LearnedTree) -> None:
    """Refuses rules of which no tree can keep all, and rules about no state at all.

    Args:
        asked: The rules.
        learned: A tree that knows their features and actions; what it does does not matter.

    Raises:
        RuleError: It names both rules, and a state in which they contradict each other.
    """
    for demand in asked:
        with contextlib.suppress(Unsettled):
            if _state_of(demand.when, demand, learned) is None:
                raise RuleError(
                    f"{demand.rule.place}: the condition of '{demand.rule}' never "
                    "holds: no state is like that."
                )
    for first, second in combinations(asked, 2):
        with contextlib.suppress(Unsettled):
            _refuse_clash(first, second, learned)


def _refuse_clash(first: Demand, second: Demand, learned: LearnedTree) -> None:
    both = _clash(first, second)
    point = None if both is None else _state_of(both, first, learned)
    if both is None or point is None:
        return
    state = point_text(point, grid_of(learned, [], [both]), learned.features)
    where = f", as where {state}" if state else ""
    raise RuleError(
        f"{second.rule.place}: '{second.rule}' contradicts '{first.rule}' of "
        f"{first.rule.place}{where}: make a condition narrower."
    )


def _clash(first: Demand, second: Demand) -> Formula | None:
    """Where no command keeps both rules; None if there is always one."""
    if first.action.channel != second.action.channel:
        return None
    demanded = [one for one in (first, second) if one.forbids is None]
    if len(demanded) == 2:
        return AllOf((first.when, second.when)) if first.action != second.action else None
    if len(demanded) == 1 and first.action == second.action:
        return AllOf((first.region, second.region))
    return None


def _state_of(formula: Formula, demand: Demand, learned: LearnedTree) -> Point | None:
    """A state in which a formula holds; None if there is none.

    Raises:
        Unsettled: It could not be found out.
    """
    grid = grid_of(learned, [], [formula])
    shown = of_tree(learned, demand.action.channel)
    near = nearest(grid.boxes(formula), grid, learned.features, shown)
    return None if near is None else near.point
