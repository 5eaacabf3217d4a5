"""The part of a stream in a model: its states, and the moves between them.

The states of a step depend only on its number of members, and a stream is a series of steps.  So a
stream is assembled from blocks, one for each step in each round.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from rebt_ros.arrays import Float32Array, FloatArray, IntArray
from rebt_ros.beyond_the_paper.routines.program import Place, Step, Stream, places


class State(NamedTuple):
    """The last action of a stream."""

    stream: int
    place: int
    """Position of the step, with all rounds."""
    done: int
    """Which members of the step are done, one bit each."""
    member: int
    """The last member done."""

    def completes(self, step: Step) -> bool:
        """Whether this completes the step."""
        return self.done == (1 << len(step)) - 1


@dataclass(frozen=True, eq=False, slots=True)
class StreamModel:
    """The states of a stream and the moves between them."""

    states: tuple[State, ...]
    """States, numbered as if this were stream 0."""
    action: IntArray
    """The action of each state, shape (states,)."""
    within: Float32Array
    """Probability of the next member of an incomplete step, shape (states, states)."""
    stops: FloatArray
    """Probability of stopping within a step; 1 where it is complete, shape (states,)."""
    after: Float32Array
    """Probability of beginning the next step after a complete one, shape (states, states)."""
    border: IntArray
    """The border after a state, or -1, shape (states,)."""
    borders: int
    """Number of borders; the rounds of a routine share them."""
    first: FloatArray
    """Probability of beginning the first step, shape (states,)."""
    anywhere: FloatArray
    """Probability of resuming the stream anywhere, shape (states,)."""


class _Block(NamedTuple):
    """The states of one step."""

    states: tuple[tuple[int, int], ...]
    """The members done, and the last one."""
    within: FloatArray
    stops: FloatArray
    complete: IntArray
    begins: FloatArray
    """Probability of beginning the step."""
    goes_on: FloatArray
    """Probability of continuing it, summed over all sets of done members."""


@lru_cache(maxsize=512)
def stream_model(stream: Stream, persistence: float) -> StreamModel:
    """The model of a stream.

    Args:
        stream: At least one step.
        persistence: Probability that the next member of a step is done, rather than a later one.
    """
    order = places(stream)
    steps = [stream[place.routine].steps[place.step] for place in order]
    blocks = [_block(len(step), persistence) for step in steps]
    begin = np.cumsum([0, *(len(block.states) for block in blocks)]).tolist()
    size = begin[-1]
    within, after = np.zeros((2, size, size), np.float32)
    stops, border = np.ones(size), np.full(size, -1)
    anywhere = np.zeros(size)
    borders: dict[tuple[Place, Place], int] = {}
    states: list[State] = []
    action: list[int] = []
    for number, (step, block) in enumerate(zip(steps, blocks, strict=True)):
        mine = slice(begin[number], begin[number + 1])
        within[mine, mine] = block.within
        stops[mine] = block.stops
        anywhere[mine] = block.goes_on
        states += [State(0, number, done, member) for done, member in block.states]
        action += [step[member] for _, member in block.states]
        if number + 1 < len(steps):
            done = mine.start + block.complete
            between = order[number], order[number + 1]
            border[done] = borders.setdefault(between, len(borders))
            after[done, begin[number + 1] : begin[number + 2]] = blocks[number + 1].begins
    first = np.zeros(size)
    first[: begin[1]] = blocks[0].begins
    return StreamModel(
        tuple(states),
        np.array(action, dtype=np.int64),
        within,
        stops,
        after,
        border,
        len(borders),
        first,
        anywhere / anywhere.sum(),
    )


@lru_cache(maxsize=256)
def _block(members: int, persistence: float) -> _Block:
    states = tuple(
        (done, member)
        for done, member in product(range(1, 1 << members), range(members))
        if done >> member & 1
    )
    index = {state: number for number, state in enumerate(states)}
    everything = (1 << members) - 1

    def entering(done: int, after: int = -1) -> tuple[FloatArray, float]:
        """Probability of each next member, and of none."""
        entry, left = np.zeros(len(states)), 1.0
        for member in range(after + 1, members):
            if not done >> member & 1:
                entry[index[done | 1 << member, member]] = left * persistence
                left *= 1 - persistence
        return entry, left

    def beginning(done: int) -> FloatArray:
        entry, left = entering(done)
        return entry / (1 - left)

    within, stops = np.zeros((len(states), len(states))), np.ones(len(states))
    for number, (done, member) in enumerate(states):
        if done != everything:
            within[number], stops[number] = entering(done, member)
    complete = [number for number, (done, _) in enumerate(states) if done == everything]
    goes_on = np.sum([beginning(done) for done in range(everything)], axis=0)
    return _Block(states, within, stops, np.array(complete), beginning(0), goes_on)
