"""``ros2 run rebt_ros replay TREE INPUT...``: runs a tree over recorded demonstrations."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from rebt_ros.commands.shell import (
    add_input_options,
    aligned,
    input_options,
    parse,
    print_notes,
    run,
)
from rebt_ros.errors import listing
from rebt_ros.learning.replaying import Disagreement, Replay
from rebt_ros.offline.replay_over_files import replay

#: Recordings whose rows lie closer have no clock, as CSV tables (seconds).
_NO_CLOCK = 1e-3
#: So many actions are named that the tree does not have.
_NAMED = 5


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="replay",
        description="Runs a learned tree over recorded demonstrations and shows where it would "
        "have acted differently.",
    )
    parser.add_argument("tree", type=Path, metavar="TREE", help="tree.json of a learned tree")
    add_input_options(parser)
    parser.add_argument(
        "--disagreements",
        type=int,
        default=10,
        metavar="N",
        help="maximum number of disagreements to list (default: %(default)s)",
    )
    parser.add_argument(
        "--btlog",
        type=Path,
        metavar="FILE",
        help="also write the status of each node in each row to this .btlog file for Groot2",
    )
    parsed = parse(parser, arguments)
    run(lambda: _replay(parsed), "replay")


def _replay(parsed: argparse.Namespace) -> None:
    results = replay(parsed.tree, parsed.inputs, reading=input_options(parsed), btlog=parsed.btlog)
    for place, result in enumerate(results):
        if place:
            print()
        if len(results) > 1:
            print(f"Channel {result.channel}:")
        _print(result, max(parsed.disagreements, 0))
    if parsed.btlog is not None:
        print(f"\nWhat each node did is in {parsed.btlog}.")


def _print(result: Replay, most: int) -> None:
    if result.foreign:
        print_notes([_on_foreign(result)])
    print(f"{result.rows} rows")
    print(f"  agreement, own history    {result.own_history_agreement:.2%}")
    print(f"  agreement, teacher-forced {result.teacher_forced_agreement:.2%}")
    print()
    print("\n".join(_confusion_table(result)))
    listed = result.disagreements[:most]
    if listed:
        print()
        print(f"First {len(listed)} of {len(result.disagreements)} disagreements:")
        print("\n".join(_disagreement_table(listed)))


def _on_foreign(result: Replay) -> str:
    labels = [repr(label) for label in result.foreign]
    named = listing(labels, _NAMED)
    are = "are no actions" if labels[1:] else "is no action"
    rows = sum(result.foreign.values())
    return (
        f"{named} {are} of the tree, which cannot agree in {rows} of {result.rows} rows: it was "
        "learned from others, or from the same by another name"
    )


def _confusion_table(result: Replay) -> Iterator[str]:
    """Rows by what was shown; no column for "none" where the tree always chose."""
    silent = result.confusion[:, -1].any()
    chosen = (*result.actions, "(none)") if silent else result.actions
    cells = [["shown \\ chosen", *chosen]]
    for label, counts in zip(result.actions, result.confusion.tolist(), strict=True):
        if any(counts):
            cells.append([label, *(str(count or "·") for count in counts[: len(chosen)])])
    return aligned(cells)


def _disagreement_table(listed: Sequence[Disagreement]) -> Iterator[str]:
    has_clock = any(one.seconds >= _NO_CLOCK for one in listed)
    cells = [["demonstration", "row", *(["seconds"] if has_clock else []), "shown", "chosen"]]
    for one in listed:
        seconds = [f"{one.seconds:.3f}"] if has_clock else []
        row = [one.demonstration, str(one.row), *seconds, one.shown, one.chosen or "(none)"]
        cells.append(row)
    return aligned(cells)


if __name__ == "__main__":
    main()
