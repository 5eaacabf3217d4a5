"""Columns of a table that say to which demonstration each row belongs, such as `episode`.

A demonstration is a stretch of rows in which none of these columns changes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from rebt_ros.errors import InputError, listing
from rebt_ros.storage.cells import is_missing
from rebt_ros.storage.read import Part

#: Columns of these names do.
_NAMED = re.compile(
    r"(?:(?:episode|trial|demo|demonstration|traj|trajectory|rollout)s?"
    r"|(?:ep|run|session|bag|recording|attempt)(?=[ _.]?(?:id|idx|index|no|nr|num|number|name)\Z))"
    r"(?:[ _.]?(?:id|idx|index|no|nr|num|number|name))?"
)
#: Columns of these names do where their values say so as well.
_MAYBE = re.compile(r"ep|run|session|bag|recording|attempt|(?:source[ _.]?)?file(?:[ _.]?name)?")
#: So many numbers that rise by one count demonstrations; fewer may be truths.
_FEWEST_COUNTED = 3
_FILE = re.compile(r".+\.(?:csv|tsv|txt|bag|mcap|db3|rec|json|parquet|xlsx?)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Episodes:
    """Which columns tell demonstrations, and which demonstrations there are."""

    columns: frozenset[str] = frozenset()
    """They are no features."""
    parts: tuple[Part, ...] = ()
    """The demonstrations, in order; none where the table is a single one."""
    notes: tuple[str, ...] = ()
    """What a person should know about it; no full stops."""


def named_episodes(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int], where: Callable[[int], str]
) -> Episodes:
    """The demonstrations that columns tell which somebody named.

    Args:
        columns: Their cells in all rows of a table, by name.
        rows: Which of the rows count, in order.
        where: What a row is called, for errors.

    Raises:
        InputError: A cell is empty, or a demonstration comes back.
    """
    everywhere = {name: _filled(cells) for name, cells in columns.items()}
    telling = _at(everywhere, rows)
    for name, cells in telling.items():
        if "" in cells:
            raise InputError(
                f"{where(rows[cells.index('')])}: column {name!r} is empty: say to which "
                "demonstration the row belongs."
            )
    parts = _parts(telling)
    seen: set[str] = set()
    begin = 0
    for part in parts:
        if part.name in seen:
            raise InputError(
                f"{where(rows[begin])}: {_words(telling, 'says', 'say')} {part.name!r} again, "
                "after another demonstration: sort the rows by demonstration, or name a further "
                "column that tells these apart."
            )
        seen.add(part.name)
        begin += part.rows
    return _split(telling, parts, tuple(_lost(everywhere, parts)))


def found_episodes(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int], *, split: bool
) -> Episodes:
    """The demonstrations that columns tell by their names and values.

    No demonstration comes back once another one has begun.  Where several columns are called so,
    they tell together if they can: sessions have trials.

    Args:
        columns: The cells of all columns that may be features in all rows of a table, by name.
        rows: Which of the rows count, in order.
        split: Whether the demonstrations are wanted, instead of a single one.
    """
    everywhere = {name: _filled(cells) for name, cells in columns.items() if may_tell(name)}
    called = _at(everywhere, rows)
    telling = _telling({name: cells for name, cells in called.items() if _tells(name, cells)})
    parts = _parts(telling)
    others = {name: cells for name, cells in called.items() if name not in telling}
    numbering = frozenset(
        name for name, cells in others.items() if _is_named(name) and _numbers(cells, parts)
    )
    notes = [
        *(
            f"column {name!r} numbers or dates the rows and is no feature; name it as the episode "
            "column if each row is a demonstration of its own"
            for name in sorted(numbering)
        ),
        *_doubts({name: cells for name, cells in others.items() if name not in numbering}),
    ]
    if not telling:
        return Episodes(numbering, notes=tuple(notes))
    if split:
        lost = _lost({name: everywhere[name] for name in telling}, parts)
        found = _split(telling, parts, (*lost, *notes))
    else:
        found = Episodes(frozenset(telling), notes=(_together(telling, len(parts)), *notes))
    return Episodes(found.columns | numbering, found.parts, found.notes)


def _telling(certain: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """The columns that tell demonstrations apart: all together, or else those that can alone."""
    if _is_told_apart(certain):
        return dict(certain)
    alone = {name: cells for name, cells in certain.items() if _is_told_apart({name: cells})}
    return alone if _is_told_apart(alone) else dict([*alone.items()][:1])


def _split(columns: Iterable[str], parts: tuple[Part, ...], notes: tuple[str, ...]) -> Episodes:
    note = _belongs(columns)
    if len(parts) > 1:
        note = (
            f"{_words(columns, 'splits', 'split')} the rows into {len(parts)} demonstrations, "
            f"{parts[0].name!r} to {parts[-1].name!r}, and {_no_features(columns)}"
        )
    return Episodes(frozenset(columns), parts if len(parts) > 1 else (), (note, *notes))


def _together(columns: Iterable[str], parts: int) -> str:
    """Says that demonstrations which columns tell are not split."""
    if parts == 1:
        return _belongs(columns)
    return (
        f"{_belongs(columns)}; the {parts} demonstrations are read as a single one as asked, in "
        "which each seems to go on where the one before has ended"
    )


def _belongs(columns: Iterable[str]) -> str:
    says = _words(columns, "says", "say")
    return f"{says} to which demonstration a row belongs and {_no_features(columns)}"


def _no_features(columns: Iterable[str]) -> str:
    return "is no feature" if len(set(columns)) == 1 else "are no features"


def _doubts(columns: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Notes on features that seem to say to which demonstration rows belong."""
    for name, cells in columns.items():
        if _is_named(name):
            why = "has values that come back or are missing"
        elif len(set(cells)) > 1 and all(cells) and _is_told_apart({name: cells}):
            why = "has values that do not come back"
        else:
            continue
        yield (
            f"column {name!r} {why}, and is a feature: name it as an episode column, alone or with "
            "others, if it says to which demonstration a row belongs"
        )


def _lost(everywhere: Mapping[str, Sequence[str]], kept: Sequence[Part]) -> Iterator[str]:
    """Notes demonstrations without any row that counts."""
    there = {part.name for part in kept}
    rows = zip(*everywhere.values(), strict=True)
    names = dict.fromkeys(_name(cells) for cells in rows if all(cells))
    if gone := [name for name in names if name not in there]:
        what = "demonstrations have" if len(gone) > 1 else "demonstration has"
        yield (
            f"{len(gone)} {what} no action and {'are' if len(gone) > 1 else 'is'} left out: "
            f"{listing([repr(name) for name in gone])}"
        )


def _words(columns: Iterable[str], one: str, several: str) -> str:
    """Names columns, with a verb in the singular or in the plural."""
    names = sorted(columns)
    listed = ", ".join(map(repr, names))
    return f"column {listed} {one}" if len(names) == 1 else f"columns {listed} {several}"


def _is_named(name: str) -> bool:
    return _NAMED.fullmatch(name.strip().lower()) is not None


def may_tell(name: str) -> bool:
    """Whether a column may tell demonstrations, by its name."""
    return _is_named(name) or _MAYBE.fullmatch(name.strip().lower()) is not None


def _tells(name: str, cells: Sequence[str]) -> bool:
    """Whether a column that may tell demonstrations by its name does by its values."""
    if not all(cells):
        return False
    if _is_named(name):
        return True
    values = [cell for cell, _ in groupby(cells)]
    if all(value.isascii() and value.isdecimal() for value in values):
        first = int(values[0])
        return len(values) >= _FEWEST_COUNTED and all(
            int(value) == number for number, value in enumerate(values, first)
        )
    if all(map(_FILE.fullmatch, values)):
        return True
    begin = name.strip().lower()
    return len(values) > 1 and all(
        value.lower().startswith(begin) and value[-1].isdecimal() for value in values
    )


def _numbers(cells: Sequence[str], parts: Sequence[Part]) -> bool:
    """Whether a column has another value in every row of each demonstration."""
    begin = 0
    for rows in [part.rows for part in parts] or [len(cells)]:
        its = cells[begin : begin + rows]
        if len(set(its)) < len(its) or not all(its):
            return False
        begin += rows
    return True


def _filled(cells: Sequence[str]) -> list[str]:
    """Cells without blanks; where each value stands in the first of its rows only, in all of them.

    So a spreadsheet writes cells that are merged.
    """
    plain = ["" if is_missing(one := cell.strip()) else one for cell in cells]
    values = [cell for cell in plain if cell]
    if not plain[0] or not 1 < len(values) < len(plain) or len(set(values)) < len(values):
        return plain
    filled, last = [], ""
    for cell in plain:
        last = cell or last
        filled.append(last)
    return filled


def _at(columns: Mapping[str, Sequence[str]], rows: Sequence[int]) -> dict[str, list[str]]:
    return {name: [cells[row] for row in rows] for name, cells in columns.items()}


def _name(cells: Sequence[str]) -> str:
    return "/".join(cells)


def _parts(columns: Mapping[str, Sequence[str]]) -> tuple[Part, ...]:
    return tuple(
        Part(_name(cells), sum(1 for _ in rows))
        for cells, rows in groupby(zip(*columns.values(), strict=True))
    )


def _is_told_apart(columns: Mapping[str, Sequence[str]]) -> bool:
    """Whether no demonstration comes back, and not every row is one."""
    parts = _parts(columns)
    if not parts or len({part.name for part in parts}) < len(parts):
        return False
    return len(parts) == 1 or any(part.rows > 1 for part in parts)
