"""Reductions beyond the paper, and the tree sizes up to which they are made."""

from __future__ import annotations

from dataclasses import dataclass, replace

#: Decision trees with more leaves are minimized without the domain's don't-cares: there are too
#: many of them, and espresso would take minutes.
MOST_LEAVES_BY_DOMAIN = 40

#: The rules of decision trees with more leaves are ordered by their number of leaves.
MOST_LEAVES_IN_BEST_ORDER = 500
#: The rules of decision trees with more leaves keep all conditions: espresso would take minutes.
MOST_LEAVES_MINIMIZED = 2000


@dataclass(frozen=True, slots=True)
class Reductions:
    """The reductions beyond the paper, each of which is optional."""

    domain: bool = True
    """Infeasible combinations of conditions are don't-cares, in trees of up to 40 leaves."""
    repeated_factoring: bool = True
    """Factoring is repeated instead of done once."""
    priority: bool = True
    """Rules are in priority order, with the states of earlier ones as don't-cares."""
    intervals: bool = True
    """Two thresholds that enclose a feature become one condition."""

    def made_in(self, leaves: int) -> Reductions:
        """The reductions that are made for a decision tree with this many leaves."""
        return replace(self, domain=self.domain and leaves <= MOST_LEAVES_BY_DOMAIN)


ALL_REDUCTIONS = Reductions()
