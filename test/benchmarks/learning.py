"""Benchmarks of learning: all of it, its parts, how it grows, and its worst cases."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
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
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, encode
from rebt_ros.decision_tree.training import fit
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.conversion import convert
from rebt_ros.learning.options import DEFAULTS, LearnOptions
from rebt_ros.learning.pipeline import learn_from

_LEARNER = Path(__file__).with_name("learner.py")
#: Seconds after which a worst case has failed.
_LONGEST = 120.0
#: How much of something growth is measured with.
_FACTORS = (1.0, 10**0.5, 10.0)


def relearn(settings: Settings) -> list[Figure]:
    """Learning with default options: all is chosen, and all levels are judged in folds."""
    case = CASES["relearn"]
    case = replace(case, rows=settings.size(case.rows, 400))
    rows = rows_of(case)
    matrix = encode(rows, FEATURES_ALONE)
    subjects: dict[str, Callable[[], float]] = {
        "ours": timed(lambda: learn_from(rows)),
        "limit": timed(lambda: DecisionTreeClassifier(random_state=0).fit(matrix, rows.chosen)),
    }
    name = f"relearn, {case.rows:,} x {case.width} / one DecisionTreeClassifier.fit"
    return [compared(name, alternate(subjects, settings.rounds), 3)]


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
            memory["ours"].most,
            4,
            memory["ours"],
            memory["limit"],
            "x",
        ),
    ]


def rules(settings: Settings) -> list[Figure]:
    """Each pruning level from its decision tree to its minimized behavior tree."""
    rows = table(settings.size(20_000, 500), 20)
    fitted = fit(rows)
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
    """How the time of learning grows up to ten times as much of something."""
    options = LearnOptions(max_depth=8, exact=True)
    base = Case(settings.size(20_000, 400), 6, actions=6, options=options)
    # So many that what does not depend on their number is little beside the rest.
    many = replace(base, rows=settings.size(100_000, 800))
    cases: dict[str, Callable[[float], Case]] = {
        "rows": lambda factor: replace(many, rows=round(factor * many.rows)),
        "features": lambda factor: replace(base, width=round(factor * base.width)),
        "actions": lambda factor: replace(base, actions=round(factor * base.actions)),
    }
    figures = [
        _exponent(name, settings, {factor: _learns(case(factor)) for factor in _FACTORS})
        for name, case in cases.items()
    ]
    rows = table(settings.size(20_000, 500), 10, noise=0.3)
    fitted = fit(rows)
    alphas = fitted.path.alphas

    def judges(factor: float) -> Callable[[], float]:
        places = np.linspace(0, len(alphas) - 1, round(len(alphas) * factor / _FACTORS[-1]))
        some = alphas[places.astype(int)]
        return timed(lambda: fitted.hits(rows, some))

    name = f"levels to judge, up to {len(alphas)}"
    return [*figures, _exponent(name, settings, {factor: judges(factor) for factor in _FACTORS})]


def _learns(case: Case) -> Callable[[], float]:
    rows: DemonstrationTable = rows_of(case)
    return timed(lambda: learn_from(rows, case.options))


def _exponent(name: str, settings: Settings, subjects: dict[float, Callable[[], float]]) -> Figure:
    """The slope of the time against the factor, both as logarithms, by least squares."""
    spreads = alternate({str(one): subject for one, subject in subjects.items()}, settings.rounds)
    least = [one.least for one in spreads.values()]
    slope = float(np.polyfit(np.log(list(subjects)), np.log(least), 1)[0])
    first, *_, last = spreads.values()
    detail = "least: " + ", ".join(
        f"{seconds:.3g} s at {factor:.2g} x"
        for factor, seconds in zip(subjects, least, strict=True)
    )
    return Figure(f"growth of time: exponent in {name}", slope, 1.15, last, first, "s", detail)


def worst(settings: Settings) -> list[Figure]:
    """Each worst case in seconds, against a bound on what it may take."""
    quick = ("--quick",) if settings.quick else ()
    return [
        _bounded(name, quick, settings.rounds) for name in CASES if name not in {"relearn", "large"}
    ]


def _bounded(case: str, quick: tuple[str, ...], rounds: int) -> Figure:
    name = f"worst case: {case}"
    found = []
    try:
        for _ in range(rounds):
            found.append(in_a_process(_LEARNER, "ours", case, *quick, timeout=_LONGEST))
    except subprocess.TimeoutExpired:
        return Figure(name, math.inf, _LONGEST, detail=f"not done after {_LONGEST:g} s")
    took = Spread(tuple(one["seconds"] for one in found))
    detail = str(found[0]["detail"])
    return Figure(name, took.most, _LONGEST, took, None, "s", detail)
