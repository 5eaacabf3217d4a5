"""Benchmarks of learning: all of it, its parts, how it grows, and its worst cases."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from examples import table
from harness import (
    Figure,
    Settings,
    Spread,
    alternate,
    compared,
    in_a_process,
    timed,
)
from learner import CASES, Case, rows_of
from running import State, by_hand
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.behavior_tree import nodes
from rebt_ros.choosing import convert
from rebt_ros.decision_tree.encoding import encode
from rebt_ros.decision_tree.training import fit
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.options import DEFAULTS, LearnOptions
from rebt_ros.pipeline import learn_from

_LEARNER = Path(__file__).with_name("learner.py")
#: Seconds after which a worst case has failed.
_LONGEST = 120.0


def relearn(settings: Settings) -> list[Figure]:
    """Learning with default options: LAT, depth and PSA automatic, all levels judged in folds."""
    case = CASES["relearn"]
    case = replace(case, rows=settings.size(case.rows, 400))
    rows = rows_of(case)
    matrix = encode(rows, last_action=False)
    subjects: dict[str, Callable[[], float]] = {
        "ours": timed(lambda: learn_from(rows)),
        "limit": timed(lambda: DecisionTreeClassifier(random_state=0).fit(matrix, rows.chosen)),
    }
    name = f"relearn, {case.rows:,} x {case.width} / one DecisionTreeClassifier.fit"
    return [compared(name, alternate(subjects, settings.rounds), 8)]


def relearn_large(settings: Settings) -> list[Figure]:
    """A million rows, depth 8; in processes of their own, for their memory."""
    quick = ("--quick",) if settings.quick else ()
    found: dict[str, list[dict[str, float]]] = {"ours": [], "limit": []}
    for _ in range(settings.rounds):
        for subject, results in found.items():
            results.append(in_a_process(_LEARNER, subject, "large", *quick))
    case = CASES["large"]
    cells = (case.rows if not settings.quick else max(case.rows // 50, 300)) * case.width
    spreads = {
        subject: Spread(tuple(one["seconds"] for one in results))
        for subject, results in found.items()
    }
    memory = {
        subject: Spread(tuple(one["memory"] / (4 * cells) for one in results))
        for subject, results in found.items()
    }
    size = f"{cells // case.width:,} x {case.width}, depth 8"
    return [
        compared(f"relearn, {size} / the same fit", spreads, 8),
        Figure(
            f"peak memory of relearn, {size} / its float32 table",
            max(memory["ours"].measured),
            4,
            memory["ours"],
            memory["limit"],
            "x",
        ),
    ]


def rules(settings: Settings) -> list[Figure]:
    """Each pruning level from its decision tree to its minimized behavior tree."""
    rows = table(settings.size(20_000, 500), 20)
    fitted = fit(rows, last_action=False)
    counts = fitted.path.leaf_counts().tolist()
    levels = dict(zip(counts, fitted.path.alphas, strict=True))
    small = [one for one in sorted(levels) if 1 < one <= 40]
    place = {feature.name: index for index, feature in enumerate(rows.features)}
    figures = []
    for name, chosen in (
        ("up to 40 leaves", small[:: max(len(small) // 8, 1)]),
        ("more leaves", [one for one in sorted(levels) if 40 < one <= 300][::20][:6]),
    ):
        if not chosen:
            continue
        trees = [fitted.at(float(levels[leaves])) for leaves in chosen]
        made = [convert(one, DEFAULTS, psa=False) for one in trees]

        def ours(trees: list[Any] = trees) -> None:
            for one in trees:
                convert(one, DEFAULTS, psa=False)

        def limit(made: list[nodes.Node] = made) -> None:
            for tree in made:
                state = State()
                state.values = rows.states[0].tolist()
                by_hand(tree, state, place).tick_once()

        spreads = alternate({"ours": timed(ours), "limit": timed(limit)}, settings.rounds)
        figures.append(
            compared(
                f"rules -> minimized tree per level, {name} / building and ticking it once",
                spreads,
                20,
                detail=f"levels of {', '.join(map(str, chosen))} leaves",
            )
        )
    return figures


def growth(settings: Settings) -> list[Figure]:
    """How the time of learning grows with ten times as much."""
    options = LearnOptions(max_depth=8)
    base = Case(settings.size(4000, 400), 6, actions=6, options=options)
    figures = [
        _exponent(name, goal, settings, partial(_learns, base), partial(_learns, more))
        for name, goal, more in (
            ("rows", 1.15, replace(base, rows=10 * base.rows)),
            ("features", 1.15, replace(base, width=10 * base.width)),
            ("actions", 1.15, replace(base, actions=10 * base.actions)),
        )
    ]
    rows = table(settings.size(20_000, 500), 10, noise=0.3)
    fitted = fit(rows, last_action=False)
    alphas = fitted.path.alphas
    few = alphas[:: len(alphas) // max(len(alphas) // 10, 1)]
    return [
        *figures,
        _exponent(
            f"levels to judge ({len(few)} to {len(alphas)})",
            1.15,
            settings,
            lambda: timed(lambda: fitted.agreements(rows, few)),
            lambda: timed(lambda: fitted.agreements(rows, alphas)),
            math.log(len(alphas) / len(few)),
        ),
    ]


def _learns(case: Case) -> Callable[[], float]:
    rows: DemonstrationTable = rows_of(case)
    return timed(lambda: learn_from(rows, case.options))


def _exponent(
    name: str,
    goal: float,
    settings: Settings,
    less: Callable[[], Callable[[], float]],
    more: Callable[[], Callable[[], float]],
    factor: float = math.log(10),
) -> Figure:
    spreads = alternate({"less": less(), "more": more()}, min(settings.rounds, 3))
    exponent = math.log(spreads["more"].least / spreads["less"].least) / factor
    return Figure(
        f"growth of time: exponent in {name}", exponent, goal, spreads["more"], spreads["less"], "s"
    )


def worst(settings: Settings) -> list[Figure]:
    """Each worst case, once: in seconds, against a bound on what it may take."""
    quick = ("--quick",) if settings.quick else ()
    return [_bounded(name, quick) for name in CASES if name not in {"relearn", "large"}]


def _bounded(case: str, quick: tuple[str, ...]) -> Figure:
    name = f"worst case: {case} (s)"
    try:
        found = in_a_process(_LEARNER, "ours", case, *quick, timeout=_LONGEST)
    except subprocess.TimeoutExpired:
        return Figure(name, math.inf, _LONGEST, detail=f"not done after {_LONGEST:g} s")
    return Figure(name, found["seconds"], _LONGEST, detail=str(found["detail"]))
