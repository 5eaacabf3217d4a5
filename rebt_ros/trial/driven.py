"""How often each tree succeeded in the last trial, kept beside what was learned."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rebt_ros.codec.bounds import Count
from rebt_ros.codec.form import MisfitError
from rebt_ros.codec.hints import record
from rebt_ros.codec.text import indented, parsed
from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.text import read_text
from rebt_ros.trial.candidates import Candidate
from rebt_ros.trial.tally import Tally

#: Name of the file in the directory of what was learned.
NAME: Final = "trials.json"


@dataclass(frozen=True, slots=True)
class _Entry:
    """Episodes of one tree."""

    successes: Count
    episodes: Count


@dataclass(frozen=True, slots=True)
class _File:
    """The file."""

    trees: dict[str, _Entry]
    """By the fingerprints of their documents."""


_FORM: Final = record(_File)


def write_driven(directory: Path, driven: Iterable[tuple[Candidate, Tally]]) -> None:
    """Writes trials.json, in place of that of the trial before.

    Args:
        directory: Of what was learned.
        driven: The trees, and how often each succeeded; those that never drove are left out.

    Raises:
        StorageError: It cannot be written.
    """
    trees = {
        candidate.fingerprint: _Entry(tally.successes, tally.episodes)
        for candidate, tally in driven
        if tally.episodes
    }
    write_text_atomically(directory / NAME, indented(_FORM.encode(_File(trees))) + "\n")


def read_driven(directory: Path) -> Mapping[str, Tally]:
    """How often each tree succeeded, by the fingerprint of its document; empty without a trial.

    Raises:
        InputError: The file is there and cannot be used.
    """
    path = directory / NAME
    if not path.exists():
        return {}
    try:
        trees = _FORM.decode(parsed(read_text(path))).trees
        return {name: Tally(one.successes, one.episodes) for name, one in trees.items()}
    except (MisfitError, ValueError, RecursionError) as err:
        raise InputError(f"{path} cannot be used ({err}): delete it, or drive again.") from err
