"""What inputs are, how they are read, and by which means."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from pathlib import Path

from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.errors import OptionError
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.weights import weight

_PAIR = 2


class InputKind(Enum):
    """What a file, or a directory that is one demonstration, is."""

    TABLE = "CSV table"
    RECORDING = "recording"
    BAG = "bag"


@dataclass(frozen=True, slots=True)
class Source:
    """A file, or a directory, that is one demonstration."""

    path: Path
    kind: InputKind


@dataclass(frozen=True, slots=True)
class Aside:
    """An input that could not be read."""

    path: Path
    reason: str
    """Why, as a sentence."""


@dataclass(frozen=True, slots=True)
class ReadCounts:
    """Of how many inputs what they hold came from where."""

    cached: int
    """From the cache: these were read earlier."""
    read: int
    """From the inputs themselves."""
    aside: int
    """From nowhere: these cannot be read."""


def _show_nothing(stage: str, share: float) -> None:
    pass


def _tell_nobody(aside: tuple[Aside, ...]) -> None:
    pass


def _note_nothing(notes: tuple[str, ...]) -> None:
    pass


def _count_nothing(counts: ReadCounts) -> None:
    pass


@dataclass(frozen=True, slots=True)
class ReadingPlan:
    """By which means many inputs are read; none of it changes what is read."""

    cache: Path | None = None
    """Directory that keeps what was read of each input; None to keep nothing."""
    jobs: int | None = 1
    """Processes, -1 for one per processor; None for one per processor where that pays."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers read, instead of processes."""
    strict: bool = True
    """Whether an input that cannot be read is an error, instead of being set aside.  It always is
    where nothing else was read."""
    progress: Callable[[str, float], None] = _show_nothing
    """Told what is being done and which share of the reading is behind."""
    tell: Callable[[tuple[Aside, ...]], None] = _tell_nobody
    """Told what was set aside, where something was."""
    tell_counts: Callable[[ReadCounts], None] = _count_nothing
    """Told where what the inputs hold came from, once all is there."""
    tell_notes: Callable[[tuple[str, ...]], None] = _note_nothing
    """Told what a person should know about how the inputs were read, where there is something, each
    led by the name of its demonstration; no full stops."""


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
    episode_columns: tuple[str, ...] | None = None
    """Of CSV tables, columns that say to which demonstration a row belongs; none (`()`) for tables
    that are a single one each; None to tell by names and values."""
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
    exclude: tuple[str, ...] = ()
    """Demonstrations that are left out, before they are read: names of files, paths, patterns, and
    `@list.txt` with such in its lines.  What follows a `#` says which demonstrations of a table."""
    weights: tuple[tuple[str, Fraction], ...] = ()
    """How much demonstrations count, by such names, of which the last one that fits tells; also as
    a mapping.  Others count 1, and what counts 0 is left out.  Where nothing is learned, only that
    matters."""
    plan: ReadingPlan = field(default_factory=ReadingPlan)
    """By which means they are read."""

    def __post_init__(self) -> None:
        """Takes a word for a tuple of it, and words for enums.

        Raises:
            OptionError: A value is of another type.
        """
        for name in ("labels", "channels", "action_topics", "exclude"):
            object.__setattr__(self, name, _texts(name, getattr(self, name)))
        if self.episode_columns is not None:
            named = _texts("episode_columns", self.episode_columns)
            object.__setattr__(self, "episode_columns", named)
        object.__setattr__(self, "weights", _weights(self.weights))
        topics = self.state_topics
        several = (topics,) if isinstance(topics, str | StateTopic) else topics
        object.__setattr__(
            self,
            "state_topics",
            tuple(StateTopic(one) if isinstance(one, str) else one for one in several),
        )
        kinds = {kind.value: kind for kind in RowKind}
        if isinstance(self.row_kind, str) and self.row_kind in kinds:
            object.__setattr__(self, "row_kind", kinds[self.row_kind])
        rate = self.sample_rate
        are_topics = all(isinstance(one, StateTopic) for one in self.state_topics)
        for name, fits, what in (
            ("state_topics", are_topics, "names"),
            ("row_kind", isinstance(self.row_kind, RowKind | None), f"one of {', '.join(kinds)}"),
            ("header", isinstance(self.header, bool), "True or False"),
            ("skip_bad", isinstance(self.skip_bad, bool), "True or False"),
            ("sample_rate", rate is None or isinstance(rate, int | float), "a number or None"),
            ("robot", isinstance(self.robot, RobotFile | None), "a RobotFile or None"),
            ("plan", isinstance(self.plan, ReadingPlan), "a ReadingPlan"),
        ):
            if not fits:
                raise OptionError(f"{name} must be {what}, not {getattr(self, name)!r}.")


def _weights(value: object) -> tuple[tuple[str, Fraction], ...]:
    """Weights by names, also of a mapping."""
    pairs = tuple(value.items()) if isinstance(value, Mapping) else value
    if not isinstance(pairs, tuple) or not all(
        isinstance(pair, tuple) and len(pair) == _PAIR and isinstance(pair[0], str)
        for pair in pairs
    ):
        raise OptionError(f"weights must be numbers by names of demonstrations, not {value!r}.")
    return tuple((name, weight(its)) for name, its in pairs)


def _texts(name: str, value: object) -> tuple[str, ...]:
    """A text, or several of them, as a tuple."""
    several = (value,) if isinstance(value, str) else value
    if not isinstance(several, list | tuple) or not all(isinstance(one, str) for one in several):
        raise OptionError(f"{name} must be texts, not {value!r}.")
    return tuple(several)
