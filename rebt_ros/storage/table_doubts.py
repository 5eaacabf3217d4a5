"""What the author of a table may not have meant by its columns of actions and features."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from rebt_ros.storage.cells import is_maybe_missing, is_missing

#: Where there are more actions than that, they should recur.
_MANY_ACTIONS = 20

#: What follows the name of the actions where a column holds them once more.
_AGAIN = re.compile(r"s?(?:[._ ]?(?:id|idx|index|name|no|nr|num|number|code|label|class))?")
#: Columns of these names are known only after an action, in tables for reinforcement learning.
_AFTERWARDS = re.compile(r"rewards?|returns?|terminat(?:ed|ion)|truncated|next[._ ].+|.+[._ ]next")
#: One of so many columns is 1 in each row where they stand for one of so many choices.
_FEWEST_CHOICES = 3

_ZERO, _ONE = frozenset({"0", "0.0"}), frozenset({"1", "1.0"})


def of_actions(actions: Sequence[str], events: int) -> list[str]:
    """What a person may not have meant by actions of such names, or by so many of them."""
    notes = [
        f"{action!r} is taken for an action: leave cells without one empty"
        for action in actions
        if is_maybe_missing(action)
    ]
    if len(actions) > _MANY_ACTIONS and 2 * len(actions) > events:
        notes.append(
            f"{len(actions)} different actions in {events} rows, such as {actions[0]!r}, hardly "
            "recur, and each is an action of its own: name the label column if it is another"
        )
    return notes


def actions_again(
    label: str, columns: Mapping[str, Sequence[str]], actions: Sequence[str]
) -> list[str]:
    """The names of columns that say what the action of each row is, in other words.

    Args:
        label: Name of the column of actions.
        columns: Cells by the names of columns that may be features.
        actions: The action of each row.
    """
    return [
        name
        for name, cells in columns.items()
        if _is_called_after(name, label) and _are_one(cells, actions)
    ]


def _is_called_after(name: str, label: str) -> bool:
    plain = name.strip().lower()
    stems = {"action", "label", label.strip().lower()}
    return any(plain.startswith(one) and _AGAIN.fullmatch(plain[len(one) :]) for one in stems)


def same_words(columns: Mapping[str, Sequence[str]], actions: Sequence[str]) -> Iterator[str]:
    """Notes features that hold the action of each row in the same words.

    Args:
        columns: Cells by the names of the features.
        actions: The action of each row.
    """
    for name, cells in columns.items():
        if all(cell.strip() == action for cell, action in zip(cells, actions, strict=True)):
            yield (
                f"column {name!r} holds the action of each row, word for word: leave it out of the "
                "table if it is known only with the action"
            )


def of_features(names: Sequence[str]) -> Iterator[str]:
    """Notes features that may be known only after the action."""
    for name in names:
        if _AFTERWARDS.fullmatch(name.strip().lower()):
            yield (
                f"column {name!r} is a feature: leave it out of the table if it is known only "
                "after the action"
            )


def of_choices(names: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """A note where the last columns seem to hold a 1 for the action and 0 for all others.

    Args:
        names: Of the columns, of which the last one is that of the actions.
        rows: The cells of each row.
    """
    first = len(names)
    while first and all(row[first - 1].strip() in _ZERO | _ONE for row in rows):
        first -= 1
    for place in range(first, len(names) - _FEWEST_CHOICES + 1):
        if all(sum(cell.strip() in _ONE for cell in row[place:]) == 1 for row in rows):
            listed = ", ".join(map(repr, names[place:]))
            yield (
                f"each row has a single 1 in {listed}, of which the last is taken for the actions: "
                "if they stand for one action each, write its name in a single column instead"
            )
            return


def _are_one(cells: Sequence[str], actions: Sequence[str]) -> bool:
    """Whether each value stands for one action, and each action for one value."""
    pairs = {(cell.strip(), action) for cell, action in zip(cells, actions, strict=True)}
    values, acted = {value for value, _ in pairs}, {action for _, action in pairs}
    is_whole = not any(map(is_missing, values))
    return is_whole and len(pairs) == len(values) == len(acted)
