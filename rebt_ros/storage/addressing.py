"""Which demonstrations a person means: by name, by path, by a pattern, or by a list of those."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from fnmatch import fnmatchcase
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError, listing
from rebt_ros.storage.read import PART
from rebt_ros.storage.sources import listed

#: How an address begins that is a list of addresses.
_LIST: Final = "@"


class Demonstrations:
    """Demonstrations that a person can name.

    Args:
        names: What they are called; they differ.
        paths: Of their files.
        files: What their files are called, of which some hold several demonstrations; by default
            as they are.
    """

    def __init__(
        self, names: Sequence[str], paths: Sequence[Path], files: Sequence[str] | None = None
    ) -> None:
        self._names = tuple(names)
        self._paths = tuple(paths)
        self._files = self._names if files is None else tuple(files)

    @cached_property
    def _resolved(self) -> list[Path]:
        # To resolve thousands takes a second, and hardly anybody asks for it.
        return [path.resolve() for path in self._paths]

    def meant(self, address: str) -> tuple[int, ...]:
        """Which demonstrations an address means.

        Args:
            address: A name; that or a path of a file, or of a directory with all that is in it; or
                a pattern of names or paths, such as ``run_?.csv``.  For some of the demonstrations
                of a table, ``#`` and what they are called there follow, such as
                ``fleet/runs.csv#1?``.

        Raises:
            InputError: None.
        """
        found = tuple(self._found(address)) or tuple(self._parts(address))
        if not found:
            there = listing(self._names) or "none"
            raise InputError(
                f"no demonstration is called {address!r}, and no file of one: there are "
                f"{there} (inspect lists all)."
            )
        return found

    def whole(self, address: str) -> tuple[int, ...]:
        """Which an address means with all that is in their files; none if it means parts."""
        return tuple(self._found(address))

    def partly(self, address: str) -> tuple[int, ...]:
        """Which are of files that an address, which means no whole one, may mean parts of."""
        if glob.has_magic(address):
            return tuple(range(len(self._names)))
        table = address.rpartition(PART)[0]
        return tuple(self._found(table)) if table else ()

    def _found(self, address: str) -> Iterator[int]:
        if address in self._names:
            yield self._names.index(address)
        elif address in self._files:
            yield from (number for number, file in enumerate(self._files) if file == address)
        elif place := _there(address):
            for number, its in enumerate(self._resolved):
                if place == its or place in its.parents:
                    yield number
        elif glob.has_magic(address):
            for number, called in enumerate(
                zip(self._names, self._files, map(str, self._paths), strict=True)
            ):
                if any(fnmatchcase(one, address) for one in called):
                    yield number

    def _parts(self, address: str) -> Iterator[int]:
        table, _, part = address.rpartition(PART)
        for number in self._found(table) if table else ():
            name, file = self._names[number], self._files[number]
            if fnmatchcase(name.removeprefix(file).removeprefix(PART), part):
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
    files: Sequence[str] | None = None,
    done: Set[str] = frozenset(),
) -> tuple[Fraction, ...]:
    """How much demonstrations count; those that are left out count 0.

    Args:
        names: Of all demonstrations.
        paths: Of their files.
        addresses: Of what is left out: as in `Demonstrations.meant`, or ``@`` with the path of a
            list of addresses.
        weights: Addresses with what they count, of which the last one that fits tells.
        files: What their files are called; by default as they are.
        done: Addresses that may mean nothing more.

    Raises:
        InputError: An address means no demonstration, all are left out, or a list cannot be read.
    """
    demonstrations = Demonstrations(names, paths, files)
    counting = [Fraction(1)] * len(names)
    for address, weight in (*weights, *_left_out(addresses, files or names)):
        try:
            for number in demonstrations.meant(address):
                counting[number] = weight
        except InputError:
            if address not in done:
                raise
    _check_something_left(counting, names)
    return tuple(counting)


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which files are read, before it is known which of them hold several demonstrations."""

    files: tuple[bool, ...]
    done: frozenset[str]
    """Addresses that mean files."""


def wanted(
    names: Sequence[str],
    paths: Sequence[Path],
    addresses: Sequence[str] = (),
    weights: Sequence[tuple[str, Fraction]] = (),
) -> Wanted:
    """The files that may have demonstrations which count: see `weighted`.

    Args:
        names: Of all files.
        paths: Of them.
        addresses: Of what is left out.
        weights: Addresses with what they count.

    Raises:
        InputError: An address means no file, all are left out, or a list cannot be read.
    """
    there = Demonstrations(names, paths)
    counting = [Fraction(1)] * len(names)
    done = set()
    for address, weight in (*weights, *_left_out(addresses, names)):
        whole = there.whole(address)
        if whole:
            done.add(address)
        of_files = whole or there.partly(address) or there.meant(address)
        for number in of_files:
            if whole or weight:
                counting[number] = weight
    _check_something_left(counting, names)
    return Wanted(tuple(map(bool, counting)), frozenset(done))


def _left_out(addresses: Sequence[str], names: Sequence[str]) -> Iterator[tuple[str, Fraction]]:
    """Addresses of what counts 0, also those of lists."""
    for address in addresses:
        yield from ((line, Fraction(0)) for line in _lines(address, names))


def _check_something_left(counting: Sequence[Fraction], names: Sequence[str]) -> None:
    if any(counting):
        return
    raise InputError(
        f"all {len(names)} demonstrations are left out: there is nothing else to read."
        if len(names) > 1
        else f"{names[0]} is left out: there is nothing else to read."
    )


def _lines(address: str, names: Sequence[str]) -> tuple[str, ...]:
    if not address.startswith(_LIST) or address in names or _there(address):
        return (address,)
    return listed(Path(address.removeprefix(_LIST)), "demonstrations")
