"""Recordings of version 1, which were CSV: they are read as before, and damage is named."""

from __future__ import annotations

from pathlib import Path

import pytest
from recording_examples import FEATURES, ROWS, assert_same

from rebt_ros.demonstration.demonstration import Demonstration, RowKind
from rebt_ros.errors import InputError
from rebt_ros.storage.recording import read_recording, recordings

#: As a recorder of rebt_ros 0.1 wrote it, to the byte.
TEXT = """\
# rebt_ros recording {"version": 1, "sample_rate": null, "features": [\
{"name": "front", "topic": "/state", "index": 0}, \
{"name": "left, \\"near\\"", "topic": "/state", "index": 1}], "channels": ["/action"]}
stamp,channel,action,last_action,front,"left, ""near\"""
1700000000000000001,/action,go,,0.1,-2.0
1700000000000000002,/action,"say ""hi"", twice",go,0.3333333333333333,5e-324
1700000000000000003,/action,go,"say ""hi"", twice",1e+38,-0.0
"""


def written(directory: Path, text: bytes = TEXT.encode()) -> Path:
    path = directory / "20261122T031500.000000Z-1-abcdef.csv"
    path.write_bytes(text)
    return path


def test_an_old_recording_reads_back_to_the_last_bit(tmp_path: Path) -> None:
    read = read_recording(written(tmp_path))
    assert read.notes == ()
    assert_same(read.demonstration, Demonstration.from_rows("", FEATURES, ROWS))


@pytest.mark.parametrize(
    ("rate", "kind"), [(b"null", RowKind.EVENT), (b"20.0", RowKind.SAMPLE), (b"5", RowKind.SAMPLE)]
)
def test_what_a_row_is_follows_from_the_sample_rate(
    tmp_path: Path, rate: bytes, kind: RowKind
) -> None:
    text = TEXT.encode().replace(b'"sample_rate": null', b'"sample_rate": ' + rate)
    assert read_recording(written(tmp_path, text)).demonstration.row_kind is kind


def test_a_torn_last_line_is_left_out_with_a_note(tmp_path: Path) -> None:
    whole = TEXT.encode()
    end_of_second = whole.rstrip(b"\n").rindex(b"\n") + 1
    for size in (end_of_second + 1, len(whole) - 1):
        read = read_recording(written(tmp_path, whole[:size]))
        assert len(read.demonstration) == 2
        assert read.notes == ("its last line is incomplete and left out",)


def test_a_line_torn_within_a_character_is_left_out_too(tmp_path: Path) -> None:
    torn = TEXT.encode() + "1,/action,ü".encode()[:-1]
    assert len(read_recording(written(tmp_path, torn)).demonstration) == 3


def test_a_file_without_its_two_first_lines_is_passed_over(tmp_path: Path) -> None:
    path = written(tmp_path)
    first = TEXT.encode().splitlines()[0]
    (tmp_path / "19990101-torn.csv").write_bytes(first + b"\nstamp,")
    (tmp_path / "19990102-empty.csv").touch()
    assert recordings(tmp_path) == (path,)


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
        (b'"version": 1', b'"version": 3', "its version is 3, not 1 or 2: use the version"),
        (b'"sample_rate": null', b'"sample_rate": -1', "its sample rate is -1, not null"),
        (b'"features": [', b'"features": 7, "x": [', "lists no features"),
        (b'"name": "front"', b'"name": 7', "is not a feature"),
        (b'"index": 0', b'"index": null', "needs both a topic and an index"),
        (b'"topic": "/state", "index": 0', b'"index": true', "is not a feature"),
        (b"recording {", b"recording ", "cannot be read"),
        (b"recording {", b"recording " + b"[" * 100_000, "nested too deeply"),
        (b"# rebt_ros recording", b"# something", "is not a recording"),
    ],
)
def test_damage_is_named_in_one_sentence(
    tmp_path: Path, old: bytes, new: bytes, message: str
) -> None:
    whole = TEXT.encode()
    assert old in whole
    with pytest.raises(InputError, match=message) as caught:
        read_recording(written(tmp_path, whole.replace(old, new, 1)))
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)
