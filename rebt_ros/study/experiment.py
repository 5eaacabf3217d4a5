"""The whole experiment: configurations in, results and report out."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from rebt_ros.errors import InputError
from rebt_ros.learning.progress import Progress
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.study.configurations import (
    Lost,
    chosen_paths,
    configuration_paths,
    in_order,
    read_where_possible,
)
from rebt_ros.study.figures import usable
from rebt_ros.study.page import report_page
from rebt_ros.study.report import ExperimentReport, report_csv, report_json, report_of
from rebt_ros.study.result_files import ResultFiles
from rebt_ros.study.running import attempt
from rebt_ros.study.settings import Settings
from rebt_ros.workers import run_all


@dataclass(frozen=True, slots=True)
class Chosen:
    """Which of the configurations to run."""

    names: tuple[str, ...] = ()
    """All if empty."""
    limit: int | None = None
    """The first so many of them."""


def run_experiment(
    configurations: Path,
    directory: Path,
    settings: Settings,
    chosen: Chosen | None = None,
    *,
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Progress = lambda stage, share: None,
) -> ExperimentReport:
    """Runs what has not been run and writes report.json, report.csv and index.html.

    Args:
        configurations: Directory of configuration files.
        directory: Of the results; those of an earlier run are used again.
        settings: What to simulate and measure.
        chosen: Which configurations; None for all.
        jobs: Processes, -1 for one per processor.
        scheduler: Address of a Dask scheduler to use instead of processes.
        progress: Told what is being done and which share of the work is behind.

    Raises:
        RebtError: No configuration can be used, or the directory or the workers cannot.
    """
    start = time.monotonic()
    chosen = chosen or Chosen()
    paths = chosen_paths(configuration_paths(configurations), chosen.names, chosen.limit)
    configs, lost = read_where_possible(paths)
    files = ResultFiles(directory, settings)
    kept = {config.name: files.finished(config) for config in configs}
    finished = [result for result in kept.values() if result is not None]
    missing = [config for config in configs if kept[config.name] is None]
    failed: list[Lost] = list(lost)
    for result in run_all(attempt, [(config, settings) for config in missing], jobs, scheduler):
        if isinstance(result, Lost):
            failed.append(result)
        else:
            files.write(result)
            finished.append(result)
        done = len(finished) + len(failed)
        progress(f"{done} of {len(paths)}", done / len(paths))
    failed.sort(key=lambda one: in_order(one.configuration))
    finished.sort(key=lambda one: in_order(one.configuration))
    if not usable(finished):
        reason = failed[0].reason if failed else "nothing simulated can be compared."
        raise InputError(f"there is nothing to report: {reason}")
    report = report_of(settings, tuple(finished), tuple(failed), time.monotonic() - start)
    write_text_atomically(directory / "report.csv", report_csv(report))
    write_text_atomically(directory / "index.html", report_page(report))
    # Last, so that where it is, all is.
    write_text_atomically(directory / "report.json", report_json(report))
    return report
