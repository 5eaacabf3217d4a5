"""Moments: rows that share a state, and what was done in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray, in_parts
from rebt_ros.demonstration.table import DemonstrationTable

#: Positions of actions, in the order in which they were done.
Word = tuple[int, ...]

#: Maximum number of moments, taken from all over the demonstrations.
_MOST_MOMENTS = 25_000


@dataclass(frozen=True, eq=False, slots=True)
class Moments:
    """What was done in which state.

    Consecutive rows in one state are a moment: nothing but the robot's own actions lies between
    them, so the actions of a moment were decided on the same state.
    """

    actions: tuple[str, ...]
    words: tuple[Word, ...]
    """The different words, by their number of rows, descending."""
    counts: IntArray
    """Number of moments with each word, shape (words,)."""
    word: IntArray
    """Position in `words` of the word of each moment, shape (moments,)."""
    states: FloatArray
    """State of each moment, shape (moments, features)."""

    def __len__(self) -> int:
        return len(self.word)

    @property
    def rows(self) -> int:
        """Number of actions in all moments."""
        return sum(
            len(word) * count for word, count in zip(self.words, self.counts.tolist(), strict=True)
        )


def moments(table: DemonstrationTable) -> Moments:
    """Gathers the rows of a table that share a state."""
    begins = np.ones(len(table), dtype=bool)
    if len(table) > 1:
        # Lagged features distinguish rows of one state.
        now = [place for place, feature in enumerate(table.features) if not feature.lag]
        alike: BoolArray = np.diff(table.demonstration) == 0
        if not now:
            # Without a state, only time distinguishes moments.
            alike &= np.diff(table.stamps) == 0
        for rows in in_parts(len(alike)):
            states = table.states[rows.start : rows.stop + 1]
            for column in now:
                after, before = states[1:, column], states[:-1, column]
                alike[rows] &= (after == before) | (np.isnan(after) & np.isnan(before))
        begins[1:] = ~alike
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(table))
    if len(first) > _MOST_MOMENTS:
        taken = np.linspace(0, len(first) - 1, _MOST_MOMENTS).astype(np.int64)
        first, last = first[taken], last[taken]
    counts: dict[Word, int] = {}
    found = []
    for begin, end in zip(first.tolist(), last.tolist(), strict=True):
        word = tuple(table.chosen[begin:end].tolist())
        counts[word] = counts.get(word, 0) + 1
        found.append(word)
    words = sorted(counts, key=lambda word: (-len(word) * counts[word], word))
    place = {word: number for number, word in enumerate(words)}
    return Moments(
        table.actions,
        tuple(words),
        np.array([counts[word] for word in words], dtype=np.int64),
        np.array([place[word] for word in found], dtype=np.int64),
        table.states[first],
    )
