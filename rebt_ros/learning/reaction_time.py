"""Reaction time: how late a demonstrator acted, read off the demonstrations, and undone.

delay
    Rows that pass until a decision is acted on: row t's action belongs to the state d rows before.
explanation
    A decision tree of actions, with the rows that it gets wrong as exceptions (see
    `FittedTree.explanation`).

People act 0.1 to 0.5 s late.  At the true delay, actions follow from states by the demonstrator's
own rules; at any other one, a tree must make up for what happened in between.  So its explanation
is the smallest there.  All delays explain the same rows, with the same actions before them: only
the states that they belong to differ.

A tree that may test the previous action leans on it, as actions are held, and then hardly sees a
delay; one that may not cannot explain a task that needs memory.  So both are asked (see
`estimate`).

Few demonstrations have few changes of action, so that explanations differ by one or two leaves and
exceptions.  Then it tells more how many bits they take (see `shortest_description`): who goes when
a bell has rung is described by one test of the bell, and who goes two rows later by a position for
each demonstration.

Where several delays explain the rows equally well, borders tell them apart: who turns at 10 does so
at the true delay only, and a row later at 9.37 (see `border_bits`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.decision_tree.description_length import (
    Description,
    border_bits,
    shortest_description,
)
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.lags import evenly_spaced
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.late_actions import places, row_gap, rows_in

#: Reactions take up to 0.5 s; a peak is seen only where there is a later delay to compare with.
_LATEST = 0.6
#: Delays up to that many rows are tried where stamps tell no time.
_MOST_ROWS = 6
#: Delays lose the first rows of each demonstration: at most this share of the usual one.
_LOST = 1 / 3
#: Delays that are tried at first; between them, only those around the best are.
_FIRST_TRIALS = 8
#: Rows that are explained, in so many stretches: as many fits as there are trials then cost about
#: as much as one or two to 20,000 rows.
_ROWS, _STRETCHES = 2_000, 10
#: States alone explain late actions only if that takes at most so many times what states with
#: previous actions take to explain actions that are not late.
_ALONE = 1.5
#: ... and if the delay is less than half of the time for which an action is held, with a margin.
#: Who goes to and fro between two places turns round half a run after passing the middle.
_MARGIN = 0.9
#: Where previous actions bring the explanation to this share, without a delay, a task needs memory;
#: then a delay of half a run or more has to do as much.
_MUCH_SIMPLER = 1 / 3
#: Who goes on until something is over looks late, too: a fan that starts at 25 degrees and runs
#: until it is 22.  Previous actions explain that with so many leaves for each action: where it
#: begins, and until when it is held.
_BEGUN_AND_HELD = 2
#: The explanation must be smaller by that many standard errors, and by that share.
_STANDARD_ERRORS, _SHARE = 1.0, 0.1
#: A description must be shorter by so many bits: by chance, one of a thousand is.
_BITS = 10.0
#: Descriptions whose lengths differ by no more bits are equally good; then the delay is short.
_EQUAL_BITS = 4.0
#: What takes a leaf or an exception for more than this share of the rows explains nothing.
_LARGEST = 1 / 3
#: Borders are clearly rounder if it takes so many bits less to say them: a digit.
_ROUNDER = math.log2(10)

_WITH_PREVIOUS = Vocabulary(history=History.PREVIOUS)


@dataclass(frozen=True, slots=True)
class Trial:
    """How long the explanation is if the demonstrator was late by so many rows."""

    rows: int
    size: float
    """Leaves and exceptions; or bits."""


@dataclass(frozen=True, slots=True)
class ReactionTime:
    """How late a demonstrator acted."""

    rows: int
    """The delay; 0 unless one is clear."""
    seconds: float | None
    """The same in seconds; None where stamps tell no time."""
    sentence: str
    """What to tell a person; without a full stop."""
    trials: tuple[Trial, ...] = ()
    """What decided, by ascending delay; empty where nothing could be compared."""
    by_states_alone: bool = True
    """Whether these are explanations by states alone; else the previous action is tested, too."""
    in_bits: bool = False
    """Whether sizes are in bits, instead of leaves and exceptions."""


def given(table: DemonstrationTable, seconds: float) -> ReactionTime:
    """A reaction time that a person says.

    Raises:
        OptionError: The table's stamps tell no time.
    """
    rows = rows_in(table, seconds)
    return ReactionTime(
        rows, seconds, f"actions are learned as of {seconds:g} s ({rows} rows) before, as asked"
    )


def estimate(table: DemonstrationTable) -> ReactionTime:
    """How late the demonstrator acted, where that is clear.

    Delays up to 0.6 s (6 rows, where stamps tell no time) are tried; the longest one only shows
    that sizes rise again.  It takes the delay with the smallest explanation by states alone, unless
    that is much larger than the one by states and previous actions without a delay, or the delay is
    about half of the time for which actions are held, or longer: then it takes the delay with the
    smallest explanation by states and previous actions.  For a task that needs memory is hardly
    explained by states alone; but who goes to and fro between two places looks as if the middle
    told when to turn round, half a way late.  So where previous actions bring the explanation to a
    third, without a delay, such a delay is only taken if it does as much.  And who starts something
    at one border and goes on until another one looks as if late at a border between them: where
    previous actions explain that with two leaves for each action, states alone have to do clearly
    better than that.  Of neighbors that are equally small it is the one in the middle; if they
    reach to the longest delay, as where each state follows from the one before, the first of them;
    but if the borders of another one that is as small are clearly rounder, it is that.

    A delay is clear if its explanation is not larger than a third of the rows, and smaller than the
    one without a delay by a tenth and by a standard error, where sizes are counts: of a and b, the
    standard error is the root of a + b.  Where none is clear, it takes the delay with the shortest
    description by states and previous actions, if that is clear: less than half of the time for
    which actions are held, and shorter than without a delay by ten bits, a tenth, and a standard
    error of the exceptions.

    Args:
        table: Samples of one channel, in whole demonstrations.

    Returns:
        Deterministic; a delay of 0 where there is nothing to compare.
    """
    gap = row_gap(table)
    why_not, most = _most(table, gap)
    if why_not:
        return ReactionTime(0, _seconds(0, gap), why_not)
    explanations = _Explanations(table, most)
    trials, by_states_alone = explanations.trials()
    rows, in_bits = explanations.clear(trials), False
    if not rows and len(trials) > 1:
        rows, described = explanations.described()
        in_bits = rows > 0
        if in_bits:
            trials, by_states_alone = described, False
    sentence = _NOT_LATE
    if rows:
        rows = explanations.roundest(rows, trials, by_states_alone, in_bits)
        seconds = _seconds(rows, gap)
        counted = f"{rows} row{'s' * (rows > 1)}"
        late = counted if seconds is None else f"{seconds:.2f} s ({counted})"
        sentence = (
            f"the demonstrator acted {late} late; actions are learned as of when they were due"
        )
    return ReactionTime(rows, _seconds(rows, gap), sentence, trials, by_states_alone, in_bits)


_NOT_LATE = "no reaction time shows: actions are learned as of when they were taken"


def _seconds(rows: int, gap: float | None) -> float | None:
    return None if gap is None else rows * gap


def _most(table: DemonstrationTable, gap: float | None) -> tuple[str, int]:
    """Why there is nothing to compare, or nothing; and the longest delay to try."""
    if len(np.unique(table.chosen)) < 2:
        return "no reaction time shows where one action is taken all the time", 0
    if not evenly_spaced(table):
        return "no reaction time can be read off rows that are not evenly spaced", 0
    lengths = np.unique(table.demonstration, return_counts=True)[1]
    enough = int(float(np.median(lengths)) * _LOST)
    # The tolerance keeps jitter from leaving out the last delay.
    most = min(enough, _MOST_ROWS if gap is None else math.floor(_LATEST / gap + 0.1))
    if most < 2:
        short = "demonstrations are too short" if enough < 2 else "rows are too far apart"
        return f"no reaction time can be told: {short}", 0
    return "", most


class _Explanations:
    """Explanations of the same rows with several delays."""

    def __init__(self, table: DemonstrationTable, most: int) -> None:
        self._table = table
        self._most = most
        place, _ = places(table)
        # Rows whose state and previous action are known whatever the delay is.
        self._rows = _stretches(np.flatnonzero(place >= most))
        self._half_a_run = _MARGIN * _half_a_run(table)
        self._trees: dict[tuple[int, Vocabulary], FittedTree] = {}

    def __len__(self) -> int:
        """Rows that are explained."""
        return len(self._rows)

    def clear(self, trials: Sequence[Trial]) -> int:
        """The delay that is clear, or 0.

        Where the longest one is the best, as half a run late hardly a border is needed any more, it
        is that of those shorter than half a run, if it brings the explanation to a third.
        """
        if _peak(trials) is not trials[-1]:
            return _clear(trials, len(self))
        shorter = [one for one in trials if one.rows < max(self._half_a_run, 1)]
        much_simpler = _peak(shorter).size <= _MUCH_SIMPLER * trials[0].size
        return _clear(shorter, len(self)) if much_simpler else 0

    def described(self) -> tuple[int, tuple[Trial, ...]]:
        """The delay at which states and previous actions describe the rows clearly best, or 0.

        And the bits that descriptions take, by ascending delay.
        """
        made: dict[int, Description] = {}

        def bits(delay: int) -> float:
            made[delay] = shortest_description(self._fitted(delay, _WITH_PREVIOUS))
            return made[delay].bits

        trials = self._around(Trial(0, bits(0)), bits)
        best = _shortest(trials)
        before, after = made[0], made[best.rows]
        wrong = math.sqrt(before.exceptions + after.exceptions)
        least = max(_BITS, _SHARE * before.bits, _STANDARD_ERRORS * wrong * before.exception_bits)
        named_one_by_one = len(self) * math.log2(len(np.unique(self._table.chosen[self._rows])))
        clear = (
            before.bits - after.bits >= least
            and after.bits <= _LARGEST * named_one_by_one
            and best.rows < self._half_a_run
            # Where the longest delay is clearly better, descriptions may go on to become shorter.
            and trials[-1].size >= best.size - _BITS
        )
        return best.rows if clear else 0, trials

    def roundest(
        self, rows: int, trials: Sequence[Trial], by_states_alone: bool, in_bits: bool
    ) -> int:
        """Of the delays that explain the rows as well, the one with the roundest borders.

        Args:
            rows: A clear delay, kept unless the borders of another one are clearly rounder.
            trials: What it was found by.
            by_states_alone: Whether the previous action was not tested.
            in_bits: Whether their sizes are in bits.
        """
        vocabulary = FEATURES_ALONE if by_states_alone else _WITH_PREVIOUS
        sizes = {one.rows: one.size for one in trials}
        most = sizes[rows] + (_EQUAL_BITS if in_bits else 0)

        def explains(delay: int) -> bool:
            if delay not in sizes:
                fitted = self._fitted(delay, vocabulary)
                sizes[delay] = shortest_description(fitted).bits if in_bits else fitted.explanation
            return sizes[delay] <= most

        tried = [delay for delay in sizes if 0 < delay < self._most and explains(delay)]
        near = max(rows - _FIRST_TRIALS, 1), min(rows + _FIRST_TRIALS, self._most)
        earlier = takewhile(explains, range(rows - 1, near[0] - 1, -1))
        later = takewhile(explains, range(rows + 1, near[1]))
        bits: dict[int, float] = {}
        for delay in sorted({*tried, *earlier, *later}):
            late = self._late(delay)
            explained = self._fitted(delay, vocabulary).readable_explained(late)
            bits[delay] = border_bits(explained.tree, late)
        best = min(bits, key=lambda delay: (bits[delay], abs(delay - rows)))
        return best if bits[best] <= bits[rows] - _ROUNDER else rows

    def trials(self) -> tuple[tuple[Trial, ...], bool]:
        """What decides, by ascending delay, and whether it is about states alone."""
        alone = Trial(0, self._size(0, FEATURES_ALONE))
        without_delay = self._fitted(0, _WITH_PREVIOUS)
        with_previous = Trial(0, without_delay.explanation)
        # Every action takes a leaf or an exception: nothing can be smaller than that.
        least = len(np.unique(self._table.chosen[self._rows]))
        for one in (alone, with_previous):
            if one.size == least:
                return (one,), one is alone
        trials = self._around(alone, lambda delay: self._size(delay, FEATURES_ALONE))
        best = _peak(trials)
        held = without_delay.explaining_leaves <= _BEGUN_AND_HELD * least
        needs_memory = held and not _clear((with_previous, *trials[1:]), len(self))
        tells = best.rows < self._half_a_run and best.size <= _ALONE * with_previous.size
        if tells and not (_clear(trials, len(self)) and needs_memory):
            return trials, True
        trials = self._around(with_previous, lambda delay: self._size(delay, _WITH_PREVIOUS))
        much_simpler = _peak(trials).size <= _MUCH_SIMPLER * with_previous.size
        if with_previous.size <= _MUCH_SIMPLER * alone.size and not much_simpler:
            # Half a way late, a task that needs memory seems to need none, and mistakes weigh less:
            # once each, and not again where they are the previous action.
            trials = tuple(one for one in trials if one.rows < max(self._half_a_run, 1))
        return trials, False

    def _around(self, without: Trial, size: Callable[[int], float]) -> tuple[Trial, ...]:
        """Delays from all over the range, then closer and closer ones around the best."""
        step = math.ceil(self._most / _FIRST_TRIALS)
        delays = set(range(step, self._most + 1, step))
        made = {0: without}
        while True:
            for delay in sorted(delays - set(made)):
                made[delay] = Trial(delay, size(delay))
            trials = tuple(made[delay] for delay in sorted(made))
            if step == 1:
                return trials
            step = math.ceil(step / 2)
            best = _peak(trials).rows
            delays = {max(best - step, 0), min(best + step, self._most)}

    def _size(self, delay: int, vocabulary: Vocabulary) -> int:
        return self._fitted(delay, vocabulary).explanation

    def _fitted(self, delay: int, vocabulary: Vocabulary) -> FittedTree:
        if (delay, vocabulary) not in self._trees:
            self._trees[delay, vocabulary] = self._fit(delay, vocabulary)
        return self._trees[delay, vocabulary]

    def _fit(self, delay: int, vocabulary: Vocabulary) -> FittedTree:
        return fit(self._late(delay), FitOptions(vocabulary=vocabulary))

    def _late(self, delay: int) -> DemonstrationTable:
        """The rows that are explained, with the states of so many rows before."""
        table, rows = self._table, self._rows
        return replace(
            table,
            states=table.states[rows - delay],
            chosen=table.chosen[rows],
            demonstration=table.demonstration[rows],
            stamps=table.stamps[rows - delay],
            before=None,
            previous=table.previous[rows],
        )


def _stretches(rows: IntArray) -> IntArray:
    """Not too many of the rows: long stretches from everywhere."""
    if len(rows) <= _ROWS:
        return rows
    length = _ROWS // _STRETCHES
    begins = np.linspace(0, len(rows) - length, _STRETCHES).astype(np.int64)
    return np.asarray(rows[(begins[:, None] + np.arange(length)).ravel()])


def _half_a_run(table: DemonstrationTable) -> float:
    """Rows after which someone who goes to and fro turns round, from the place in between.

    Who takes a rows there and b rows back passes one place ab / (a + b) rows before each end: half
    a run, where both take as long.  The mean over pairs of successive runs; long ones count more,
    as single rows within a run may be mistakes.  Infinite where there are no such pairs.
    """
    begins = np.flatnonzero(table.previous != table.chosen)
    runs = np.diff(np.append(begins, len(table))).astype(np.float64)
    together = table.demonstration[begins[1:]] == table.demonstration[begins[:-1]]
    there, back = runs[:-1][together], runs[1:][together]
    weights = there * back
    if not len(weights):
        return math.inf
    return float(np.sum(weights * weights / (there + back)) / np.sum(weights))


def _clear(trials: Sequence[Trial], explained: int) -> int:
    """The delay that is clear, or 0, where so many rows are explained."""
    without, best = trials[0], _peak(trials)
    # Where the longest delay is the best, sizes may go on to fall.
    if best is trials[-1] or best.size > _LARGEST * explained:
        return 0
    gain = without.size - best.size
    least = max(_STANDARD_ERRORS * math.sqrt(without.size + best.size), _SHARE * without.size)
    return best.rows if gain >= least else 0


def _peak(trials: Sequence[Trial]) -> Trial:
    """The delay with the smallest explanation; of equal neighbors, see `estimate`."""
    sizes = [trial.size for trial in trials]
    first = last = sizes.index(min(sizes))
    while last + 1 < len(sizes) and sizes[last + 1] == sizes[first]:
        last += 1
    ends = last + 1 == len(sizes)
    return trials[first if ends else (first + last) // 2]


def _shortest(trials: Sequence[Trial]) -> Trial:
    """The delay with the shortest description, of all but the longest delay.

    Of such that are equally good it is the first, or the second of three or more: a border that is
    passed at one speed is still one a row too early or too late.
    """
    sizes = [trial.size for trial in trials]
    equal = min(sizes[:-1]) + _EQUAL_BITS
    first = next(place for place, size in enumerate(sizes) if size <= equal)
    three = first and first + 3 < len(sizes) and max(sizes[first + 1 : first + 3]) <= equal
    return trials[first + 1 if three else first]
