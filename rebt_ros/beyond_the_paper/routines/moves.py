"""Programs that differ from a given one by a single change."""

from __future__ import annotations

from collections.abc import Iterator

from rebt_ros.beyond_the_paper.routines.corpus import Corpus
from rebt_ros.beyond_the_paper.routines.program import (
    Program,
    Routine,
    Step,
    Stream,
    states_needed,
    tidy,
)

#: Maximum number of members of a step, and of states of a model; more would take too long.
_MOST_MEMBERS = 4
MOST_STATES = 100
#: Actions may be adjacent if one follows the other in this share of the rarer action's rows.
_LINKED = 0.04


def neighbours(program: Program, corpus: Corpus, rounds: int) -> list[Program]:
    """All programs that are one change away, each once.

    Args:
        program: The given program; may be empty.
        corpus: Words that show which actions follow each other.
        rounds: Number of rounds of new Repeaters.
    """
    changed = (tidy(change) for change in _changes(program, _Links(corpus), rounds))
    return [
        one
        for one in dict.fromkeys(changed)
        if one and one != program and states_needed(one) <= MOST_STATES
    ]


class _Links:
    """Which actions may be adjacent."""

    def __init__(self, corpus: Corpus) -> None:
        rows = corpus.share * max(corpus.followers.sum(), 1.0)
        least = _LINKED * rows[:, None].clip(max=rows[None, :])
        self._linked = (corpus.followers > least).tolist()
        self.actions = range(corpus.actions)

    def between(self, before: Step, after: Step) -> Iterator[int]:
        """Actions that follow one of `before` and precede one of `after`, if there are any."""
        for action in self.actions:
            follows = not before or any(self._linked[one][action] for one in before)
            if follows and (not after or any(self._linked[action][one] for one in after)):
                yield action


def _changes(program: Program, links: _Links, rounds: int) -> Iterator[Program]:
    for place in range(len(program) + 1):
        for action in links.actions:
            yield (*program[:place], (Routine(1, ((action,),)),), *program[place:])
    for place, stream in enumerate(program):
        before, behind = program[:place], program[place + 1 :]
        if behind:
            yield (*before, stream + behind[0], *behind[1:])
            yield (*before, behind[0], stream, *behind[1:])
        for cut in range(1, len(stream)):
            yield (*before, stream[:cut], stream[cut:], *behind)
        for number in range(len(stream)):
            for streams in _stream_changes(stream, number, links, rounds):
                yield (*before, *streams, *behind)


def _stream_changes(
    stream: Stream, number: int, links: _Links, rounds: int
) -> Iterator[tuple[Stream, ...]]:
    """Replacements of a stream by a change of one of its routines."""
    before, routine, behind = stream[:number], stream[number], stream[number + 1 :]
    for steps in _step_changes(routine, links):
        yield ((*before, Routine(routine.rounds, steps), *behind),)
    yield ((*before, Routine(1 if routine.rounds > 1 else rounds, routine.steps), *behind),)
    for cut in range(1, len(routine.steps)):
        for first, second in ((1, 1), (1, rounds), (rounds, 1), (rounds, rounds)):
            left, right = Routine(first, routine.steps[:cut]), Routine(second, routine.steps[cut:])
            if first > 1 or second > 1:
                yield ((*before, left, right, *behind),)
            yield ((*before, left), (right, *behind))
    if behind:
        after = behind[0]
        for times in {routine.rounds, after.rounds}:
            yield ((*before, Routine(times, routine.steps + after.steps), *behind[1:]),)
        yield (
            (
                *before,
                Routine(routine.rounds, routine.steps[:-1]),
                Routine(after.rounds, routine.steps[-1:] + after.steps),
                *behind[1:],
            ),
        )
        yield (
            (
                *before,
                Routine(routine.rounds, routine.steps + after.steps[:1]),
                Routine(after.rounds, after.steps[1:]),
                *behind[1:],
            ),
        )


def _step_changes(routine: Routine, links: _Links) -> Iterator[tuple[Step, ...]]:
    steps = routine.steps
    around = steps if routine.rounds > 1 else ((),)
    for place in range(len(steps) + 1):
        before = steps[place - 1] if place else around[-1]
        after = steps[place] if place < len(steps) else around[0]
        for action in links.between(before, after):
            yield (*steps[:place], (action,), *steps[place:])
    for place in range(1, len(steps)):
        first, second = steps[place - 1], steps[place]
        yield (*steps[: place - 1], second, first, *steps[place + 1 :])
        if not set(first) & set(second) and len(first) + len(second) <= _MOST_MEMBERS:
            yield (*steps[: place - 1], first + second, *steps[place + 1 :])
            yield (*steps[: place - 1], second + first, *steps[place + 1 :])
    if routine.rounds > 1 and len(steps) > 1:
        yield (*steps[1:], steps[0])
    for place, step in enumerate(steps):
        for instead in _instead_of(step, links):
            yield (*steps[:place], *instead, *steps[place + 1 :])


def _instead_of(step: Step, links: _Links) -> Iterator[tuple[Step, ...]]:
    """Replacements of a step."""
    for place, member in enumerate(step):
        others = step[:place] + step[place + 1 :]
        yield (others,)
        if others:
            yield ((member,), others)
            yield (others, (member,))
        for earlier in range(place):
            swapped = list(step)
            swapped[place], swapped[earlier] = step[earlier], member
            yield (tuple(swapped),)
    if len(step) < _MOST_MEMBERS:
        for action in links.actions:
            if action not in step:
                for place in range(len(step) + 1):
                    yield ((*step[:place], action, *step[place:]),)
