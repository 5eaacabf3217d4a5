"""Rules of large trees: the whole proof, beside one prediction of 10,000 rows."""

from __future__ import annotations

import numpy as np
from examples import table
from harness import Figure, Settings, alternate, compared, timed

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.prediction import States, choose, history_columns
from rebt_ros.demonstration.last_action import History
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.verification.proof import check
from rebt_ros.verification.resolving import demands
from rebt_ros.verification.rules_file import loads
from rebt_ros.verification.verdict import Answer, verdicts

_FEATURES = 24
_RULES = 20


def check_rules(settings: Settings) -> list[Figure]:
    """Twenty rules of a tree of 200 leaves, and of one of 2,000; also where branches overlap."""
    sizes = [(settings.size(500, 60), "200"), (settings.size(5_000, 120), "2,000")]
    return [
        _checked(settings, rows, leaves, overlapping)
        for overlapping in (False, True)
        for rows, leaves in sizes
    ]


def _checked(settings: Settings, rows: int, leaves: str, overlapping: bool) -> Figure:
    # Without the conditions that no row needs, branches of so noisy a tree overlap in millions of
    # ways.
    options = LearnOptions(
        ccp_alpha=0.0,
        history=History.NONE,
        simplest=False,
        routines=False,
        test_fraction=0.0,
        leave_out_conditions=overlapping,
    )
    learning = learn_from(table(rows, _FEATURES, noise=0.5), options)
    learned = learning.learned
    rules = loads(_rules(learned))
    many = table(settings.size(10_000, 100), _FEATURES, seed=1)
    columns = history_columns(many.actions, many.previous, many.last)
    states = States(many.features, many.states, columns)
    actions = nodes.actions(learned.tree)
    asked = demands(rules, learned)
    found = verdicts(check(learned, asked), asked)

    spreads = alternate(
        {
            "ours": timed(lambda: check(learned, asked)),
            "limit": timed(lambda: choose(learned.tree, actions, states)),
        },
        settings.rounds,
    )
    answers = [one.answer for one in found]
    detail = (
        f"{learning.decision_tree.tree.leaves} leaves, {nodes.size(learned.tree)} nodes; "
        f"{answers.count(Answer.PROVEN)} proven, {answers.count(Answer.BROKEN)} broken"
    )
    tree = f"a tree of {leaves} leaves{', which overlap' if overlapping else ''}"
    name = f"{_RULES} rules of {tree} / prediction of 10,000 rows"
    return compared(name, spreads, None, "s", detail)


def _rules(learned: LearnedTree) -> str:
    """Rules about corners of the states, of which some are broken."""
    random = np.random.default_rng(0)
    lines = ["rules:"]
    for number in range(_RULES):
        one, other = random.choice(_FEATURES, 2, replace=False)
        low, high = np.round(random.uniform(-0.9, -0.3), 2), np.round(random.uniform(0.2, 0.9), 2)
        action = learned.actions[number % len(learned.actions)].label
        lines += [
            f"- {'never' if number % 2 else 'only'}: {action}",
            f"  when: {'' if number % 2 else 'not '}(f{one} < {low} and f{other} > {high})",
        ]
    return "\n".join(lines) + "\n"
