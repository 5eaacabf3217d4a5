"""What is compared: ways to make a driver of demonstrations."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, cast

from sklearn.ensemble import RandomForestClassifier
from sklearn.tree import DecisionTreeClassifier

import rebt_ros
from driving.demonstrating import Shown, write_tables
from driving.episodes import Driver
from driving.plain import PlainDriver
from driving.task import Task
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Figures
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.table import tabulate
from rebt_ros.learning.levels import as_learned
from rebt_ros.paper.re_bt_espresso import bt_espresso
from rebt_ros.storage.inputs import load

#: Of the plain trees that are not grown fully, of BT-Espresso's and of the paper's.
_DEPTH = 5
_TREES = 100


@dataclass(frozen=True, slots=True)
class Made:
    """What a method made of demonstrations."""

    driver: Driver
    nodes: int
    seconds: float
    """That learning took."""
    about: Mapping[str, Any] = field(default_factory=dict)
    """What else is worth writing down."""


Method: TypeAlias = Callable[[Task, Sequence[Shown]], Made]


def _product(options: rebt_ros.LearnOptions) -> Method:
    def learn(task: Task, shown: Sequence[Shown]) -> Made:
        with tempfile.TemporaryDirectory() as directory:
            paths = write_tables(Path(directory), task.features, shown)
            start = time.perf_counter()
            result = rebt_ros.learn(paths, options=options)
            seconds = time.perf_counter() - start
        learned = result.learned
        figures = learned.provenance.figures
        return Made(
            cast(Driver, rebt_ros.Policy(learned)),
            nodes.size(learned.tree),
            seconds,
            {
                "agreement": figures.own_history_agreement,
                "mean_recall": figures.mean_recall,
                "history": learned.provenance.history.value,
                "late": learned.provenance.late_rows,
            },
        )

    return learn


def _bt_espresso(task: Task, shown: Sequence[Shown]) -> Made:
    """The paper's baseline: all conditions of a tree of depth 5, minimized, without history."""
    with tempfile.TemporaryDirectory() as directory:
        loaded = load(write_tables(Path(directory), task.features, shown))
    start = time.perf_counter()
    (table,) = tabulate(loaded.demonstrations)
    trained = fit(table, FitOptions(max_depth=_DEPTH)).at(0.0)
    tree = bt_espresso(trained.tree)
    seconds = time.perf_counter() - start
    unjudged = Figures(0, None, None, 0)
    learned = as_learned(table, trained, tree, 0.0, unjudged, rebt_ros.LearnOptions.paper())
    return Made(cast(Driver, rebt_ros.Policy(learned)), nodes.size(tree), seconds)


def _plain(model: Callable[[], Any], history: bool) -> Method:
    def learn(task: Task, shown: Sequence[Shown]) -> Made:
        start = time.perf_counter()
        driver = PlainDriver(model(), task, shown, history)
        return Made(driver, driver.nodes, time.perf_counter() - start)

    return learn


def _tree(depth: int | None = None) -> Callable[[], Any]:
    return lambda: DecisionTreeClassifier(max_depth=depth, random_state=0)


def _forest() -> Any:
    return RandomForestClassifier(_TREES, random_state=0)


DEFAULT = "default"
METHODS: Mapping[str, Method] = {
    DEFAULT: _product(rebt_ros.LearnOptions()),
    "tree": _plain(_tree(), history=False),
    "tree+history": _plain(_tree(), history=True),
    "depth5": _plain(_tree(_DEPTH), history=False),
    "depth5+history": _plain(_tree(_DEPTH), history=True),
    "forest": _plain(_forest, history=False),
    "forest+history": _plain(_forest, history=True),
    "bt-espresso": _bt_espresso,
    "paper": _product(rebt_ros.LearnOptions.paper()),
    # Not usually run: the default without a part of it.
    "unpruned": _product(rebt_ros.LearnOptions(ccp_alpha=0.0)),
    "no-history": _product(rebt_ros.LearnOptions(history=rebt_ros.History.NONE)),
    "no-differences": _product(rebt_ros.LearnOptions(differences=rebt_ros.Use.NEVER)),
    "keep-conditions": _product(rebt_ros.LearnOptions(leave_out_conditions=False)),
    "no-sums": _product(rebt_ros.LearnOptions(sums=rebt_ros.Use.NEVER)),
    "no-reaction-time": _product(rebt_ros.LearnOptions(reaction_time=0.0)),
}
USUAL = tuple(METHODS)[:9]
#: Of the plain ones, without rebt_ros.
PLAIN = ("tree", "tree+history", "depth5", "depth5+history", "forest", "forest+history")
