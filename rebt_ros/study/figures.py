"""The figures of an experiment: what all results of a mode come to, against BT-Espresso."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import mean, median
from typing import Literal

from rebt_ros.study.mode import Mode
from rebt_ros.study.reduction import Reductions
from rebt_ros.study.results import ConfigurationResult, LevelSizes, Score, SubtreeResult


@dataclass(frozen=True, slots=True)
class Contest:
    """How often a mode came nearer than the baseline, as near, and less near."""

    wins: int
    ties: int
    losses: int

    @classmethod
    def of(cls, differences: Sequence[float]) -> Contest:
        """The contest in which the baseline's distance is larger by these."""
        wins = sum(difference > 0 for difference in differences)
        losses = sum(difference < 0 for difference in differences)
        return cls(wins, len(differences) - wins - losses, losses)


@dataclass(frozen=True, slots=True)
class Share:
    """So many of so many."""

    count: int
    total: int


@dataclass(frozen=True, slots=True)
class Loss:
    """A simulated subtree to which the baseline comes nearer."""

    configuration: str
    subtree: int
    statistic: str
    """``minimum`` or ``median``."""
    distance: float
    baseline: float
    shown: str
    """What was simulated."""
    found: str
    """The mode's minimum-scoring subtree."""
    baseline_found: str


@dataclass(frozen=True, slots=True)
class Spread:
    """Median and maximum over all pruning levels."""

    median: float
    maximum: int

    @classmethod
    def of(cls, counts: Sequence[int]) -> Spread:
        """Of at least one level."""
        return cls(median(counts), max(counts))


@dataclass(frozen=True, slots=True)
class ModeFigures:
    """The figures of one mode."""

    subtrees: int
    """Simulated subtrees that were compared."""
    minimum: Contest
    median: Contest
    mean_minimum: float
    """Mean over the subtrees of their minimum distance."""
    mean_median: float
    exact: int
    """Subtrees whose minimum is 0."""
    proven: int
    """Subtrees whose minimum is known to be the exact graph edit distance."""
    repeater: Share
    """Of the subtrees with a Repeater, those whose minimum-scoring subtree has one."""
    psa: Share
    """Of the subtrees with PSA nodes, those whose minimum-scoring subtree has as many."""
    psa_of_all: Share
    """The same of all subtrees, those without PSA nodes among them."""
    reductions: Reductions | None
    """None where no decision tree decides anything."""
    with_inverters: Reductions | None
    """The same, Inverters counted."""
    mismatches: int
    """Rows on which these trees do not what their decision trees do."""
    trees: int
    """Trees whose size was compared."""
    subtrees_offered: Spread
    """Generated subtrees per pruning level."""
    suggestions_offered: Spread
    agreement: Share
    """Rows held out on which the main trees agree with the demonstration, own history."""
    losses: tuple[Loss, ...]


@dataclass(frozen=True, slots=True)
class Measured:
    """How the measure of record did its work, and how it compares to the paper's."""

    compared: int
    excluded: int
    measured: int
    exact_minima: Share
    """Minima known to be exact, of all modes and subtrees."""
    exact_levels: Share
    """The same of the scores of all pruning levels."""
    networkx_tried: int
    networkx_missed: int
    """Pairs that networkx needed too long for."""
    at_most_networkx: Share
    """Where it did not: pairs whose distance is at most networkx's."""


@dataclass(frozen=True, slots=True)
class Difference:
    """By how much a mode comes nearer than the baseline, for the plots."""

    minimum: float
    median: float


def usable(results: Sequence[ConfigurationResult]) -> list[tuple[str, SubtreeResult]]:
    """The simulated subtrees that were compared, with the names of their configurations."""
    return [
        (result.configuration, subtree)
        for result in results
        for subtree in result.subtrees
        if subtree.usable
    ]


def differences(results: Sequence[ConfigurationResult], mode: Mode) -> list[Difference]:
    """Baseline's distances minus the mode's, for each subtree that was compared."""
    return [
        Difference(
            subtree.scores[Mode.BASELINE].minimum - subtree.scores[mode].minimum,
            subtree.scores[Mode.BASELINE].median - subtree.scores[mode].median,
        )
        for _, subtree in usable(results)
    ]


def reductions(results: Sequence[ConfigurationResult], mode: Mode) -> list[float]:
    """Per cent of nodes that are gone, for each tree whose size was compared."""
    return [size.reduction for result in results for size in result.modes[mode].sizes]


def _with_inverters(results: Sequence[ConfigurationResult], mode: Mode) -> list[float]:
    return [size.reduction_as_emitted for result in results for size in result.modes[mode].sizes]


def mode_figures(results: Sequence[ConfigurationResult], mode: Mode) -> ModeFigures:
    """The figures of a mode.

    Args:
        results: At least one, with at least one subtree that was compared.
        mode: Which one.
    """
    subtrees = [subtree for _, subtree in usable(results)]
    scores = [subtree.scores[mode] for subtree in subtrees]
    apart = differences(results, mode)
    reduced = reductions(results, mode)
    levels = [level for result in results for level in result.modes[mode].offered]
    right_psa = [
        (subtree.psa > 0, subtree.psa == score.psa)
        for subtree, score in zip(subtrees, scores, strict=True)
    ]
    return ModeFigures(
        subtrees=len(subtrees),
        minimum=Contest.of([one.minimum for one in apart]),
        median=Contest.of([one.median for one in apart]),
        mean_minimum=round(mean(score.minimum for score in scores), 3),
        mean_median=round(mean(score.median for score in scores), 3),
        exact=sum(score.minimum == 0 for score in scores),
        proven=sum(map(_proven, scores)),
        repeater=_share(
            score.repeaters > 0
            for subtree, score in zip(subtrees, scores, strict=True)
            if subtree.repeaters
        ),
        psa=_share(right for has_psa, right in right_psa if has_psa),
        psa_of_all=_share(right for _, right in right_psa),
        reductions=Reductions.of(reduced) if reduced else None,
        with_inverters=Reductions.of(_with_inverters(results, mode)) if reduced else None,
        mismatches=sum(result.modes[mode].mismatches for result in results),
        trees=len(reduced),
        subtrees_offered=_spread(levels, "subtrees"),
        suggestions_offered=_spread(levels, "suggestions"),
        agreement=_agreement(results, mode),
        losses=tuple(_losses(results, mode)),
    )


def measured(results: Sequence[ConfigurationResult]) -> Measured:
    """How the measure did in all results."""
    scores = [score for _, subtree in usable(results) for score in subtree.scores.values()]
    tried = [pair for result in results for pair in result.networkx]
    finished = [(pair.upper, pair.networkx) for pair in tried if pair.networkx is not None]
    return Measured(
        compared=sum(result.pairs.compared for result in results),
        excluded=sum(result.pairs.excluded for result in results),
        measured=sum(result.pairs.measured for result in results),
        exact_minima=_share(map(_proven, scores)),
        exact_levels=Share(
            sum(score.exact_levels for score in scores), sum(score.levels for score in scores)
        ),
        networkx_tried=len(tried),
        networkx_missed=len(tried) - len(finished),
        at_most_networkx=_share(upper <= distance for upper, distance in finished),
    )


def _proven(score: Score) -> bool:
    return score.minimum == score.minimum_at_least


def _share(holds: Iterable[bool]) -> Share:
    each = list(holds)
    return Share(sum(each), len(each))


def _spread(levels: Sequence[LevelSizes], what: Literal["subtrees", "suggestions"]) -> Spread:
    return Spread.of([getattr(level, what) for level in levels])


def _agreement(results: Sequence[ConfigurationResult], mode: Mode) -> Share:
    found = [one for result in results if (one := result.modes[mode].agreement) is not None]
    return Share(sum(one.right for one in found), sum(one.rows for one in found))


def _losses(results: Sequence[ConfigurationResult], mode: Mode) -> Iterator[Loss]:
    for configuration, subtree in usable(results):
        score, baseline = subtree.scores[mode], subtree.scores[Mode.BASELINE]
        for statistic, distance, other in (
            ("minimum", score.minimum, baseline.minimum),
            ("median", score.median, baseline.median),
        ):
            if distance > other:
                yield Loss(
                    configuration,
                    subtree.number,
                    statistic,
                    distance,
                    other,
                    subtree.shown,
                    score.found,
                    baseline.found,
                )
