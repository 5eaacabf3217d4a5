"""Inversely related literals (Algorithm 1, line 3: BUILD_INV_SET)."""

from __future__ import annotations

from collections.abc import Iterable

from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.dnf import Dnf


def build_inv_set(dnfs: Iterable[Dnf]) -> frozenset[Literal]:
    """The negative literals whose positive twin occurs as well.

    Algorithm 1 shows each of them as an Inverter over its twin (lines 17 to 19), so that a reader
    sees two behaviors related by one condition.
    """
    occurring = {literal for dnf in dnfs for conjunction in dnf for literal in conjunction}
    return frozenset(one for one in occurring if not one.positive and ~one in occurring)
