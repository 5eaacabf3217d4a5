"""Learns once in a process of its own, and prints what that took as JSON.

    python learner.py ours|limit CASE [--quick]

seconds: of learning from the table, or of scikit-learn's fit to the same rows
memory: the most that was held, the table included, beyond what the process held otherwise (bytes)
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, replace

import numpy as np
from examples import table
from harness import forget_peak, peak_memory
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.behavior_tree import nodes
from rebt_ros.decision_tree.encoding import encode
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.options import DEFAULTS, LearnOptions
from rebt_ros.learning.pipeline import learn_from


@dataclass(frozen=True, slots=True)
class Case:
    """A table, and how to learn from it."""

    rows: int
    width: int
    actions: int = 8
    noise: float = 0.05
    options: LearnOptions = DEFAULTS
    in_turns: bool = False
    """Whether every action is followed by any other, as in a LAT graph with all edges."""


CASES = {
    "relearn": Case(20_000, 20),
    "large": Case(1_000_000, 24, options=LearnOptions(max_depth=8, exact=True)),
    "60 actions": Case(20_000, 20, actions=60),
    "200 features": Case(20_000, 200),
    "depth 12, no pruning": Case(
        20_000, 20, noise=0.3, options=LearnOptions(max_depth=12, ccp_alpha=0.0)
    ),
    "noise labels": Case(20_000, 20, noise=1.0),
    "noise labels, no pruning": Case(20_000, 20, noise=1.0, options=LearnOptions(ccp_alpha=0.0)),
    "30 fully connected actions": Case(5000, 4, actions=30, noise=1.0, in_turns=True),
}


def rows_of(case: Case) -> DemonstrationTable:
    rows = table(case.rows, case.width, case.actions, case.noise)
    if not case.in_turns:
        return rows
    # All differences but 0 are equally likely, so that no action follows itself.
    steps = np.random.default_rng(0).integers(1, case.actions, size=case.rows)
    return replace(rows, chosen=np.cumsum(steps) % case.actions)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("subject", choices=("ours", "limit"))
    parser.add_argument("case", choices=CASES)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    case = CASES[options.case]
    if options.quick:
        case = replace(case, rows=max(case.rows // 50, 300))
    rows = rows_of(case)
    forget_peak()
    before = peak_memory() - rows.states.nbytes
    found: dict[str, object] = {}
    start = time.perf_counter()
    if options.subject == "limit":
        tree = DecisionTreeClassifier(max_depth=case.options.max_depth, random_state=0)
        tree.fit(encode(rows, last_action=False), rows.chosen)
    else:
        learning = learn_from(rows, case.options)
        leaves = learning.decision_tree.tree.leaves
        found["detail"] = f"{leaves} leaves, {nodes.size(learning.learned.tree)} nodes" + "".join(
            f"; {note}" for note in learning.notes
        )
    found["seconds"] = time.perf_counter() - start
    found["memory"] = peak_memory() - before
    print(json.dumps(found))


if __name__ == "__main__":
    main()
