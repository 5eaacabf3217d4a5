"""Two-level minimization with Berkeley espresso (Algorithm 1, line 4: LOGIC_MINIMIZER).

The only module that knows pyeda.  Espresso is fed cubes, one small integer per condition, never
symbolic expressions: those would have to be built, ordered and taken apart again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from pyeda.boolalg.espresso import DTYPE, FTYPE, RTYPE, espresso

from rebt_ros.logic.conditions import Condition, Literal
from rebt_ros.logic.dnf import FALSE, TRUE, Conjunction, Dnf, conditions_of

#: Positional cube notation: what espresso calls the value of one input.
_NEGATIVE, _POSITIVE, _ABSENT = 1, 2, 3
#: Value of the only output: not in the ON-set, in it, or free to be either.
_OFF, _ON, _DONT_CARE = 0, 1, 2

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
    if dnf.is_true or dnf == FALSE:
        # Espresso has no cubes of zero inputs.
        return TRUE if dnf.is_true else FALSE
    if off == FALSE:
        return TRUE
    given = Dnf(dnf.conjunctions + dont_care.conjunctions + (off or FALSE).conjunctions)
    vocabulary = conditions_of(given)
    place = {condition: place for place, condition in enumerate(vocabulary)}
    cover = [(_cube(conjunction, place), (_ON,)) for conjunction in dnf]
    cover += [(_cube(conjunction, place), (_DONT_CARE,)) for conjunction in dont_care]
    kinds = FTYPE | DTYPE
    if off is not None:
        cover += [(_cube(conjunction, place), (_OFF,)) for conjunction in off]
        kinds |= RTYPE
    _rewind()
    minimized = espresso(len(vocabulary), 1, cover, kinds)
    cubes = sorted((inputs for inputs, _ in minimized), key=_reading_order)
    return Dnf(tuple(_conjunction(cube, vocabulary) for cube in cubes))


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
    """Cubes that test the first conditions of the vocabulary come first, positive ones before."""
    return [(_POSITIVE, _NEGATIVE, _ABSENT).index(value) for value in cube]


def _cube(conjunction: Conjunction, place: Mapping[Condition, int]) -> _Cube:
    cube = [_ABSENT] * len(place)
    for literal in conjunction:
        cube[place[literal.condition]] = _POSITIVE if literal.positive else _NEGATIVE
    return tuple(cube)


def _conjunction(cube: _Cube, vocabulary: tuple[Condition, ...]) -> Conjunction:
    return Conjunction(
        tuple(
            Literal(condition, positive=value == _POSITIVE)
            for condition, value in zip(vocabulary, cube, strict=True)
            if value != _ABSENT
        )
    )
