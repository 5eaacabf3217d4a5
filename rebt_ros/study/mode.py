"""The ways to make trees that are compared."""

from __future__ import annotations

from enum import Enum


class Mode(Enum):
    """A way from a decision tree to generated subtrees."""

    BASELINE = "baseline"
    """BT-Espresso."""
    PAPER = "paper"
    """RE:BT-Espresso as printed, all suggestions attached to the root."""
    DEFAULT = "default"
    """What is learned without options: at most twelve suggestions beside the main tree."""
