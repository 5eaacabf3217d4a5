"""Recordings: what was acknowledged is on disk, to the last bit, and damage is named."""

import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError
from rebt_ros.storage import recording
from rebt_ros.storage.recording import (
    RecordingError,
    RecordingWriter,
    is_recording,
    read_recording,
    recordings,
)

CHECKOUT = Path(__file__).resolve().parents[1]
FEATURES = (
    Feature("front", topic="/state", index=0),
    Feature('left, "near"', topic="/state", index=1),
)
ROWS = (
    Row(1_700_000_000_000_000_001, "/action", "go", None, (0.1, -2.0)),
    Row(1_700_000_000_000_000_002, "/action", 'say "hi", twice', "go", (1 / 3, 5e-324)),
    Row(1_700_000_000_000_000_003, "/action", "go", 'say "hi", twice', (1e38, -0.0)),
)


def written(directory: Path, rows=ROWS) -> Path:
    with RecordingWriter(directory, FEATURES, ["/action"]) as writer:
        for row in rows:
            writer.write(row)
    return writer.path


def assert_same(one: Demonstration, other: Demonstration) -> None:
    assert one.features == other.features
    assert one.states.tobytes() == other.states.tobytes()
    assert one.stamps.tolist() == other.stamps.tolist()
    assert (one.actions, one.channels) == (other.actions, other.channels)
    assert one.chosen.tolist() == other.chosen.tolist()
    assert one.channel.tolist() == other.channel.tolist()


def test_a_recording_reads_back_to_the_last_bit(tmp_path):
    path = written(tmp_path)
    read = read_recording(path)
    assert_same(read.demonstration, Demonstration.from_rows(path.name, FEATURES, ROWS))
    assert read.demonstration.name == path.name
    assert read.notes == ()


@given(
    st.lists(
        st.tuples(
            st.integers(-(2**63), 2**63 - 1),
            st.sampled_from(["/a", "/b, c"]),
            st.text(min_size=1, max_size=6).filter(str.isprintable),
            st.tuples(
                st.floats(-LARGEST_VALUE, LARGEST_VALUE), st.floats(-LARGEST_VALUE, LARGEST_VALUE)
            ),
        ),
        min_size=1,
        max_size=15,
    )
)
def test_any_rows_survive(tmp_path_factory, values):
    rows = [Row(stamp, channel, action, None, state) for stamp, channel, action, state in values]
    with RecordingWriter(tmp_path_factory.mktemp("any"), FEATURES, ["/a", "/b, c"]) as writer:
        for row in rows:
            writer.write(row)
    expected = Demonstration.from_rows("any", FEATURES, rows)
    assert_same(read_recording(writer.path).demonstration, expected)


def test_ordinary_tools_see_the_columns_and_the_last_action(tmp_path):
    first, *lines = written(tmp_path).read_text().splitlines()
    assert first.startswith("# rebt_ros recording {")
    assert json.loads(first.removeprefix("# rebt_ros recording ")) == {
        "version": 1,
        "sample_rate": None,
        "features": [
            {"name": "front", "topic": "/state", "index": 0},
            {"name": 'left, "near"', "topic": "/state", "index": 1},
        ],
        "channels": ["/action"],
    }
    table = list(csv.DictReader(lines))
    assert [row["last_action"] for row in table] == ["", "go", 'say "hi", twice']
    assert [row['left, "near"'] for row in table] == ["-2.0", "5e-324", "-0.0"]


def test_a_recording_can_be_read_after_every_row(tmp_path):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        assert len(read_recording(writer.path).demonstration) == 0
        for count, row in enumerate(ROWS, 1):
            writer.write(row)
            assert len(read_recording(writer.path).demonstration) == count == writer.rows


def test_a_killed_recorder_loses_no_acknowledged_row(tmp_path):
    script = f"""
from pathlib import Path
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.storage.recording import RecordingWriter
writer = RecordingWriter(Path({str(tmp_path)!r}), (Feature("x", topic="/s", index=0),), ["/a"])
for count in range(10**9):
    writer.write(Row(count, "/a", "go", None, (count / 3,)))
    print(count, flush=True)
"""
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, cwd=CHECKOUT
    ) as process:
        for line in process.stdout:
            if int(line) == 50:
                process.send_signal(signal.SIGKILL)
                break
        acknowledged = [50, *map(int, process.stdout)]
    (path,) = recordings(tmp_path)
    read = read_recording(path).demonstration
    assert len(read) >= acknowledged[-1] + 1
    assert read.states[:, 0].tolist() == [count / 3 for count in range(len(read))]


def test_a_torn_last_line_is_left_out_with_a_note(tmp_path):
    path = written(tmp_path)
    whole = path.read_bytes()
    end_of_second = whole.rstrip(b"\n").rindex(b"\n") + 1
    for size in (end_of_second + 1, len(whole) - 1):
        path.write_bytes(whole[:size])
        read = read_recording(path)
        assert len(read.demonstration) == 2
        assert read.notes == ("its last line is incomplete and left out",)


def test_a_line_torn_within_a_character_is_left_out_too(tmp_path):
    path = written(tmp_path)
    with path.open("ab") as file:
        file.write("1,/action,ü".encode()[:-1])
    assert len(read_recording(path).demonstration) == 3


def test_two_recorders_in_one_directory_never_share_a_file(tmp_path):
    writers = [RecordingWriter(tmp_path, FEATURES, ["/action"]) for _ in range(20)]
    assert len({writer.path for writer in writers}) == 20
    for writer in writers:
        writer.write(ROWS[0])
        writer.close()
    assert [len(read_recording(path).demonstration) for path in recordings(tmp_path)] == [1] * 20


def test_recordings_come_oldest_first_and_other_files_are_passed_over(tmp_path):
    (tmp_path / "0.csv").write_text("x,a\n1,go\n")
    (tmp_path / "notes.txt").write_text("# rebt_ros recording {}\n")
    paths = [written(tmp_path) for _ in range(3)]
    assert recordings(tmp_path) == tuple(paths)


def test_a_file_without_its_two_first_lines_is_passed_over(tmp_path):
    path = written(tmp_path)
    (tmp_path / "19990101-torn.csv").write_bytes(path.read_bytes().splitlines()[0] + b"\nstamp,")
    (tmp_path / "19990102-empty.csv").touch()
    assert recordings(tmp_path) == (path,)


def test_an_empty_recording_is_removed_on_close(tmp_path):
    with RecordingWriter(tmp_path / "new" / "directory", FEATURES, ["/action"]) as writer:
        assert is_recording(writer.path)
    assert not writer.path.exists()
    with pytest.raises(InputError, match="record a demonstration first"):
        recordings(tmp_path / "new" / "directory")


def test_a_discarded_recording_is_removed(tmp_path):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
        writer.discard()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="closed"):
        writer.write(ROWS[0])


def test_a_full_disk_cuts_the_partial_line_off_and_keeps_the_rows_before(tmp_path, monkeypatch):
    write = os.write
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
        with monkeypatch.context() as patch:
            patch.setattr(recording.os, "write", lambda fd, data: write(fd, data[:5]))
            with pytest.raises(RecordingError, match="its first 1 rows are kept"):
                writer.write(ROWS[1])
        assert writer.rows == 1
        assert read_recording(writer.path).notes == ()
        writer.write(ROWS[2])
    read = read_recording(writer.path)
    assert read.demonstration.stamps.tolist() == [ROWS[0].stamp, ROWS[2].stamp]
    assert read.notes == ()


def test_a_partial_line_that_cannot_be_cut_off_now_is_cut_off_before_the_next(
    tmp_path, monkeypatch
):
    write = os.write

    def refuse(*_):
        raise OSError(5, "Input/output error")

    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
        with monkeypatch.context() as patch:
            patch.setattr(recording.os, "write", lambda fd, data: write(fd, data[:5]))
            patch.setattr(recording.os, "ftruncate", refuse)
            for _ in range(2):
                with pytest.raises(RecordingError):
                    writer.write(ROWS[1])
        writer.write(ROWS[1])
    assert read_recording(writer.path).demonstration.stamps.tolist() == [
        ROWS[0].stamp,
        ROWS[1].stamp,
    ]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
def test_a_real_full_disk_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(
        recording, "_create", lambda _: (tmp_path / "gone.csv", os.open("/dev/full", os.O_WRONLY))
    )
    with pytest.raises(RecordingError, match="No space left"):
        RecordingWriter(tmp_path, FEATURES, ["/action"])


def test_rows_are_not_acknowledged_into_a_removed_file(tmp_path):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.path.unlink()
        with pytest.raises(RecordingError, match="was removed"):
            writer.write(ROWS[0])


def test_a_directory_that_cannot_be_is_an_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="no recording can be created"):
        RecordingWriter(tmp_path / "file" / "sub", FEATURES, ["/action"])


@pytest.mark.parametrize(
    "row",
    [
        ROWS[0]._replace(state=(1.0,)),
        ROWS[0]._replace(state=(1.0, float("nan"))),
        ROWS[0]._replace(state=(1.0, 1e39)),
        ROWS[0]._replace(channel="/other"),
        ROWS[0]._replace(action=""),
        ROWS[0]._replace(action="two\nlines"),
    ],
)
def test_a_row_that_could_not_be_read_back_is_not_written(tmp_path, row):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer, pytest.raises(ValueError):
        writer.write(row)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"0.1,-2.0", b"0.1", "line 3: this is not a row"),
        (b"0.1,-2.0", b"0.1,-2.0,3.0", "line 3: this is not a row"),
        (b"0.1,-2.0", b"0.1,x", "line 3: this is not a row"),
        (b"0.1,-2.0", b"nan,-2.0", "line 3: 'front' is nan"),
        (b"0.1,-2.0", b"0.1,-inf", "line 3: 'left, \"near\"' is -inf"),
        (b"0.1,-2.0", b"0.1,1e39", "line 3: 'left, \"near\"' is 1e\\+39"),
        (b"002,/action", b"002,/other", "line 4: .*'/other' is not one of its channels"),
        (b"1700000000000000002", b"soon", "line 4: this is not a row"),
        (b"1700000000000000002", b"9" * 19, "line 4: .* is not a stamp"),
        (b',"say ""hi"", twice",go', b',"say,go', "line 4: this is not a row"),
        (b"/action,go", b"/action,", "line 3: .* is not an action"),
        (b"/action,go", b"/action,g\xff", "line 3: this is not a row"),
        (b"\n17", b"\n\n17", "line 3: this is not a row"),
        (b"stamp,channel", b"stamps,channel", "line 2: the columns must be"),
        (b'"version": 1', b'"version": 2', "its version is 2, not 1"),
        (b'"features": [', b'"features": 7, "x": [', "lists no features"),
        (b'"name": "front"', b'"name": 7', "is not a feature"),
        (b'"index": 0', b'"index": null', "needs both a topic and an index"),
        (b'"topic": "/state", "index": 0', b'"index": true', "is not a feature"),
        (b"recording {", b"recording ", "cannot be read"),
        (b"recording {", b"recording " + b"[" * 100_000, "nested too deeply"),
        (b"# rebt_ros recording", b"# something", "is not a recording"),
    ],
)
def test_damage_is_named_in_one_sentence(tmp_path, old, new, message):
    path = written(tmp_path)
    whole = path.read_bytes()
    assert old in whole
    path.write_bytes(whole.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        read_recording(path)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_missing_files_and_directories_are_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_recording(tmp_path / "nothing.csv")
    with pytest.raises(InputError, match="does not exist"):
        recordings(tmp_path / "nothing")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="not a directory"):
        recordings(tmp_path / "file")


def test_numpy_numbers_are_written_like_others(tmp_path):
    path = written(tmp_path, [ROWS[0]._replace(state=tuple(np.array([0.5, 0.25])))])
    assert read_recording(path).demonstration.states.tolist() == [[0.5, 0.25]]
