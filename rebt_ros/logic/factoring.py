"""Factoring by the distributive law.

`pull_out_common` is the paper's single level (Algorithm 1, line 6); `factor` repeats it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import reduce
from itertools import chain
from operator import and_
from typing import NamedTuple

from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.dnf import Dnf, conditions_of
from rebt_ros.logic.literal_codes import Codes, Cover, Numbering, mask


@dataclass(frozen=True, slots=True)
class Factored:
    """``common AND (OR of alternatives)``; without alternatives, only ``common``."""

    common: tuple[Literal, ...]
    alternatives: tuple[Factored, ...] = ()


def unfactored(dnf: Dnf) -> Factored:
    """The DNF as it is, with nothing in common."""
    conjunctions = tuple(Factored(conjunction.literals) for conjunction in dnf)
    return conjunctions[0] if len(conjunctions) == 1 else Factored((), conjunctions)


def pull_out_common(dnf: Dnf) -> Factored:
    """One level of factoring, as in the paper: literals of all conjunctions move to the front.

    Args:
        dnf: At least one conjunction, none of which implies another (as espresso leaves it).
    """
    numbering = Numbering(conditions_of(dnf))
    return named(pulled_out(numbering.cover(dnf)), numbering)


def factor(dnf: Dnf) -> Factored:
    """Repeated factoring: divides out what several conjunctions have in common, until nothing is.

    The literal that occurs in most conjunctions is divided out first (of equals, the first one);
    then quotient and remainder are factored in the same way.

    Args:
        dnf: At least one conjunction, none of which implies another (as espresso leaves it).
    """
    numbering = Numbering(conditions_of(dnf))
    return named(factored(numbering.cover(dnf)), numbering)


class FactoredCodes(NamedTuple):
    """`Factored`, with literals as codes."""

    common: Codes
    alternatives: tuple[FactoredCodes, ...] = ()


def named(parts: FactoredCodes, numbering: Numbering) -> Factored:
    """A factored condition, with its codes as literals."""
    return Factored(
        numbering.literals(parts.common),
        tuple(named(alternative, numbering) for alternative in parts.alternatives),
    )


def factored(cover: Cover) -> FactoredCodes:
    """`factor` for codes."""
    common, rest = _pulled_out(cover)
    return FactoredCodes(common, tuple(_divided(rest)))


def pulled_out(cover: Cover) -> FactoredCodes:
    """`pull_out_common` for codes."""
    common, rest = _pulled_out(cover)
    return FactoredCodes(common, tuple(map(FactoredCodes, rest)))


def _pulled_out(cover: Cover) -> tuple[Codes, Cover]:
    """What all conjunctions have in common, and the rest of each; a single one has no rest."""
    if len(cover) == 1:
        return cover[0], ()
    shared = reduce(and_, map(mask, cover))
    if not shared:
        return (), cover
    common = tuple(code for code in cover[0] if shared >> code & 1)
    return common, [tuple(code for code in codes if not shared >> code & 1) for codes in cover]


def _divided(cover: Cover) -> list[FactoredCodes]:
    """An OR of plain conjunctions as an OR of factored ones."""
    parts: list[FactoredCodes] = []
    while cover:
        occurrences = Counter(chain.from_iterable(cover))
        divisor = max(occurrences, key=occurrences.__getitem__, default=None)
        if divisor is None or occurrences[divisor] < 2:
            return [*parts, *map(FactoredCodes, cover)]
        parts.append(factored([codes for codes in cover if divisor in codes]))
        cover = [codes for codes in cover if divisor not in codes]
    return parts
