"""``ros2 run rebt_ros inspect INPUT...``: what demonstrations hold, before learning from them."""

from __future__ import annotations

import argparse
from pathlib import Path

from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import (
    add_input_options,
    aligned,
    input_options,
    parse,
    print_notes,
    run,
)
from rebt_ros.inspection.idle import IDLE_SECONDS
from rebt_ros.inspection.inspecting import inspect
from rebt_ros.inspection.inspection import Inspection, dumps
from rebt_ros.inspection.page import inspection_page
from rebt_ros.inspection.wording import HEADING, cells, findings, summary
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.inputs import load


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="inspect",
        description="Lists demonstrations with their lengths, actions, rates, gaps, idle "
        "stretches and constant features, and points out near-duplicates, "
        "contradicting rows and outliers (docs/inspect.md).",
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write all figures to this file as JSON"
    )
    parser.add_argument(
        "--html", type=Path, metavar="FILE", help="write a self-contained HTML page to this file"
    )
    parser.add_argument(
        "--idle",
        type=float,
        default=IDLE_SECONDS,
        metavar="SECONDS",
        help="minimum length of an idle stretch (default: %(default)s)",
    )
    add_input_options(parser)
    parsed = parse(parser, arguments)
    run(lambda: _inspect(parsed), "inspect")


def _inspect(parsed: argparse.Namespace) -> None:
    progress = ProgressBar()
    try:
        # All notes are printed below.
        reading = input_options(parsed, progress, tell_notes=lambda notes: None)
        loaded = load(tuple(parsed.inputs), reading)
        inspection = inspect(
            loaded.demonstrations,
            tuple(map(str, loaded.paths)),
            idle_seconds=parsed.idle,
            progress=progress,
        )
    finally:
        progress.clear()
    print_notes((*loaded.notes, *inspection.notes))
    _print(inspection)
    for path, written in ((parsed.json, dumps), (parsed.html, inspection_page)):
        if path is not None:
            write_text_atomically(path, written(inspection))
            print(f"Written to {path}.")


def _print(inspection: Inspection) -> None:
    several = inspection.several_channels
    lines = [cells(one, several=several) for one in inspection.demonstrations]
    print("\n".join(aligned([HEADING, *lines], words=1)))
    print(summary(inspection))
    found = list(findings(inspection))
    if found:
        print("Worth a look:")
        print("\n".join(f"  {finding}" for finding in found))


if __name__ == "__main__":
    main()
