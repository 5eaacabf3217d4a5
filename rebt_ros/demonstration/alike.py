"""Labels that may be one, written in several ways."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.errors import listing

#: What parts words, but not numbers.
_PARTING = re.compile(r"(?<=[^\W\d_])[\s_-]+(?=[^\W_])|(?<=[^\W_])[\s_-]+(?=[^\W\d_])")

#: So many groups are named.
_NAMED = 3


def alike(demonstrations: Sequence[Demonstration]) -> Iterator[str]:
    """Notes actions, and categories of features, that differ only in how they are written.

    >>> list(alike([]))
    []
    """
    labels = {
        (channel, one.actions[action])
        for one in demonstrations
        for place, channel in enumerate(one.channels)
        for action in set(one.chosen[one.channel == place].tolist())
    }
    for channel in sorted({channel for channel, _ in labels}):
        its = _groups(label for where, label in labels if where == channel)
        if its:
            yield f"{_listed(its)} are different actions: write them alike where they are one"
    categories: dict[str, set[str]] = {}
    for one in demonstrations:
        for feature in one.features:
            categories.setdefault(feature.name, set()).update(feature.categories)
    for name, its_categories in sorted(categories.items()):
        if its := _groups(its_categories):
            yield (
                f"{_listed(its)} are different values of feature {name!r}: write them alike where "
                "they are one"
            )


def _groups(labels: Iterable[str]) -> list[list[str]]:
    """Those that are alike, together."""
    by_key: dict[object, list[str]] = {}
    for label in sorted(set(labels)):
        by_key.setdefault(_key(label), []).append(label)
    return [group for group in by_key.values() if len(group) > 1]


def _key(label: str) -> object:
    r"""What labels have in common that are alike.

    >>> _key("Move-Forward") == _key("move forward") == _key("moveForward")
    True
    >>> _key("1") == _key("1.0") != _key("-1")
    True
    >>> _key("caf\u00e9") == _key("cafe\u0301")
    True
    """
    try:
        return float(label)
    except ValueError:
        # The same letter may be one character, or a plain one with an accent behind it.
        return _PARTING.sub("", unicodedata.normalize("NFKC", label).strip()).casefold()


def _listed(groups: Sequence[Sequence[str]]) -> str:
    return listing([" and ".join(map(repr, group)) for group in groups], _NAMED, "; ")
