"""Programs: what a robot may be doing, without the conditions of its steps.

step
    An action, or several that are done together (PSA), in the order in which they are tried.
routine
    Steps one after another, gone through once or several times.
stream
    Routines one after another.
program
    Streams side by side; in each moment every stream continues for a while, one after another.

All are tuples of positions of actions, because a search tries thousands of them.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

Step: TypeAlias = tuple[int, ...]


class Routine(NamedTuple):
    """Steps that are done one after another."""

    rounds: int
    """How often they are done; a Repeater if more than once."""
    steps: tuple[Step, ...]


Stream: TypeAlias = tuple[Routine, ...]
Program: TypeAlias = tuple[Stream, ...]


class Place(NamedTuple):
    """The place of a step in a stream with all its rounds."""

    routine: int
    step: int


def places(stream: Stream) -> tuple[Place, ...]:
    """The steps of a stream in the order in which they are done, with all rounds."""
    return tuple(
        Place(number, step)
        for number, routine in enumerate(stream)
        for _ in range(routine.rounds)
        for step in range(len(routine.steps))
    )


def tidy(program: Program) -> Program:
    """The same program without empty parts, with adjacent routines of one round joined."""
    streams = []
    for stream in program:
        routines: list[Routine] = []
        for rounds, steps in stream:
            steps = tuple(step for step in steps if step)
            if not steps:
                continue
            if routines and rounds == 1 and routines[-1].rounds == 1:
                routines[-1] = Routine(1, routines[-1].steps + steps)
            else:
                routines.append(Routine(rounds, steps))
        if routines:
            streams.append(tuple(routines))
    return tuple(streams)


def complexity(program: Program) -> int:
    """The size of a description of a program."""
    return sum(
        3
        + sum(
            2 + 3 * (rounds > 1) + sum(2 + 2 * len(step) for step in steps)
            for rounds, steps in stream
        )
        for stream in program
    )


def states_needed(program: Program) -> int:
    """Number of states of a model of the program; see `likelihood`."""
    return sum(
        rounds * sum(len(step) * 2 ** (len(step) - 1) for step in steps)
        for stream in program
        for rounds, steps in stream
    )
