"""The likelihood of the words of moments under programs.

A hidden Markov model reads a word from left to right.  Its state is the last step done, its round,
and the members of a PSA step done so far.  From there the stream continues with its next step, or
stops for this moment.  A later stream then takes over at any of its steps, where it stopped in an
earlier moment.  What streams do in one moment is related, since they began together and have run
equally long.  So there are several kinds of moments, each with probabilities of its own that
streams take part and take over.  All probabilities are learned from the words by expectation
maximization; rows that fit nowhere are noise.

The probability of a prefix is divided by that of noise to the power of its length, to stay within
the range of 32-bit floats.

Axes of arrays, in this order: programs P, kinds of moments K, prefixes of words n, states S (R with
the initial state as the last one), streams T (U with "nobody" as the last one), borders
B.  Programs with fewer states, streams or borders than others are padded.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from rebt_ros.arrays import BoolArray, Float32Array, FloatArray, IntArray
from rebt_ros.beyond_the_paper.routines.corpus import Corpus
from rebt_ros.beyond_the_paper.routines.program import Program, complexity, places
from rebt_ros.beyond_the_paper.routines.streams import StreamModel, stream_model

#: Number of kinds of moments.  In the first kind, all streams are at their beginning.
_KINDS = 4
#: Price of a unit of a program's complexity, in nats per moment.
_PRICE = 20 / 15_000
#: Probability that a row belongs to no step of the program.
_NOISE = 0.01
#: Lower bound of probabilities, for logarithms.
_LEAST = np.float32(1e-30)


class _Read(NamedTuple):
    """The forward pass over the prefixes of one length."""

    before: Float32Array
    """Probabilities of the prefixes without the last action and of a state, shape (P, K, n, R)."""
    stopped_before: Float32Array
    """Probability that the next to act is one of the streams from here on, shape (P, K, n, U)."""
    took_over: Float32Array
    """Probability that the stream of each state takes over then, shape (P, K, n, S)."""
    here: Float32Array
    """As `before`, for the prefixes themselves."""
    stopped: Float32Array
    ended: Float32Array
    """Probability that the word ends here, shape (P, n)."""
    cut: Float32Array
    """Probability of the prefix, shape (P, n)."""


class _Expected:
    """Expected numbers of events."""

    def __init__(self, programs: int, states: int, streams: int) -> None:
        #: A stream took over among those from one on, shape (P, K, U, T); in a state, (P, K, S).
        self.taken = np.zeros((programs, _KINDS, streams + 1, streams), np.float32)
        self.entered = np.zeros((programs, _KINDS, states), np.float32)
        #: No stream did, shape (P, K, U).
        self.ended = np.zeros((programs, _KINDS, streams + 1), np.float32)
        #: A stream continued from a state, or stopped there, shape (P, R).
        self.went_on = np.zeros((programs, states + 1), np.float32)
        self.stopped = np.zeros((programs, states + 1), np.float32)
        #: Moments were of a kind, shape (P, K).
        self.kind = np.zeros((programs, _KINDS), np.float32)


class Models:
    """Programs with probabilities, learned together.

    Args:
        programs: At least one, each of at least one stream.
        corpus: The words.
    """

    def __init__(self, programs: Sequence[Program], corpus: Corpus) -> None:
        persistence = round(min(max(corpus.continues, 0.3), 0.9), 2)
        parts = [[stream_model(stream, persistence) for stream in program] for program in programs]
        count = len(programs)
        streams = max(map(len, parts))
        states = max(sum(len(part.states) for part in one) for one in parts)
        borders = max(sum(part.borders for part in one) for one in parts)
        self._corpus = corpus
        self._states, self._streams = states, streams
        self._within = np.zeros((count, states + 1, states), np.float32)
        self._after = np.zeros_like(self._within)
        self._stops = np.ones((count, states + 1), np.float32)
        #: States without a border have the last one, at which nothing continues.
        self._border = np.full((count, states + 1), borders)
        self._first = np.zeros((count, states), np.float32)
        self._enters = np.zeros((count, _KINDS, states), np.float32)
        self._idle = np.ones((count, _KINDS, streams), np.float32)
        self._used = np.zeros((count, 1, streams), dtype=bool)
        action = np.full((count, states), -1)
        stream_of = np.full((count, states), streams)
        for number, one in enumerate(parts):
            self._idle[number, :, : len(one)] = _first_guess(len(one))
            self._used[number, :, : len(one)] = True
            self._place(number, one, action[number], stream_of[number])
        self._enters[:, 0] = self._first
        follows = np.append(stream_of + 1, np.zeros((count, 1), dtype=np.int64), axis=1)
        #: 1 where a state belongs to a stream, shape (P, S, T), and transposed.
        self._to_stream = _marks(stream_of, streams)
        self._of_stream = np.ascontiguousarray(self._to_stream.swapaxes(1, 2))
        #: 1 where the streams from one on may take over from a state, shape (P, R, U).
        self._follows = _marks(follows, streams + 1)
        self._of_border = np.ascontiguousarray(_marks(self._border, borders).swapaxes(1, 2))
        self._emits = [
            (action[:, None, None, :] == level.action[:, None]).astype(np.float32) / _NOISE
            for level in corpus.levels
        ]
        self._goes_on = np.full((count, borders + 1), 0.45, np.float32)
        self._goes_on[:, borders] = 0
        self._kind = np.full((count, _KINDS), 1 / _KINDS, np.float32)
        price = np.array([complexity(program) for program in programs]) * _PRICE * corpus.moments
        self._worth_of_nothing = corpus.rows * np.log(_NOISE) - price
        self._assemble()

    def _place(
        self, number: int, parts: list[StreamModel], action: IntArray, stream_of: IntArray
    ) -> None:
        """Puts the streams of a program into its rows of the arrays, one after another."""
        begin, borders = 0, 0
        for stream, part in enumerate(parts):
            mine = slice(begin, begin + len(part.states))
            self._within[number, mine, mine] = part.within
            self._after[number, mine, mine] = part.after
            self._stops[number, mine] = part.stops
            bordering = mine.start + np.flatnonzero(part.border >= 0)
            self._border[number, bordering] = part.border[part.border >= 0] + borders
            self._first[number, mine] = part.first
            self._enters[number, :, mine] = part.anywhere
            action[mine], stream_of[mine] = part.action, stream
            begin, borders = mine.stop, borders + part.borders

    def fit(self, rounds: int) -> FloatArray:
        """Learns the probabilities.

        Args:
            rounds: Rounds of expectation maximization.

        Returns:
            Log likelihood of the corpus minus the price of each program in nats, shape (P,).
        """
        likelihood = self._read()
        for _ in range(rounds):
            self._learn(self._expect())
            likelihood = self._read()
        worth: FloatArray = likelihood + self._worth_of_nothing
        return worth

    def moves(self, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Probabilities of a program.

        Args:
            number: Number of the program, which is not padded if it is the largest one.

        Returns:
            Probabilities to move from each state, or none yet, to each state, shape (K, R, S); that
            a word ends there, shape (K, R); of each kind of moments, shape (K,).
        """
        takes_over = self._leaves[number] @ self._reach[number] @ self._of_stream[number]
        moves = self._stays[number] + takes_over * self._enters[number][:, None]
        ends = (self._leaves[number] @ self._nobody[number][:, :, None])[:, :, 0]
        return moves.astype(float), ends.astype(float), self._kind[number].astype(float)

    def goes_on(self, number: int) -> FloatArray:
        """Probabilities that a program continues at each border, shape (borders,)."""
        return self._goes_on[number, :-1].astype(float)

    def _assemble(self) -> None:
        """Probabilities of all moves from those of their parts."""
        going_on = np.take_along_axis(self._goes_on, self._border, axis=1)
        #: Continuing in the same stream, shape (P, R, S), and transposed.
        self._stays = self._within + going_on[:, :, None] * self._after
        self._stayed = np.ascontiguousarray(self._stays.swapaxes(1, 2))
        #: Leaving it to the streams from one on, shape (P, R, U), and transposed.
        self._leaves = self._follows * (self._stops * (1 - going_on))[:, :, None]
        self._left = np.ascontiguousarray(self._leaves.swapaxes(1, 2))
        #: A stream takes over among those from one on, shape (P, K, U, T), or nobody (P, K, U).
        self._reach = np.zeros((*self._kind.shape, self._streams + 1, self._streams), np.float32)
        self._nobody = np.ones((*self._kind.shape, self._streams + 1), np.float32)
        for stream in reversed(range(self._streams)):
            idle = self._idle[:, :, stream]
            self._nobody[:, :, stream] = idle * self._nobody[:, :, stream + 1]
            self._reach[:, :, stream] = idle[:, :, None] * self._reach[:, :, stream + 1]
            self._reach[:, :, stream, stream] = 1 - idle

    def _read(self) -> FloatArray:
        """Forward pass over all words; returns log likelihoods in nats, shape (P,)."""
        here = np.zeros((*self._kind.shape, 1, self._states + 1), np.float32)
        here[:, :, 0, -1] = self._kind
        stopped = _times(here, self._leaves)
        self._begun, self._levels = here, list[_Read]()
        likelihood = np.zeros(len(here))
        for level, emits in zip(self._corpus.levels, self._emits, strict=True):
            before, stopped_before = here[:, :, level.parent], stopped[:, :, level.parent]
            took_over = _times(stopped_before @ self._reach, self._of_stream)
            moved = took_over * self._enters[:, :, None]
            moved += _times(before, self._stays)
            moved *= emits
            here = before * level.noise[:, None]
            here[..., :-1] += moved
            stopped = _times(here, self._leaves)
            ended = (stopped @ self._nobody[..., None])[..., 0].sum(axis=1) + _LEAST
            cut = here.sum(axis=(1, 3)) + _LEAST
            likelihood += np.log(ended) @ level.ended + np.log(cut) @ level.cut
            self._levels.append(_Read(before, stopped_before, took_over, here, stopped, ended, cut))
        return likelihood

    def _expect(self) -> _Expected:
        """Backward pass: the expected number of all events."""
        expected = _Expected(len(self._kind), self._states, self._streams)
        # Likelihood after the prefixes of a level, if the stream continues, and if it stops.
        rest = np.zeros(1, np.float32)
        others = np.zeros(1, np.float32)
        for level, emits, read in reversed(
            list(zip(self._corpus.levels, self._emits, self._levels, strict=True))
        ):
            ended = _per_word(level.ended, read.ended)
            expected.ended += (read.stopped * ended).sum(axis=2)
            here = _times(ended * self._nobody[:, :, None] + others, self._left)
            expected.stopped += np.einsum("pknr,pknr->pr", read.here, here)
            here += _per_word(level.cut, read.cut)
            here += rest
            arrived = here[..., :-1] * emits
            expected.entered += np.einsum("pkns,pkns->pks", arrived, read.took_over)
            stayed = _times(arrived, self._stayed)
            expected.went_on += np.einsum("pknr,pknr->pr", read.before, stayed)
            arrived *= self._enters[:, :, None]
            taken = _times(arrived, self._to_stream)
            expected.taken += read.stopped_before.swapaxes(2, 3) @ taken
            here *= level.noise[:, None]
            rest = level.children @ (stayed + here)
            others = level.children @ (taken @ self._reach.swapaxes(2, 3))
        top = _times(others, self._left)
        expected.stopped += np.einsum("pknr,pknr->pr", self._begun, top)
        expected.kind = (rest + top)[:, :, 0, -1] * self._kind
        expected.taken *= self._reach
        expected.ended *= self._nobody
        expected.entered *= self._enters
        return expected

    def _learn(self, expected: _Expected) -> None:
        """Each probability becomes its expected share (Baum-Welch)."""
        self._kind = (expected.kind + 1) / (expected.kind.sum(axis=1, keepdims=True) + _KINDS)
        taken = expected.entered @ self._to_stream + 1
        idle = np.ones_like(taken)
        passed_on = np.cumsum(expected.taken, axis=2)
        idle += np.cumsum(expected.ended, axis=2)[:, :, :-1]
        for stream in range(self._streams):
            idle[:, :, stream] += passed_on[:, :, stream, stream + 1 :].sum(axis=2)
        self._idle = np.where(self._used, idle / (idle + taken), np.float32(1))
        going = (self._of_border @ expected.went_on[:, :, None])[:, :, 0]
        being = going + (self._of_border @ expected.stopped[:, :, None])[:, :, 0]
        self._goes_on[:, :-1] = np.minimum((going + 0.5) / (being + 1), 0.95)
        entered = expected.entered
        entered[:, 1:] += 0.5 * self._enters[:, 1:]
        entered[:, 0] = np.where(self._first > 0, entered[:, 0] + _LEAST, np.float32(0))
        together = entered @ self._to_stream @ self._of_stream
        self._enters = (entered / np.maximum(together, _LEAST)).astype(np.float32)
        self._assemble()


class Model:
    """A program with probabilities.

    Args:
        program: At least one stream.
        corpus: The words.
    """

    def __init__(self, program: Program, corpus: Corpus) -> None:
        self.program = program
        self.corpus = corpus
        self._models = Models((program,), corpus)
        self.states = tuple(
            state._replace(stream=number)
            for number, stream in enumerate(program)
            for state in stream_model(stream, 0.5).states
        )
        #: The steps of each stream in the order in which they are done.
        self.order = tuple(places(stream) for stream in program)
        self._action = [
            program[state.stream][self.order[state.stream][state.place].routine].steps[
                self.order[state.stream][state.place].step
            ][state.member]
            for state in self.states
        ]

    def fit(self, rounds: int) -> float:
        """Learns the probabilities.

        Args:
            rounds: Rounds of expectation maximization.

        Returns:
            Log likelihood of the corpus minus the price of the program, in nats.
        """
        return float(self._models.fit(rounds)[0])

    @property
    def goes_on(self) -> FloatArray:
        """Probability of continuing at each border between two steps, shape (borders,)."""
        return self._models.goes_on(0)

    def explain(self, word: tuple[int, ...], cut: bool) -> list[int | None]:
        """The most probable state after each action of a word (Viterbi); None for noise.

        Args:
            word: The actions of a moment that are read.
            cut: Whether the moment continues after them.
        """
        moves, ends, kinds = self._models.moves(0)
        size = len(self.states)
        score = np.zeros((_KINDS, size + 1))
        score[:, size] = kinds
        choices: list[tuple[IntArray, BoolArray]] = []
        for action in word:
            steps = score[:, :, None] * moves
            best = np.zeros_like(score)
            best[:, :size] = steps.max(axis=1) * (np.array(self._action) == action)
            noise = score * _NOISE * self.corpus.share[action]
            choices.append((steps.argmax(axis=1), noise > best))
            score = np.maximum(best, noise)
        final = score if cut else score * ends
        kind, state = (int(one) for one in np.unravel_index(final.argmax(), final.shape))
        explained: list[int | None] = []
        for previous, noise in reversed(choices):
            if noise[kind, state]:
                explained.append(None)
            else:
                explained.append(state)
                state = int(previous[kind, state])
        return explained[::-1]


def _times(some: Float32Array, matrix: Float32Array) -> Float32Array:
    """Rows of all kinds times a matrix for each program, shape (P, K, n, columns)."""
    programs, kinds, rows, size = some.shape
    times: Float32Array = some.reshape(programs, kinds * rows, size) @ matrix
    return times.reshape(programs, kinds, rows, -1)


def _per_word(count: FloatArray, probability: Float32Array) -> Float32Array:
    """Weight of a word divided by its probability, shape (P, 1, n, 1)."""
    share: Float32Array = (count / probability).astype(np.float32)[:, None, :, None]
    return share


def _marks(number: IntArray, size: int) -> Float32Array:
    """One-hot vectors of the numbers, shape (P, numbers, size)."""
    marks: Float32Array = (number[:, :, None] == np.arange(size)).astype(np.float32)
    return marks


def _first_guess(streams: int) -> Float32Array:
    """Initial probabilities that each stream does nothing, different for each kind of moment."""
    idle = np.full((_KINDS, streams), 0.5, np.float32)
    period = max(2, min(streams, _KINDS - 1))
    for kind, stream in product(range(1, _KINDS), range(streams)):
        idle[kind, stream] = 0.75 if (stream + kind) % period else 0.3
    return idle
