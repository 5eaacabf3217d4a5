"""What is found out about demonstrations, as data.

gap
    Two rows one after the other that are further apart in time than the demonstration's rows are.
idle stretch
    Rows one after the other in which neither the state nor the action changes.
contradicting row
    A row for which another one has an equal state and another action, on the same channel.
near-duplicate
    A demonstration that is hardly another one than one before it.
outlier
    A demonstration of which a figure is far from that of the others.

Times are seconds since the first row of the demonstration.  Rows are numbered from 0, demonstration
by demonstration.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Final, TypeAlias

from rebt_ros.codec.bounds import Bounds, Count, Share
from rebt_ros.codec.form import Definitions, Json
from rebt_ros.codec.hints import record
from rebt_ros.codec.text import indented

#: A number that is not negative.
Amount: TypeAlias = Annotated[float, Bounds(0)]


@dataclass(frozen=True, slots=True)
class ActionCount:
    """How often an action is shown in a demonstration."""

    channel: str
    action: str
    rows: Count


@dataclass(frozen=True, slots=True)
class Timing:
    """When the rows of a demonstration were recorded."""

    seconds: Amount
    """From the first row to the last; where the clock was set back, without that."""
    rate: Amount
    """Rows per second of one channel: one by the median time from a row to the next."""
    clock_set_back: Count
    """How often a row is older than the one before it."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of a demonstration: a gap, from one row to the next, or an idle stretch."""

    row: Count
    """Its first row."""
    rows: Count
    at: Amount | None
    """When it begins; None where stamps tell no time."""
    seconds: Amount | None
    """How long it is; None where stamps tell no time."""


@dataclass(frozen=True, slots=True)
class Stretches:
    """All gaps, or all idle stretches, of a demonstration."""

    count: Count
    rows: Count
    """In idle stretches; of gaps, the rows that end them."""
    seconds: Amount | None
    """All together; None where stamps tell no time."""
    longest: tuple[Stretch, ...]
    """The longest ones, the longest first."""


@dataclass(frozen=True, slots=True)
class Duplicate:
    """That a demonstration is nearly another one."""

    of: str
    """Name of the other one, which comes before it."""
    share: Share
    """Of the rows that are compared, those that are alike."""


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A row that contradicts others."""

    row: Count
    at: Amount | None
    """None where stamps tell no time."""
    channel: str
    action: str
    other: str
    """The action that is shown most often in its state beside its own."""
    demonstration: str
    """Where that is shown."""
    other_row: Count


@dataclass(frozen=True, slots=True)
class Contradictions:
    """The rows of a demonstration that contradict others."""

    rows: Count
    with_others: Count
    """Of them, those that contradict another demonstration."""
    outvoted: Count
    """Of them, those in whose state another action is shown more often."""
    examples: tuple[Contradiction, ...]
    """Some of them, those that are outvoted first."""


class OutlierKind(Enum):
    """What is far from the other demonstrations."""

    ROWS = "rows"
    SECONDS = "seconds"
    RATE = "rate"
    ACTION_SHARE = "action_share"
    """The share of an action."""
    FEATURE_MEDIAN = "feature_median"
    """The median of a feature."""
    FEATURE_RANGE = "feature_range"
    """A value of a feature that is far outside what all others have."""
    ACTION_ONLY_HERE = "action_only_here"


@dataclass(frozen=True, slots=True)
class Outlier:
    """A figure of a demonstration that is far from that of the others."""

    kind: OutlierKind
    name: str
    """Of the action or the feature; empty where it is about neither."""
    value: float
    """Here."""
    usual: float
    """The median of all demonstrations; of a range, its nearer end in all others; 0 of an action
    that only this one shows."""
    score: Amount
    """How far, by the measure of its kind; larger is further."""


@dataclass(frozen=True, slots=True)
class Inspected:
    """What is found out about one demonstration."""

    name: str
    """By which it is addressed."""
    path: str
    """Of its file."""
    rows: Count
    timing: Timing | None
    """None where stamps tell no time, or there is one row only."""
    actions: tuple[ActionCount, ...]
    """The most frequent first."""
    gaps: Stretches | None
    """None where stamps tell no time."""
    idle: Stretches | None
    """None of events, which say nothing of the time between them."""
    constant: tuple[str, ...]
    """Features that never vary, or are never known."""
    missing: Count
    """Values that are missing."""
    near_duplicate: Duplicate | None
    contradicting: Contradictions
    outliers: tuple[Outlier, ...]
    """The furthest first."""


@dataclass(frozen=True, slots=True)
class Inspection:
    """What is found out about demonstrations."""

    row_kind: str
    """What a row is: ``event`` or ``sample``."""
    rows: Count
    features: tuple[str, ...]
    constant: tuple[str, ...]
    """Features that never vary, in no demonstration and between none."""
    actions: tuple[ActionCount, ...]
    """The most frequent first."""
    contradicting: Count
    """Rows."""
    demonstrations: tuple[Inspected, ...]
    notes: tuple[str, ...] = ()
    """What was not looked for, and why; no full stops."""

    @property
    def several_channels(self) -> bool:
        """Whether actions were shown on several channels."""
        return len({one.channel for one in self.actions}) > 1


#: Name of the form in JSON.
FORMAT: Final = "rebt_ros inspection"
VERSION: Final = 1

_FORM: Final = record(Inspection).with_constants({"format": FORMAT, "version": VERSION})


def json_schema() -> Json:
    """The JSON Schema (draft 2020-12) of an inspection."""
    definitions: Definitions = {}
    schema = _FORM.schema(definitions)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "rebt_ros inspection of demonstrations, version 1",
        "description": "What is found out about demonstrations before they are learned from; "
        "docs/inspect.md says what the words mean.",
        **schema,
        "$defs": definitions,
    }


def dumps(inspection: Inspection) -> str:
    """An inspection as JSON text; what of names of files is no text stands as a question mark."""
    text = indented(_FORM.encode(inspection)) + "\n"
    return text.encode("utf-8", "replace").decode("utf-8")
