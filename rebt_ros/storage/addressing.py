"""Which demonstrations a person means: by name, by path, by a pattern, or by a list of those."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError, listing
from rebt_ros.storage.sources import listed

#: How an address begins that is a list of addresses.
_LIST: Final = "@"


class Demonstrations:
    """Demonstrations that a person can name.

    Args:
        names: What they are called; they differ.
        paths: Of their files.
    """

    def __init__(self, names: Sequence[str], paths: Sequence[Path]) -> None:
        self._names = tuple(names)
        self._paths = tuple(paths)

    @cached_property
    def _resolved(self) -> list[Path]:
        # To resolve thousands takes a second, and hardly anybody asks for it.
        return [path.resolve() for path in self._paths]

    def meant(self, address: str) -> tuple[int, ...]:
        """Which demonstrations an address means.

        Args:
            address: A name; a path of a file, or of a directory with all that is in it; or a
                pattern of names or paths, such as ``run_?.csv``.

        Raises:
            InputError: None.
        """
        found = tuple(self._found(address))
        if not found:
            there = listing(self._names) or "none"
            raise InputError(
                f"no demonstration is called {address!r}, and no file of one: there are "
                f"{there} (inspect lists all)."
            )
        return found

    def _found(self, address: str) -> Iterator[int]:
        if address in self._names:
            yield self._names.index(address)
        elif place := _there(address):
            for number, its in enumerate(self._resolved):
                if place == its or place in its.parents:
                    yield number
        elif glob.has_magic(address):
            for number, (name, path) in enumerate(zip(self._names, self._paths, strict=True)):
                if fnmatchcase(name, address) or fnmatchcase(str(path), address):
                    yield number


def _there(address: str) -> Path | None:
    """The file or directory of this path; None where there is none."""
    try:
        return Path(address).resolve(strict=True)
    except (OSError, RuntimeError, ValueError):
        return None


def weighted(
    names: Sequence[str],
    paths: Sequence[Path],
    addresses: Sequence[str] = (),
    weights: Sequence[tuple[str, Fraction]] = (),
) -> tuple[Fraction, ...]:
    """How much demonstrations count; those that are left out count 0.

    Args:
        names: Of all demonstrations.
        paths: Of their files.
        addresses: Of what is left out: as in `Demonstrations.meant`, or ``@`` with the path of a
            list of addresses.
        weights: Addresses with what they count, of which the last one that fits tells.

    Raises:
        InputError: An address means no demonstration, all are left out, or a list cannot be read.
    """
    demonstrations = Demonstrations(names, paths)
    counting = [Fraction(1)] * len(names)
    for address, weight in weights:
        for number in demonstrations.meant(address):
            counting[number] = weight
    for address in addresses:
        for line in _lines(address, names):
            for number in demonstrations.meant(line):
                counting[number] = Fraction(0)
    if not any(counting):
        raise InputError(
            f"all {len(names)} demonstrations are left out: there is nothing else to read."
            if len(names) > 1
            else f"{names[0]} is left out: there is nothing else to read."
        )
    return tuple(counting)


def _lines(address: str, names: Sequence[str]) -> tuple[str, ...]:
    if not address.startswith(_LIST) or address in names or _there(address):
        return (address,)
    return listed(Path(address.removeprefix(_LIST)), "demonstrations")
