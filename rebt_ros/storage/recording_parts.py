"""Parts of recordings, written as recordings of their own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.errors import OptionError
from rebt_ros.storage.recording import RecordingError, RecordingWriter, read_recording
from rebt_ros.storage.recording_files import SUFFIX
from rebt_ros.storage.recording_head import Head, read_head


def write_part(path: Path, first: float, end: float, name: str) -> Path:
    """Writes the rows of a stretch of time beside the recording, which stays as it is.

    What was done before the stretch is known to its first row as LAT, as in a takeover; the
    previous action is not.

    Args:
        path: The recording.
        first: Seconds since its first row.
        end: The same; rows before it are in the part.
        name: Of the part, without its suffix.

    Raises:
        InputError: The recording cannot be read.
        OptionError: The stretch has no rows, or the name is taken.
        RecordingError: The part cannot be written.
    """
    target = path.with_name(f"{name}{SUFFIX}")
    if target.exists():
        raise OptionError(f"there is a file {target.name} already: move it elsewhere.")
    shown = read_recording(path).demonstration
    with path.open("rb") as file:
        head = read_head(path, file)
    seconds = (shown.stamps - shown.stamps[:1]) / 1e9
    wanted = ((seconds >= first) & (seconds < end)).tolist()
    if not any(wanted):
        raise OptionError(f"{path.name} has no rows from {first:g} to {end:g} s.")
    writer = RecordingWriter(
        path.parent,
        head.features,
        head.channels,
        sample_rate=head.sample_rate,
        origin=head.origin,
        robot=head.robot,
        categories=_categories(head, shown),
    )
    try:
        with writer:
            for row, is_wanted in zip(_rows(shown), wanted, strict=True):
                if is_wanted:
                    writer.write(row)
        writer.path.rename(target)
    except (OSError, RecordingError) as err:
        writer.discard()
        raise RecordingError(f"{target} cannot be written ({err}).") from err
    return target


def _rows(shown: Demonstration) -> Iterator[Row]:
    """The rows, each with its LAT."""
    histories = {
        channel: ActionHistory([label] if (label := shown.before.get(channel)) else [])
        for channel in shown.channels
    }
    for stamp, state, action, channel in zip(
        shown.stamps.tolist(),
        shown.states.tolist(),
        shown.chosen.tolist(),
        shown.channel.tolist(),
        strict=True,
    ):
        label, topic = shown.actions[action], shown.channels[channel]
        history = histories[topic]
        yield Row(stamp, topic, label, history.before(label), tuple(state))
        history.begin(label)


def _categories(head: Head, shown: Demonstration) -> dict[str, Categories]:
    """Categories of features that hold texts, numbered as in the rows."""
    categories = {}
    for place in head.texts:
        known = categories[head.features[place].name] = Categories()
        for name in shown.features[place].categories:
            known.code(name)
    return categories
