"""Shows a learned tree: in the terminal, or as a picture or text in a file."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.commands.shell import parse, run, use_color
from rebt_ros.drawing.dot import render_dot
from rebt_ros.drawing.svg import render_svg
from rebt_ros.drawing.text import render_text
from rebt_ros.drawing.tree_png import render_png
from rebt_ros.errors import OptionError
from rebt_ros.storage.atomic import write_bytes_atomically
from rebt_ros.storage.tree_file import read_tree

_RENDERERS: dict[str, Callable[[LearnedTree], str | bytes]] = {
    ".svg": render_svg,
    ".png": render_png,
    ".dot": render_dot,
    ".txt": render_text,
}


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="show", description=__doc__)
    parser.add_argument("tree", type=Path, metavar="TREE", help="tree.json of a learned tree")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help=f"write it to a file of one of the kinds {', '.join(_RENDERERS)} instead",
    )
    parsed = parse(parser, arguments)
    run(lambda: _show(parsed.tree, parsed.out), "show")


def _show(path: Path, out: Path | None) -> None:
    if out is None:
        print(render_text(read_tree(path), color=use_color()), end="")
        return
    render = _RENDERERS.get(out.suffix.lower())
    if render is None:
        raise OptionError(
            f"{out} has no suffix that says how to draw the tree: name a file that ends in "
            f"{', '.join(_RENDERERS)}."
        )
    content = render(read_tree(path))
    write_bytes_atomically(out, content.encode() if isinstance(content, str) else content)
    print(f"Written to {out}.")


if __name__ == "__main__":
    main()
