"""Results on disk, a file for each cell, so that a run goes on where it was interrupted.

A result counts only as long as the code that made it, and all settings, are the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rebt_ros
from driving.methods import PLAIN
from driving.results import EXPERT, Cell, Result
from rebt_ros.storage.atomic import write_text_atomically

_HERE = Path(__file__).parent
_PACKAGE = Path(rebt_ros.__file__).parent
#: Modules of this package that no result of driving depends on.
_NOT_DECIDING = {
    "__init__.py",
    "__main__.py",
    "cells.py",
    "corrections.py",
    "plot.py",
    "processes.py",
    "report.py",
    "results.py",
    "running.py",
}


@dataclass(frozen=True, slots=True)
class Origin:
    """What results depend on beside their cell."""

    settings: str
    package: str
    """Fingerprint of rebt_ros."""
    benchmark: str
    """Fingerprint of this package."""

    @classmethod
    def of(cls, settings: str, *further: Path) -> Origin:
        """With the code as it is now.

        Args:
            settings: In any words.
            further: Modules that decide about these results, but not about those of driving.
        """
        own = [path for path in _HERE.glob("*.py") if path.name not in _NOT_DECIDING]
        return cls(settings, _fingerprint(_PACKAGE.rglob("*.py")), _fingerprint([*own, *further]))

    def text(self, *, ours: bool) -> str:
        """Equal texts mean equal results; `ours` says whether rebt_ros takes part."""
        parts = (self.benchmark, self.package) if ours else (self.benchmark,)
        return "; ".join((self.settings, *parts))


def _fingerprint(paths: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in sorted(paths):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class Store:
    """A directory of results."""

    directory: Path
    origin: Origin

    def path(self, cell: Cell) -> Path:
        """Where the result of a cell is."""
        return self.directory / cell.task / f"{cell.number}-{cell.n}-{cell.method}.json"

    def write(self, result: Result) -> None:
        """Keeps a result, in the place of an older one."""
        cell = result.cell
        data = {
            "task": cell.task,
            "set": cell.number,
            "n": cell.n,
            "method": cell.method,
            "success": result.success,
            "nodes": result.nodes,
            "rows": result.rows,
            "seconds": round(result.seconds, 3),
            "refusal": result.refusal,
            "about": dict(result.about),
        }
        write_json(self.path(cell), data | {"made_by": self._made_by(cell)})

    def read(self, cell: Cell) -> Result | None:
        """What is known of a cell; None where there is nothing, or other code has made it."""
        data = read_json(self.path(cell), self._made_by(cell))
        if data is None:
            return None
        names = ("success", "nodes", "rows", "seconds", "refusal", "about")
        return Result(cell, *(data[name] for name in names))

    def missing(self, cells: Iterable[Cell]) -> tuple[Cell, ...]:
        """The cells without a result."""
        return tuple(cell for cell in cells if self.read(cell) is None)

    def results(self, cells: Iterable[Cell]) -> tuple[Result, ...]:
        """Of those cells that have one."""
        found = map(self.read, cells)
        return tuple(one for one in found if one is not None)

    def _made_by(self, cell: Cell) -> str:
        # The robot is simulated by rebt_ros.
        plain = cell.method in (*PLAIN, EXPERT) and cell.task != "robot"
        return self.origin.text(ours=not plain)


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Writes an object that says what it was made by."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text_atomically(path, json.dumps(data) + "\n")


def read_json(path: Path, made_by: str) -> dict[str, Any] | None:
    """What was written; None where there is nothing, or something else has made it."""
    if not path.exists():
        return None
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return data if data["made_by"] == made_by else None
