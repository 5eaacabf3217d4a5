"""Two-level minimization with Berkeley espresso (Algorithm 1, line 4: LOGIC_MINIMIZER).

The only module that knows pyeda.  Espresso is fed cubes, one small integer per condition, never
symbolic expressions: those would have to be built, ordered and taken apart again.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import TypeAlias

from pyeda.boolalg.espresso import DTYPE, FTYPE, RTYPE, espresso

from rebt_ros.logic.dnf import FALSE, Dnf, conditions_of
from rebt_ros.logic.numbered import Codes, Cover, Numbering

#: Positional cube notation: what espresso calls the value of one input.
_NEGATIVE, _POSITIVE, _ABSENT = 1, 2, 3
#: Value of the only output: not in the ON-set, in it, or free to be either.
_OFF, _ON, _DONT_CARE = 0, 1, 2

#: Place of each value of an input in the order in which cubes are read: positive ones come first.
_RANK = {_POSITIVE: 0, _NEGATIVE: 1, _ABSENT: 2}

_Cube: TypeAlias = tuple[int, ...]

#: ``a b | ~a ~b | a c``, where ``~b c`` could stand for ``a c``.
_EITHER_WAY = {((2, 2, 3), (_ON,)), ((1, 1, 3), (_ON,)), ((2, 3, 2), (_ON,))}


def minimize(dnf: Dnf, dont_care: Dnf = FALSE, off: Dnf | None = None) -> Dnf:
    """An equivalent DNF with (nearly) the fewest conjunctions and literals.

    Args:
        dnf: Where the rule must hold.
        dont_care: Where the result may do either.
        off: Where it must not hold, if that is known: espresso then need not find out by taking a
            complement, which can be much larger than the rule.  `dnf`, `dont_care` and `off`
            cover all assignments between them.

    Returns:
        A DNF equal to `dnf` on every assignment of its conditions outside `dont_care`.  Literals
        stand in the order in which their conditions first occur, and so do conjunctions.
    """
    given = Dnf(dnf.conjunctions + dont_care.conjunctions + (off or FALSE).conjunctions)
    numbering = Numbering(conditions_of(given))
    minimized = minimized_cover(
        numbering.cover(dnf),
        numbering.cover(dont_care),
        None if off is None else numbering.cover(off),
    )
    return numbering.dnf(minimized)


def minimized_cover(on: Cover, dont_care: Cover = (), off: Cover | None = None) -> list[Codes]:
    """`minimize` in numbers."""
    if not on or not all(on):
        # Espresso has no cubes of zero inputs.
        return [()] if on else []
    if off is not None and not off:
        return [()]
    given = dict.fromkeys(chain.from_iterable(chain(on, dont_care, off or ())))
    vocabulary = tuple(dict.fromkeys(code >> 1 for code in given))
    place = {condition: place for place, condition in enumerate(vocabulary)}
    cover = [(_cube(codes, place), (_ON,)) for codes in on]
    cover += [(_cube(codes, place), (_DONT_CARE,)) for codes in dont_care]
    kinds = FTYPE | DTYPE
    if off is not None:
        cover += [(_cube(codes, place), (_OFF,)) for codes in off]
        kinds |= RTYPE
    _rewind()
    minimized = espresso(len(vocabulary), 1, cover, kinds)
    # Cubes that test the first conditions of the vocabulary come first, positive ones before.
    cubes = sorted((inputs for inputs, _ in minimized), key=_reading_order)
    return [
        tuple(
            2 * condition + (value == _POSITIVE)
            for condition, value in zip(vocabulary, cube, strict=True)
            if value != _ABSENT
        )
        for cube in cubes
    ]


def _rewind() -> None:
    """Makes espresso forget earlier calls, so that equal rules are minimized equally.

    Its REDUCE step goes through the cubes in one of two orders, by turns, and the library remembers
    across calls whose turn it is.  Minimizing `_EITHER_WAY` takes one turn, and leaves the rule
    unchanged only in the turn before the one that a new process begins with.
    """
    for _ in range(2):
        if espresso(3, 1, sorted(_EITHER_WAY), FTYPE | DTYPE) == _EITHER_WAY:
            return


def _reading_order(cube: _Cube) -> list[int]:
    return [_RANK[value] for value in cube]


def _cube(codes: Codes, place: Mapping[int, int]) -> _Cube:
    cube = [_ABSENT] * len(place)
    for code in codes:
        cube[place[code >> 1]] = _POSITIVE if code & 1 else _NEGATIVE
    return tuple(cube)
