"""``make bench-reduction``: how much smaller than BT-Espresso's our trees are (paper, Fig. 5).

Simulates every configuration, learns a decision tree at each pruning level, and converts it with
BT-Espresso, with the paper's two reductions (no SAES), and with all of ours.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import aligned, parse, run
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.training import fit
from rebt_ros.decision_tree.tree import DecisionTree, Leaf
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import InputError, OptionError
from rebt_ros.learning.evaluation import teacher_forced_choices
from rebt_ros.paper.re_bt_espresso import bt_espresso
from rebt_ros.paper.rule_trees import main_tree
from rebt_ros.paper.rules import dt_to_rules_psa, leaf_rules
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.study.configurations import read_configs
from rebt_ros.study.reduction import Reductions, Size, SizeComparison
from rebt_ros.study.settings import MAX_DEPTH
from rebt_ros.study.simulator.configuration import ExperimentConfig
from rebt_ros.study.simulator.synthetic_robot import TICKS, ExperimentRobot, simulate

_MODES: dict[str, Callable[[DecisionTree], nodes.Node]] = {
    "paper": lambda tree: main_tree(dt_to_rules_psa(tree, 0.0)),
    "default": lambda tree: reduced_tree(leaf_rules(tree, lambda leaf: (leaf.most_probable,))),
}


@dataclass(frozen=True, slots=True)
class Comparison(SizeComparison):
    """The sizes, and whether the mode's tree still does the same."""

    mismatches: int
    """Rows on which the mode's tree and the decision tree differ."""


@dataclass(frozen=True, slots=True)
class ConfigurationResult:
    """The pruning levels of one configuration."""

    rows: int
    comparisons: dict[str, list[Comparison]]
    """By mode."""
    undecided: int
    """Levels left out because their leaves, though several, all choose one action."""


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parsed = parse(_parser(), arguments)
    run(lambda: _bench(parsed), "bench-reduction")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="bench-reduction",
        description="Compares the sizes of BT-Espresso's trees and ours on simulated experiments.",
    )
    parser.add_argument(
        "experiments", type=Path, metavar="DIR", help="directory of configuration files (*.json)"
    )
    parser.add_argument(
        "--ticks", type=int, default=TICKS, help="per configuration (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="default: %(default)s")
    parser.add_argument(
        "--jobs", type=int, default=-1, help="processes (default: one per processor)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("bench-results/reduction.json"),
        metavar="FILE",
        help="default: %(default)s",
    )
    return parser


def _bench(parsed: argparse.Namespace) -> None:
    if parsed.jobs == 0:
        raise OptionError("jobs is 0: name a number of processes, or -1 for one per processor.")
    configs = read_configs(parsed.experiments)
    start = time.monotonic()
    results: list[ConfigurationResult] = []
    progress = ProgressBar()
    try:
        tasks = (joblib.delayed(compare)(config, parsed.ticks, parsed.seed) for config in configs)
        for result in joblib.Parallel(n_jobs=parsed.jobs, return_as="generator")(tasks):
            results.append(result)
            progress(f"{len(results)} of {len(configs)}", len(results) / len(configs))
    finally:
        progress.clear()
    seconds = time.monotonic() - start
    figures = {
        mode: Figures.of([one for result in results for one in result.comparisons[mode]])
        for mode in _MODES
    }
    rows = sum(result.rows for result in results)
    undecided = sum(result.undecided for result in results)
    settings: dict[str, Any] = {"ticks": parsed.ticks, "seed": parsed.seed, "max_depth": MAX_DEPTH}
    work: dict[str, Any] = {
        "configurations": len(configs),
        "rows": rows,
        "levels_of_one_action": undecided,
        "seconds": round(seconds, 1),
    }
    modes = {mode: one.encoded() for mode, one in figures.items()}
    write_text_atomically(parsed.out, json.dumps(modes | settings | work, indent=1) + "\n")
    skipped = [note for config in configs for note in config.notes]
    if skipped:
        print(f"note: {len(skipped)} nodes without meaning were skipped, such as: {skipped[0]}.")
    if undecided:
        print(f"note: {undecided} levels are left out, whose leaves all choose one action.")
    print(_table(figures))
    print(
        f"Trees compared: {figures['default'].trees}; {len(configs)} configurations, "
        f"{parsed.ticks} ticks each, {rows} rows; {seconds:.0f} s. Written to {parsed.out}."
    )


def compare(config: ExperimentConfig, ticks: int, seed: int) -> ConfigurationResult:
    """Simulates one configuration and compares the trees of all its pruning levels.

    Levels that decide nothing are left out: those with a single leaf, and those whose leaves all
    choose one action, of which BT-Espresso makes a single node as well.
    """
    comparisons: dict[str, list[Comparison]] = {mode: [] for mode in _MODES}
    demonstration = simulate(ExperimentRobot(config, seed), ticks).demonstration
    if not len(demonstration):
        return ConfigurationResult(0, comparisons, 0)
    (table,) = tabulate([demonstration])
    fitted = fit(table, vocabulary=Vocabulary(History.LAST), max_depth=MAX_DEPTH)
    undecided = 0
    for alpha in fitted.path.alphas:
        trained = fitted.at(float(alpha))
        if isinstance(trained.tree.root, Leaf):
            continue
        if len({leaf.most_probable for _, leaf in trained.tree.paths()}) == 1:
            undecided += 1
            continue
        predicted = trained.predict(table)
        baseline = Size.of(bt_espresso(trained.tree))
        for mode, convert in _MODES.items():
            tree = convert(trained.tree)
            mismatches = int(np.sum(teacher_forced_choices(tree, table) != predicted))
            comparisons[mode].append(Comparison(baseline, Size.of(tree), mismatches))
    return ConfigurationResult(len(table), comparisons, undecided)


@dataclass(frozen=True, slots=True)
class Figures:
    """The figures of one mode."""

    reductions: Reductions
    as_emitted: Reductions
    """Inverters counted."""
    mismatches: int
    trees: int

    @classmethod
    def of(cls, comparisons: Sequence[Comparison]) -> Figures:
        """The figures of a mode's comparisons.

        Raises:
            InputError: There are none.
        """
        if not comparisons:
            raise InputError("no decision tree had more than one leaf: simulate more ticks.")
        return cls(
            Reductions.of([one.reduction for one in comparisons]),
            Reductions.of([one.reduction_as_emitted for one in comparisons]),
            sum(one.mismatches for one in comparisons),
            len(comparisons),
        )

    def encoded(self) -> dict[str, Any]:
        """For JSON."""
        return {
            **asdict(self.reductions),
            "mismatches": self.mismatches,
            "trees": self.trees,
            "as_emitted": asdict(self.as_emitted),
        }


def _table(figures: Mapping[str, Figures]) -> str:
    """The figures for a person to read."""
    lines: list[tuple[str, ...]] = [
        ("nodes saved against BT-Espresso", "median", "maximum", "trees reduced", "mismatches")
    ]
    for mode, one in figures.items():
        lines.append((f"{mode} mode", *one.reductions.cells(), str(one.mismatches)))
        lines.append((f"{mode} mode, Inverters counted", *one.as_emitted.cells(), ""))
    return "\n".join(aligned(lines))


if __name__ == "__main__":
    main()
