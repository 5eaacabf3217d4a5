"""Figures, files and pages made of results that were thought up."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest

from rebt_ros.errors import InputError
from rebt_ros.study.bars import BarChart, Series, bar_chart_svg, histogram
from rebt_ros.study.configurations import Lost
from rebt_ros.study.figures import Contest, Share, mode_figures
from rebt_ros.study.mode import Mode
from rebt_ros.study.page import report_page
from rebt_ros.study.reduction import Size, SizeComparison
from rebt_ros.study.report import (
    ExperimentReport,
    report_csv,
    report_json,
    report_of,
    rows_of_table,
)
from rebt_ros.study.results import (
    Agreement,
    ConfigurationResult,
    LevelSizes,
    ModeResult,
    NetworkxPair,
    Pairs,
    Score,
    SubtreeResult,
    decoded,
    encoded,
)
from rebt_ros.study.settings import Settings

HOSTILE = "<script>alert('x')</script>\x1b&\"'"


def reached(
    minimum: float, median: float, *, repeaters: int = 0, psa: int = 0, at_least: float = 0
) -> Score:
    return Score(minimum, at_least, median, 3, 2, 5, repeaters, psa, 1, f"found {minimum:g}")


def subtree(number: int, repeaters: int, psa: int, **scores: Score) -> SubtreeResult:
    by_mode = {mode: scores[mode.value] for mode in Mode} if scores else {}
    return SubtreeResult(number, f"simulated {number}", 6, repeaters, psa, by_mode)


def mode_result(*saved: int, right: int = 5) -> ModeResult:
    sizes = tuple(SizeComparison(Size(20, 20), Size(21, 20 - one)) for one in saved)
    return ModeResult((LevelSizes(4, 1), LevelSizes(9, 3)), sizes, Agreement(right, 10), 4)


RESULT = ConfigurationResult(
    configuration="expr1",
    digest="d",
    fingerprint="f",
    rows=40,
    levels=2,
    skipped=1,
    subtrees=(
        subtree(
            1,
            1,
            1,
            baseline=reached(5, 6),
            paper=reached(3, 7, repeaters=1),
            default=reached(0, 1.5, repeaters=2, psa=1),
        ),
        subtree(
            2,
            1,
            0,
            baseline=reached(4, 4, at_least=4),
            paper=reached(4, 3),
            default=reached(5, 4, psa=1),
        ),
        subtree(3, 0, 0),
    ),
    modes={
        Mode.BASELINE: mode_result(0, 0),
        Mode.PAPER: mode_result(0, 5),
        Mode.DEFAULT: mode_result(2, 10, right=7),
    },
    pairs=Pairs(100, 20, 30),
    networkx=(
        NetworkxPair((3, 4), 2, 2, 2.0),
        NetworkxPair((3, 4), 2, 3, 2.0),
        NetworkxPair((9, 9), 2, 3, None),
    ),
    seconds=1.5,
)
SETTINGS = Settings(ticks=100, seed=7, networkx_pairs=3)


@pytest.fixture
def report() -> ExperimentReport:
    return report_of(SETTINGS, (RESULT,), (Lost("expr2", "it broke"),), 12.34)


def test_wins_ties_and_losses_are_counted_against_the_baseline() -> None:
    paper, default = (mode_figures([RESULT], mode) for mode in (Mode.PAPER, Mode.DEFAULT))
    assert (paper.minimum, paper.median) == (Contest(1, 1, 0), Contest(1, 0, 1))
    assert (default.minimum, default.median) == (Contest(1, 0, 1), Contest(1, 1, 0))
    assert [(loss.subtree, loss.statistic) for loss in paper.losses] == [(1, "median")]
    (loss,) = default.losses
    assert (loss.configuration, loss.subtree, loss.statistic) == ("expr1", 2, "minimum")
    assert (loss.distance, loss.baseline) == (5, 4)
    assert (loss.shown, loss.found, loss.baseline_found) == ("simulated 2", "found 5", "found 4")
    assert mode_figures([RESULT], Mode.BASELINE).minimum == Contest(0, 2, 0)


def test_a_subtree_that_was_never_run_is_not_compared() -> None:
    assert mode_figures([RESULT], Mode.PAPER).subtrees == 2


def test_repeaters_and_psa_nodes_count_where_they_were_simulated() -> None:
    default = mode_figures([RESULT], Mode.DEFAULT)
    assert default.repeater == Share(1, 2)
    assert default.psa == Share(1, 1)
    # A PSA node where none was simulated is wrong.
    assert default.psa_of_all == Share(1, 2)
    assert mode_figures([RESULT], Mode.PAPER).psa == Share(0, 1)


def test_exact_recoveries_reductions_and_what_was_offered_are_counted() -> None:
    default = mode_figures([RESULT], Mode.DEFAULT)
    assert default.exact == 1
    assert default.proven == 1
    assert default.reductions is not None
    assert (default.reductions.median, default.reductions.maximum) == (30, 50)
    assert default.reductions.share_reduced == 100
    assert default.with_inverters is not None
    assert (default.with_inverters.median, default.with_inverters.share_reduced) == (-5, 0)
    assert default.mismatches == 4
    assert default.agreement == Share(7, 10)
    assert (default.subtrees_offered.median, default.subtrees_offered.maximum) == (6.5, 9)
    assert (default.suggestions_offered.median, default.suggestions_offered.maximum) == (2, 3)


def test_the_report_has_the_figures_of_all_modes(report: ExperimentReport) -> None:
    value = json.loads(report_json(report))
    default = value["modes"]["default"]
    assert (default["wins"], default["ties"], default["losses"]) == (1, 0, 1)
    assert default["median"] == {"wins": 1, "ties": 1, "losses": 0}
    assert (default["repeater"], default["psa"], default["exact"]) == ([1, 2], [1, 1], 1)
    assert default["node_reduction"]["trees"] == 2
    assert default["own_history_agreement"] == 0.7
    assert default["offered"] == {"median": 6.5, "maximum": 9}
    assert value["lost_configurations"] == [{"configuration": "expr2", "reason": "it broke"}]
    assert (value["seed"], value["seconds"], value["configurations"]) == (7, 12.3, 2)
    assert value["not_comparable"] == 1
    measure = value["measure"]
    assert (measure["networkx_tried"], measure["networkx_missed"]) == (3, 1)
    assert measure["at_most_networkx"] == [1, 2]
    assert measure["exact_minima"] == [2, 6]


def test_the_papers_figures_stand_beside_ours(report: ExperimentReport) -> None:
    heading, *rows = rows_of_table(report)
    assert heading[1] == "paper (reported)"
    assert {len(row) for row in rows} == {5}
    by_name = {name: cells for name, *cells in rows}
    assert by_name["minimum: wins / ties / losses"] == [
        "54 / 178 / 2",
        "0 / 2 / 0",
        "1 / 1 / 0",
        "1 / 0 / 1",
    ]
    assert by_name["recovered exactly"] == ["-", "0 of 2", "0 of 2", "1 of 2"]


def test_the_table_of_scores_has_a_line_for_each_subtree_and_mode(report: ExperimentReport) -> None:
    lines = list(csv.DictReader(report_csv(report).splitlines()))
    assert [(line["subtree"], line["mode"]) for line in lines] == [
        *(("1", mode.value) for mode in Mode),
        *(("2", mode.value) for mode in Mode),
        ("3", ""),
    ]
    assert lines[2]["outcome_of_minimum"] == "win"
    assert lines[5]["outcome_of_minimum"] == "loss"
    assert lines[6]["compared"] == "no"


def test_a_result_is_read_back_as_it_was_written() -> None:
    assert decoded(encoded(RESULT), "it") == RESULT


@pytest.mark.parametrize("text", ["", "{}", "[]", "[" * 100_000, '{"modes": {"x": 1}}'])
def test_a_file_that_is_no_result_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^it is no result of this experiment: delete it\.$"):
        decoded(text, "it")


class _Tags(HTMLParser):
    """Checks that all elements are closed, and collects what could load or run something."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.suspicious: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = {name for name, _ in attrs}
        if tag in {"script", "a", "link", "img", "iframe"} or names & {"src", "href", "onclick"}:
            self.suspicious.append(tag)
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in {"line", "rect"}

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_the_page_is_whole_and_needs_nothing_else(report: ExperimentReport) -> None:
    page = report_page(report)
    tags = _Tags()
    tags.feed(page)
    assert tags.open == []
    assert tags.suspicious == []
    for text in ("106 of 125", "expr2", "it broke", "found 5", "Differences of zero"):
        assert text in page


def test_names_from_files_do_not_act_on_the_page(report: ExperimentReport) -> None:
    hostile = replace(
        RESULT,
        configuration=HOSTILE,
        subtrees=tuple(replace(one, shown=HOSTILE) for one in RESULT.subtrees),
    )
    page = report_page(report_of(SETTINGS, (hostile,), (Lost(HOSTILE, HOSTILE),), 1.0))
    tags = _Tags()
    tags.feed(page)
    assert (tags.open, tags.suspicious) == ([], [])
    assert "\x1b" not in page
    assert HOSTILE.replace("\x1b", "") in tags.texts


def test_a_page_can_be_made_where_nothing_differs() -> None:
    score = reached(3, 3)
    same = replace(
        RESULT,
        subtrees=(subtree(1, 0, 0, baseline=score, paper=score, default=score),),
        modes=dict.fromkeys(Mode, replace(mode_result(), agreement=None)),
        networkx=(),
    )
    report = report_of(SETTINGS, (same,), (), 1.0)
    assert "nowhere does BT-Espresso come nearer" in report_page(report)
    assert json.loads(report_json(report))["modes"]["paper"]["node_reduction"] is None


def test_a_histogram_leaves_no_group_between_its_ends_out() -> None:
    chart = histogram(
        [("one", [1, 1, 4]), ("other", [2])],
        int,
        str,
        title="t",
        x_label="x",
        y_label="y",
    )
    assert chart.groups == ("1", "2", "3", "4")
    assert chart.series == (Series("one", (2, 0, 0, 1)), Series("other", (0, 1, 0, 0)))


@pytest.mark.parametrize("most", [0, 1, 7, 60, 12345])
def test_bars_are_as_high_as_their_counts(most: int) -> None:
    chart = BarChart("t & u", ("a", "b"), (Series("<s>", (most, most // 2)),), "x", "y")
    root = ElementTree.fromstring(bar_chart_svg(chart))
    bars = [one for one in root.iter("rect") if one.find("title") is not None]
    heights = [float(one.attrib["height"]) for one in bars]
    assert len(heights) == sum(count > 0 for count in (most, most // 2))
    if len(heights) == 2:
        assert heights[1] / heights[0] == pytest.approx(most // 2 / most, abs=0.01)
