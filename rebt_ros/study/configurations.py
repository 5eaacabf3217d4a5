"""The configurations of an experiment: reading a directory of them, and choosing some."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage.text import read_text
from rebt_ros.study.simulator.configuration import ExperimentConfig
from rebt_ros.study.simulator.configuration_file import parse_config


@dataclass(frozen=True, slots=True)
class Lost:
    """A configuration without results."""

    configuration: str
    reason: str
    """One sentence."""


def configuration_paths(directory: Path) -> tuple[Path, ...]:
    """The configuration files of a directory, in the order of the numbers in their names.

    Raises:
        InputError: There are none.
    """
    if not directory.is_dir():
        raise InputError(f"{directory} is no directory: name one of configuration files, *.json.")
    paths = sorted(directory.glob("*.json"), key=lambda path: in_order(path.stem))
    if not paths:
        raise InputError(f"{directory} has no configuration files: name a directory of *.json.")
    return tuple(paths)


def chosen_paths(
    paths: Sequence[Path], names: Sequence[str] = (), limit: int | None = None
) -> tuple[Path, ...]:
    """Some of the files.

    Args:
        paths: All there are.
        names: Those to keep, without suffix; all if empty.
        limit: How many of them to keep at most, the first ones.

    Raises:
        OptionError: There is no such file, or the limit leaves none.
    """
    unknown = sorted(set(names) - {path.stem for path in paths})
    if unknown:
        raise OptionError(
            f"there is no configuration {unknown[0]!r}: "
            f"choose of {paths[0].stem} to {paths[-1].stem}."
        )
    if limit is not None and limit < 1:
        raise OptionError(f"the limit is {limit}: run at least 1 configuration.")
    kept = [path for path in paths if not names or path.stem in names]
    return tuple(kept[:limit])


def read_where_possible(
    paths: Sequence[Path],
) -> tuple[tuple[ExperimentConfig, ...], tuple[Lost, ...]]:
    """The configurations of some files, and those that cannot be read."""
    configs, lost = [], []
    for path in paths:
        try:
            configs.append(parse_config(read_text(path), path.stem))
        except InputError as error:
            lost.append(Lost(path.stem, str(error)))
    return tuple(configs), tuple(lost)


def digest(config: ExperimentConfig) -> str:
    """Tells configurations apart, whatever their files look like."""
    return hashlib.sha256(repr(config).encode()).hexdigest()


def in_order(name: str) -> list[tuple[str, int]]:
    """Sorts names by the numbers in them.

    >>> sorted(["expr10", "expr9"], key=in_order)
    ['expr9', 'expr10']
    """
    parts = re.split(r"([0-9]+)", name)
    return [
        (text, int(number)) for text, number in zip(parts[::2], [*parts[1::2], "0"], strict=True)
    ]
