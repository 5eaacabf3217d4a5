"""How probable a program makes the words of moments.

A hidden Markov model reads a word from left to right.  Its state is the step that was done last, in
which round, and what of a PSA step is done already.  From there the stream goes on with its next
step, or stops for this moment, and a later stream takes over, at any of its steps: where it
stopped in an earlier moment.  What the streams do in one moment hangs together, since they begin
together and have run for equally long; so there are several kinds of moments, in each of which
streams take part, and take over, with probabilities of their own.  All probabilities are learned
from the words by expectation maximization; rows that fit nowhere are noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.routines.corpus import Corpus
from rebt_ros.routines.program import Place, Program, Step, Stream, complexity, places

#: Kinds of moments.  In the first one all streams are at their beginning.
_KINDS = 4
#: What one more thing to be said about a program must be worth, in nats per moment.
_PRICE = 20 / 15_000


class State(NamedTuple):
    """What a stream did last."""

    stream: int
    place: int
    """Of the step, all rounds counted."""
    done: int
    """Which members of the step are done, one bit each."""
    member: int
    """The last one."""

    def completes(self, step: Step) -> bool:
        """Whether the step is done with it."""
        return self.done == (1 << len(step)) - 1


@dataclass(frozen=True, eq=False, slots=True)
class _StreamModel:
    """What a stream contributes to a model, in states of its own."""

    states: tuple[State, ...]
    action: IntArray
    within: FloatArray
    """Probability of the next member of a step that is not done yet, shape (states, states)."""
    stops: FloatArray
    """Probability to stop within a step; 1 where it is done, shape (states,)."""
    before: IntArray
    """States with which a step is done that another follows."""
    after: FloatArray
    """How that one begins, shape (len(before), states)."""
    border: IntArray
    """Which of the stream's borders lies between; rounds share them, shape (len(before),)."""
    borders: tuple[tuple[Place, Place], ...]
    first: FloatArray
    """How its first step begins, shape (states,)."""
    anywhere: FloatArray
    """How it goes on from anywhere, shape (states,)."""


@lru_cache(maxsize=4096)
def _stream_model(stream: Stream, persistence: float) -> _StreamModel:
    order = places(stream)
    steps = [stream[place.routine].steps[place.step] for place in order]
    states = tuple(
        State(0, place, done, member)
        for place, step in enumerate(steps)
        for done, member in product(range(1, 1 << len(step)), range(len(step)))
        if done >> member & 1
    )
    index = {state: number for number, state in enumerate(states)}
    size = len(states)

    def entering(place: int, done: int = 0, after: int = -1) -> tuple[FloatArray, float]:
        """Probability of each next member to be done, and of none."""
        entry, left = np.zeros(size), 1.0
        for member in range(after + 1, len(steps[place])):
            if not done >> member & 1:
                entry[index[State(0, place, done | 1 << member, member)]] = left * persistence
                left *= 1 - persistence
        return entry, left

    def beginning(place: int, done: int = 0) -> FloatArray:
        entry, left = entering(place, done)
        return entry / (1 - left)

    within, stops = np.zeros((size, size)), np.ones(size)
    before, after, border = [], [], []
    borders: dict[tuple[Place, Place], int] = {}
    for number, state in enumerate(states):
        if not state.completes(steps[state.place]):
            within[number], stops[number] = entering(state.place, state.done, state.member)
        elif state.place + 1 < len(steps):
            before.append(number)
            after.append(beginning(state.place + 1))
            between = (order[state.place], order[state.place + 1])
            border.append(borders.setdefault(between, len(borders)))
    anywhere = np.sum(
        [
            beginning(place, done)
            for place, step in enumerate(steps)
            for done in range((1 << len(step)) - 1)
        ],
        axis=0,
    )
    return _StreamModel(
        states,
        np.array([steps[state.place][state.member] for state in states], dtype=np.int64),
        within,
        stops,
        np.array(before, dtype=np.int64),
        np.array(after).reshape(len(before), size),
        np.array(border, dtype=np.int64),
        tuple(borders),
        beginning(0),
        anywhere / anywhere.sum(),
    )


class Model:
    """A program with probabilities.

    Args:
        program: At least one stream.
        corpus: What is read.
    """

    def __init__(self, program: Program, corpus: Corpus) -> None:
        self.program = program
        self.corpus = corpus
        persistence = round(min(max(corpus.continues, 0.3), 0.9), 2)
        parts = [_stream_model(stream, persistence) for stream in program]
        offsets = np.cumsum([0, *(len(part.states) for part in parts)])
        size = int(offsets[-1])
        self.states = tuple(
            state._replace(stream=stream)
            for stream, part in enumerate(parts)
            for state in part.states
        )
        #: The steps of each stream in the order in which they are done.
        self.order = tuple(places(stream) for stream in program)
        self._of_stream = [slice(int(begin), int(end)) for begin, end in pairwise(offsets)]
        self._is_action = np.zeros((corpus.actions, size))
        self._within = np.zeros((size + 1, size))
        self._stops = np.ones(size + 1)
        self._first = np.zeros((len(parts), size))
        anywhere = np.zeros((len(parts), size))
        before, after, border, borders = [], [], [], 0
        for stream, (part, mine) in enumerate(zip(parts, self._of_stream, strict=True)):
            self._is_action[part.action, np.arange(mine.start, mine.stop)] = 1
            self._within[mine, mine] = part.within
            self._stops[mine] = part.stops
            self._first[stream, mine] = part.first
            anywhere[stream, mine] = part.anywhere
            before.append(part.before + mine.start)
            border.append(part.border + borders)
            borders += len(part.borders)
            padded = np.zeros((len(part.before), size))
            padded[:, mine] = part.after
            after.append(padded)
        self._before = np.concatenate(before)
        self._after = np.concatenate(after)
        self._border = np.concatenate(border)
        #: The stream from which on others may take over; nothing has been done yet in the last.
        self._next = np.append(np.repeat(np.arange(len(parts)) + 1, np.diff(offsets)), 0)
        self.goes_on = np.full(borders, 0.45)
        self._enters = np.broadcast_to(anywhere, (_KINDS, len(parts), size)).copy()
        self._enters[0] = self._first
        self._idle = _first_guess(len(parts))
        self._kind = np.full(_KINDS, 1 / _KINDS)
        self._assemble()

    def fit(self, rounds: int) -> float:
        """Learns the probabilities.

        Args:
            rounds: Of expectation maximization.

        Returns:
            Log likelihood of the corpus less the price of the program, in nats.
        """
        likelihood = self._read()
        for _ in range(rounds):
            self._improve()
            likelihood = self._read()
        return likelihood - _PRICE * self.corpus.moments * complexity(self.program)

    def explain(self, word: tuple[int, ...], cut: bool) -> list[int | None]:
        """The most probable state after each action of a word (Viterbi), None for noise.

        Args:
            word: Actions of one moment, as long as is read.
            cut: Whether it goes on behind them.
        """
        size = len(self.states)
        score = np.zeros((_KINDS, size + 1))
        score[:, size] = self._kind
        choices: list[tuple[IntArray, BoolArray]] = []
        for action in word:
            steps = score[:, :, None] * self._moves
            best = np.zeros_like(score)
            best[:, :size] = steps.max(axis=1) * self._is_action[action]
            noise = score * 0.01 * self.corpus.share[action]
            choices.append((steps.argmax(axis=1), noise > best))
            score = np.maximum(best, noise)
        final = score if cut else score * self._ends
        kind, state = (int(one) for one in np.unravel_index(final.argmax(), final.shape))
        explained: list[int | None] = []
        for previous, noise in reversed(choices):
            if noise[kind, state]:
                explained.append(None)
            else:
                explained.append(state)
                state = int(previous[kind, state])
        return explained[::-1]

    def _assemble(self) -> None:
        """Probabilities of all moves from those of their parts."""
        size, streams = len(self.states), len(self.program)
        moves, stops = self._within.copy(), self._stops.copy()
        going_on = self.goes_on[self._border]
        moves[self._before] = going_on[:, None] * self._after
        stops[self._before] = 1 - going_on
        takes_over = np.zeros((_KINDS, streams + 1, size))
        nobody = np.ones((_KINDS, streams + 1))
        for stream in reversed(range(streams)):
            idle = self._idle[:, stream]
            takes_over[:, stream] = (1 - idle)[:, None] * self._enters[:, stream]
            takes_over[:, stream] += idle[:, None] * takes_over[:, stream + 1]
            nobody[:, stream] = idle * nobody[:, stream + 1]
        #: From each state, or none yet, to each state, shape (kinds, states + 1, states).
        self._moves = moves + stops[:, None] * takes_over[:, self._next]
        #: Probability that the word ends there, shape (kinds, states + 1).
        self._ends = stops * nobody[:, self._next]

    def _read(self) -> float:
        """Forward pass over all words at once; their log likelihood in nats."""
        size = len(self.states)
        start = np.zeros((_KINDS, 1, size + 1))
        start[:, 0, size] = self._kind
        self._forward = [start]
        self._ended, self._cut = [], []
        likelihood = 0.0
        ends = self._ends[:, :, None]
        for level in self.corpus.levels:
            before = self._forward[-1][:, level.parent]
            here = before * level.noise[:, None]
            here[:, :, :size] += (before @ self._moves) * self._is_action[level.action]
            self._forward.append(here)
            self._ended.append((here @ ends)[:, :, 0].sum(axis=0) + 1e-300)
            self._cut.append(here.sum(axis=(0, 2)) + 1e-300)
            likelihood += level.ended @ np.log(self._ended[-1])
            likelihood += level.cut @ np.log(self._cut[-1])
        return float(likelihood)

    def _improve(self) -> None:
        """Backward pass, then each probability becomes its expected share (Baum-Welch)."""
        size = len(self.states)
        moved, ended = np.zeros_like(self._moves), np.zeros_like(self._ends)
        backwards = self._moves.transpose(0, 2, 1)
        rest: FloatArray | None = None
        for number, level in reversed(list(enumerate(self.corpus.levels))):
            ends = (level.ended / self._ended[number])[None, :, None] * self._ends[:, None]
            ended += (self._forward[number + 1] * ends).sum(axis=1)
            here = ends + (level.cut / self._cut[number])[None, :, None]
            if rest is not None:
                here = here + rest
            arrived = self._is_action[level.action] * here[:, :, :size]
            before = self._forward[number][:, level.parent]
            moved += before.transpose(0, 2, 1) @ arrived
            rest = level.children @ (arrived @ backwards + here * level.noise[:, None])
        assert rest is not None, "a corpus has words"
        kinds = rest[:, 0, size] * self._kind
        self._kind = (kinds + 1) / (kinds.sum() + _KINDS)
        self._share_out(moved * self._moves, ended)
        self._assemble()

    def _share_out(self, moved: FloatArray, ended: FloatArray) -> None:
        """Sets probabilities from how often each move and end is expected."""
        inside = np.zeros(len(self.states) + 1)
        passed = moved.sum(axis=0)
        entered = np.zeros_like(self._enters)
        idle, taken = np.ones_like(self._idle), np.ones_like(self._idle)
        for stream, mine in enumerate(self._of_stream):
            inside[mine] = passed[mine, mine].sum(axis=1)
            earlier = self._next <= stream
            entered[:, stream, mine] = moved[:, earlier, mine].sum(axis=1)
            taken[:, stream] += entered[:, stream].sum(axis=1)
            skipped = moved[:, earlier, mine.stop :].sum(axis=(1, 2))
            idle[:, stream] += skipped + ended[:, earlier].sum(axis=1)
        all_moves = passed.sum(axis=1) + ended.sum(axis=0)
        borders = len(self.goes_on)
        going = np.bincount(self._border, inside[self._before], borders)
        being = np.bincount(self._border, all_moves[self._before], borders)
        self.goes_on = np.minimum((going + 0.5) / (being + 1), 0.95)
        entered[1:] += 0.5 * self._enters[1:]
        entered[0] = np.where(self._first > 0, entered[0] + 1e-9, 0)
        self._enters = entered / np.maximum(entered.sum(axis=2, keepdims=True), 1e-300)
        self._idle = idle / (idle + taken)


def _first_guess(streams: int) -> FloatArray:
    """Probabilities of each stream to do nothing, different for each kind of moments."""
    idle = np.full((_KINDS, streams), 0.5)
    period = max(2, min(streams, _KINDS - 1))
    for kind, stream in product(range(1, _KINDS), range(streams)):
        idle[kind, stream] = 0.75 if (stream + kind) % period else 0.3
    return idle
