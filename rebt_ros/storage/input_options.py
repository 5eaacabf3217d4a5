"""What inputs are, how they are read, and by which means."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.robot_file.robot_file import RobotFile


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


def _show_nothing(stage: str, share: float) -> None:
    pass


def _tell_nobody(aside: tuple[Aside, ...]) -> None:
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
    plan: ReadingPlan = field(default_factory=ReadingPlan)
    """By which means they are read."""
