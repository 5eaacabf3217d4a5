"""Logs in the format of BehaviorTree.CPP's FileLogger2."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import StorageError
from rebt_ros.storage.btlog import BtLogWriter, Transition, read_btlog

TRANSITIONS = st.lists(
    st.builds(
        Transition, st.integers(0, 2**48 - 1), st.integers(0, 2**16 - 1), st.integers(0, 255)
    ),
    max_size=5,
)

#: By hand, from the description of the format.
BY_HAND = (
    b"BTCPP4-FileLogger2\x01"
    b"\x05\x00\x00\x00<a/>\n"
    b"\x40\x42\x0f\x00\x00\x00\x00\x00"
    b"\x01\x00\x00\x00\x00\x00" + b"\x02\x00" + b"\x01"
    b"\x00\x00\x00\x00\x01\x00" + b"\x00\x01" + b"\x03"
)


@given(st.text(max_size=20), st.integers(-(2**63), 2**63 - 1), TRANSITIONS, st.integers(0, 8))
def test_what_was_written_is_read_back_also_where_the_last_change_is_cut_short(
    xml: str, began: int, transitions: list[Transition], cut: int
) -> None:
    xml = xml.encode("utf-8", "ignore").decode()
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "logs" / "one.btlog"
        with BtLogWriter(path, xml, began) as log:
            log.write(transitions[:2])
            log.write(transitions[2:])
        if cut and transitions:
            path.write_bytes(path.read_bytes()[:-cut])
            transitions = transitions[:-1]
        read = read_btlog(path)
    assert (read.xml, read.began, list(read.transitions)) == (xml, began, transitions)


def test_the_bytes_are_those_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "one.btlog"
    changes = (Transition(1, 2, 1), Transition(2**32, 256, 3))
    with BtLogWriter(path, "<a/>\n", 1_000_000) as log:
        log.write(changes)
    assert path.read_bytes() == BY_HAND
    assert read_btlog(path).transitions == changes


@pytest.mark.parametrize("length", [0, 10, 19, 22, 25, 30])
def test_a_file_that_ends_too_early_is_refused_in_a_sentence(length: int, tmp_path: Path) -> None:
    path = tmp_path / "one.btlog"
    path.write_bytes(BY_HAND[:length])
    with pytest.raises(InputError, match=r"one\.btlog (ends before|is no log)"):
        read_btlog(path)


def test_a_length_that_is_a_lie_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "one.btlog"
    for length in (b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", b"\x00\x00\x00\x80"):
        path.write_bytes(BY_HAND[:19] + length + BY_HAND[23:])
        with pytest.raises(InputError, match="ends before its tree does"):
            read_btlog(path)


def test_what_cannot_be_read_or_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing\.btlog cannot be read"):
        read_btlog(tmp_path / "missing.btlog")
    with pytest.raises(StorageError, match="cannot be written"):
        BtLogWriter(tmp_path, "", 0)
