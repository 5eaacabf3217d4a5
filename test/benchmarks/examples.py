"""What the benchmarks learn from: tables of a size, made from a policy that can be learned."""

from __future__ import annotations

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable, tabulate

#: Splits of the policy that is demonstrated.
_DEPTH = 4


def demonstration(
    rows: int, width: int, actions: int = 8, noise: float = 0.05, seed: int = 0
) -> Demonstration:
    """States that wander, and what a decision tree of 16 leaves does in them.

    Args:
        rows: How many.
        width: Features.
        actions: Labels.
        noise: Share of the rows in which any action is taken; 1: nothing can be learned.
        seed: Of the random numbers.
    """
    random = np.random.default_rng(seed)
    states: FloatArray = np.sin(np.cumsum(random.normal(scale=0.1, size=(rows, width)), axis=0))
    chosen = _policy(states) % actions
    # So that all actions occur, however many there are.
    erring = random.random(rows) < noise
    erring[:actions] = True
    chosen[erring] = random.integers(actions, size=int(erring.sum()))
    chosen[:actions] = np.arange(actions)
    return Demonstration(
        "benchmark",
        tuple(Feature(f"f{index}") for index in range(width)),
        states,
        np.arange(rows, dtype=np.int64) * 10**8,
        tuple(f"a{code:03}" for code in range(actions)),
        chosen,
        ("action",),
        np.zeros(rows, dtype=np.int64),
    )


def _policy(states: FloatArray) -> IntArray:
    """The leaf that each state reaches in a tree with other features at every node."""
    rows, width = states.shape
    leaf = np.zeros(rows, dtype=np.int64)
    for level in range(_DEPTH):
        feature = (leaf * 7 + level * 3) % width
        threshold = ((leaf * 13 + level) % 5 - 2) * 0.2
        leaf = 2 * leaf + (states[np.arange(rows), feature] > threshold)
    return leaf


def table(
    rows: int, width: int, actions: int = 8, noise: float = 0.05, seed: int = 0
) -> DemonstrationTable:
    """The table of one such demonstration."""
    return tabulate([demonstration(rows, width, actions, noise, seed)])[0]
