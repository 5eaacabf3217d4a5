"""The words of moments as a tree of their prefixes, which are read all at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rebt_ros.arrays import Float32Array, FloatArray, IntArray
from rebt_ros.beyond_the_paper.routines.moments import Moments, Word

#: Number of different words that are read: those with the most rows.
_MOST_WORDS = 120
#: Number of actions of a word that are read.
LONGEST_WORD = 9
#: Minimum share of an action's rows, which keeps noise by rare actions from being too improbable.
_LEAST_SHARE = 0.001


class TrieLevel(NamedTuple):
    """The prefixes of one length."""

    parent: IntArray
    """Position of the prefix without its last action on the level before, shape (n,)."""
    action: IntArray
    """The last action, shape (n,)."""
    ended: FloatArray
    """Moments whose word ends there, shape (n,)."""
    cut: FloatArray
    """Moments whose word continues, but is read no further, shape (n,)."""
    noise: Float32Array
    """Share of the last action, its probability as noise, shape (n,)."""
    children: Float32Array
    """Which of them extend each prefix of the level before, 0 or 1, shape (n before, n)."""


@dataclass(frozen=True, eq=False, slots=True)
class Corpus:
    """The most frequent words."""

    actions: int
    levels: tuple[TrieLevel, ...]
    moments: float
    """Number of moments with these words."""
    rows: float
    """Number of their actions that are read."""
    followers: FloatArray
    """How often an action follows another, shape (actions, actions)."""
    share: FloatArray
    """Share of each action, shape (actions,)."""
    continues: float
    """Share of actions that another one follows in the same moment."""


def corpus(moments: Moments) -> Corpus:
    """Reads the words of moments.

    Args:
        moments: At least one.
    """
    read: dict[Word, list[float]] = {}
    actions = len(moments.actions)
    followers, seen = np.zeros((actions, actions)), np.ones(actions)
    words = moments.words[:_MOST_WORDS]
    for word, count in zip(words, moments.counts.tolist(), strict=False):
        read.setdefault(word[:LONGEST_WORD], [0.0, 0.0])[len(word) > LONGEST_WORD] += count
        np.add.at(seen, list(word), count)
        np.add.at(followers, (list(word[:-1]), list(word[1:])), count)
    share = np.maximum(seen / seen.sum(), _LEAST_SHARE)
    return Corpus(
        actions,
        tuple(_levels(read, share)),
        sum(map(sum, read.values())),
        sum(len(word) * sum(counts) for word, counts in read.items()),
        followers,
        share,
        float(followers.sum() / (seen.sum() - actions)),
    )


def _levels(read: dict[Word, list[float]], share: FloatArray) -> list[TrieLevel]:
    levels = []
    before: dict[Word, int] = {(): 0}
    for length in range(1, max(map(len, read)) + 1):
        here = list(dict.fromkeys(word[:length] for word in read if len(word) >= length))
        ends = np.array([read.get(word, [0.0, 0.0]) for word in here])
        parent = np.array([before[word[:-1]] for word in here], dtype=np.int64)
        action = np.array([word[-1] for word in here], dtype=np.int64)
        children = np.zeros((len(before), len(here)), np.float32)
        children[parent, np.arange(len(here))] = 1
        levels.append(
            TrieLevel(
                parent, action, ends[:, 0], ends[:, 1], share[action].astype(np.float32), children
            )
        )
        before = {word: place for place, word in enumerate(here)}
    return levels
