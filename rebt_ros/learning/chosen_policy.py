"""What was chosen to learn, and why."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.learning.judged_levels import JudgedLevels


@dataclass(frozen=True, eq=False, slots=True)
class ChosenPolicy:
    """What was chosen, and why."""

    fitted: FittedTree
    ccp_alpha: float
    psa: bool
    """Whether PSA nodes stand in the tree."""
    levels: JudgedLevels | None
    """The pruning levels that were chosen from; None where there was no choice."""
    reasons: tuple[str, ...]
    """A sentence for each choice."""
    of_all: FittedTree | None = None
    """The tree of all rows, also of those that were held out; None where none was chosen by."""
