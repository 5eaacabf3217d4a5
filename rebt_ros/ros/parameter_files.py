"""Parameter files that are not about the node that was started with them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import yaml

#: Larger files are not looked at (bytes).
_LARGEST: Final = 1_000_000
_PARAMETERS: Final = "ros__parameters"
_FILE: Final = "--params-file"


def without_effect(args: Sequence[str], node: str) -> Iterator[str]:
    """Says of each parameter file of a command line that has no parameters for the node.

    ROS 2 passes over parameters of other nodes in silence, also where a name is misspelled or
    lacks the namespace.

    Args:
        args: The command line.
        node: Full name of the node, such as `/robot1/recorder`.
    """
    for option, file in pairwise(args):
        if option == _FILE:
            names = _nodes(Path(file))
            if names is not None and not any(_fits(name, node) for name in names):
                others = f" (there are some for {', '.join(names)})" if names else ""
                yield (
                    f"{file} has no parameters for {node}{others}, so that defaults hold: "
                    f"write them under '{node}:', or under '/**:' for every node."
                )


def _nodes(path: Path) -> list[str] | None:
    """The nodes that a file has parameters for; None where that cannot be told."""
    try:
        if path.stat().st_size > _LARGEST:
            return None
        content = yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, yaml.YAMLError, RecursionError):
        return None
    return list(_named(content, "")) if isinstance(content, Mapping) else []


def _named(content: Mapping[object, object], above: str) -> Iterator[str]:
    for key, value in content.items():
        if key == _PARAMETERS:
            if value:
                yield above
        elif isinstance(value, Mapping):
            yield from _named(value, f"{above}/{str(key).strip('/')}")


def _fits(pattern: str, node: str) -> bool:
    """Whether a name of a parameter file stands for a node.

    >>> [_fits(one, "/a/recorder") for one in ("/**", "/*/recorder", "/**/recorder", "/recorder")]
    [True, True, True, False]
    >>> _fits("/**/recorder", "/recorder")
    True
    """
    parts = {"/**": r"(?:/[^/]+)*", "/*": r"/[^/]+"}
    return (
        re.fullmatch(
            "".join(parts.get(one, re.escape(one)) for one in re.findall(r"/[^/]*", pattern)), node
        )
        is not None
    )
