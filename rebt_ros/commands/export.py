"""Writes a learned tree for another engine: BehaviorTree.CPP 4, for Groot2 too, or py_trees."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rebt_ros.commands.shell import parse, run
from rebt_ros.export.languages import LANGUAGES
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.tree_file import read_tree


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="export", description=__doc__)
    parser.add_argument("tree", type=Path, metavar="TREE", help="tree.json of a learned tree")
    parser.add_argument(
        "--to",
        choices=list(LANGUAGES),
        default="btcpp",
        help="btcpp: BehaviorTree.CPP 4 XML; py_trees: XML for py_trees 2.5 and later (default: "
        "%(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="write to this file instead of standard output"
    )
    parsed = parse(parser, arguments)
    run(lambda: _export(parsed.tree, parsed.to, parsed.out), "export")


def _export(path: Path, language: str, out: Path | None) -> None:
    text = LANGUAGES[language](read_tree(path))
    if out is None:
        print(_as_printed(text), end="")
        return
    write_text_atomically(out, text)
    print(f"Written to {out}.")


def _as_printed(text: str) -> str:
    """The XML with references instead of what the output cannot hold, whatever it is read as."""
    if "utf" in (sys.stdout.encoding or "").lower():
        return text
    return text.encode("ascii", "xmlcharrefreplace").decode("ascii")


if __name__ == "__main__":
    main()
