"""Moments: the rows that share one state, and what was done in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray, in_parts
from rebt_ros.demonstration.table import DemonstrationTable

#: Positions of actions in the order in which they were done.
Word = tuple[int, ...]

#: Moments that are looked at; of more, as many are taken from all over the demonstrations.
_MOST_MOMENTS = 25_000


@dataclass(frozen=True, eq=False, slots=True)
class Moments:
    """What was done in which state.

    Rows that follow each other in one state are one moment: nothing but the robot's own doing lies
    between them, so that what stands in one moment was decided on one and the same state.
    """

    actions: tuple[str, ...]
    words: tuple[Word, ...]
    """The different words, the one with the most rows first."""
    counts: IntArray
    """How many moments have each word, shape (words,)."""
    word: IntArray
    """Position in `words` of each moment's word, shape (moments,)."""
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
    """Gathers the rows of a table that share one state."""
    begins = np.ones(len(table), dtype=bool)
    if len(table) > 1:
        # What was before tells rows of one state apart.
        now = [place for place, feature in enumerate(table.features) if not feature.lag]
        alike: BoolArray = np.diff(table.demonstration) == 0
        if not now:
            # Without a state there is but the time to tell moments apart.
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
