"""Successive halving: who drives next, and who goes on (Karnin, Koren and Somekh, 2013).

All candidates drive a few episodes; the better half goes on; those drive as many again, and so on,
until the last ones have driven all episodes.  It is deterministic and fair: all that are compared
have driven the same number of episodes, with the same numbers, in turns, so that a world that
changes in the course of a day changes for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rebt_ros.errors import OptionError
from rebt_ros.trial.tally import Tally

#: So few episodes tell too little to send anybody home.
FEWEST_EPISODES: Final = 5
MOST_EPISODES: Final = 100_000

#: The last round is a comparison.
_FINALISTS: Final = 2


@dataclass(frozen=True, slots=True)
class Turn:
    """What comes next."""

    candidate: int
    episode: int
    """Its number, from 0."""
    round: int
    """From 0."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How a candidate stands."""

    candidate: int
    tally: Tally
    round: int
    """The last one that it took part in, from 0."""


def rounds_of(episodes: int) -> tuple[int, ...]:
    """How many episodes each of those that are left has driven after each round.

    Args:
        episodes: Of each of the last ones, in all.

    Raises:
        OptionError: There are none, or too many.
    """
    if not 1 <= episodes <= MOST_EPISODES:
        raise OptionError(f"episodes must be 1 to {MOST_EPISODES}, not {episodes}.")
    rounds = [episodes]
    while (half := (rounds[0] + 1) // 2) >= FEWEST_EPISODES:
        rounds.insert(0, half)
    return tuple(rounds)


def places(candidates: int, rounds_left: int) -> int:
    """How many candidates may go on at most.

    The better half, but two at least, and not fewer than later halvings bring down to two.

    Args:
        candidates: How many there are.
        rounds_left: How many rounds come after the one that has ended, at least 1.
    """
    halvings_to_come = rounds_left - 1
    return min(candidates, max((candidates + 1) // 2, _FINALISTS << halvings_to_come))


def ranked(tallies: Sequence[Tally], sizes: Sequence[int]) -> tuple[int, ...]:
    """Candidates from best to worst: by their share of successes; of equals, the smaller first."""
    return tuple(sorted(range(len(tallies)), key=lambda one: (-_share(tallies[one]), sizes[one])))


def going_on(tallies: Sequence[Tally], sizes: Sequence[int], rounds_left: int) -> tuple[int, ...]:
    """Who takes part in the next round, in the order in which they were given.

    Those leave that are worse than the best, and not only by chance; of the others, all but the
    better half (see `places`).

    Args:
        tallies: Of all that drove in the round that has ended; at least one.
        sizes: Nodes of their trees.
        rounds_left: How many rounds come after it, at least 1.
    """
    order = ranked(tallies, sizes)
    best = tallies[order[0]]
    hopeful = [one for one in order if not best.surely_above(tallies[one])]
    return tuple(sorted(hopeful[: places(len(hopeful), rounds_left)]))


class Trial:
    """A trial under way: asks for one episode after the other and is told how each went.

    Args:
        sizes: Nodes of the candidates' trees; at least one.
        episodes: What each of the last candidates drives in all.

    Raises:
        OptionError: There are no candidates, or as of `rounds_of`.
    """

    def __init__(self, sizes: Sequence[int], episodes: int) -> None:
        if not sizes:
            raise OptionError("there is no candidate: name a tree.")
        self.rounds = rounds_of(episodes)
        self._sizes = tuple(sizes)
        self._successes = [0] * len(sizes)
        self._episodes = [0] * len(sizes)
        self._last_round = [0] * len(sizes)
        self._round = 0
        self._taking_part: tuple[int, ...] = tuple(range(len(sizes)))

    @property
    def turn(self) -> Turn | None:
        """Who drives next; None when the trial is over."""
        # The first of those who have driven least.
        candidate = min(self._taking_part, key=lambda one: self._episodes[one])
        episode = self._episodes[candidate]
        if episode == self.rounds[-1]:
            return None
        return Turn(candidate, episode, self._round)

    def note(self, *, success: bool) -> None:
        """Takes down how the episode of `turn` went.

        Raises:
            ValueError: The trial is over.
        """
        turn = self.turn
        if turn is None:
            raise ValueError("the trial is over")
        self._episodes[turn.candidate] += 1
        self._successes[turn.candidate] += success
        if all(self._episodes[one] == self.rounds[self._round] for one in self._taking_part):
            self._end_round()

    @property
    def driven(self) -> int:
        """Episodes so far."""
        return sum(self._episodes)

    @property
    def most_left(self) -> int:
        """Episodes that are to come at most; fewer where a candidate proves hopeless."""
        after = self.rounds[self._round]
        left = sum(after - self._episodes[one] for one in self._taking_part)
        count = len(self._taking_part)
        for number in range(self._round + 1, len(self.rounds)):
            count = places(count, len(self.rounds) - number)
            left += count * (self.rounds[number] - self.rounds[number - 1])
        return left

    @property
    def standings(self) -> tuple[Standing, ...]:
        """All candidates from best to worst: who left later, then as of `ranked`."""
        order = ranked([self._tally(one) for one in range(len(self._sizes))], self._sizes)
        standings = [Standing(one, self._tally(one), self._last_round[one]) for one in order]
        return tuple(sorted(standings, key=lambda standing: -standing.round))

    @property
    def winner(self) -> int | None:
        """The best of the last round; None while the trial goes on."""
        return self.standings[0].candidate if self.turn is None else None

    def _end_round(self) -> None:
        rounds_left = len(self.rounds) - 1 - self._round
        if not rounds_left:
            return
        tallies = [self._tally(one) for one in self._taking_part]
        sizes = [self._sizes[one] for one in self._taking_part]
        chosen = going_on(tallies, sizes, rounds_left)
        self._taking_part = tuple(self._taking_part[one] for one in chosen)
        self._round += 1
        for one in self._taking_part:
            self._last_round[one] = self._round

    def _tally(self, candidate: int) -> Tally:
        return Tally(self._successes[candidate], self._episodes[candidate])


def _share(tally: Tally) -> float:
    """Below all others where nothing was tried."""
    return -1.0 if tally.share is None else tally.share
