"""Identifiers: names that C++, XML and scripts take, made from names that people gave."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from itertools import count

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_OTHER = re.compile(r"[^A-Za-z0-9]+")
#: BehaviorTree.CPP's scripts read a name that begins so as a truth value and what follows.
_TRUTH = ("true", "false")


def identifiers(names: Iterable[str], kind: str, reserved: Iterable[str] = ()) -> dict[str, str]:
    """An identifier of ASCII letters, digits and underscores for each name, all different.

    A name that is an identifier is its own, whatever the others are.

    Args:
        names: The names.
        kind: What they name; begins an identifier where what is left of a name cannot.
        reserved: Identifiers that are not to be used.

    >>> identifiers(["front", "Front left (m)", "front-left m", "2nd", "true_north"], "feature")
    {'front': 'front', 'Front left (m)': 'Front_left_m', 'front-left m': 'front_left_m', \
'2nd': 'feature_2nd', 'true_north': 'feature_true_north'}
    """
    distinct = tuple(dict.fromkeys(names))
    reserved = frozenset(reserved)
    found = {name: name for name in distinct if _usable(name) and name not in reserved}
    taken = {*reserved, *found}
    for name in distinct:
        if name not in found:
            found[name] = _free(_made_of(name, kind, reserved), taken)
            taken.add(found[name])
    return {name: found[name] for name in distinct}


def _usable(name: str) -> bool:
    return _IDENTIFIER.fullmatch(name) is not None and not name.startswith(_TRUTH)


def _made_of(name: str, kind: str, reserved: frozenset[str]) -> str:
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    words = _OTHER.sub("_", plain).strip("_")
    if _usable(words) and words not in reserved:
        return words
    return f"{kind}_{words}" if words else kind


def _free(wanted: str, taken: set[str]) -> str:
    if wanted not in taken:
        return wanted
    return next(name for number in count(2) if (name := f"{wanted}_{number}") not in taken)
