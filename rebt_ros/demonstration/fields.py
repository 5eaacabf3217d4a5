"""Names that a state message gives to its own values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from rebt_ros.arrays import FloatArray

#: Numbers of a message of rclpy, or of rosbags.
Values = TypeVar("Values", Sequence[float], FloatArray)


class LayoutMessage(Protocol):
    """The layout of an array message."""

    dim: Sequence[Any]
    """Each with a `label` and a `size`."""
    data_offset: int


class ArrayMessage(Protocol[Values]):
    """std_msgs/Float64MultiArray, of rclpy or of rosbags."""

    layout: LayoutMessage
    data: Values


@dataclass(frozen=True, slots=True)
class Dimension:
    """A dimension in the layout of an array message."""

    label: str
    size: int = 1


def fields_of(dimensions: Sequence[Dimension], count: int) -> tuple[str, ...]:
    """The field names in the layout of an array message.

    Args:
        dimensions: Those of the layout, in order.
        count: How many values the message has.

    Returns:
        One name per value, all different: the labels if there is one dimension of size 1 (or 0)
        per value, or the parts of a single label that lists them with commas.  Empty if the labels
        are neither, as those of a matrix.

    >>> fields_of([Dimension("front,left,right", 3)], 3)
    ('front', 'left', 'right')
    >>> fields_of([Dimension("front"), Dimension("left")], 2)
    ('front', 'left')
    >>> fields_of([Dimension("rows", 1), Dimension("columns", 2)], 2)
    ()
    """
    if len(dimensions) == 1:
        names = [dimensions[0].label] if count == 1 else dimensions[0].label.split(",")
    elif len(dimensions) == count and all(dimension.size <= 1 for dimension in dimensions):
        names = [dimension.label for dimension in dimensions]
    else:
        return ()
    fields = tuple(name.strip() for name in names)
    return fields if len(fields) == count == len(set(fields)) and all(fields) else ()


def values_of(message: ArrayMessage[Values]) -> Values:
    """The values of an array message, without the padding before them."""
    offset = message.layout.data_offset
    return message.data[offset:] if offset else message.data


def names_of(message: ArrayMessage[Values]) -> tuple[str, ...]:
    """The names that its layout gives to the values of an array message; empty if none."""
    dimensions = [Dimension(one.label, one.size) for one in message.layout.dim]
    return fields_of(dimensions, len(values_of(message)))


def dimension_labels_of(fields: Sequence[str]) -> tuple[str, ...]:
    """Labels of the layout's dimensions from which `fields_of` reads these names.

    >>> dimension_labels_of(["front", "left"])
    ('front,left',)
    >>> dimension_labels_of(["front, far", "left"])
    ('front, far', 'left')
    """
    return tuple(fields) if any("," in field for field in fields) else (",".join(fields),)
