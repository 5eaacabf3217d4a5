"""What must not get lost, and what did."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

#: How many losses are told in full.
_TOLD: Final = 30


@dataclass(slots=True)
class Ledger:
    """Figures and losses of a soak."""

    faults: Counter[str] = field(default_factory=Counter)
    """How often each was injected."""
    losses: Counter[str] = field(default_factory=Counter)
    """What got lost, by kind; must stay empty."""
    told: list[str] = field(default_factory=list)
    """The first losses, in words."""
    figures: dict[str, float] = field(default_factory=dict)
    """What a person wants to know beside."""
    acknowledged: dict[Path, int] = field(default_factory=dict)
    """Rows that the recorder has said are in a file."""

    def lose(self, kind: str, what: str, count: int = 1) -> None:
        """Notes a loss."""
        self.losses[kind] += count
        if len(self.told) < _TOLD:
            self.told.append(f"{kind}: {what}")

    def raise_to(self, figure: str, value: float) -> None:
        """Keeps the largest value of a figure."""
        self.figures[figure] = max(self.figures.get(figure, value), value)

    def acknowledge(self, path: Path, rows: int) -> None:
        """Notes what the recorder says is in a file."""
        self.acknowledged[path] = max(self.acknowledged.get(path, 0), rows)

    def forgive_missing_files(self) -> None:
        """After a demonstration was discarded on purpose."""
        for path in [one for one in self.acknowledged if not one.exists()]:
            del self.acknowledged[path]

    def report(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "losses": sum(self.losses.values()),
            "losses_by_kind": dict(self.losses),
            "told": self.told,
            "faults": sum(self.faults.values()),
            "faults_by_kind": dict(sorted(self.faults.items())),
            **self.figures,
        }
