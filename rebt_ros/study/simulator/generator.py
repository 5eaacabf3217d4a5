"""Random configurations by the rules of the paper's experiments (IV-B).

The paper says that subtrees follow "valid BT rules" and are combined in sets of 2 or 3 under a
Parallel or a Sequence root.  The rest is read off the 100 published files and their generator:
a subtree is a Sequence or a Repeater of 2 to 5 steps, the last of which acts; conditions may be
inverted; two of them may stand under a Selector, and 2 or 3 actions under a Parallel/Selector
node; no subtree has a condition's variable or an action twice.

One deviation: where their generator has run out of actions it leaves a node of type DEFAULT, which
means nothing.  This one chooses among what is left, and keeps an action back for the last step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, groupby
from random import Random
from typing import Final, TypeVar

from rebt_ros.errors import OptionError
from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    ExperimentConfig,
    Group,
    GroupKind,
    Inverted,
    SimulatedNode,
    leaves,
)

T = TypeVar("T")

VARIABLES: Final = tuple(f"/env_state_var_{number}" for number in range(1, 6))
ACTIONS: Final = tuple(f"action_{number}" for number in range(5))
ROOTS: Final = (GroupKind.PARALLEL, GroupKind.SEQUENCE)
SUBTREES: Final = (GroupKind.SEQUENCE, GroupKind.REPEATER)
SUBTREE_COUNTS: Final = (2, 3)
STEP_COUNTS: Final = (2, 3, 4, 5)
PSA_SIZES: Final = (2, 3)
THRESHOLD: Final = 0.5

#: Probabilities, as they are in the published files: a step that is not the last acts; acting is a
#: Parallel/Selector node; testing is a Selector; a condition is inverted.
_ACTS, _PSA, _SELECTOR, _INVERTED = 0.4, 0.25, 0.3, 0.75


def generate_configs(
    count: int, seed: int, progress: Callable[[float], None] | None = None
) -> list[ExperimentConfig]:
    """Draws configurations, no two of which are the same but for the order of what has none.

    Args:
        count: How many, at least 1.
        seed: Equal numbers give equal configurations, and a larger count only more of them.
        progress: Called now and then with the share that is done.

    Returns:
        Configurations named expr0, expr1, ...

    Raises:
        OptionError: No configurations are asked for.
    """
    if count < 1:
        raise OptionError(f"the number of configurations is {count}: generate at least 1.")
    draw = _Draw(seed)
    seen: set[SimulatedNode] = set()
    configs: list[ExperimentConfig] = []
    while len(configs) < count:
        root = _tree(draw)
        form = canonical_form(root)
        if form in seen:
            continue
        seen.add(form)
        configs.append(ExperimentConfig(f"expr{len(configs)}", root))
        if progress is not None and len(configs) % 100 == 0:
            progress(len(configs) / count)
    return configs


def canonical_form(node: SimulatedNode) -> SimulatedNode:
    """The same tree, with everything sorted whose order does not matter.

    That is: children of Parallel and Parallel/Selector nodes, and conditions next to each other.
    """
    match node:
        case Inverted(child=child):
            return Inverted(canonical_form(child))
        case Group(kind=kind, children=children):
            forms = [canonical_form(child) for child in children]
            if kind in (GroupKind.PARALLEL, GroupKind.PARALLEL_SELECTOR):
                return Group(kind, tuple(sorted(forms, key=repr)))
            runs = groupby(forms, _only_tests)
            ordered = (sorted(run, key=repr) if tests else run for tests, run in runs)
            return Group(kind, tuple(chain.from_iterable(ordered)))
        case _:
            return node


def _only_tests(node: SimulatedNode) -> bool:
    return all(isinstance(leaf, Check) for leaf in leaves(node))


class _Draw:
    """Choices that are the same on every version of Python: of its generator only `random` is."""

    def __init__(self, seed: int) -> None:
        self._random = Random(f"{seed} configurations").random

    def happens(self, probability: float) -> bool:
        return self._random() < probability

    def one_of(self, values: Sequence[T]) -> T:
        return values[int(self._random() * len(values))]

    def taken_from(self, values: list[T]) -> T:
        """One of the values, which is removed."""
        return values.pop(int(self._random() * len(values)))


def _tree(draw: _Draw) -> Group:
    kind = draw.one_of(ROOTS)
    wanted = draw.one_of(SUBTREE_COUNTS)
    subtrees: list[Group] = []
    while len(subtrees) < wanted:
        subtree = _subtree(draw)
        if canonical_form(subtree) not in map(canonical_form, subtrees):
            subtrees.append(subtree)
    return Group(kind, tuple(subtrees))


def _subtree(draw: _Draw) -> Group:
    kind = draw.one_of(SUBTREES)
    variables, actions = list(VARIABLES), list(ACTIONS)
    steps = [_step(draw, variables, actions) for _ in range(draw.one_of(STEP_COUNTS) - 1)]
    return Group(kind, (*steps, _acting(draw, actions, kept=0)))


def _step(draw: _Draw, variables: list[str], actions: list[str]) -> SimulatedNode:
    """Any step but the last, which needs one of the actions.

    Four steps cannot use up five variables and all actions but one: that takes three steps and two.
    """
    acts = draw.happens(_ACTS)
    if len(actions) > 1 and (acts or not variables):
        return _acting(draw, actions, kept=1)
    if len(variables) > 1 and draw.happens(_SELECTOR):
        return Group(GroupKind.SELECTOR, (_test(draw, variables), _test(draw, variables)))
    return _test(draw, variables)


def _acting(draw: _Draw, actions: list[str], kept: int) -> SimulatedNode:
    free = len(actions) - kept
    if free >= min(PSA_SIZES) and draw.happens(_PSA):
        size = min(draw.one_of(PSA_SIZES), free)
        return Group(
            GroupKind.PARALLEL_SELECTOR,
            tuple(Act(draw.taken_from(actions)) for _ in range(size)),
        )
    return Act(draw.taken_from(actions))


def _test(draw: _Draw, variables: list[str]) -> SimulatedNode:
    check = Check(draw.taken_from(variables), THRESHOLD)
    return Inverted(check) if draw.happens(_INVERTED) else check
