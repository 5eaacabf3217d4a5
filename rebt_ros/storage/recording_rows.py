"""Rows of a recording: records of one fixed length, which numpy reads as they are.

All numbers are little-endian.  Actions are numbered in the order in which they occur, from 1 on; a
record whose channel is `LABEL` holds a label's text, or a part of it, where a row holds its state:

| field | in a row | in a label's record |
| --- | --- | --- |
| stamp | nanoseconds | 0 |
| channel | position in the head's channels | `LABEL` |
| action | number of the action | number of the action |
| last_action | number of the LAT, 0 without one | how many bytes of text the record holds |
| checksum | makes the sum of the record's 32-bit words 2**32 - 1, modulo 2**32 | as in a row |
| state | the features' values | UTF-8 text, followed by zeros |

In version 3 a value may be NaN, where it is missing, and that of a feature that holds texts is the
number of a label.
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

import numpy as np
from numpy.typing import NDArray

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.demonstration.builder import LARGEST_VALUE, is_label
from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.demonstration import Demonstration, Row, in_sorted_order
from rebt_ros.demonstration.large_arrays import roomy
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.storage.account import Account
from rebt_ros.storage.read import Read
from rebt_ros.storage.recording_head import Head

LABEL: Final = 2**32 - 1

_WORD: Final = 2**32 - 1
#: Bytes that are read at a time.
_CHUNK: Final = 1 << 22

Records = NDArray[np.void]


def record_type(width: int) -> np.dtype[np.void]:
    """The type of a record with this many features."""
    return np.dtype(
        [
            ("stamp", "<i8"),
            ("channel", "<u4"),
            ("action", "<u4"),
            ("last_action", "<u4"),
            ("checksum", "<u4"),
            ("state", "<f8", (width,)),
        ]
    )


class RowEncoder:
    """Turns rows into records.

    Args:
        channels: Channels of the rows.
        width: Number of features, at least one.
        texts: The categories of features that hold texts, by their place; they may grow.
    """

    def __init__(
        self, channels: Sequence[str], width: int, texts: Mapping[int, Categories] | None = None
    ) -> None:
        self._texts = texts or {}
        self._channels = {channel: number for number, channel in enumerate(channels)}
        self._numbers: dict[str, int] = {}
        self._room = 8 * width
        self._row = struct.Struct(f"<qIIII{width}d")
        self._label = struct.Struct(f"<qIIII{self._room}s")
        self._words = struct.Struct(f"<{self._row.size // 4}I")

    @property
    def labels(self) -> int:
        """How many labels have a number."""
        return len(self._numbers)

    def encode(self, row: Row) -> bytes:
        """The record of a row, after those of labels that it is the first to use."""
        names = [row.last_action, row.action] if row.last_action else [row.action]
        state = row.state
        if self._texts:
            found = {
                place: categories.names[int(state[place])]
                for place, categories in self._texts.items()
                if state[place] == state[place]
            }
            names = list(dict.fromkeys((*names, *found.values())))
        labels = b"".join(self._introduced(name) for name in names if name not in self._numbers)
        last_action = self._numbers[row.last_action] if row.last_action else 0
        if self._texts:
            numbered = list(state)
            for place, name in found.items():
                numbered[place] = float(self._numbers[name])
            state = tuple(numbered)
        return labels + self._checked(
            self._row,
            row.stamp,
            self._channels[row.channel],
            self._numbers[row.action],
            last_action,
            state,
        )

    def forget(self, labels: int) -> None:
        """Takes the numbers back that were given after so many, as their records were not kept."""
        while len(self._numbers) > labels:
            self._numbers.popitem()

    def _introduced(self, label: str) -> bytes:
        number = self._numbers[label] = len(self._numbers) + 1
        text = label.encode()
        parts = (text[start : start + self._room] for start in range(0, len(text), self._room))
        return b"".join(
            self._checked(self._label, 0, LABEL, number, len(part), (part,)) for part in parts
        )

    def _checked(
        self,
        record: struct.Struct,
        stamp: int,
        channel: int,
        action: int,
        last_action: int,
        content: Sequence[Any],
    ) -> bytes:
        words = sum(
            self._words.unpack(record.pack(stamp, channel, action, last_action, 0, *content))
        )
        return record.pack(stamp, channel, action, last_action, ~words & _WORD, *content)


def read_rows(path: Path, file: BinaryIO, head: Head) -> Read:
    """Reads what follows the first line, as far as it is there now.

    What a loss of power left of the last rows is left out with a note.

    Raises:
        InputError: A record is damaged, or says what cannot be.
    """
    if not head.features:
        raise InputError(f"{path} has no features: record a state with at least one value.")
    kind = record_type(len(head.features))
    count, rest = divmod(os.fstat(file.fileno()).st_size - file.tell(), kind.itemsize)
    columns = _Columns(path, head, count)
    seen, damaged = 0, -1
    for records in _chunks(file, kind, count):
        sound = _sound(records)
        good = len(sound) if sound.all() else int(np.argmin(sound))
        if damaged < 0:
            columns.add(records[:good])
            damaged = seen + good if good < len(sound) else -1
            sound = sound[good:]
        if damaged >= 0 and sound.any():
            raise InputError(
                f"{path}, record {damaged + 1} after the first line: it is damaged: "
                "restore the file from a copy, or move it elsewhere."
            )
        seen += len(records)
    notes, left_out = [], {}
    if rest:
        notes.append("its last row is incomplete and left out")
        left_out["are incomplete"] = 1
    if damaged >= 0:
        count = seen - damaged
        what = "record is" if count == 1 else f"{count} records are"
        notes.append(f"its last {what} damaged and left out")
        left_out["are damaged"] = seen - damaged
    shown = columns.demonstration()
    stated, sound_ones = seen + bool(rest), damaged if damaged >= 0 else seen
    account = Account("records", stated, sound_ones, len(shown), left_out)
    return Read(shown, tuple(notes), account, robot=head.robot)


def _chunks(file: BinaryIO, kind: np.dtype[np.void], count: int) -> Iterator[Records]:
    """The records in parts, all in one buffer."""
    buffer = np.empty(max(1, min(count, _CHUNK // kind.itemsize)), dtype=kind)
    while count > 0:
        part = buffer[:count]
        # Shorter than it was where the file is being cut.
        got = cast(io.BufferedReader, file).readinto(part.view(np.uint8).data) // kind.itemsize
        if got == 0:
            return
        yield part[:got]
        count -= got


def _sound(records: Records) -> BoolArray:
    words: NDArray[np.uint32] = records.view("<u4").reshape(len(records), -1)
    sound: BoolArray = words.sum(axis=1, dtype=np.uint32) == _WORD
    return sound


class _Columns:
    """The columns of a demonstration, filled with one part of its records after another."""

    def __init__(self, path: Path, head: Head, room: int) -> None:
        self._path = path
        self._head = head
        self._states = roomy((room, len(head.features)))
        self._stamps, self._actions, self._channel = np.empty((3, room), dtype=np.int64)
        self._rows = 0
        self._labels: list[bytearray] = []
        self._goes_on = False
        self._before: dict[int, int] = {}

    def add(self, records: Records) -> None:
        """Takes records whose checksums are right."""
        labels = records["channel"] == LABEL
        if labels.any():
            for record in records[labels]:
                self._add_label(
                    int(record["action"]), record["state"].tobytes(), int(record["last_action"])
                )
            records = records[~labels]
        if not len(records):
            return
        part = slice(self._rows, self._rows + len(records))
        self._rows = part.stop
        self._stamps[part] = records["stamp"]
        self._actions[part] = records["action"]
        self._channel[part] = records["channel"]
        if len(self._before) < len(self._head.channels):
            channels, first = np.unique(records["channel"], return_index=True)
            for channel, last in zip(channels, records["last_action"][first], strict=True):
                self._before.setdefault(int(channel), int(last))
        states = self._states[part]
        states[...] = records["state"]
        if self._head.may_miss:
            in_range = not np.any(np.abs(states) > LARGEST_VALUE)
        else:
            # Also false where there is a NaN.
            in_range = bool(states.min() >= -LARGEST_VALUE and states.max() <= LARGEST_VALUE)
        if not in_range:
            self._refuse_value(part.start)
        if records["channel"].max() >= len(self._head.channels):
            raise self._wrong("a channel is not one of those in its first line")

    def demonstration(self) -> Demonstration:
        """All rows that were added."""
        rows = slice(self._rows)
        actions = self._actions[rows] - 1
        labels = self._decoded()
        if actions.size and not (actions.min() >= 0 and actions.max() < len(labels)):
            raise self._wrong("an action has no label")
        if max(self._before.values(), default=0) > len(labels):
            raise self._wrong("a last action has no label")
        features = self._described(labels)
        self._check_categories(features)
        return Demonstration(
            self._path.name,
            features,
            self._states[rows],
            self._stamps[rows],
            *_occurring(labels, actions),
            *_occurring(self._head.channels, self._channel[rows]),
            {
                self._head.channels[channel]: labels[last - 1]
                for channel, last in self._before.items()
                if last
            },
            self._head.row_kind,
        )

    def _described(self, labels: tuple[str, ...]) -> tuple[Feature, ...]:
        """The features, those that hold texts with the texts that occur as their categories."""
        features = list(self._head.features)
        for place in self._head.texts:
            column = self._states[: self._rows, place]
            known = ~np.isnan(column)
            numbers, codes = np.unique(column[known], return_inverse=True)
            if not numbers.size:
                continue
            if not (numbers[0] >= 1 and numbers[-1] <= len(labels)) or np.any(numbers % 1):
                raise self._wrong(f"{features[place].name!r} holds a text that is not there")
            column[known] = codes
            names = tuple(labels[int(number) - 1] for number in numbers)
            features[place] = replace(
                features[place], kind=FeatureKind.CATEGORICAL, categories=names
            )
        return tuple(features)

    def _check_categories(self, features: Sequence[Feature]) -> None:
        for place, feature in enumerate(features):
            if feature.kind is FeatureKind.NUMERIC:
                continue
            column = self._states[: self._rows, place]
            known = column[~np.isnan(column)]
            most = len(feature.categories) or 2
            if np.any((known < 0) | (known >= most) | (known % 1 != 0)):
                raise self._wrong(f"{feature.name!r} holds a value that is none of its categories")

    def _add_label(self, number: int, content: bytes, size: int) -> None:
        if number == len(self._labels) + 1:
            self._labels.append(bytearray())
        elif number != len(self._labels) or not self._goes_on:
            raise self._wrong("the numbers of its labels are not in order")
        self._labels[-1] += content[:size]
        # Only a part that is full is followed by another one.
        self._goes_on = size == len(content)

    def _decoded(self) -> tuple[str, ...]:
        try:
            labels = tuple(label.decode() for label in self._labels)
        except UnicodeDecodeError as err:
            raise self._wrong("a label is not UTF-8") from err
        if not all(map(is_label, labels)) or len(set(labels)) < len(labels):
            raise self._wrong("a label is not printable, or there twice")
        return labels

    def _refuse_value(self, first: int) -> None:
        states = self._states[first : self._rows]
        row, column = np.argwhere(~(np.abs(states) <= LARGEST_VALUE))[0].tolist()
        raise self._wrong(
            f"{self._head.features[column].name!r} is {states[row, column]} in row "
            f"{first + row + 1}, which is not within ±{LARGEST_VALUE:g}"
        )

    def _wrong(self, what: str) -> InputError:
        return InputError(
            f"{self._path} is not as a recorder writes it, because {what}: move it elsewhere."
        )


def _occurring(names: Sequence[str], codes: IntArray) -> tuple[tuple[str, ...], IntArray]:
    """A column of strings, of which only those that occur are named, sorted."""
    occurs = np.bincount(codes, minlength=len(names)) > 0
    used = tuple(name for name, here in zip(names, occurs.tolist(), strict=True) if here)
    return in_sorted_order(used, (np.cumsum(occurs) - 1)[codes])
