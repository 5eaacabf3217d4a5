"""The program that best explains what was done in moments."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

from rebt_ros.beyond_the_paper.routines.corpus import Corpus
from rebt_ros.beyond_the_paper.routines.likelihood import Models
from rebt_ros.beyond_the_paper.routines.moments import Moments, Word
from rebt_ros.beyond_the_paper.routines.moves import MOST_STATES, neighbours
from rebt_ros.beyond_the_paper.routines.program import Program, Routine, Stream, states_needed, tidy

#: Number of searches that begin with a word, of those that are completed, and of recombinations of
#: the streams that they found.
_BEGINNINGS = 4
_FINALISTS = 3
_RECOMBINATIONS = 2
#: Maximum number of programs that a search tries at first, and in total.
_FEW, _MANY = 250, 700
#: Rounds of Repeaters during the search, and further rounds tried at the end.
_ROUNDS = 3
_OTHER_ROUNDS = (2, 4, 5, 6)
#: Number of words that a search may begin with, and their maximum length.
_CANDIDATES = 12
_LONGEST = 18
#: Number of programs that are judged before the best of them is taken.
_AT_ONCE = 40
#: Rounds of expectation maximization: for a first look, and before a program is taken.
_GLANCE, _LOOK = 1, 5
#: Number of programs learned together; more do not fit into the processor's cache.
_TOGETHER = 8
#: Gain for which a program is taken at first look, and at a closer look, in nats.
_PROMISING, _GAIN = -40.0, 3.0
#: Number of programs that get a closer look if none was taken at first.
_CLOSER = 8


class _Judged(NamedTuple):
    """A program with its value."""

    score: float
    """Value in nats."""
    program: Program


def programs(moments: Moments, corpus: Corpus) -> list[Program]:
    """Programs that explain the moments, the best first."""
    rounds = _ROUNDS
    begun = _judge([_first(corpus), *_beginnings(moments, corpus, rounds)], corpus, _LOOK)
    found = [_climb(one, corpus, rounds, _FEW) for one in begun]
    found.sort(reverse=True)
    found[:_FINALISTS] = [_climb(one, corpus, rounds, _MANY) for one in found[:_FINALISTS]]
    best = max(found)
    for _ in range(_RECOMBINATIONS):
        streams = dict.fromkeys(stream for one in found for stream in one.program)
        better = _recombined(best, list(streams), corpus)
        if better is None:
            break
        best = _climb(better, corpus, rounds, _MANY)
        found.append(best)
    for times in _OTHER_ROUNDS:
        program = _with_rounds(best.program, times)
        if program != best.program and states_needed(program) <= MOST_STATES:
            (other,) = _judge([program], corpus, _LOOK)
            if other.score > best.score + _GAIN:
                best = _climb(other, corpus, times, _MANY)
                found.append(best)
    found.sort(reverse=True)
    return list(dict.fromkeys(one.program for one in found))


def _with_rounds(program: Program, rounds: int) -> Program:
    return tuple(
        tuple(Routine(rounds if one.rounds > 1 else 1, one.steps) for one in stream)
        for stream in program
    )


def _first(corpus: Corpus) -> Program:
    """The program that only does the most frequent action."""
    return ((Routine(1, ((int(corpus.share.argmax()),),)),),)


def _beginnings(moments: Moments, corpus: Corpus, rounds: int) -> list[Program]:
    """Programs of one stream that does a long word, for the words that explain most."""
    often = [
        (len(word) * min(count, 20) ** 0.25, word)
        for word, count in zip(moments.words, moments.counts.tolist(), strict=True)
        if count > 1 and len(word) <= _LONGEST
    ]
    longest = (word for _, word in sorted(often, key=lambda one: (-one[0], one[1])))
    folded = dict.fromkeys(tidy((fold(word, rounds),)) for word in longest)
    fitting = [one for one in folded if states_needed(one) <= MOST_STATES][:_CANDIDATES]
    judged = sorted(_judge(fitting, corpus, _GLANCE), reverse=True)
    return [one.program for one in judged[:_BEGINNINGS]]


def _recombined(best: _Judged, streams: list[Stream], corpus: Corpus) -> _Judged | None:
    """The program with a stream of another program, if that is better."""
    program = best.program
    changed = dict.fromkeys(
        (*program[:place], stream, *program[end:])
        for stream in streams
        for place in range(len(program) + 1)
        for end in range(place, len(program) + 1)
    )
    others = [one for one in changed if one != program and states_needed(one) <= MOST_STATES]
    return _better_than(best, _judge(others, corpus, _GLANCE), corpus)


def fold(word: Word, rounds: int) -> Stream:
    """A stream that does a word, with repetitions as routines of the given number of rounds.

    >>> fold((0, 1, 2, 1, 2, 3), rounds=3)
    (Routine(rounds=1, steps=((0,),)), Routine(rounds=3, steps=((1,), (2,))), \
Routine(rounds=1, steps=((3,),)))
    """
    for length in range(1, len(word) // 2 + 1):
        for begin in range(len(word) - 2 * length + 1):
            unit, end = word[begin : begin + length], begin + length
            while word[end : end + length] == unit:
                end += length
            if end > begin + length:
                repeated = Routine(rounds, tuple((action,) for action in unit))
                return (*fold(word[:begin], rounds), repeated, *fold(word[end:], rounds))
    return (Routine(1, tuple((action,) for action in word)),) if word else ()


def _climb(best: _Judged, corpus: Corpus, rounds: int, most: int) -> _Judged:
    """Moves to better neighbors until there are none, or until enough have been tried."""
    draw = Random(0)
    seen = {best.program}
    looked = 0
    while looked < most:
        waiting = [
            neighbour
            for neighbour in neighbours(best.program, corpus, rounds)
            if neighbour not in seen
        ]
        draw.shuffle(waiting)
        # With many actions, there are more neighbors than can be tried.
        waiting = waiting[: most - looked]
        glanced: list[_Judged] = []
        better = None
        while waiting and better is None:
            some, waiting = waiting[:_AT_ONCE], waiting[_AT_ONCE:]
            seen.update(some)
            looked += len(some)
            judged = _judge(some, corpus, _GLANCE)
            glanced += judged
            first = max(judged)
            if first.score > best.score + _PROMISING:
                better = _better_than(best, [first], corpus)
        better = better or _better_than(best, glanced, corpus)
        if better is None:
            break
        best = better
    return best


def _better_than(best: _Judged, judged: list[_Judged], corpus: Corpus) -> _Judged | None:
    """The first of the most promising programs that proves better at a closer look."""
    promising = [one.program for one in sorted(judged, reverse=True)[:_CLOSER]]
    for one in _judge(promising, corpus, _LOOK):
        if one.score > best.score + _GAIN:
            return one
    return None


def _judge(programs: list[Program], corpus: Corpus, rounds: int) -> list[_Judged]:
    """The values of programs after some rounds of expectation maximization."""
    judged: list[_Judged] = []
    for begin in range(0, len(programs), _TOGETHER):
        some = programs[begin : begin + _TOGETHER]
        judged += map(_Judged, Models(some, corpus).fit(rounds).tolist(), some)
    return judged
