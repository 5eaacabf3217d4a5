"""The reductions past the paper, and the sizes up to which they are made."""

from __future__ import annotations

from dataclasses import dataclass, replace

#: Decision trees with more leaves are minimized without the domain's don't-cares, whose number and
#: entanglement make espresso take minutes there.
MOST_LEAVES_BY_DOMAIN = 40

#: In larger decision trees, too, rules are ordered by their number of leaves.
MOST_LEAVES_IN_BEST_ORDER = 500
#: Rules of yet larger ones keep the decision tree's conditions: espresso would take minutes.
MOST_LEAVES_MINIMIZED = 2000


@dataclass(frozen=True, slots=True)
class Reductions:
    """The reductions past the paper, each of which can be left out."""

    domain: bool = True
    """Infeasible combinations of conditions are don't-cares, in trees of up to 40 leaves."""
    repeated_factoring: bool = True
    """Factoring is repeated instead of done once."""
    priority: bool = True
    """Rules stand in order of priority, with the states of earlier ones as don't-cares."""
    intervals: bool = True
    """Two thresholds that enclose a feature are one condition."""

    def made_in(self, leaves: int) -> Reductions:
        """Those of these that are made of a decision tree with so many leaves."""
        return replace(self, domain=self.domain and leaves <= MOST_LEAVES_BY_DOMAIN)


ALL_REDUCTIONS = Reductions()
