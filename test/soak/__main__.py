"""Runs the nodes under load and random faults, and counts what gets lost: nothing must."""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from soak.campaign import Plan, run
from soak.ledger import Ledger


def main(arguments: Sequence[str] | None = None) -> int:
    """Soaks, prints a table and writes the figures.

    Returns:
        The exit code: 0 where nothing was lost, 1 where anything was.
    """
    options = _parser().parse_args(arguments)
    seed = random.SystemRandom().randrange(10**6) if options.seed is None else options.seed
    plan = Plan(60 * options.minutes, seed, options.state_rate, options.tick_rate)
    directory = Path(tempfile.mkdtemp(prefix="rebt_ros_soak_"))
    print(f"seed {seed}; {options.minutes:g} minutes; files in {directory}", flush=True)
    began, load = time.monotonic(), os.getloadavg()[0]

    def tell(what: str) -> None:
        if options.verbose:
            print(f"{time.monotonic() - began:7.1f} s  {what}", flush=True)

    ledger = run(directory, plan, tell)
    report = {"seed": seed, "minutes": options.minutes} | ledger.report()
    report["load"] = {"before": load, "after": os.getloadavg()[0], "cores": os.cpu_count()}
    print(_table(ledger))
    if options.output is not None:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if report["losses"]:
        print(f"FAILED: {report['losses']} losses; seed {seed}, the files stay in {directory}")
        return 1
    shutil.rmtree(directory)
    print(f"PASSED: nothing was lost; seed {seed}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="how long; 10")
    parser.add_argument("--seed", type=int, help="what the faults follow from; at random")
    parser.add_argument("--state-rate", type=float, default=200.0, help="states (Hz); 200")
    parser.add_argument("--tick-rate", type=float, default=50.0, help="ticks (Hz); 50")
    parser.add_argument("--output", type=Path, help="JSON file for the figures")
    parser.add_argument("--verbose", action="store_true", help="tell of every fault")
    return parser


def _table(ledger: Ledger) -> str:
    rows = [(name.replace("_", " "), f"{value:g}") for name, value in ledger.figures.items()]
    rows += [("faults injected", str(sum(ledger.faults.values())))]
    rows += [(f"  {name}", str(count)) for name, count in sorted(ledger.faults.items())]
    rows += [("losses", str(sum(ledger.losses.values())))]
    rows += [(f"  {name}", str(count)) for name, count in sorted(ledger.losses.items())]
    width = max(len(name) for name, _ in rows)
    lines = [f"{name:<{width}}  {value:>10}" for name, value in rows]
    return "\n".join([*lines, *(f"  {one}" for one in ledger.told)])


if __name__ == "__main__":
    sys.exit(main())
