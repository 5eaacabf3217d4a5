"""Reaction time: how late a demonstrator acted, estimated from the demonstrations.

delay
    Rows between a decision and its action: the action of row t belongs to the state d rows earlier.
explanation
    A decision tree of the actions, and the rows that it gets wrong as exceptions (see
    `FittedTree.explanation`).

People act 0.1 to 0.5 s late.  At the true delay, actions follow from states by the demonstrator's
own rules.  At any other delay, a tree must account for what happened in between, so the explanation
is smallest at the true one.  All delays explain the same rows, with the same actions before them;
only the states differ.

A tree that may test the previous action relies on it, since actions are held, and so hardly notices
a delay.  A tree that may not cannot explain a task that needs memory.  So both are used (see
`estimate`).

In few demonstrations the action changes rarely, and explanations differ by one or two leaves and
exceptions.  Their length in bits then says more (see `shortest_description`): going when a bell has
rung takes one test of the bell, and going two rows later a position for each demonstration.

If several delays explain the rows equally well, borders distinguish them: a demonstrator who turns
at 10 does so only at the true delay, and at 9.37 one row later (see `border_bits`).
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

#: Reactions take up to 0.5 s; a minimum shows only if there is a later delay to compare with.
_LATEST = 0.6
#: Longest delay in rows if stamps are not times.
_MOST_ROWS = 6
#: A delay drops the first rows of each demonstration: at most this share of the median length.
_LOST = 1 / 3
#: Delays that are tried first; in between, only those around the best.
_FIRST_TRIALS = 8
#: Number of rows that are explained, and of stretches: all trials then cost about as much as one or
#: two fits to 20,000 rows.
_ROWS, _STRETCHES = 2_000, 10
#: States alone explain late actions only if the explanation is at most this many times as large as
#: that by states and previous actions without a delay, ...
_ALONE = 1.5
#: ... and only if the delay is less than half the time for which actions are held, with a margin: a
#: shuttle between two places turns half a run after passing the middle.
_MARGIN = 0.9
#: If previous actions reduce the explanation to this share, without a delay, a task needs
#: memory.  A delay of half a run or more then has to reduce it as much.
_MUCH_SIMPLER = 1 / 3
#: Hysteresis looks late too: a fan that starts at 25 degrees and runs until 22.  Previous actions
#: explain it with this many leaves per action: where it begins, and until when it is held.
_BEGUN_AND_HELD = 2
#: The explanation must be smaller by this many standard errors, and by this share.
_STANDARD_ERRORS, _SHARE = 1.0, 0.1
#: A description must be shorter by this many bits; by chance, one in a thousand is.
_BITS = 10.0
#: Descriptions that differ by no more bits are equally good; the delay is then short.
_EQUAL_BITS = 4.0
#: An explanation with more leaves and exceptions than this share of the rows explains nothing.
_LARGEST = 1 / 3
#: Borders are clearly rounder if they take this many bits less: one digit.
_ROUNDER = math.log2(10)

_WITH_PREVIOUS = Vocabulary(history=History.PREVIOUS)


@dataclass(frozen=True, slots=True)
class Trial:
    """The size of the explanation for a delay."""

    rows: int
    size: float
    """Leaves and exceptions, or bits."""


@dataclass(frozen=True, slots=True)
class ReactionTime:
    """How late a demonstrator acted."""

    rows: int
    """The delay in rows; 0 unless one is clear."""
    seconds: float | None
    """The delay in seconds; None if stamps are not times."""
    sentence: str
    """A sentence for people, without a full stop."""
    trials: tuple[Trial, ...] = ()
    """The trials that decided, by ascending delay; empty if nothing could be compared."""
    by_states_alone: bool = True
    """Whether these are explanations by states alone, without the previous action."""
    in_bits: bool = False
    """Whether sizes are in bits, instead of leaves and exceptions."""


def given(table: DemonstrationTable, seconds: float) -> ReactionTime:
    """A reaction time that the user gives.

    Raises:
        OptionError: The table's stamps are not times.
    """
    rows = rows_in(table, seconds)
    return ReactionTime(
        rows, seconds, f"actions are learned from {seconds:g} s ({rows} rows) before, as requested"
    )


def estimate(table: DemonstrationTable) -> ReactionTime:
    """How late the demonstrator acted, if that is clear.

    Delays up to 0.6 s (6 rows, if stamps are not times) are tried; the longest one only shows that
    sizes rise again.

    The best delay has the smallest explanation by states alone.  There are two exceptions, in which
    it has the smallest explanation by states and previous actions: if states alone explain much
    worse than states and previous actions without a delay, as in tasks that need memory; and if the
    delay is about half the time for which actions are held, or longer.

    - A shuttle between two places looks as if it turned in the middle, half a run late.  So if
      previous actions reduce the explanation to a third, without a delay, such a delay has to
      reduce it as much.
    - Starting at one border and continuing until another one looks late at a border between them.
      If previous actions explain this with two leaves per action, states alone have to do clearly
      better.
    - Of adjacent delays with equally small explanations, the middle one counts; if they extend to
      the longest delay, as when each state follows from the one before, the first one.  If the
      borders of another equally good delay are clearly rounder, that one counts.

    A delay is clear if its explanation is at most a third of the rows, and smaller than the one
    without a delay by a tenth and by a standard error (of counts a and b, the root of a + b).  If
    none is clear, the delay with the shortest description by states and previous actions is taken,
    if that is clear: less than half the time for which actions are held, and shorter than without a
    delay by ten bits, a tenth, and a standard error of the exceptions.

    Args:
        table: Samples of one channel, in whole demonstrations.

    Returns:
        A deterministic result, with delay 0 if there is nothing to compare.
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
            f"the demonstrator acted {late} late; actions are learned from when they were due"
        )
    return ReactionTime(rows, _seconds(rows, gap), sentence, trials, by_states_alone, in_bits)


_NOT_LATE = "no reaction time is found: actions are learned from when they were taken"


def _seconds(rows: int, gap: float | None) -> float | None:
    return None if gap is None else rows * gap


def _most(table: DemonstrationTable, gap: float | None) -> tuple[str, int]:
    """Why there is nothing to compare (empty if there is), and the longest delay to try."""
    if len(np.unique(table.chosen)) < 2:
        return "no reaction time can be found if the action is always the same", 0
    if not evenly_spaced(table):
        return "no reaction time can be found in rows that are not evenly spaced", 0
    lengths = np.diff(table.begins, append=len(table))
    enough = int(float(np.median(lengths)) * _LOST)
    # The tolerance keeps jitter from excluding the last delay.
    most = min(enough, _MOST_ROWS if gap is None else math.floor(_LATEST / gap + 0.1))
    if most < 2:
        short = "demonstrations are too short" if enough < 2 else "rows are too far apart"
        return f"no reaction time can be found: {short}", 0
    return "", most


class _Explanations:
    """Explanations of the same rows for several delays."""

    def __init__(self, table: DemonstrationTable, most: int) -> None:
        self._table = table
        self._most = most
        place, _ = places(table)
        # Rows whose state and previous action are known at every delay.
        self._rows = _stretches(np.flatnonzero(place >= most))
        self._half_a_run = _MARGIN * _half_a_run(table)
        self._trees: dict[tuple[int, Vocabulary], FittedTree] = {}

    def __len__(self) -> int:
        """Number of rows that are explained."""
        return len(self._rows)

    def clear(self, trials: Sequence[Trial]) -> int:
        """The delay that is clear, or 0.

        If the longest delay is the best, because half a run late hardly needs a border, it is the
        best of those shorter than half a run, if that reduces the explanation to a third.
        """
        if _peak(trials) is not trials[-1]:
            return _clear(trials, len(self))
        shorter = [one for one in trials if one.rows < max(self._half_a_run, 1)]
        much_simpler = _peak(shorter).size <= _MUCH_SIMPLER * trials[0].size
        return _clear(shorter, len(self)) if much_simpler else 0

    def described(self) -> tuple[int, tuple[Trial, ...]]:
        """The delay with the clearly shortest description by states and previous actions, or 0.

        Also returns the bits of the descriptions, by ascending delay.
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
            # If the longest delay is clearly better, descriptions may become even shorter after it.
            and trials[-1].size >= best.size - _BITS
        )
        return best.rows if clear else 0, trials

    def roundest(
        self, rows: int, trials: Sequence[Trial], by_states_alone: bool, in_bits: bool
    ) -> int:
        """The delay with the roundest borders among those that explain the rows as well.

        Args:
            rows: A clear delay, kept unless the borders of another one are clearly rounder.
            trials: The trials that found it.
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
        """The trials that decide, by ascending delay, and whether these are by states alone."""
        alone = Trial(0, self._size(0, FEATURES_ALONE))
        without_delay = self._fitted(0, _WITH_PREVIOUS)
        with_previous = Trial(0, without_delay.explanation)
        # Every action takes a leaf or an exception: no explanation is smaller.
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
            # Half a run late, a task that needs memory seems to need none, and mistakes weigh less:
            # once each, and not again as the previous action.
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
        """The rows that are explained, with the states of the given number of rows earlier."""
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
    """A limited number of the rows: long stretches from all over the table."""
    if len(rows) <= _ROWS:
        return rows
    length = _ROWS // _STRETCHES
    begins = np.linspace(0, len(rows) - length, _STRETCHES).astype(np.int64)
    return np.asarray(rows[(begins[:, None] + np.arange(length)).ravel()])


def _half_a_run(table: DemonstrationTable) -> float:
    """Rows from a place in between until a shuttle between two places turns.

    A shuttle that takes a rows there and b rows back passes one place ab / (a + b) rows before each
    end: half a run if both take equally long.  This is the mean over pairs of successive runs.
    Long runs count more, since single rows within a run may be mistakes.  Infinite without pairs.
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
    """The clear delay, or 0, given the number of explained rows."""
    without, best = trials[0], _peak(trials)
    # If the longest delay is the best, sizes may fall further after it.
    if best is trials[-1] or best.size > _LARGEST * explained:
        return 0
    gain = without.size - best.size
    least = max(_STANDARD_ERRORS * math.sqrt(without.size + best.size), _SHARE * without.size)
    return best.rows if gain >= least else 0


def _peak(trials: Sequence[Trial]) -> Trial:
    """The delay with the smallest explanation; see `estimate` for ties."""
    sizes = [trial.size for trial in trials]
    first = last = sizes.index(min(sizes))
    while last + 1 < len(sizes) and sizes[last + 1] == sizes[first]:
        last += 1
    ends = last + 1 == len(sizes)
    return trials[first if ends else (first + last) // 2]


def _shortest(trials: Sequence[Trial]) -> Trial:
    """The delay with the shortest description, except for the longest delay.

    Of equally good ones, it is the first, or the second of three or more: a border that is passed
    at constant speed still works one row too early or too late.
    """
    sizes = [trial.size for trial in trials]
    equal = min(sizes[:-1]) + _EQUAL_BITS
    first = next(place for place, size in enumerate(sizes) if size <= equal)
    three = first and first + 3 < len(sizes) and max(sizes[first + 1 : first + 3]) <= equal
    return trials[first + 1 if three else first]
