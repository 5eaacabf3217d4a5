"""Names that a state message gives to its own values."""

from __future__ import annotations

from collections.abc import Sequence


def fields_of(dimension_labels: Sequence[str], count: int) -> tuple[str, ...]:
    """The field names in the layout of an array message.

    Args:
        dimension_labels: Labels of the layout's dimensions, in order.
        count: How many values the message has.

    Returns:
        One name per value, all different: the labels where there is one per value, or the parts of
        a single label that lists them with commas; empty where the labels are neither.

    >>> fields_of(["front,left,right"], 3)
    ('front', 'left', 'right')
    >>> fields_of(["front", "left"], 2)
    ('front', 'left')
    >>> fields_of(["rows", "columns"], 6)
    ()
    """
    if len(dimension_labels) == count:
        names = list(dimension_labels)
    elif len(dimension_labels) == 1:
        names = dimension_labels[0].split(",")
    else:
        return ()
    fields = tuple(name.strip() for name in names)
    return fields if len(fields) == count == len(set(fields)) and all(fields) else ()


def dimension_labels_of(fields: Sequence[str]) -> tuple[str, ...]:
    """Labels of the layout's dimensions from which `fields_of` reads these names.

    >>> dimension_labels_of(["front", "left"])
    ('front,left',)
    >>> dimension_labels_of(["front, far", "left"])
    ('front, far', 'left')
    """
    return tuple(fields) if any("," in field for field in fields) else (",".join(fields),)
