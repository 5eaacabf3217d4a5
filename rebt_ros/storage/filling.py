"""Tables that were merged of several topics, in which no row has an action and a state."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rebt_ros.errors import listing
from rebt_ros.storage.cells import is_missing


def filled_down(
    names: Sequence[str],
    rows: Sequence[Sequence[str]],
    labels: Sequence[int],
    labelled: Sequence[int],
    is_no_state: Callable[[str, Sequence[str]], bool],
) -> tuple[tuple[Sequence[str], ...], tuple[str, ...]]:
    """The cells of the rows that have an action, column by column.

    Where all of the state is in other rows, as where messages of several topics have a row each,
    what was said last above holds still.

    Args:
        names: Of the columns.
        rows: All rows.
        labels: Positions of the columns of actions.
        labelled: Positions of the rows with an action.
        is_no_state: Whether a column, by its name and by its cells, is none of the state.

    Returns:
        The cells, and notes.
    """
    cells = tuple(zip(*(rows[row] for row in labelled), strict=True))
    others = [place for place in range(len(names)) if place not in labels]
    empty = [place for place in others if _is_empty(cells[place])]
    apart = [place for place in empty if not _is_empty([row[place] for row in rows])]
    there = [place for place in others if place not in empty]
    if not apart or not all(
        is_no_state(names[place], [row[place] for row in rows]) for place in there
    ):
        return cells, ()
    filled: list[Sequence[str]] = list(cells)
    for place in apart:
        last, column = "", []
        for row in rows:
            last = last if is_missing(row[place].strip()) else row[place]
            column.append(last)
        filled[place] = [column[row] for row in labelled]
    note = (
        f"no row has both an action and a state, so that a row with an action has the last values "
        f"above it of {listing([repr(names[place]) for place in apart])}"
    )
    return tuple(filled), (note,)


def _is_empty(cells: Sequence[str]) -> bool:
    return all(is_missing(cell.strip()) for cell in cells)
