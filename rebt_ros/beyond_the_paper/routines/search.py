"""The program that explains what was done in moments best."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

from rebt_ros.beyond_the_paper.routines.corpus import Corpus
from rebt_ros.beyond_the_paper.routines.likelihood import Models
from rebt_ros.beyond_the_paper.routines.moments import Moments, Word
from rebt_ros.beyond_the_paper.routines.moves import MOST_STATES, neighbours
from rebt_ros.beyond_the_paper.routines.program import Program, Routine, Stream, states_needed, tidy

#: Searches that begin with a word, those of them that are brought to an end, and how often streams
#: of what they found are put together anew.
_BEGINNINGS = 4
_FINALISTS = 3
_RECOMBINATIONS = 2
#: Programs that a search looks at at first, and to the end.
_FEW, _MANY = 250, 700
#: How often what is repeated is taken to be repeated, and what is tried in the end.
_ROUNDS = 3
_OTHER_ROUNDS = (2, 4, 5, 6)
#: Words that a search may begin with, and the longest of them.
_CANDIDATES = 12
_LONGEST = 18
#: Programs that are judged before the best of them is taken.
_AT_ONCE = 40
#: Rounds of expectation maximization: at first sight, and before a program is taken.
_GLANCE, _LOOK = 1, 5
#: Programs whose probabilities are learned together; more do not fit into the processor's cache.
_TOGETHER = 8
#: What a program must gain at first sight to be taken at once, and at a closer look, in nats.
_PROMISING, _GAIN = -40.0, 3.0
#: Programs that get a closer look when none was taken at once.
_CLOSER = 8


class _Judged(NamedTuple):
    """A program with what it is worth."""

    score: float
    """In nats."""
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
    """Does nothing but the most frequent action."""
    return ((Routine(1, ((int(corpus.share.argmax()),),)),),)


def _beginnings(moments: Moments, corpus: Corpus, rounds: int) -> list[Program]:
    """One stream that does what a long word says, for the words with which that explains most."""
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
    """The program with a stream of another one, if that is better."""
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
    """A stream that does what a word says, with what is repeated as routines of some rounds.

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
    """Takes better neighbours until there is none, or enough have been looked at."""
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
        # With many actions there are more neighbours than can be looked at.
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
    """The first of the most promising programs that is better at a closer look."""
    promising = [one.program for one in sorted(judged, reverse=True)[:_CLOSER]]
    for one in _judge(promising, corpus, _LOOK):
        if one.score > best.score + _GAIN:
            return one
    return None


def _judge(programs: list[Program], corpus: Corpus, rounds: int) -> list[_Judged]:
    """What programs are worth after some rounds of expectation maximization."""
    judged: list[_Judged] = []
    for begin in range(0, len(programs), _TOGETHER):
        some = programs[begin : begin + _TOGETHER]
        judged += map(_Judged, Models(some, corpus).fit(rounds).tolist(), some)
    return judged
