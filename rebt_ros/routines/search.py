"""The program that explains what was done in moments best."""

from __future__ import annotations

from random import Random

from rebt_ros.routines.corpus import Corpus
from rebt_ros.routines.likelihood import Model
from rebt_ros.routines.moments import Moments, Word
from rebt_ros.routines.moves import MOST_STATES, neighbours
from rebt_ros.routines.program import Program, Routine, Stream, states_needed, tidy

#: Searches, each from a word of its own, and how often streams of what they found are put together
#: anew.
_BEGINNINGS = 4
_RECOMBINATIONS = 3
#: Programs that a search looks at at first, and that the best one looks at further.
_FEW, _MANY = 250, 1000
#: How often what is repeated is repeated; more is as good as for ever.
_ROUNDS = (2, 3, 4)
#: Words that a search may begin with, and the longest of them.
_CANDIDATES = 12
_LONGEST = 18
#: Programs that are judged before the best of them is taken.
_AT_ONCE = 40
#: Rounds of expectation maximization: at first sight, and before a program is taken.
_GLANCE, _LOOK = 1, 5
#: What a program must gain at first sight to be taken at once, and at a closer look, in nats.
_PROMISING, _GAIN = -40.0, 3.0
#: Programs that get a closer look when none was taken at once.
_CLOSER = 8


def programs(moments: Moments, corpus: Corpus) -> list[tuple[float, Program]]:
    """Programs that explain the moments, the best first, with their scores in nats."""
    rounds, found = _repeated(moments, corpus)
    others = [_first(corpus), *_beginnings(moments, corpus, rounds)[1:_BEGINNINGS]]
    found += [_climb(_score(one, corpus, _LOOK), one, corpus, rounds, _FEW) for one in others]
    best = _climb(*max(found), corpus, rounds, _MANY)
    for _ in range(_RECOMBINATIONS):
        streams = dict.fromkeys(stream for _, program in found for stream in program)
        better = _recombined(*best, list(streams), corpus)
        if better is None:
            break
        found.append(best)
        best = _climb(*better, corpus, rounds, _MANY)
    found.append(best)
    return sorted({program: (score, program) for score, program in found}.values(), reverse=True)


def _repeated(moments: Moments, corpus: Corpus) -> tuple[int, list[tuple[float, Program]]]:
    """How often repeated routines are repeated, by what is found if they were."""
    found: dict[tuple[float, Program], int] = {}
    for times in _ROUNDS:
        for program in _beginnings(moments, corpus, times)[:1]:
            start = _score(program, corpus, _LOOK)
            found[_climb(start, program, corpus, times, _FEW)] = times
    return (found[max(found)] if found else _ROUNDS[0]), list(found)


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
    longest = [word for _, word in sorted(often, key=lambda one: (-one[0], one[1]))]
    folded = dict.fromkeys(tidy((fold(word, rounds),)) for word in longest)
    fitting = [one for one in folded if states_needed(one) <= MOST_STATES][:_CANDIDATES]
    return sorted(fitting, key=lambda one: _score(one, corpus, _LOOK), reverse=True)


def _recombined(
    best: float, program: Program, streams: list[Stream], corpus: Corpus
) -> tuple[float, Program] | None:
    """The program with a stream of another one, if that is better."""
    changed = dict.fromkeys(
        (*program[:place], stream, *program[end:])
        for stream in streams
        for place in range(len(program) + 1)
        for end in range(place, len(program) + 1)
    )
    judged = [
        (_score(one, corpus, _GLANCE), one)
        for one in changed
        if one != program and states_needed(one) <= MOST_STATES
    ]
    return _better_than(best, judged, corpus)


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


def _climb(
    best: float, program: Program, corpus: Corpus, rounds: int, most: int
) -> tuple[float, Program]:
    """Takes better neighbours until there is none, or enough have been looked at."""
    draw = Random(0)
    seen = {program}
    looked = 0
    while looked < most:
        waiting = [one for one in neighbours(program, corpus, rounds) if one not in seen]
        draw.shuffle(waiting)
        least = _score(program, corpus, _GLANCE) + _PROMISING
        glanced: list[tuple[float, Program]] = []
        better = None
        while waiting and better is None:
            some, waiting = waiting[:_AT_ONCE], waiting[_AT_ONCE:]
            seen.update(some)
            looked += len(some)
            judged = [(_score(one, corpus, _GLANCE), one) for one in some]
            glanced += judged
            if max(judged)[0] > least:
                better = _better_than(best, [max(judged)], corpus)
        better = better or _better_than(best, glanced, corpus)
        if better is None:
            break
        best, program = better
    return best, program


def _better_than(
    best: float, judged: list[tuple[float, Program]], corpus: Corpus
) -> tuple[float, Program] | None:
    """The first of the most promising programs that is better at a closer look."""
    for _, program in sorted(judged, reverse=True)[:_CLOSER]:
        score = _score(program, corpus, _LOOK)
        if score > best + _GAIN:
            return score, program
    return None


def _score(program: Program, corpus: Corpus, rounds: int) -> float:
    return Model(program, corpus).fit(rounds)
