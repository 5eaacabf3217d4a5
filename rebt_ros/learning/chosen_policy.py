"""The choices made for a policy, and their reasons."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.learning.judged_levels import JudgedLevels


@dataclass(frozen=True, eq=False, slots=True)
class ChosenPolicy:
    """A chosen tree, and why it was chosen."""

    fitted: FittedTree
    ccp_alpha: float
    psa: bool
    """Whether the tree has PSA nodes."""
    levels: JudgedLevels | None
    """The pruning levels to choose from; None without a choice."""
    reasons: tuple[str, ...]
    """A sentence for each choice."""
    of_all: FittedTree | None = None
    """The tree of all rows, including those held out; None without cross-validation."""
