"""``ros2 run rebt_ros simulate CONFIG.json --out DIR``: a demonstration by a simulated tree."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import add_seed, aligned, directory, parse, run, word_of
from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import StorageError, write_text_atomically
from rebt_ros.storage.bag_writer import BagStorage, new_bag
from rebt_ros.storage.csv_writer import write_csv
from rebt_ros.storage.text import read_text
from rebt_ros.study.simulator.configuration import ExperimentConfig
from rebt_ros.study.simulator.configuration_file import parse_config
from rebt_ros.study.simulator.synthetic_robot import (
    REPEATS,
    RUNNING_CHANCE,
    TICKS,
    ExperimentRobot,
    LoggedAction,
    SimulatedRun,
    Watch,
    published_variables,
    simulate,
)

_TABLE, _BAG, _SUMMARY = "table.csv", "bag", "summary.json"


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parsed = parse(_parser(), arguments)
    run(lambda: _simulate(parsed), "simulate")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="simulate",
        description="Lets the behavior tree of a configuration file act in a random environment, "
        f"as in the paper's experiments, and writes what it did to DIR/{_TABLE} for learn to read.",
    )
    parser.add_argument(
        "config", type=Path, metavar="CONFIG", help="configuration file of an experiment (*.json)"
    )
    parser.add_argument(
        "--ticks",
        type=int,
        default=TICKS,
        metavar="N",
        help="number of ticks (default: %(default)s)",
    )
    add_seed(parser)
    parser.add_argument(
        "--running-chance",
        type=float,
        default=RUNNING_CHANCE,
        metavar="SHARE",
        help="probability that an action is still running when ticked; below 1 (default: "
        "%(default)s)",
    )
    parser.add_argument(
        "--repeats",
        type=int,
        default=REPEATS,
        metavar="N",
        help="number of times that Repeaters run their children (default: %(default)s)",
    )
    parser.add_argument(
        "--out",
        type=directory,
        default=Path("simulated"),
        metavar="DIR",
        help="default: %(default)s",
    )
    parser.add_argument(
        "--bag",
        type=word_of(BagStorage),
        nargs="?",
        const=BagStorage.MCAP,
        metavar="|".join(one.value for one in BagStorage),
        help=f"also write a rosbag2 bag, DIR/{_BAG}, with every tick's state "
        "(default: none; without a value: mcap)",
    )
    return parser


def _simulate(parsed: argparse.Namespace) -> None:
    config = parse_config(read_text(parsed.config), parsed.config.stem)
    for note in config.notes:
        print(f"warning: {note}.", file=sys.stderr)
    if not config.actions:
        raise InputError(f"{config.name} has no action: there would be nothing to learn.")
    robot = ExperimentRobot(
        config,
        parsed.seed,
        running_chance=parsed.running_chance,
        repeats=parsed.repeats,
        variables=published_variables(config),
    )
    if (parsed.out / _BAG).exists():
        raise StorageError(
            f"{parsed.out / _BAG} exists already: remove it, or name another directory with --out."
        )
    progress = ProgressBar()
    try:
        with _bag_watch(parsed.out / _BAG, robot.variables, parsed.bag) as watch:
            result = simulate(
                robot, parsed.ticks, lambda share: progress("simulating", share), watch
            )
            # While the bag is not in its place yet, so that neither is there without the other.
            write_csv(parsed.out / _TABLE, result.demonstration, result.succeeded)
    finally:
        progress.clear()
    settings: dict[str, Any] = {
        "configuration": config.name,
        "ticks": parsed.ticks,
        "seed": parsed.seed,
        "running_chance": parsed.running_chance,
        "repeats": parsed.repeats,
    }
    _write_summary(parsed.out / _SUMMARY, settings, config, result)
    print("\n".join(_report(config, result)))
    print(f"Written to {parsed.out}: {_TABLE}{f', {_BAG}/' if parsed.bag else ''}, {_SUMMARY}.")


@contextmanager
def _bag_watch(
    path: Path, variables: Sequence[str], storage: BagStorage | None
) -> Iterator[Watch | None]:
    """What writes a simulation to a bag, if there is to be one."""
    if storage is None:
        yield None
        return
    with new_bag(path, variables, storage) as bag:

        def watch(stamp: int, state: tuple[float, ...], done: Sequence[LoggedAction]) -> None:
            bag.state(stamp, state)
            for action in done:
                bag.action(stamp, action.label)
                bag.outcome(stamp, action.succeeded)

        yield watch


def _counts(result: SimulatedRun) -> dict[str, tuple[int, int]]:
    """How often each action was done, and how often with success."""
    shown = result.demonstration
    labels = [shown.actions[code] for code in shown.chosen.tolist()]
    done = Counter(labels)
    succeeded = Counter(
        label for label, success in zip(labels, result.succeeded.tolist(), strict=True) if success
    )
    return {label: (done[label], succeeded[label]) for label in shown.actions}


def _write_summary(
    path: Path, settings: dict[str, Any], config: ExperimentConfig, result: SimulatedRun
) -> None:
    actions = {
        label: {"done": done, "succeeded": succeeded}
        for label, (done, succeeded) in _counts(result).items()
    }
    summary = settings | {
        "rows": len(result.demonstration),
        "variables": [feature.name for feature in result.demonstration.features],
        "actions": actions,
        "notes": list(config.notes),
    }
    write_text_atomically(path, json.dumps(summary, indent=2, ensure_ascii=False) + "\n")


def _report(config: ExperimentConfig, result: SimulatedRun) -> Iterator[str]:
    rows = len(result.demonstration)
    yield f"{config.name}: {result.ticks} ticks, {rows} actions."
    if not config.variables:
        (unread,) = (feature.name for feature in result.demonstration.features)
        yield f"note: {config.name} has no conditions; no node reads the state, {unread}."
    never = sorted(set(config.actions) - set(result.demonstration.actions))
    if never:
        yield f"note: never done: {', '.join(never)}."
    if rows:
        counts = _counts(result).items()
        cells = [(label, str(done), str(succeeded)) for label, (done, succeeded) in counts]
        yield from aligned([("action", "done", "succeeded"), *cells])


if __name__ == "__main__":
    main()
