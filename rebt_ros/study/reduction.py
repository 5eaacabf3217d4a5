"""How much smaller than BT-Espresso's trees others are (paper, Fig. 5).

Inverters are not counted: BT-Espresso has none, as it negates the conditions themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from rebt_ros.behavior_tree import nodes


@dataclass(frozen=True, slots=True)
class Size:
    """Number of nodes of a tree."""

    emitted: int
    without_inverters: int

    @classmethod
    def of(cls, tree: nodes.Node) -> Size:
        """The size of a tree."""
        inverters = sum(isinstance(node, nodes.Inverter) for node in nodes.walk(tree))
        emitted = nodes.size(tree)
        return cls(emitted, emitted - inverters)


@dataclass(frozen=True, slots=True)
class SizeComparison:
    """One decision tree, converted by BT-Espresso and by one mode."""

    baseline: Size
    size: Size

    @property
    def reduction(self) -> float:
        """Per cent of the baseline's nodes that are gone, Inverters left out on both sides."""
        before = self.baseline.without_inverters
        return 100 * (before - self.size.without_inverters) / before

    @property
    def reduction_as_emitted(self) -> float:
        """The same, with Inverters."""
        return 100 * (self.baseline.emitted - self.size.emitted) / self.baseline.emitted


@dataclass(frozen=True, slots=True)
class Reductions:
    """How the relative reductions of many trees are distributed, in per cent."""

    median: float
    maximum: float
    share_reduced: float
    """Trees that got smaller at all."""

    @classmethod
    def of(cls, reductions: Sequence[float]) -> Reductions:
        """The distribution of at least one reduction."""
        reduced = sum(reduction > 0 for reduction in reductions)
        share = 100 * reduced / len(reductions)
        return cls(round(median(reductions), 2), round(max(reductions), 2), round(share, 2))

    def cells(self) -> tuple[str, str, str]:
        """For a table."""
        return f"{self.median:.2f} %", f"{self.maximum:.2f} %", f"{self.share_reduced:.2f} %"
