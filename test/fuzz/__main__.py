"""The campaigns: many mutated inputs for every reader, and for a running executor."""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from fuzz import executor
from fuzz.campaign import LARGEST_GROWTH, LONGEST, Outcome, watched

#: Inputs of each target, unless told otherwise.
SIZES: Final = {
    "documents": 100_000,
    "recordings": 50_000,
    "tables": 50_000,
    "experiments": 50_000,
    "bags": 20_000,
    "robot_bags": 5_000,
    # One in twenty is a mutated message, which the middleware drops.
    executor.TARGET: 11_000,
}

_HEADER: Final = ("target", "inputs", "taken", "refused", "failed", "slowest ms", "growth MB", "s")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs campaigns, prints a table and writes the figures.

    Returns:
        The exit code: 1 where anything but a refusal happened.
    """
    options = _parser().parse_args(arguments)
    seed = random.SystemRandom().randrange(10**6) if options.seed is None else options.seed
    names = options.target or list(SIZES)
    print(f"seed {seed}; an input may take {LONGEST:g} s and {LARGEST_GROWTH >> 20} MB")
    rows, outcomes = [_HEADER], []
    for name in names:
        count = round(SIZES[name] * options.scale) if options.inputs is None else options.inputs
        began = time.monotonic()
        outcome = _run(name, seed, range(options.first, options.first + count))
        outcomes.append(outcome)
        rows.append(_row(outcome, time.monotonic() - began))
        print(_table(rows[-1:] if len(rows) > 2 else rows), flush=True)
        for failure in outcome.failures:
            print(f"  {failure}", flush=True)
    passed = all(outcome.passed for outcome in outcomes)
    if options.output is not None:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        report = {
            "seed": seed,
            "passed": passed,
            "longest_s": LONGEST,
            "largest_growth_bytes": LARGEST_GROWTH,
            "targets": [outcome.report() for outcome in outcomes],
        }
        options.output.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return 0 if passed else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--seed", type=int, help="what all inputs follow from; at random")
    parser.add_argument("--target", action="append", choices=list(SIZES), help="all of them")
    parser.add_argument("--scale", type=float, default=1.0, help="of the numbers of inputs; 1.0")
    parser.add_argument("--inputs", type=int, help="of each target, instead of a scale")
    parser.add_argument("--first", type=int, default=0, help="number of the first input; 0")
    parser.add_argument("--output", type=Path, help="JSON file for the figures")
    return parser


def _run(name: str, seed: int, numbers: range) -> Outcome:
    if name != executor.TARGET:
        return watched(name, seed, numbers)
    with tempfile.TemporaryDirectory(prefix="rebt_ros_fuzz_") as directory:
        return executor.run(Path(directory), seed, numbers)


def _row(outcome: Outcome, seconds: float) -> tuple[str, ...]:
    return (
        outcome.target,
        str(outcome.inputs),
        str(outcome.accepted),
        str(outcome.refused),
        str(outcome.failed),
        f"{outcome.slowest * 1e3:.0f}",
        f"{outcome.growth / (1 << 20):.0f}",
        f"{seconds:.0f}",
    )


def _table(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(12, len(name)) for name in _HEADER]
    return "\n".join(
        "".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows
    )


if __name__ == "__main__":
    sys.exit(main())
