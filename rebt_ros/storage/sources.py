"""What a user names on the command line, as files and directories that are one demonstration each.

A directory stands for what is in it, a pattern such as `fleet/*/run_?` for what it matches, and
`@list.txt` for the lines of a file.
"""

from __future__ import annotations

import glob
from collections import Counter
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError, listing, printable
from rebt_ros.storage.bag_files import begins_like_messages, holds_messages, is_bag
from rebt_ros.storage.bag_metadata import NAME as METADATA
from rebt_ros.storage.input_options import InputKind, Source
from rebt_ros.storage.recording_files import is_named_so, is_recording, no_recordings, recordings
from rebt_ros.storage.strangers import PACKED_ARCHIVES, refuse_strangers
from rebt_ros.storage.text import unreadable

#: Suffixes of tables, in lower case.
_TABLES = frozenset({".csv", ".tsv"})

#: Ends of names of what may be demonstrations and is not read, in lower case.
_UNREAD = (
    *(f"{suffix}{packed}" for suffix in (".csv", ".tsv") for packed in (".gz", ".bz2", ".xz")),
    *(".bag", ".xlsx", ".xls", ".ods", ".parquet", ".feather", ".zip", ".tar", ".7z", ".rar"),
    *PACKED_ARCHIVES,
)

#: How an input begins that is a list of inputs.
_LIST: Final = "@"
#: Begins a line of a list that says nothing.
_COMMENT: Final = "#"
_LONGEST_LIST: Final = 1 << 30


@dataclass(frozen=True, slots=True)
class Strange:
    """A file that was looked at, and that is nothing to read."""

    path: Path
    error: InputError


def sources_of(inputs: Sequence[Path], *, strict: bool = True) -> list[Source | Strange]:
    """The demonstrations that inputs stand for.

    Args:
        inputs: Bags (directories, .mcap or .db3 files), recordings, CSV tables, directories of any
            of them, patterns of their paths, and `@` with the path of a list of all those.
        strict: Whether a file that is nothing to read is an error, instead of a `Strange`.

    Returns:
        In the order of the inputs; those of a directory oldest first, those of a pattern sorted.

    Raises:
        InputError: There is no input, one is there twice, or one is not there.
    """
    if not inputs:
        raise InputError("there is no input: name a bag, a recording or a CSV table.")
    found: list[Source | Strange] = []
    for path in _expanded(inputs):
        try:
            found += _sources(path)
        except OSError as err:
            raise unreadable(path, err) from err
        except InputError as err:
            if strict or not path.is_file():
                raise
            found.append(Strange(path, err))
    _check_distinct([one.path for one in found])
    return found


def names_of(sources: Sequence[Source | Strange]) -> tuple[str, ...]:
    """What demonstrations are called: by their files, by paths where several files have one name.

    >>> names_of([Source(Path("a/run.csv"), InputKind.TABLE), Source(Path("b"), InputKind.BAG)])
    ('run.csv', 'b')
    """
    # Names of files need not be UTF-8, or printable; those of demonstrations are written to files.
    names = [printable(source.path.absolute().name) for source in sources]
    counts = Counter(names)
    return tuple(
        name if counts[name] == 1 else printable(str(source.path))
        for name, source in zip(names, sources, strict=True)
    )


def passed_over(inputs: Sequence[Path], taken: Set[Path]) -> Iterator[str]:
    """Notes what in directories looks like demonstrations and is not among those taken."""
    for path in _expanded(inputs):
        if path.is_dir() and not is_bag(path):
            yield from (f"{path}: {note}" for note in _passed_over(path, taken))


def _passed_over(directory: Path, taken: Set[Path]) -> Iterator[str]:
    yield from no_recordings(directory)
    others = [
        path
        for path in sorted(directory.iterdir())
        if path not in taken and not path.name.startswith(".") and not is_named_so(path)
    ]
    if below := list(filter(_holds_demonstrations, others)):
        yield f"demonstrations in directories in it are left out: {_names(below)}"
    if files := list(filter(_may_be_demonstration, others)):
        yield f"what else may be demonstrations is left out: {_names(files)}"


def _holds_demonstrations(directory: Path) -> bool:
    """Whether there are demonstrations in a directory, or bags in it."""
    if not directory.is_dir():
        return False
    try:
        return is_bag(directory) or any(
            is_bag(path) if path.is_dir() else _may_be_demonstration(path)
            for path in directory.iterdir()
        )
    except OSError:
        return False


def _may_be_demonstration(path: Path) -> bool:
    """Whether a file's name is one of a demonstration, also of kinds that are not read."""
    return path.is_file() and (
        is_named_so(path)
        or holds_messages(path)
        or path.name.lower().endswith((*_TABLES, *_UNREAD))
    )


def _names(paths: Sequence[Path]) -> str:
    return listing([path.name for path in paths])


def has_table_suffix(file: Path) -> bool:
    """Whether the name of a file says that it is a table."""
    return file.suffix.lower() in _TABLES


def _expanded(inputs: Sequence[Path]) -> Iterator[Path]:
    """The inputs, with what lists and patterns stand for in their places."""
    for path in inputs:
        if str(path).startswith(_LIST) and not path.exists():
            yield from _listed(Path(str(path)[len(_LIST) :]))
        else:
            yield from _matching(path)


def _listed(file: Path) -> Iterator[Path]:
    """What the lines of a list stand for, one of which is what it would be as an input."""
    for line in listed(file, "inputs"):
        if line.startswith(_LIST) and not Path(line).exists():
            raise InputError(f"{file} lists the list {line}: name it as an input of its own.")
        yield from _matching(Path(line))


def listed(file: Path, what: str) -> tuple[str, ...]:
    """The lines of a list that say something; at least one.

    Args:
        file: The list.
        what: Of what it is one, in the plural.

    Raises:
        InputError: It cannot be read, or is no list.
    """
    try:
        if file.is_file() and file.stat().st_size > _LONGEST_LIST:
            raise InputError(f"{file} is too long for a list of {what}: name a shorter one.")
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as err:
        raise _no_list(file, what) from err
    except OSError as err:
        raise unreadable(file, err) from err
    named = [line.strip() for line in lines]
    named = [line for line in named if line and not line.startswith(_COMMENT)]
    if not named:
        raise InputError(f"{file} lists no {what}: write one in each of its lines.")
    if any("\0" in line for line in named):
        raise _no_list(file, what)
    return tuple(named)


def _no_list(file: Path, what: str) -> InputError:
    return InputError(f"{file} is no list of {what}: write one in each of its lines.")


def _matching(path: Path) -> Iterator[Path]:
    """What a pattern matches, sorted; a path that is there stands for itself."""
    if not glob.has_magic(str(path)) or path.exists():
        yield path
        return
    found = sorted(glob.glob(str(path), recursive=True))
    if not found:
        raise InputError(f"nothing matches {path}: name bags, recordings or CSV tables.")
    yield from map(Path, found)


def _sources(path: Path) -> Iterator[Source]:
    """The demonstrations that a path stands for."""
    if not path.exists():
        raise InputError(f"{path} does not exist: name a bag, a recording or a CSV table.")
    if path.is_dir():
        yield from [Source(path, InputKind.BAG)] if is_bag(path) else _within(path)
    elif path.name == METADATA:
        yield Source(path.absolute().parent, InputKind.BAG)
    else:
        yield Source(path, _kind_of(path))


def _within(directory: Path) -> Iterator[Source]:
    """The demonstrations in a directory that is no bag: recordings, bags or tables."""
    inside = sorted(directory.iterdir())
    bags = [path for path in inside if path.is_dir() and is_bag(path)]
    recorded = (path for path in inside if is_named_so(path) and is_recording(path))
    if first := next(recorded, None):
        if bags:
            raise InputError(
                f"{directory} holds bags and recordings ({bags[0].name}, {first.name}): name those "
                "to read."
            )
        yield from (Source(recording, InputKind.RECORDING) for recording in recordings(directory))
        return
    tables = [path for path in inside if has_table_suffix(path) and path.is_file()]
    if not bags and not tables:
        below = [one for one in inside if _holds_demonstrations(one)]
        if below and not any(map(is_named_so, inside)):
            raise InputError(
                f"{directory} holds directories with demonstrations ({_names(below)}): name those "
                "to read."
            )
        yield from (Source(recording, InputKind.RECORDING) for recording in recordings(directory))
        return
    if bags and tables:
        raise InputError(
            f"{directory} holds bags and tables ({bags[0].name}, {tables[0].name}): name those to "
            "read."
        )
    yield from (Source(bag, InputKind.BAG) for bag in bags)
    yield from (Source(table, InputKind.TABLE) for table in tables)


def _kind_of(file: Path) -> InputKind:
    if not holds_messages(file):
        refuse_strangers(file)
    if holds_messages(file) or begins_like_messages(file):
        return InputKind.BAG
    if has_table_suffix(file) or not is_recording(file):
        return InputKind.TABLE
    return InputKind.RECORDING


def _check_distinct(paths: Sequence[Path]) -> None:
    seen: set[Path] = set()
    directories: dict[Path, Path] = {}
    for path in paths:
        if path.is_symlink() or path.name in ("", ".."):
            place = path.resolve()
        else:
            # What leads to the files of one directory is looked at once.
            if path.parent not in directories:
                directories[path.parent] = path.parent.resolve()
            place = directories[path.parent] / path.name
        if place in seen:
            raise InputError(f"{path} is given twice: name every demonstration once.")
        seen.add(place)
