"""What all commands share: options of inputs, color, errors as one sentence."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import Enum
from pathlib import Path
from typing import TextIO, TypeVar

from rebt_ros import streams
from rebt_ros.commands.progress import ProgressBar
from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.errors import RebtError
from rebt_ros.robot_file.reading import read_robot_file
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.input_options import Aside, InputOptions, ReadCounts, ReadingPlan
from rebt_ros.storage.read_cache import default_cache
from rebt_ros.verification.robot_rules import rules_of

#: Exit codes of a failure that the user can mend, and of Ctrl-C (128 + SIGINT).
_FAILED, _INTERRUPTED = 1, 130

#: So many inputs that are set aside are listed in the terminal.
_LISTED = 20

_Word = TypeVar("_Word", bound=Enum)


def parse(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None = None
) -> argparse.Namespace:
    """What the command line says; to be called first of all.

    Options may stand anywhere among the inputs: ``learn one.csv --out learned another.csv``.
    """
    streams.prepare()
    words = sys.argv[1:] if arguments is None else list(arguments)
    if "--" in words:
        # What `parse_intermixed_args` makes of names that begin with a dash depends on the Python.
        return parser.parse_args(words)
    return parser.parse_intermixed_args(words)


def run(command: Callable[[], None], name: str) -> None:
    """Runs a command; a `RebtError`, or a lack of memory, becomes one sentence and exit code 1."""
    try:
        command()
        sys.stdout.flush()
    except RebtError as error:
        _fail(f"{name}: {error}")
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
    except MemoryError:
        _fail(
            f"{name}: there is not enough memory: close other programs, raise the limit (ulimit "
            "-v), or name fewer inputs."
        )
    except BrokenPipeError:
        # The reader, such as `head`, has seen enough.
        streams.drop(sys.stdout)
    except OSError as error:
        if error.filename is not None:
            _fail(f"{name}: {error.filename} cannot be used ({error.strerror}).")
        if _is_nowhere():
            _fail(f"{name}: the current directory is not there any more: change to another one.")
        streams.drop(sys.stdout)
        _fail(f"{name}: the output cannot be written ({error.strerror or error}).")


def _is_nowhere() -> bool:
    """Whether somebody has removed the directory that relative paths begin in."""
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


def _fail(sentence: str) -> None:
    print(sentence, file=sys.stderr)
    sys.exit(_FAILED)


def directory(text: str) -> Path:
    """The type of an option that names a directory to write to."""
    if not text.strip():
        raise argparse.ArgumentTypeError("a directory needs a name: name one, or leave it out")
    path = Path(text)
    with contextlib.suppress(OSError):
        for one in (path, *path.parents):
            if one.exists() and not one.is_dir():
                raise argparse.ArgumentTypeError(f"{one} is no directory: name another place")
    return path


def _input(text: str) -> Path:
    """The type of an argument that names what is read: an unset variable of a shell does not."""
    if not text.strip():
        raise argparse.ArgumentTypeError("an input needs a name: name a file or a directory")
    return Path(text)


def count(text: str) -> int:
    """The type of an option that says how many, one at least."""
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is no number of things: name 1 or more")
    return int(text)


def word_of(kind: type[_Word], *others: str) -> Callable[[str], _Word]:
    """The type of an option that takes one of a few words, each the value of an enum's member.

    Args:
        kind: The enum.
        others: Words that the option takes besides, for its refusals.
    """

    def read(text: str) -> _Word:
        try:
            return kind(text)
        except ValueError:
            known = ", ".join((*others, *(str(member.value) for member in kind)))
            raise argparse.ArgumentTypeError(f"{text!r} is none of {known}") from None

    return read


def use_color() -> bool:
    """Whether the terminal shows colors and its user wants them (https://no-color.org)."""
    return sys.stdout.isatty() and "NO_COLOR" not in os.environ


def aligned(cells: Sequence[Sequence[str]], words: int = 0) -> Iterator[str]:
    """Lines of a table: the first column to the left, the others to the right.

    Args:
        cells: The lines.
        words: How many columns at the right are text, which stands to the left.
    """
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    numbers = range(1, len(widths) - words)
    for line in cells:
        sides = (">" if place in numbers else "<" for place in range(len(line)))
        placed = (
            f"{cell:{side}{width}}" for cell, side, width in zip(line, sides, widths, strict=True)
        )
        yield "  ".join(placed).rstrip()


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Adds the seed of what is made up."""
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        help="random seed; the same seed gives the same files (default: %(default)s)",
    )


def add_input_options(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """Adds INPUT... and how to read it."""
    parser.add_argument(
        "inputs",
        nargs="+" if required else "*",
        type=_input,
        metavar="INPUT",
        help="a rosbag2 bag (directory, .mcap or .db3), a recording, a CSV table, a directory of "
        "these, a pattern such as 'fleet/*', or @FILE with one input per line",
    )
    tables = parser.add_argument_group("CSV tables")
    tables.add_argument(
        "--label",
        action="append",
        default=[],
        metavar="COLUMN",
        help="column with the actions; repeatable: each column becomes a channel named after it "
        "(default: the column called action, else the last one)",
    )
    tables.add_argument(
        "--episode-column",
        action="append",
        metavar="COLUMN",
        help="column that says to which demonstration a row belongs, which splits the table; "
        "repeatable, where only several tell them apart; none for a single demonstration (default: "
        "a column called episode, trial, demo, run_id, … whose values do not come back)",
    )
    tables.add_argument(
        "--no-header", action="store_true", help="the first line is a row; columns are x0, x1, …"
    )
    tables.add_argument(
        "--rows",
        type=word_of(RowKind),
        metavar="|".join(kind.value for kind in RowKind),
        help="what a row is: a whole action, or a sample of an action that is held (default: "
        "event if a column LABEL.outcome says how actions ended, else sample)",
    )
    bags = parser.add_argument_group("bags")
    bags.add_argument(
        "--state-topic",
        action="append",
        default=[],
        metavar="TOPIC[:FIELD,…]",
        help="Float64MultiArray topic with the state, and names for its values; repeatable "
        "(default: the only one, with the names in its layout labels)",
    )
    bags.add_argument(
        "--action-topic",
        action="append",
        default=[],
        metavar="TOPIC",
        help="String topic with the actions; repeatable (default: the only one)",
    )
    bags.add_argument(
        "--sample-rate",
        type=float,
        metavar="HZ",
        help="rows per second while an action holds (default: one row per action message)",
    )
    bags.add_argument(
        "--robot",
        type=Path,
        metavar="FILE",
        help="robot file that says where features and actions are in messages of any type; "
        "replaces the topic options (docs/robot_file.md)",
    )
    bags.add_argument(
        "--skip-bad",
        action="store_true",
        help="skip malformed messages instead of refusing the bag",
    )
    _add_plan(parser)


def _add_plan(parser: argparse.ArgumentParser) -> None:
    """Adds by which means inputs are read."""
    many = parser.add_argument_group("many inputs (docs/scale.md)")
    many.add_argument(
        "--exclude",
        action="append",
        default=[],
        metavar="NAME",
        help="leave out demonstrations: a name that inspect prints, a path, a pattern such as "
        "'run_?.csv', or @FILE with one of these per line; repeatable",
    )
    cache = many.add_mutually_exclusive_group()
    cache.add_argument(
        "--cache",
        type=directory,
        metavar="DIR",
        help="cache what is read here, so that only new inputs are read the next time (default: "
        "rebt_ros in $XDG_CACHE_HOME or ~/.cache)",
    )
    cache.add_argument(
        "--no-cache", action="store_true", help="read everything again and cache nothing"
    )
    many.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="number of reading processes; -1 for one per processor (default: one per processor "
        "if that saves time)",
    )
    many.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster whose workers read the inputs, such as "
        "tcp://127.0.0.1:8786; workers need the same paths and the package distributed",
    )
    many.add_argument(
        "--strict",
        action="store_true",
        help="stop at an input that cannot be read, instead of setting it aside",
    )


def _robot_file(path: Path) -> RobotFile:
    robot = read_robot_file(path)
    # Rules that cannot be read are found at once.
    rules_of(robot)
    return robot


def input_options(
    arguments: argparse.Namespace,
    progress: ProgressBar | None = None,
    tell_notes: Callable[[tuple[str, ...]], None] | None = None,
) -> InputOptions:
    """The options that `add_input_options` added.

    Args:
        arguments: What the command line says.
        progress: Shows how far the reading is.
        tell_notes: Told how the inputs were read; by default the terminal lists it.
    """
    return InputOptions(
        labels=tuple(arguments.label),
        header=not arguments.no_header,
        row_kind=arguments.rows,
        episode_columns=_episode_columns(arguments.episode_column),
        state_topics=tuple(map(_state_topic, arguments.state_topic)),
        action_topics=tuple(arguments.action_topic),
        sample_rate=arguments.sample_rate,
        skip_bad=arguments.skip_bad,
        robot=_robot_file(arguments.robot) if arguments.robot else None,
        exclude=tuple(arguments.exclude),
        plan=ReadingPlan(
            cache=None if arguments.no_cache else arguments.cache or default_cache(),
            jobs=arguments.jobs,
            scheduler=arguments.scheduler,
            strict=arguments.strict,
            progress=progress or ProgressBar(),
            tell=_tell,
            tell_counts=_tell_counts,
            tell_notes=tell_notes or _lister_of_notes(),
        ),
    )


def print_notes(notes: Iterable[str], to: TextIO | None = None) -> None:
    """Prints notes, a line each; by default to the standard output."""
    for note in notes:
        print(f"note: {note}.", file=to)


def _lister_of_notes() -> Callable[[tuple[str, ...]], None]:
    """Says how inputs were read, beside what a command prints, and once if it reads them twice."""
    told: set[str] = set()

    def tell(notes: tuple[str, ...]) -> None:
        new = [note for note in notes if note not in told]
        told.update(new)
        print_notes(new[:_LISTED], sys.stderr)
        if len(new) > _LISTED:
            print(f"and {len(new) - _LISTED} more notes: learn prints all of them", file=sys.stderr)

    return tell


def _tell(aside: tuple[Aside, ...]) -> None:
    """Says what was set aside."""
    what = "1 input" if len(aside) == 1 else f"{len(aside)} inputs"
    print(f"set aside {what} that cannot be read (--strict refuses such):", file=sys.stderr)
    for one in aside[:_LISTED]:
        reason = "" if str(one.path) in one.reason else f"{one.path}: "
        print(f"  {reason}{one.reason}", file=sys.stderr)
    if len(aside) > _LISTED:
        more = len(aside) - _LISTED
        print(f"  and {more} more: learn lists all of them in summary.json", file=sys.stderr)


def _tell_counts(counts: ReadCounts) -> None:
    """Says what was not read again, where several inputs were read before."""
    if counts.cached > 1:
        aside = f", {counts.aside} set aside" if counts.aside else ""
        print(
            f"{counts.cached + counts.read + counts.aside} inputs: {counts.cached} from the cache, "
            f"{counts.read} read{aside}",
            file=sys.stderr,
        )


def _episode_columns(named: list[str] | None) -> tuple[str, ...] | None:
    return () if named == ["none"] else None if named is None else tuple(named)


def _state_topic(text: str) -> StateTopic:
    name, _, fields = text.partition(":")
    return StateTopic(name, tuple(fields.split(",")) if fields else ())
