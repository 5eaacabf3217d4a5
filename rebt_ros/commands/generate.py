"""``ros2 run rebt_ros generate COUNT --out DIR``: random configurations for experiments."""

from __future__ import annotations

import argparse
from pathlib import Path

from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import add_seed, directory, parse, run
from rebt_ros.errors import OptionError
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.study.simulator.configuration_file import format_config
from rebt_ros.study.simulator.generator import generate_configs

#: Share of the work that is done once the configurations are drawn; the rest is writing.
_DRAWN = 0.2


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parsed = parse(_parser(), arguments)
    run(lambda: _generate(parsed), "generate")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="generate",
        description="Writes random configuration files by the rules of the paper's experiments, "
        "for simulate to read: 2 or 3 subtrees under a Parallel or a Sequence root.",
    )
    parser.add_argument("count", type=int, metavar="COUNT", help="number of configurations")
    add_seed(parser)
    parser.add_argument(
        "--out",
        type=directory,
        default=Path("experiments"),
        metavar="DIR",
        help="default: %(default)s",
    )
    return parser


def _generate(parsed: argparse.Namespace) -> None:
    there = next(iter(sorted(parsed.out.glob("*.json"))), None)
    if there is not None:
        raise OptionError(
            f"{parsed.out} holds configurations already ({there.name}): name another directory."
        )
    progress = ProgressBar()
    try:
        configs = generate_configs(
            parsed.count, parsed.seed, lambda share: progress("drawing", _DRAWN * share)
        )
        for number, config in enumerate(configs):
            write_text_atomically(parsed.out / f"{config.name}.json", format_config(config.root))
            progress("writing", _DRAWN + (1 - _DRAWN) * number / len(configs))
    finally:
        progress.clear()
    print(f"{len(configs)} configurations written to {parsed.out}.")


if __name__ == "__main__":
    main()
