"""Recordings: what was acknowledged is on disk, to the last bit, and damage is named."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording_examples import FEATURES, ROWS, assert_same

from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage import recording, recording_rows
from rebt_ros.storage.recording import RecordingError, RecordingWriter, read_recording
from rebt_ros.storage.recording_files import is_recording, recordings
from rebt_ros.storage.recording_head import Head, Origin, head_line, read_head
from rebt_ros.storage.recording_rows import LABEL, record_type

CHECKOUT = Path(__file__).resolve().parents[2]


def written(directory: Path, rows=ROWS) -> Path:
    with RecordingWriter(directory, FEATURES, ["/action"]) as writer:
        for row in rows:
            writer.write(row)
    return writer.path


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


#: What the snippet of the documentation has read, for the test.
TELL = """
import sys
assert "rebt_ros" not in sys.modules
table = {name: rows[name].tolist() for name in rows.dtype.names}
names = [(int(number), text) for number, text in labels.items()]
print(json.dumps([head, names, table]))
"""


def test_numpy_alone_reads_a_recording_as_documented(tmp_path):
    documentation = (CHECKOUT / "docs" / "formats.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", documentation, re.DOTALL)
    code = f"path = {str(written(tmp_path))!r}\n{code}{TELL}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    head, labels, rows = json.loads(done.stdout)
    labels = dict(labels)
    assert head == {
        "version": 2,
        "sample_rate": None,
        "origin": "demonstration",
        "features": [
            {"name": "front", "topic": "/state", "index": 0},
            {"name": 'left, "near"', "topic": "/state", "index": 1},
        ],
        "channels": ["/action"],
    }
    assert [labels[code] for code in rows["action"]] == [row.action for row in ROWS]
    assert [labels[code] for code in rows["last_action"]] == ["", "go", 'say "hi", twice']
    assert rows["state"] == [list(row.state) for row in ROWS]
    assert rows["stamp"] == [row.stamp for row in ROWS]


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


def test_a_torn_last_row_is_left_out_with_a_note(tmp_path):
    path = written(tmp_path)
    whole = path.read_bytes()
    end_of_second = len(whole) - record_type(2).itemsize
    for size in (end_of_second + 1, len(whole) - 1):
        path.write_bytes(whole[:size])
        read = read_recording(path)
        assert len(read.demonstration) == 2
        assert read.notes == ("its last row is incomplete and left out",)


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


def test_a_file_without_its_first_line_is_passed_over(tmp_path):
    path = written(tmp_path)
    (tmp_path / "19990101-torn.rec").write_bytes(path.read_bytes()[:100])
    (tmp_path / "19990102-empty.rec").touch()
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


def test_a_recording_that_has_ended_is_removed_as_well(tmp_path):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
    writer.discard()
    assert list(tmp_path.iterdir()) == []


def test_a_recording_that_is_set_aside_is_kept_and_passed_over(tmp_path):
    kept = written(tmp_path)
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        name = writer.path.name
        writer.write(ROWS[0])
        writer.set_aside()
        writer.set_aside()
    assert writer.path == tmp_path / f"{name}.failed"
    assert recordings(tmp_path) == (kept,)
    assert len(read_recording(writer.path).demonstration) == 1
    with pytest.raises(ValueError, match="closed"):
        writer.write(ROWS[1])


def test_an_empty_recording_that_is_set_aside_is_removed(tmp_path):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.set_aside()
    assert list(tmp_path.iterdir()) == []


def test_a_recording_that_cannot_be_set_aside_is_an_error(tmp_path):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
        (tmp_path / f"{writer.path.name}.failed" / "in the way").mkdir(parents=True)
        with pytest.raises(RecordingError, match=r"cannot be set aside .*: move it elsewhere"):
            writer.set_aside()
    assert recordings(tmp_path) == (writer.path,)


def test_a_full_disk_cuts_the_partial_row_off_and_keeps_the_rows_before(tmp_path, monkeypatch):
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


def test_a_partial_row_that_cannot_be_cut_off_now_is_cut_off_before_the_next(tmp_path, monkeypatch):
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
        recording, "_create", lambda _: (tmp_path / "gone.rec", os.open("/dev/full", os.O_WRONLY))
    )
    with pytest.raises(RecordingError, match="No space left"):
        RecordingWriter(tmp_path, FEATURES, ["/action"])


def test_a_recording_that_was_moved_is_said_to_be_where_it_is(tmp_path):
    shown, elsewhere = tmp_path / "shown", tmp_path / "elsewhere"
    with RecordingWriter(shown, FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
        writer.look()
        shown.rename(elsewhere)
        there = re.escape(str(elsewhere / writer.path.name))
        for end in (writer.look, writer.close):
            with pytest.raises(RecordingError, match=f"was moved .*: its 1 rows are in {there}"):
                end()
    # It is closed all the same.
    [path] = elsewhere.iterdir()
    assert len(read_recording(path).demonstration) == 1


def test_what_was_moved_is_not_said_to_be_discarded(tmp_path):
    writer = RecordingWriter(tmp_path / "shown", FEATURES, ["/action"])
    writer.write(ROWS[0])
    (tmp_path / "shown").rename(tmp_path / "elsewhere")
    with pytest.raises(RecordingError, match=r"its 1 rows are in .*elsewhere"):
        writer.discard()
    writer = RecordingWriter(tmp_path / "shown", FEATURES, ["/action"])
    writer.write(ROWS[0])
    writer.close()
    (tmp_path / "shown").rename(tmp_path / "gone")
    with pytest.raises(RecordingError, match="cannot be removed"):
        writer.discard()


@pytest.mark.parametrize("is_replaced", [False, True])
@pytest.mark.parametrize("notice", ["write", "look", "close"])
def test_a_recording_that_is_removed_is_written_again(tmp_path, notice, is_replaced):
    told = []
    with RecordingWriter(tmp_path / "shown", FEATURES, ["/action"], told=told.append) as writer:
        writer.write(ROWS[0])
        shutil.rmtree(tmp_path / "shown")
        if is_replaced:
            (tmp_path / "shown").mkdir()
            writer.path.write_text("something else")
        if notice == "look":
            writer.look()
        if notice != "close":
            writer.write(ROWS[1])
    assert len(told) == 1
    assert f"was removed while it was written: its 1 rows are in {writer.path} again" in told[0]
    rows = 1 if notice == "close" else 2
    assert len(list((tmp_path / "shown").iterdir())) == 1 + is_replaced
    assert len(read_recording(writer.path).demonstration) == rows


def test_rows_that_cannot_be_written_again_are_said_to_be_lost(tmp_path):
    with RecordingWriter(tmp_path / "shown", FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
        shutil.rmtree(tmp_path / "shown")
        (tmp_path / "shown").touch()
        for end in (writer.look, lambda: writer.write(ROWS[1]), writer.close):
            with pytest.raises(RecordingError, match=r"written again .*: its 1 rows are lost"):
                end()


def test_rows_are_synced_when_asked_for_and_at_the_end(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(recording.os, "fsync", lambda descriptor: synced.append(descriptor))
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer:
        writer.write(ROWS[0])
        assert synced == []
        writer.sync()
        # The file, and once its name.
        assert len(synced) == 2
        writer.sync()
        assert len(synced) == 3
    assert len(synced) == 4


def test_a_disk_that_does_not_keep_rows_is_an_error(tmp_path, monkeypatch):
    def refuse(_):
        raise OSError(5, "Input/output error")

    writer = RecordingWriter(tmp_path, FEATURES, ["/action"])
    writer.write(ROWS[0])
    monkeypatch.setattr(recording.os, "fsync", refuse)
    for end in (writer.sync, writer.close):
        with pytest.raises(RecordingError, match=r"may not be complete .*: check the disk"):
            end()
    writer.close()


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
        ROWS[0]._replace(last_action="two\nlines"),
    ],
)
def test_a_row_that_could_not_be_read_back_is_not_written(tmp_path, row):
    with RecordingWriter(tmp_path, FEATURES, ["/action"]) as writer, pytest.raises(ValueError):
        writer.write(row)


def reordered(path: Path, change) -> None:
    """Changes the records of a file and makes their checksums right again."""
    content = path.read_bytes()
    start = content.index(b"\n") + 1
    records = np.frombuffer(content[start:], record_type(2)).copy()
    records = change(records)
    records["checksum"] = 0
    words = records.view("<u4").reshape(len(records), -1)
    records["checksum"] = ~words.sum(axis=1, dtype=np.uint32)
    path.write_bytes(content[:start] + records.tobytes())


def changed(field, value, kind=None):
    """A change of the first record of a row, or of a label."""

    def change(records):
        first = np.flatnonzero((records["channel"] == LABEL) == (kind == "label"))[0]
        records[field][first] = value
        return records

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed("channel", 1), "a channel is not one of those in its first line"),
        (changed("action", 0), "an action has no label"),
        (changed("action", 3), "an action has no label"),
        (changed("state", (np.nan, 0.0)), "'front' is nan in row 1"),
        (changed("state", (0.0, -np.inf)), "'left, \"near\"' is -inf in row 1"),
        (changed("state", (1e39, 0.0)), "is 1e\\+39 in row 1, which is not within"),
        (changed("action", 7, "label"), "the numbers of its labels are not in order"),
        (changed("action", 2, "label"), "the numbers of its labels are not in order"),
        (changed("last_action", 0, "label"), "a label is not printable"),
        (changed("last_action", 3, "label"), "a label is not printable"),
        (changed("state", np.frombuffer(b"\xff" * 16), "label"), "a label is not UTF-8"),
        (lambda records: np.concatenate([records, records]), "the numbers of its labels are not"),
        (lambda records: records[1:], "the numbers of its labels are not in order"),
    ],
)
def test_what_no_recorder_writes_is_named_in_one_sentence(tmp_path, change, message):
    path = written(tmp_path)
    reordered(path, change)
    with pytest.raises(InputError, match=message) as caught:
        read_recording(path)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b'"version": 2', b'"version": 4', "its version is 4, not 2 or 3: use the version"),
        (b'"version": 2', b'"version": 1', "its version is 1, not 2 or 3: use the version"),
        (b'"version": 2', b'"version": true', "its version is True"),
        (b'"features": [', b'"features": 7, "x": [', "its head.features must be an array, not 7"),
        (b'"name": "front"', b'"name": 7', r"its head.features\[\d\].name must be a text, not 7"),
        (b'"index": 0', b'"index": null', "needs both a topic and an index"),
        (
            b'"topic": "/state", "index": 0',
            b'"index": true',
            "index must be a whole number, not True",
        ),
        (b'["/action"]', b'["/action", "/action"]', "two channels have the same name"),
        (b'rate": null', b'rate": true', "its head.sample_rate must be a number, not True"),
        (b'rate": null', b'rate": "10"', "its head.sample_rate must be a number, not '10'"),
        (b'rate": null', b'rate": [10]', "must be a number, not \\[10\\]"),
        (b'rate": null', b'rate": 0', "must be a number from 1e-09 to 1e\\+09, not 0"),
        (b'rate": null', b'rate": -1.5', "must be a number from 1e-09 to 1e\\+09, not -1.5"),
        (b'rate": null', b'rate": NaN', "NaN is not a number"),
        (b'rate": null', b'rate": Infinity', "Infinity is not a number"),
        (
            b'rate": null',
            b'rate": 1' + b"0" * 400,
            "must be a number from 1e-09 to 1e\\+09, not 1000",
        ),
        (b'rate": null', b'rate": 1' + b"0" * 5000, "cannot be read"),
        (
            b'"origin": "demonstration"',
            b'"origin": "robot"',
            "origin must be one of demonstration, takeover, failed, not 'robot': use the version",
        ),
        (b'"origin": "demonstration"', b'"origin": null', "origin must be one of .*, not None"),
        (
            b'"origin": "demonstration"',
            b'"origin": ["failed"]',
            "origin must be one of .*, not \\['failed'\\]",
        ),
        (b"recording {", b"recording ", "cannot be read"),
        (b"recording {", b"recording " + b"[" * 100_000, "nested too deeply"),
        (b"# rebt_ros recording", b"# something", "is not a recording"),
    ],
)
def test_a_wrong_first_line_is_named_in_one_sentence(tmp_path, old, new, message):
    path = written(tmp_path)
    whole = path.read_bytes()
    assert old in whole
    path.write_bytes(whole.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        read_recording(path)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


@given(st.data())
def test_a_changed_byte_of_a_record_is_noticed(tmp_path_factory, data):
    path = written(tmp_path_factory.mktemp("changed"))
    content = bytearray(path.read_bytes())
    place = data.draw(st.integers(content.index(b"\n") + 1, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    in_last = place >= len(content) - record_type(2).itemsize
    if in_last:
        read = read_recording(path)
        assert len(read.demonstration) == 2
        assert read.notes == ("its last record is damaged and left out",)
    else:
        with pytest.raises(InputError, match="damaged: restore the file"):
            read_recording(path)


def test_blocks_that_a_loss_of_power_left_empty_are_left_out_with_a_note(tmp_path):
    path = written(tmp_path)
    size = record_type(2).itemsize
    with path.open("ab") as file:
        file.write(bytes(3 * size + 1))
    read = read_recording(path)
    assert len(read.demonstration) == 3
    assert read.notes == (
        "its last row is incomplete and left out",
        "its last 3 records are damaged and left out",
    )


def test_a_recording_is_read_in_parts_alike(tmp_path, monkeypatch):
    rows = [Row(n, "/action", f"label {n % 7}" * 9, None, (n / 3, -n)) for n in range(100)]
    path = written(tmp_path, rows)
    monkeypatch.setattr(recording_rows, "_CHUNK", 3 * record_type(2).itemsize)
    assert_same(read_recording(path).demonstration, Demonstration.from_rows("", FEATURES, rows))


def test_reading_takes_little_more_memory_than_the_table(tmp_path):
    features = tuple(Feature(f"f{index}") for index in range(24))
    row = Row(0, "/action", "go", None, tuple(map(float, range(24))))
    with RecordingWriter(tmp_path, features, ["/action"]) as writer:
        writer.write(row)
    content = writer.path.read_bytes()
    with writer.path.open("ab") as file:
        for _ in range(100):
            file.write(content[-record_type(24).itemsize :] * 1000)
    tracemalloc.start()
    try:
        states = read_recording(writer.path).demonstration.states
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert states.shape == (100_001, 24)
    assert peak < 2 * states.nbytes


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


def test_the_last_action_of_a_first_row_is_read_back(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path, (Feature("x", topic="s", index=0),), ["arm", "base"]) as writer:
        writer.write(Row(1, "base", "go", "turn", (0.0,)))
        writer.write(Row(2, "base", "stop", "go", (0.0,)))
        writer.write(Row(3, "arm", "lift", None, (0.0,)))
        writer.write(Row(4, "arm", "drop", "lift", (0.0,)))
    demonstration = read_recording(writer.path).demonstration
    assert demonstration.before == {"base": "turn"}
    assert demonstration.actions == ("drop", "go", "lift", "stop")


def head_of(path: Path) -> Head:
    with path.open("rb") as file:
        return read_head(path, file)


@pytest.mark.parametrize("origin", list(Origin))
def test_why_a_demonstration_was_shown_is_in_its_first_line(tmp_path: Path, origin: Origin) -> None:
    with RecordingWriter(tmp_path, FEATURES, ["/action"], origin=origin) as writer:
        writer.write(ROWS[0])
    assert head_of(writer.path).origin is origin
    assert f'"origin": "{origin.value}"'.encode() in writer.path.read_bytes()
    assert len(read_recording(writer.path).demonstration) == 1


def test_a_recording_that_does_not_say_why_it_was_shown_is_a_demonstration(tmp_path: Path) -> None:
    path = written(tmp_path)
    content = path.read_bytes()
    path.write_bytes(content.replace(b'"origin": "demonstration", ', b"", 1))
    assert path.read_bytes() != content
    assert head_of(path).origin is Origin.DEMONSTRATION
    assert len(read_recording(path).demonstration) == len(ROWS)


@pytest.mark.parametrize(
    ("sample_rate", "kind"),
    [(None, RowKind.EVENT), (10.0, RowKind.SAMPLE), (1, RowKind.SAMPLE), (0.5, RowKind.SAMPLE)],
)
def test_what_a_row_is_follows_from_the_sample_rate(
    tmp_path: Path, sample_rate: float | None, kind: RowKind
) -> None:
    with RecordingWriter(tmp_path, FEATURES, ["/action"], sample_rate=sample_rate) as writer:
        writer.write(ROWS[0])
    assert head_of(writer.path).sample_rate == sample_rate
    assert head_of(writer.path).row_kind is kind
    assert read_recording(writer.path).demonstration.row_kind is kind


def test_without_a_word_on_the_sample_rate_a_row_is_an_event(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.write_bytes(path.read_bytes().replace(b'"sample_rate": null, ', b"", 1))
    assert head_of(path).sample_rate is None
    assert read_recording(path).demonstration.row_kind is RowKind.EVENT


def test_first_lines_are_the_same_bytes_as_in_every_release() -> None:
    features = (Feature("x", topic="/s", index=0), Feature("é", topic="/s", index=1))
    line = head_line(features, ("/a",), 2.5, Origin.FAILED)
    assert line.rstrip() == (
        b'# rebt_ros recording {"version": 2, "sample_rate": 2.5, "origin": "failed", '
        b'"features": [{"name": "x", "topic": "/s", "index": 0}, '
        b'{"name": "\\u00e9", "topic": "/s", "index": 1}], "channels": ["/a"]}'
    )
    assert len(line) % 64 == 0


def test_first_lines_by_a_robot_file_say_the_kinds_of_features() -> None:
    robot = parse_robot_file("state: {x: /s.x, y: /s.y, z: /s.z}")
    features = (
        Feature("x"),
        Feature("y", FeatureKind.CATEGORICAL, ("a", "b")),
        Feature("z"),
    )
    line = head_line(features, ("/a",), None, texts=(2,), robot=robot)
    assert line.rstrip() == (
        b'# rebt_ros recording {"version": 3, "sample_rate": null, "origin": "demonstration", '
        b'"features": [{"name": "x", "topic": null, "index": null}, '
        b'{"name": "y", "topic": null, "index": null, "kind": "categorical", '
        b'"categories": ["a", "b"]}, '
        b'{"name": "z", "topic": null, "index": null, "kind": "text"}], "channels": ["/a"], '
        b'"robot": {"state": {"x": "/s.x", "y": "/s.y", "z": "/s.z"}}}'
    )
