"""``ros2 run rebt_ros experiment CONFIGURATIONS --out DIR``: the paper's evaluation."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import aligned, directory, parse, run
from rebt_ros.study.experiment import Chosen, run_experiment
from rebt_ros.study.report import ExperimentReport, rows_of_table
from rebt_ros.study.settings import Settings


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point."""
    parsed = parse(_parser(), arguments)
    run(lambda: _experiment(parsed), "experiment")


def _parser() -> argparse.ArgumentParser:
    defaults = Settings()
    parser = argparse.ArgumentParser(
        prog="experiment",
        description="Reproduces the evaluation of the paper: simulates behavior trees, learns "
        "them back with BT-Espresso and RE:BT-Espresso, and compares learned with "
        "simulated trees. An interrupted run continues when started again.",
    )
    parser.add_argument(
        "configurations",
        type=Path,
        metavar="CONFIGURATIONS",
        help="directory of configuration files (*.json)",
    )
    parser.add_argument(
        "--out",
        type=directory,
        default=Path("experiment-results"),
        metavar="DIR",
        help="for the results and the report (default: %(default)s)",
    )
    parser.add_argument(
        "--ticks", type=int, default=defaults.ticks, help="per configuration (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=defaults.seed, help="default: %(default)s")
    parser.add_argument(
        "--configs",
        type=_names,
        default=(),
        metavar="NAME,…",
        help="run only these configurations (names without .json)",
    )
    parser.add_argument(
        "--limit", type=int, metavar="N", help="run only the first N configurations"
    )
    workers = parser.add_argument_group("workers")
    workers.add_argument(
        "--jobs", type=int, default=-1, metavar="N", help="processes (default: one per processor)"
    )
    workers.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster to run on, such as tcp://127.0.0.1:8786; needs the "
        "package distributed",
    )
    measure = parser.add_argument_group("the paper's measure, networkx")
    measure.add_argument(
        "--networkx-pairs",
        type=int,
        default=defaults.networkx_pairs,
        metavar="N",
        help="number of random pairs of each configuration to try it on; 0 for none (default: "
        "%(default)s)",
    )
    measure.add_argument(
        "--pair-seconds",
        type=float,
        default=defaults.pair_seconds,
        metavar="S",
        help="time limit for each pair (default: %(default)s)",
    )
    return parser


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip().removesuffix(".json") for name in text.split(",") if name.strip())


def _experiment(parsed: argparse.Namespace) -> None:
    settings = Settings(parsed.ticks, parsed.seed, parsed.networkx_pairs, parsed.pair_seconds)
    progress = ProgressBar()
    try:
        report = run_experiment(
            parsed.configurations,
            parsed.out,
            settings,
            Chosen(parsed.configs, parsed.limit),
            jobs=parsed.jobs,
            scheduler=parsed.scheduler,
            progress=progress,
        )
    finally:
        progress.clear()
    print("\n".join(_text(report)))
    print(f"Written to {parsed.out}: index.html, report.json, report.csv.")


def _text(report: ExperimentReport) -> list[str]:
    found = report.measured
    done, lost = len(report.results), len(report.lost)
    lines = [f"note: {one.configuration} is lost: {one.reason}" for one in report.lost]
    lines += ["", *aligned(rows_of_table(report)), ""]
    skipped = sum(result.skipped for result in report.results)
    if skipped:
        lines.append(f"{skipped} nodes without meaning were skipped.")
    if found.networkx_tried:
        lines.append(
            f"networkx: {found.networkx_missed} of {found.networkx_tried} pairs took longer than "
            f"{report.settings.pair_seconds:g} s; of the others, {found.at_most_networkx.count} of "
            f"{found.at_most_networkx.total} are at most as far apart by the measure of record."
        )
    lines.append(
        f"{done} of {done + lost} configurations, {report.settings.ticks} ticks each, seed "
        f"{report.settings.seed}; {found.compared} pairs compared; {report.seconds:.0f} s."
    )
    return lines


if __name__ == "__main__":
    main()
