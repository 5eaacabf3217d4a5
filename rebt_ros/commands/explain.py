"""``ros2 run rebt_ros explain TREE``: why a tree does in a state what it does."""

from __future__ import annotations

import argparse
from pathlib import Path

from rebt_ros.commands.shell import add_input_options, input_options, parse, run
from rebt_ros.errors import OptionError
from rebt_ros.offline.check_and_explain import Situation, explain, row_of
from rebt_ros.storage.tree_file import read_tree
from rebt_ros.verification.describing import value_text
from rebt_ros.verification.explanation_text import lines
from rebt_ros.verification.typed_states import histories_of, state_of


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="explain",
        description="Explains which branch of a learned tree acts in a state, why, and which "
        "change would lead to another action.",
    )
    parser.add_argument("tree", type=Path, metavar="TREE", help="tree.json of a learned tree")
    parser.add_argument(
        "--state",
        action="append",
        metavar="NAME=VALUE,…",
        help="values of features; all others are missing; repeatable",
    )
    parser.add_argument(
        "--done",
        action="append",
        default=[],
        metavar="ACTION,…",
        help="earlier actions, the most recent one last; repeatable",
    )
    parser.add_argument(
        "--row",
        type=int,
        metavar="N",
        help="explain this row of the INPUT, counted from 0, instead of a state",
    )
    parser.add_argument(
        "--demonstration",
        metavar="NAME",
        help="demonstration that the row is from (default: the only one)",
    )
    add_input_options(parser, required=False)
    parsed = parse(parser, arguments)
    run(lambda: _explain(parsed), "explain")


def _explain(parsed: argparse.Namespace) -> None:
    learned = read_tree(parsed.tree)
    reading = input_options(parsed)
    if (parsed.state is None) == (parsed.row is None):
        raise OptionError("say what to explain: either --state, or --row with an INPUT.")
    if parsed.state is not None:
        situation = Situation(
            state_of(",".join(parsed.state), learned), histories_of(",".join(parsed.done), learned)
        )
    else:
        situation = row_of(
            learned, parsed.row, parsed.demonstration, parsed.inputs, reading=reading
        )
    explained = explain(
        learned, situation.values, situation.histories, parsed.inputs, reading=reading
    )
    if parsed.row is not None:
        print("where " + ", ".join(map(value_text, learned.features, situation.values)))
    for one in explained:
        if len(explained) > 1:
            print(f"Channel {one.channel}:")
        print("\n".join(lines(learned, situation.values, one)))


if __name__ == "__main__":
    main()
