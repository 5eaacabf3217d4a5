"""The report of an experiment, as JSON and as a table of all scores."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from rebt_ros.study import published
from rebt_ros.study.configurations import Lost
from rebt_ros.study.figures import (
    Contest,
    Measured,
    ModeFigures,
    Share,
    Spread,
    measured,
    mode_figures,
)
from rebt_ros.study.mode import Mode
from rebt_ros.study.provenance import provenance
from rebt_ros.study.reduction import Reductions
from rebt_ros.study.results import ConfigurationResult, SubtreeResult
from rebt_ros.study.settings import Settings


@dataclass(frozen=True, slots=True)
class ExperimentReport:
    """What is reported."""

    settings: Settings
    results: tuple[ConfigurationResult, ...]
    """At least one, in the order of the configurations."""
    lost: tuple[Lost, ...]
    figures: Mapping[Mode, ModeFigures]
    measured: Measured
    seconds: float
    """From the start of the run to its end; what was finished before does not count."""


def report_of(
    settings: Settings,
    results: tuple[ConfigurationResult, ...],
    lost: tuple[Lost, ...],
    seconds: float,
) -> ExperimentReport:
    """The report of some results; see `ExperimentReport`."""
    figures = {mode: mode_figures(results, mode) for mode in Mode}
    return ExperimentReport(settings, results, lost, figures, measured(results), seconds)


def report_json(report: ExperimentReport) -> str:
    """The figures as JSON."""
    value = {
        "modes": {mode.value: _mode(one) for mode, one in report.figures.items()},
        "paper": _published(),
        "configurations": len(report.results) + len(report.lost),
        "lost_configurations": [asdict(one) for one in report.lost],
        "not_comparable": sum(
            not subtree.usable for result in report.results for subtree in result.subtrees
        ),
        "rows": sum(result.rows for result in report.results),
        "pruning_levels": sum(result.levels for result in report.results),
        "nodes_skipped": sum(result.skipped for result in report.results),
        "measure": _measured(report.measured),
        "seed": report.settings.seed,
        **provenance(report.settings),
        "seconds": round(report.seconds, 1),
        "seconds_of_configurations": round(sum(one.seconds for one in report.results), 1),
    }
    return json.dumps(value, ensure_ascii=False, indent=1) + "\n"


def _mode(figures: ModeFigures) -> dict[str, Any]:
    return {
        "subtrees": figures.subtrees,
        **asdict(figures.minimum),
        "median": asdict(figures.median),
        "mean_minimum": figures.mean_minimum,
        "mean_median": figures.mean_median,
        "exact": figures.exact,
        "repeater": _pair(figures.repeater),
        "psa": _pair(figures.psa),
        "psa_of_all": _pair(figures.psa_of_all),
        "node_reduction": _reduction(figures.reductions, figures.trees),
        "node_reduction_with_inverters": _reduction(figures.with_inverters, figures.trees),
        "mismatches": figures.mismatches,
        "own_history_agreement": ratio(figures.agreement),
        "offered": _spread(figures.subtrees_offered),
        "suggestions": _spread(figures.suggestions_offered),
        "minima_proven": figures.proven,
        "lost_to_baseline": [asdict(loss) for loss in figures.losses],
    }


def _published() -> dict[str, Any]:
    return {
        "subtrees": published.SUBTREES,
        **asdict(published.MINIMUM),
        "median": asdict(published.MEDIAN),
        "repeater": _pair(published.REPEATER),
        "psa": _pair(published.PSA),
        "node_reduction": _reduction(published.REDUCTIONS, published.TREES),
    }


def _measured(found: Measured) -> dict[str, Any]:
    return {
        "pairs_compared": found.compared,
        "pairs_excluded_by_labels": found.excluded,
        "pairs_measured": found.measured,
        "exact_minima": _pair(found.exact_minima),
        "exact_levels": _pair(found.exact_levels),
        "networkx_tried": found.networkx_tried,
        "networkx_missed": found.networkx_missed,
        "at_most_networkx": _pair(found.at_most_networkx),
    }


def _pair(share: Share) -> list[int]:
    return [share.count, share.total]


def ratio(share: Share) -> float | None:
    """The share from 0 to 1; None of nothing."""
    return round(share.count / share.total, 4) if share.total else None


def _spread(spread: Spread) -> dict[str, Any]:
    return {"median": spread.median, "maximum": spread.maximum}


def _reduction(reductions: Reductions | None, trees: int) -> dict[str, Any] | None:
    return None if reductions is None else {**asdict(reductions), "trees": trees}


_COLUMNS = (
    "configuration",
    "subtree",
    "mode",
    "compared",
    "minimum",
    "minimum_at_least",
    "median",
    "baseline_minimum",
    "baseline_median",
    "outcome_of_minimum",
    "outcome_of_median",
    "simulated_nodes",
    "found_nodes",
    "simulated_repeaters",
    "found_repeaters",
    "simulated_psa",
    "found_psa",
    "found_level",
    "levels",
    "exact_levels",
    "simulated",
    "found",
)


def report_csv(report: ExperimentReport) -> str:
    """A line for each simulated subtree and mode."""
    file = io.StringIO()
    writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    for result in report.results:
        for subtree in result.subtrees:
            writer.writerows(_lines(result.configuration, subtree))
    return file.getvalue()


def _lines(configuration: str, subtree: SubtreeResult) -> Iterator[dict[str, Any]]:
    simulated = {
        "configuration": configuration,
        "subtree": subtree.number,
        "compared": "yes" if subtree.usable else "no",
        "simulated_nodes": subtree.nodes,
        "simulated_repeaters": subtree.repeaters,
        "simulated_psa": subtree.psa,
        "simulated": subtree.shown,
    }
    if not subtree.usable:
        yield simulated
    for mode, score in subtree.scores.items():
        baseline = subtree.scores[Mode.BASELINE]
        yield simulated | {
            "mode": mode.value,
            "minimum": _distance(score.minimum),
            "minimum_at_least": _distance(score.minimum_at_least),
            "median": _distance(score.median),
            "baseline_minimum": _distance(baseline.minimum),
            "baseline_median": _distance(baseline.median),
            "outcome_of_minimum": _outcome(score.minimum, baseline.minimum),
            "outcome_of_median": _outcome(score.median, baseline.median),
            "found_nodes": score.nodes,
            "found_repeaters": score.repeaters,
            "found_psa": score.psa,
            "found_level": score.level,
            "levels": score.levels,
            "exact_levels": score.exact_levels,
            "found": score.found,
        }


def _distance(distance: float) -> float:
    """The same number, whole where it is: JSON does not tell 2.0 from 2."""
    return int(distance) if distance == int(distance) else distance


def _outcome(distance: float, baseline: float) -> str:
    if distance == baseline:
        return "tie"
    return "win" if distance < baseline else "loss"


def rows_of_table(report: ExperimentReport) -> list[tuple[str, ...]]:
    """The paper's figures beside ours, with a heading, for a person to read."""
    columns = [_column(value) for value in report.figures.values()]
    theirs = _published_column()
    heading = ("", "paper (reported)", *(f"{mode.value} (ours)" for mode in report.figures))
    return [
        heading,
        *(
            (name, theirs.get(name, "-"), *(column[name] for column in columns))
            for name in columns[0]
        ),
    ]


def _column(figures: ModeFigures) -> dict[str, str]:
    saved, most_saved, share_smaller = (
        ("-", "-", "-") if figures.reductions is None else figures.reductions.cells()
    )
    return {
        "subtrees compared": str(figures.subtrees),
        "minimum: wins / ties / losses": _contest(figures.minimum),
        "median: wins / ties / losses": _contest(figures.median),
        "mean of the minima": f"{figures.mean_minimum:.2f}",
        "recovered exactly": _of(Share(figures.exact, figures.subtrees)),
        "with a Repeater, found one": _of(figures.repeater),
        "with PSA nodes, found as many": _of(figures.psa),
        "nodes saved, median": saved,
        "nodes saved, maximum": most_saved,
        "trees with fewer nodes": share_smaller,
        "rows where trees and decision trees differ": str(figures.mismatches),
        "own-history agreement": _percent(figures.agreement),
        "subtrees per level, median / max": _spread_text(figures.subtrees_offered),
        "suggestions per level, median / max": _spread_text(figures.suggestions_offered),
        "minima known to be exact": _of(Share(figures.proven, figures.subtrees)),
    }


def _published_column() -> dict[str, str]:
    saved, most_saved, share_smaller = published.REDUCTIONS.cells()
    return {
        "subtrees compared": str(published.SUBTREES),
        "minimum: wins / ties / losses": _contest(published.MINIMUM),
        "median: wins / ties / losses": _contest(published.MEDIAN),
        "with a Repeater, found one": _of(published.REPEATER),
        "with PSA nodes, found as many": _of(published.PSA),
        "nodes saved, median": saved,
        "nodes saved, maximum": most_saved,
        "trees with fewer nodes": share_smaller,
    }


def _contest(contest: Contest) -> str:
    return f"{contest.wins} / {contest.ties} / {contest.losses}"


def _of(share: Share) -> str:
    return f"{share.count} of {share.total}"


def _percent(share: Share) -> str:
    return f"{100 * share.count / share.total:.2f} %" if share.total else "-"


def _spread_text(spread: Spread) -> str:
    return f"{spread.median:g} / {spread.maximum}"
