"""Accounts: what an input says it holds, what was read of it, and what was left out and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any


@dataclass(frozen=True, slots=True)
class Account:
    """Where the messages, or lines, of an input went.

    Of the messages of a bag it is about those of the topics that were read.
    """

    unit: str
    """What is counted: a noun in the plural."""
    stated: int
    """How many the input says it holds."""
    read: int
    """How many of them became rows or states."""
    rows: int
    """Rows that were made of them."""
    left_out: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """How many were left out, by reason; the reasons end sentences that begin with a number."""

    @property
    def missing(self) -> int:
        """How many are not accounted for: more were stated than found, or fewer if negative."""
        return self.stated - self.read - sum(self.left_out.values())

    def notes(self) -> tuple[str, ...]:
        """What a person must know; empty where all was found.  No full stops."""
        if not self.missing:
            return ()
        found = self.read + sum(self.left_out.values())
        return (f"the input says that it holds {self.stated} {self.unit}, and {found} were found",)

    def as_json(self) -> dict[str, Any]:
        """As it stands in summary.json."""
        return {
            "unit": self.unit,
            "stated": self.stated,
            "read": self.read,
            "rows": self.rows,
            "left_out": dict(self.left_out),
        }
