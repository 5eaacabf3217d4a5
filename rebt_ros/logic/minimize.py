"""Two-level minimization with Berkeley espresso (Algorithm 1, line 4: LOGIC_MINIMIZER).

The only module that uses pyeda.  Espresso gets cubes, one small integer per condition, instead of
symbolic expressions, which would have to be built, ordered and taken apart again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import itemgetter
from typing import TypeAlias

from pyeda.boolalg.espresso import DTYPE, FTYPE, RTYPE, espresso

from rebt_ros.logic.dnf import FALSE, Dnf, conditions_of
from rebt_ros.logic.literal_codes import Codes, Cover, Numbering

#: Positional cube notation: espresso's codes for the value of one input.
_NEGATIVE, _POSITIVE, _ABSENT = 1, 2, 3
#: Value of the only output: off, on, or don't care.
_OFF, _ON, _DONT_CARE = 0, 1, 2

#: Rank of each value of an input in the order of cubes: positive ones come first.
_RANK = bytes.maketrans(bytes((_POSITIVE, _NEGATIVE, _ABSENT)), bytes(range(3)))

_Cube: TypeAlias = tuple[int, ...]

#: ``a b | ~a ~b | a c``, where ``~b c`` could stand for ``a c``.
_EITHER_WAY = [((1, 1, 3), (_ON,)), ((2, 2, 3), (_ON,)), ((2, 3, 2), (_ON,))]
_UNCHANGED = set(_EITHER_WAY)


def minimize(dnf: Dnf, dont_care: Dnf = FALSE, off: Dnf | None = None) -> Dnf:
    """An equivalent DNF with (nearly) the fewest conjunctions and literals.

    Args:
        dnf: Where the rule must hold.
        dont_care: Where the result may be either.
        off: Where it must not hold, if known.  This saves espresso a complement, which can be much
            larger than the rule.  `dnf`, `dont_care` and `off` together cover all assignments.

    Returns:
        A DNF equal to `dnf` on every assignment of its conditions outside `dont_care`.  Literals
        and conjunctions are in the order in which their conditions first occur.
    """
    given = Dnf(dnf.conjunctions + dont_care.conjunctions + (off or FALSE).conjunctions)
    numbering = Numbering(conditions_of(given))
    on, free, never = (
        cubes(numbering.cover(one), len(numbering.conditions))
        for one in (dnf, dont_care, off or FALSE)
    )
    return numbering.dnf(minimized_cover(on, [free], None if off is None else [never]))


@dataclass(frozen=True, slots=True)
class Cubes:
    """A cover in espresso's form, prepared once for many minimizations."""

    conditions: tuple[int, ...]
    """Positions of the conditions that it tests, in order of occurrence."""
    inputs: tuple[bytes, ...]
    """For each conjunction, the value of every condition of the vocabulary."""
    always: bool
    """Whether a conjunction is empty, and so always holds."""


def cubes(cover: Cover, conditions: int) -> Cubes:
    """Prepares a cover.

    Args:
        cover: The conjunctions.
        conditions: Number of conditions in the vocabulary of the codes.
    """
    absent = bytes([_ABSENT]) * conditions
    inputs = []
    for codes in cover:
        cube = bytearray(absent)
        for code in codes:
            cube[code >> 1] = _POSITIVE if code & 1 else _NEGATIVE
        inputs.append(bytes(cube))
    tested = dict.fromkeys(code >> 1 for codes in cover for code in codes)
    return Cubes(tuple(tested), tuple(inputs), not all(cover))


def minimized_cover(
    on: Cubes, dont_care: Sequence[Cubes] = (), off: Sequence[Cubes] | None = None
) -> list[Codes]:
    """`minimize` for covers; `dont_care` and `off` may have several parts."""
    if not on.inputs or on.always:
        # Espresso has no cubes of zero inputs.
        return [()] if on.inputs else []
    if off is not None and not any(one.inputs for one in off):
        return [()]
    given = (on, *dont_care, *(off or ()))
    vocabulary = tuple(dict.fromkeys(chain.from_iterable(one.conditions for one in given)))
    pick = _picking(vocabulary)
    cover = [(pick(cube), (_ON,)) for cube in on.inputs]
    cover += [(pick(cube), (_DONT_CARE,)) for one in dont_care for cube in one.inputs]
    kinds = FTYPE | DTYPE
    if off is not None:
        cover += [(pick(cube), (_OFF,)) for one in off for cube in one.inputs]
        kinds |= RTYPE
    _rewind()
    minimized = espresso(len(vocabulary), 1, cover, kinds)
    negative = [2 * condition for condition in vocabulary]
    # Cubes that test the first conditions of the vocabulary come first, positive ones in front.
    return [
        tuple(
            [
                code + (value == _POSITIVE)
                for code, value in zip(negative, cube, strict=True)
                if value != _ABSENT
            ]
        )
        for cube in sorted((inputs for inputs, _ in minimized), key=_reading_order)
    ]


def _rewind() -> None:
    """Makes espresso forget earlier calls, so that equal rules are minimized equally.

    Its REDUCE step alternates between two orders of the cubes, and the library remembers across
    calls which one is next.  Minimizing `_EITHER_WAY` takes one turn.  It leaves the rule unchanged
    only if the next turn is the one that a new process begins with.
    """
    for _ in range(2):
        if espresso(3, 1, _EITHER_WAY, FTYPE | DTYPE) == _UNCHANGED:
            return


def _reading_order(cube: _Cube) -> bytes:
    return bytes(cube).translate(_RANK)


def _picking(places: tuple[int, ...]) -> Callable[[bytes], _Cube]:
    """A function that takes the values at these places; at least one."""
    if len(places) == 1:
        return lambda cube: (cube[places[0]],)
    pick: Callable[[bytes], _Cube] = itemgetter(*places)
    return pick
