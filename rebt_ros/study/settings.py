"""What decides the results of an experiment."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rebt_ros.errors import OptionError
from rebt_ros.study.simulator.synthetic_robot import TICKS

#: Splits on the longest path of decision trees (paper, IV-B).
MAX_DEPTH = 5
#: The default offers no more suggestions than this at a pruning level.
MOST_SUGGESTIONS = 12


@dataclass(frozen=True, slots=True)
class Settings:
    """What is simulated and measured; equal settings give equal results.

    Raises:
        OptionError: A value makes no sense.
    """

    ticks: int = TICKS
    """Of each simulation."""
    seed: int = 0
    """Of all simulations and samples."""
    networkx_pairs: int = 0
    """Pairs of each configuration that the paper's measure is tried on, drawn at random."""
    pair_seconds: float = 5.0
    """How long it may take for a pair; what takes longer is counted as missed."""

    def __post_init__(self) -> None:
        if self.ticks < 1:
            raise OptionError(f"ticks is {self.ticks}: simulate at least 1.")
        if self.networkx_pairs < 0:
            raise OptionError(
                f"networkx_pairs is {self.networkx_pairs}: name a number of pairs, or 0 for none."
            )
        if not 0 < self.pair_seconds < math.inf:
            raise OptionError(
                f"pair_seconds is {self.pair_seconds:g}: name a number of seconds above 0."
            )
