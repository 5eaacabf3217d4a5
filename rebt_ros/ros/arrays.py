"""What an array message says, for nodes."""

from __future__ import annotations

from rebt_ros.demonstration.fields import names_of, values_of

__all__ = ["names_of", "values_of"]
