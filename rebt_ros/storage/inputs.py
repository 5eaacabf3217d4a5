"""Whatever a user names on the command line, as demonstrations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import Demonstration, RowKind
from rebt_ros.errors import InputError, OptionError
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.account import Account
from rebt_ros.storage.bag import read_bag
from rebt_ros.storage.bag_files import holds_messages, is_bag, refuse_strangers
from rebt_ros.storage.bag_metadata import NAME as METADATA
from rebt_ros.storage.column_names import FEWEST_RISING
from rebt_ros.storage.csv_table import read_csv
from rebt_ros.storage.read import Read
from rebt_ros.storage.recording import SUFFIX, is_recording, read_recording, recordings
from rebt_ros.storage.robot_bag import read_robot_bag
from rebt_ros.storage.text import unreadable


@dataclass(frozen=True, slots=True)
class InputOptions:
    """How to read inputs; `read_csv` and `read_bag` say more about each."""

    labels: tuple[str, ...] = ()
    """Of CSV tables, the columns that hold the actions; by default the last column."""
    header: bool = True
    """Of CSV tables: whether the first line names the columns."""
    row_kind: RowKind | None = None
    """Of CSV tables, what a row is; None to tell by the columns."""
    features: frozenset[str] = frozenset()
    """Of CSV tables, columns that are features even where their names say that they number or date
    the rows."""
    channels: tuple[str, ...] = ()
    """Of CSV tables that have all of these columns, the labels where `labels` names none."""
    state_topics: tuple[StateTopic, ...] = ()
    """Of bags, the topics of the state; by default the only one of numbers."""
    action_topics: tuple[str, ...] = ()
    """Of bags, the topics of the actions; by default the only one of texts."""
    sample_rate: float | None = None
    """Of bags, rows per second and channel while an action holds; None for a row per action."""
    skip_bad: bool = False
    """Of bags: whether messages that cannot be used are left out, instead of the bag refused."""
    robot: RobotFile | None = None
    """Of bags, where features and actions are in messages of any type, instead of topics."""


@dataclass(frozen=True, slots=True)
class Loaded:
    """What was read from all inputs."""

    demonstrations: tuple[Demonstration, ...]
    notes: tuple[str, ...]
    """What a person should know, each led by the name of its demonstration, or by its path where
    others have the same name."""
    accounts: Mapping[str, Account] = field(default_factory=dict)
    """Where what each demonstration's file holds went, by the same names."""
    robot: RobotFile | None = None
    """Where features and actions are in messages, as the first file has it that says so."""


#: Suffixes of tables, in lower case.
_TABLES = frozenset({".csv", ".tsv"})


class InputKind(Enum):
    """What a file, or a directory that is one demonstration, is."""

    TABLE = "CSV table"
    RECORDING = "recording"
    BAG = "bag"


def as_paths(inputs: Sequence[str | Path] | str | Path) -> tuple[Path, ...]:
    """Inputs as people name them in Python: several, or the only one."""
    return tuple(map(Path, [inputs] if isinstance(inputs, str | Path) else inputs))


def load(inputs: Sequence[Path], options: InputOptions | None = None) -> Loaded:
    """Reads demonstrations.

    Args:
        inputs: Bags (directories, .mcap or .db3 files), recordings, CSV tables, and directories of
            any of them.
        options: How to read them.

    Returns:
        All demonstrations, in the order of the inputs; those of a directory oldest first.

    Raises:
        InputError: There is no input, one is there twice, or one cannot be read.
        OptionError: An option is for a kind of input that none is of.
    """
    options = options or InputOptions()
    if not inputs:
        raise InputError("there is no input: name a bag, a recording or a CSV table.")
    sources = [source for path in inputs for source in _readable_sources(path)]
    _check_distinct([path for path, _ in sources])
    _check_options(options, {kind for _, kind in sources})
    reads = _with_common_features(_read(sources, options))
    names = _names([path for path, _ in sources], reads)
    return Loaded(
        tuple(read.demonstration for read in reads),
        tuple(
            f"{name}: {note}"
            for name, read in zip(names, reads, strict=True)
            for note in (*read.notes, *(read.account.notes() if read.account else ()))
        ),
        {name: read.account for name, read in zip(names, reads, strict=True) if read.account},
        next((read.robot for read in reads if read.robot is not None), None),
    )


def _read(sources: Sequence[tuple[Path, InputKind]], options: InputOptions) -> list[Read]:
    """Reads them all; a column that numbers the rows of some tables only is a feature of all.

    What is called `row` may be where a robot is, and happen to rise all the way in a table.
    """
    reads = [_READERS[kind](path, options) for path, kind in sources]
    measured = {
        feature.name
        for demonstration in (read.demonstration for read in reads)
        if len(demonstration) >= FEWEST_RISING
        for feature in demonstration.features
    }
    asked_for = measured & frozenset[str]().union(*(read.no_features for read in reads))
    options = replace(options, features=options.features | asked_for)
    return [
        _READERS[kind](path, options) if asked_for & read.no_features else read
        for (path, kind), read in zip(sources, reads, strict=True)
    ]


def _names(paths: Sequence[Path], reads: Sequence[Read]) -> list[str]:
    """What inputs are called in notes: by their paths where demonstrations share a name."""
    counts = Counter(read.demonstration.name for read in reads)
    return [
        read.demonstration.name if counts[read.demonstration.name] == 1 else str(path)
        for path, read in zip(paths, reads, strict=True)
    ]


def _with_common_features(reads: Sequence[Read]) -> list[Read]:
    """Leaves out everywhere which features a table has none of: `Read.no_features`."""
    nowhere = frozenset[str]().union(*(read.no_features for read in reads))
    common = []
    for read in reads:
        demonstration = read.demonstration
        names = [feature.name for feature in demonstration.features]
        kept = [place for place, name in enumerate(names) if name not in nowhere]
        if not 0 < len(kept) < len(names):
            common.append(read)
            continue
        fewer = replace(
            demonstration,
            features=tuple(demonstration.features[place] for place in kept),
            states=demonstration.states[:, kept],
        )
        dropped = ", ".join(repr(name) for name in names if name in nowhere)
        note = f"no feature in every table, and so left out: {dropped}"
        common.append(replace(read, demonstration=fewer, notes=(*read.notes, note)))
    return common


def holds_bags(inputs: Sequence[Path]) -> bool:
    """Whether one of the inputs is a bag.

    Raises:
        InputError: One cannot be read.
    """
    return any(kind is InputKind.BAG for path in inputs for _, kind in _readable_sources(path))


def _readable_sources(path: Path) -> tuple[tuple[Path, InputKind], ...]:
    try:
        return tuple(_sources(path))
    except OSError as err:
        raise unreadable(path, err) from err


def _sources(path: Path) -> Iterator[tuple[Path, InputKind]]:
    """The demonstrations that an input stands for."""
    if not path.exists():
        raise InputError(f"{path} does not exist: name a bag, a recording or a CSV table.")
    if path.is_dir():
        yield from [(path, InputKind.BAG)] if is_bag(path) else _within(path)
    elif path.name == METADATA:
        yield path.absolute().parent, InputKind.BAG
    else:
        yield path, _kind_of(path)


def _within(directory: Path) -> Iterator[tuple[Path, InputKind]]:
    """The demonstrations in a directory that is no bag: recordings, bags or tables."""
    inside = sorted(directory.iterdir())
    bags = [path for path in inside if path.is_dir() and is_bag(path)]
    recorded = (
        path for path in inside if path.suffix == SUFFIX and path.is_file() and is_recording(path)
    )
    if first := next(recorded, None):
        if bags:
            raise InputError(
                f"{directory} holds bags and recordings ({bags[0].name}, {first.name}): name those "
                "to read."
            )
        yield from ((recording, InputKind.RECORDING) for recording in recordings(directory))
        return
    tables = [path for path in inside if _has_table_suffix(path) and path.is_file()]
    if not bags and not tables:
        yield from ((recording, InputKind.RECORDING) for recording in recordings(directory))
        return
    if bags and tables:
        raise InputError(
            f"{directory} holds bags and tables ({bags[0].name}, {tables[0].name}): name those to "
            "read."
        )
    yield from ((bag, InputKind.BAG) for bag in bags)
    yield from ((table, InputKind.TABLE) for table in tables)


def _kind_of(file: Path) -> InputKind:
    refuse_strangers(file)
    if holds_messages(file):
        return InputKind.BAG
    if _has_table_suffix(file) or not is_recording(file):
        return InputKind.TABLE
    return InputKind.RECORDING


def _has_table_suffix(file: Path) -> bool:
    return file.suffix.lower() in _TABLES


def _check_distinct(paths: Sequence[Path]) -> None:
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise InputError(f"{path} is given twice: name every demonstration once.")
        seen.add(path.resolve())


def _check_options(options: InputOptions, kinds: set[InputKind]) -> None:
    given = (
        (bool(options.labels), "a label column", InputKind.TABLE),
        (not options.header, "the absence of a header", InputKind.TABLE),
        (options.row_kind is not None, "what a row is", InputKind.TABLE),
        (bool(options.state_topics), "a state topic", InputKind.BAG),
        (bool(options.action_topics), "an action topic", InputKind.BAG),
        (options.sample_rate is not None, "a sample rate", InputKind.BAG),
        (options.skip_bad, "skipping of bad messages", InputKind.BAG),
        (options.robot is not None, "a robot file", InputKind.BAG),
    )
    for is_given, what, kind in given:
        if is_given and kind not in kinds:
            raise OptionError(
                f"the options name {what}, but no input is a {kind.value}: leave that out."
            )
    if options.robot is not None and (options.state_topics or options.action_topics):
        raise OptionError(
            "the options name a robot file, which says what the topics are, and topics beside it: "
            "leave those out."
        )


def _table(path: Path, options: InputOptions) -> Read:
    if is_recording(path):
        raise InputError(
            f"{path} begins like a recording, but its suffix is that of a table: "
            f"name it {path.stem}{SUFFIX}."
        )
    return read_csv(
        path,
        labels=options.labels,
        header=options.header,
        row_kind=options.row_kind,
        features=options.features,
        channels=options.channels,
    )


def _recording(path: Path, _: InputOptions) -> Read:
    return read_recording(path)


def _bag(path: Path, options: InputOptions) -> Read:
    if options.robot is not None:
        return read_robot_bag(
            path, options.robot, sample_rate=options.sample_rate, skip_bad=options.skip_bad
        )
    return read_bag(
        path,
        state_topics=options.state_topics,
        action_topics=options.action_topics,
        sample_rate=options.sample_rate,
        skip_bad=options.skip_bad,
    )


_READERS: dict[InputKind, Callable[[Path, InputOptions], Read]] = {
    InputKind.TABLE: _table,
    InputKind.RECORDING: _recording,
    InputKind.BAG: _bag,
}
