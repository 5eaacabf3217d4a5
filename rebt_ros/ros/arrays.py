"""What an array message says."""

from __future__ import annotations

from collections.abc import Sequence

from std_msgs.msg import Float64MultiArray

from rebt_ros.demonstration.fields import Dimension, fields_of


def values_of(message: Float64MultiArray) -> Sequence[float]:
    """Its values, without the padding before them."""
    offset = message.layout.data_offset
    values: Sequence[float] = message.data[offset:] if offset else message.data
    return values


def names_of(message: Float64MultiArray) -> tuple[str, ...]:
    """The names that its layout gives to its values; empty where it gives none."""
    dimensions = [Dimension(one.label, one.size) for one in message.layout.dim]
    return fields_of(dimensions, len(values_of(message)))
