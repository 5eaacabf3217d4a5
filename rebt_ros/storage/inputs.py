"""Whatever a user names on the command line, as demonstrations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.errors import InputError, OptionError, RebtError, listing
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.account import Account
from rebt_ros.storage.addressing import wanted, weighted
from rebt_ros.storage.bag import read_bag
from rebt_ros.storage.column_names import FEWEST_RISING
from rebt_ros.storage.csv_table import read_csv
from rebt_ros.storage.gathering import Gathered, Reading, gather
from rebt_ros.storage.input_options import Aside, InputKind, InputOptions, ReadCounts, Source
from rebt_ros.storage.read import Read
from rebt_ros.storage.recording import read_recording
from rebt_ros.storage.recording_files import SUFFIX, is_recording
from rebt_ros.storage.robot_bag import read_robot_bag
from rebt_ros.storage.sources import Strange, names_of, passed_over, sources_of


@dataclass(frozen=True, slots=True)
class Loaded:
    """What was read from all inputs."""

    demonstrations: tuple[Demonstration, ...]
    """Their names differ: they are those of their files, or their paths where several files have
    one name; of several in a table, `#` and what it says follow."""
    notes: tuple[str, ...]
    """What a person should know, each led by the name of a file, as demonstrations are called."""
    accounts: Mapping[str, Account] = field(default_factory=dict)
    """Where what each file holds went, by the same names."""
    robot: RobotFile | None = None
    """Where features and actions are in messages, as the first file has it that says so."""
    aside: tuple[Aside, ...] = ()
    """What could not be read, in the order of the inputs."""
    paths: tuple[Path, ...] = ()
    """Of the demonstrations."""
    excluded: tuple[Path, ...] = ()
    """Files that were left out as asked, in the order of the inputs."""
    weights: tuple[Fraction, ...] = ()
    """How much each demonstration counts."""
    excluded_parts: tuple[str, ...] = ()
    """Demonstrations of tables that were left out as asked, where others of these were not."""


def as_paths(inputs: Sequence[str | Path] | str | Path) -> tuple[Path, ...]:
    """Inputs as people name them in Python: several, or the only one.

    Raises:
        InputError: One is no path.
    """
    several = [inputs] if isinstance(inputs, str | Path) else inputs
    if not isinstance(several, Iterable) or isinstance(several, bytes):
        raise InputError(f"{inputs!r} is no input: name a bag, a recording or a CSV table.")
    for one in several:
        if not isinstance(one, str | Path) or not str(one).strip():
            raise InputError(f"{one!r} is no input: name a bag, a recording or a CSV table.")
    return tuple(map(Path, several))


def load(inputs: Sequence[Path], options: InputOptions | None = None) -> Loaded:
    """Reads demonstrations.

    Args:
        inputs: Bags (directories, .mcap or .db3 files), recordings, CSV tables, directories of
            any of them, patterns such as `fleet/*`, and lists of all those, such as `@list.txt`.
        options: How to read them.

    Returns:
        All demonstrations, in the order of the inputs; those of a directory oldest first.

    Raises:
        InputError: There is no input, one is there twice, or one cannot be read; if the plan is
            not strict, none can be read; what is left out or weighed is not there, or is all.
        OptionError: An option is for a kind of input that none is of.
        WorkerError: What reads elsewhere does not work.
    """
    options = options or InputOptions()
    is_chosen = bool(options.exclude or options.weights)
    every = sources_of(inputs, strict=options.plan.strict and not is_chosen)
    paths = [one.path for one in every]
    read_at_all = wanted(names_of(every), paths, options.exclude, options.weights)
    left_out = tuple(
        path for path, is_read in zip(paths, read_at_all.files, strict=True) if not is_read
    )
    sources = [one for one, is_read in zip(every, read_at_all.files, strict=True) if is_read]
    strange_one = next((one for one in sources if isinstance(one, Strange)), None)
    if strange_one is not None and options.plan.strict:
        raise strange_one.error
    readable = [one for one in sources if isinstance(one, Source)]
    _check_options(options, {source.kind for source in readable})
    strange = {one.path: one.error for one in sources if isinstance(one, Strange)}
    gathered = _gathered(readable, options)
    errors = strange | {
        source.path: answer
        for source, answer in zip(readable, gathered.found, strict=True)
        if isinstance(answer, RebtError)
    }
    aside = _aside([one.path for one in sources if one.path in errors], errors, len(sources))
    names = dict(zip((one.path for one in sources), names_of(sources), strict=True))
    there = [
        (source.path, _named(answer, names[source.path]))
        for source, answer in zip(readable, gathered.found, strict=True)
        if isinstance(answer, Read)
    ]
    if aside:
        options.plan.tell(aside)
    options.plan.tell_counts(ReadCounts(gathered.cached, len(there) - gathered.cached, len(aside)))
    reads = _with_common_features([read for _, read in there])
    shown = _Shown.of(reads, [path for path, _ in there])
    counting = weighted(
        shown.names, shown.paths, options.exclude, options.weights, shown.files, read_at_all.done
    )
    kept = shown.only([place for place, count in enumerate(counting) if count])
    not_shown = [name for name, count in zip(shown.names, counting, strict=True) if not count]
    notes = (
        *_notes_on_excluded(
            [*map(str, left_out), *not_shown], len(every) + len(shown.names) - len(there)
        ),
        *_notes_on_cache(gathered, options),
        *passed_over(inputs, {one.path for one in every}),
        *(
            f"{read.demonstration.name}: {note}"
            for read in reads
            for note in (*read.notes, *(read.account.notes() if read.account else ()))
        ),
    )
    if notes:
        options.plan.tell_notes(notes)
    return Loaded(
        kept.demonstrations,
        notes,
        {read.demonstration.name: read.account for read in reads if read.account},
        next((read.robot for read in reads if read.robot is not None), None),
        aside,
        kept.paths,
        left_out,
        tuple(filter(None, counting)),
        tuple(not_shown),
    )


@dataclass(frozen=True, slots=True)
class _Shown:
    """Demonstrations, of which a table may hold several."""

    demonstrations: tuple[Demonstration, ...]
    paths: tuple[Path, ...]
    """Of their files."""
    files: tuple[str, ...]
    """What these are called."""

    @classmethod
    def of(cls, reads: Sequence[Read], paths: Sequence[Path]) -> _Shown:
        """All that was read, from these files.

        Raises:
            InputError: Two of them have one name.
        """
        all_of_them = [
            (one, path, read.demonstration.name)
            for read, path in zip(reads, paths, strict=True)
            for one in read.demonstrations()
        ]
        counts = Counter(one.name for one, _, _ in all_of_them)
        twice = next((one for one in all_of_them if counts[one[0].name] > 1), None)
        if twice is not None:
            raise InputError(
                f"{twice[1]}: two demonstrations are called {twice[0].name!r}: give each a name of "
                "its own."
            )
        shown, of_files, files = zip(*all_of_them, strict=True)
        return cls(shown, of_files, files)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.demonstrations)

    def only(self, places: Sequence[int]) -> _Shown:
        """Some of them."""
        return _Shown(
            tuple(self.demonstrations[place] for place in places),
            tuple(self.paths[place] for place in places),
            tuple(self.files[place] for place in places),
        )


def _named(read: Read, name: str) -> Read:
    return replace(read, demonstration=replace(read.demonstration, name=name))


def _gathered(sources: Sequence[Source], options: InputOptions) -> Gathered:
    """Reads them all; a column that numbers the rows of some tables only is a feature of all.

    What is called `row` may be where a robot is, and happen to rise all the way in a table.
    """
    gathered = gather(sources, _READING, options)
    reads = [one for one in gathered.found if isinstance(one, Read)]
    measured = {
        feature.name
        for demonstration in (read.demonstration for read in reads)
        if len(demonstration) >= FEWEST_RISING
        for feature in demonstration.features
    }
    asked_for = measured & frozenset[str]().union(*(read.no_features for read in reads))
    if not asked_for:
        return gathered
    options = replace(options, features=options.features | asked_for)
    found = list(gathered.found)
    again = [
        place
        for place, one in enumerate(found)
        if isinstance(one, Read) and asked_for & one.no_features
    ]
    second = gather([sources[place] for place in again], _READING, options)
    for place, one in zip(again, second.found, strict=True):
        found[place] = one
    return Gathered(tuple(found), gathered.unwritable or second.unwritable, gathered.cached)


def _aside(
    paths: Sequence[Path], errors: Mapping[Path, RebtError], inputs: int
) -> tuple[Aside, ...]:
    """What is set aside, in the order of the inputs.

    Raises:
        RebtError: Nothing else is there.
    """
    if paths and len(paths) == inputs:
        first = errors[paths[0]]
        if inputs == 1:
            raise first
        raise InputError(f"none of {inputs} inputs can be read; the first: {first}") from first
    return tuple(Aside(path, str(errors[path])) for path in paths)


def _notes_on_excluded(names: Sequence[str], every: int) -> Iterator[str]:
    if names:
        count = f"{len(names)} of {every}"
        yield f"{count} demonstrations are left out as asked: {listing(names)}"


def _notes_on_cache(gathered: Gathered, options: InputOptions) -> Iterator[str]:
    if gathered.unwritable:
        yield (
            f"what was read cannot be kept in {options.plan.cache} ({gathered.unwritable}): it is "
            "read anew the next time, unless --cache names a directory with room where you may "
            "write"
        )


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
        InputError: One is not there.
    """
    found = sources_of(inputs, strict=False)
    return any(isinstance(one, Source) and one.kind is InputKind.BAG for one in found)


def _check_options(options: InputOptions, kinds: set[InputKind]) -> None:
    given = (
        (bool(options.labels), "a label column", InputKind.TABLE),
        (bool(options.episode_columns), "an episode column", InputKind.TABLE),
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


def _read_source(source: Source, options: InputOptions) -> Read:
    """Reads an input; whatever is wrong with it is a `RebtError`."""
    return _READERS[source.kind](source.path, options)


def _deciding_options(kind: InputKind, options: InputOptions) -> tuple[object, ...]:
    """The options that decide what is read of an input of some kind, in plain values."""
    if kind is InputKind.TABLE:
        row_kind = options.row_kind.value if options.row_kind else None
        features = sorted(options.features)
        return (
            options.labels,
            options.channels,
            options.header,
            row_kind,
            features,
            options.episode_columns,
        )
    if kind is InputKind.RECORDING:
        return ()
    robot = options.robot
    topics = tuple((topic.name, topic.fields) for topic in options.state_topics)
    described = None if robot is None else (robot.name, repr(robot), robot.content)
    return (topics, options.action_topics, options.sample_rate, options.skip_bad, described)


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
        episode_columns=options.episode_columns,
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


_READING = Reading(_read_source, _deciding_options)
