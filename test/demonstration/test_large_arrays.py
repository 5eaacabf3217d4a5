"""Large arrays are on disk, and nobody sees a difference."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rebt_ros import arrays
from rebt_ros.arrays import FloatArray
from rebt_ros.demonstration import large_arrays
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.lags import with_lags
from rebt_ros.demonstration.large_arrays import GrowingArray, Spool, is_mapped, roomy, rows_of
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import InputError
from rebt_ros.storage.read import Read, on_spool

LARGE = 80 * 24


@pytest.fixture
def on_disk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The directory of large arrays, which are so of 80 rows or more."""
    monkeypatch.setattr(large_arrays, "ON_DISK", LARGE)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def _demonstration(seed: int, rows: int) -> Demonstration:
    random = np.random.default_rng(seed)
    return Demonstration(
        f"d{seed}",
        tuple(map(Feature, "abc")),
        random.normal(size=(rows, 3)),
        np.arange(rows),
        ("go", "turn"),
        random.integers(2, size=rows),
        ("action",),
        np.zeros(rows, dtype=np.int64),
    )


def test_a_large_array_is_a_mapped_file_that_is_gone_with_it(on_disk: Path) -> None:
    large, small = roomy((80, 3)), roomy((79, 3))
    assert (is_mapped(large), is_mapped(small)) == (True, False)
    large[:] = np.arange(240).reshape(80, 3)
    assert large[5:].sum() == np.arange(240).reshape(80, 3)[5:].sum()
    assert is_mapped(large[5:, 1])
    assert not list(on_disk.iterdir())


def test_without_room_there_is_a_sentence(monkeypatch: pytest.MonkeyPatch, on_disk: Path) -> None:
    monkeypatch.setenv("TMPDIR", str(on_disk / "nowhere"))
    with pytest.raises(InputError, match=r"nowhere .*No such file.*: make room, or name another"):
        roomy((80, 3))


@pytest.mark.parametrize("at_a_time", [7, 1000])
def test_rows_are_taken_in_parts(
    monkeypatch: pytest.MonkeyPatch, on_disk: Path, at_a_time: int
) -> None:
    monkeypatch.setattr(arrays, "_ROWS_AT_A_TIME", at_a_time)
    states: FloatArray = np.random.default_rng(0).normal(size=(200, 3))
    rows = np.arange(200) % 2 == 0
    assert is_mapped(rows_of(states, rows))
    np.testing.assert_array_equal(rows_of(states, rows), states[rows])


def test_what_is_spooled_leaves_the_memory_once_it_is_much(on_disk: Path) -> None:
    spool = Spool()
    given = [np.full((rows, 3), float(rows)) for rows in (50, 20, 30, 100, 1, 0, 60)]
    taken = [spool.take(one) for one in given]
    assert [is_mapped(one) for one in taken] == [False, False, True, True, False, False, True]
    for one, other in zip(given, taken, strict=True):
        np.testing.assert_array_equal(one, other)
    # What is on disk already is not copied.
    assert spool.take(taken[2]) is taken[2]
    assert not list(on_disk.iterdir())


def test_all_columns_of_what_was_read_are_spooled_to_the_bit(on_disk: Path) -> None:
    stamps = np.array([0, -1, 2**63 - 1, -(2**63), 0x7FF8_0000_0000_0001] * 20)
    shown = replace(_demonstration(0, 100), stamps=stamps)
    spooled = on_spool(Read(shown), Spool()).demonstration
    for name in ("states", "stamps", "chosen", "channel"):
        column = getattr(spooled, name)
        assert is_mapped(column) is (name in ("states", "channel"))
        assert column.tobytes() == getattr(shown, name).tobytes()
    spool = Spool()
    spool.take(np.empty(LARGE // 8 - 1))
    for name in ("states", "stamps", "chosen", "channel"):
        column = getattr(on_spool(Read(shown), spool).demonstration, name)
        assert is_mapped(column)
        assert column.dtype == getattr(shown, name).dtype
        assert column.tobytes() == getattr(shown, name).tobytes()


def test_rows_that_come_one_by_one_leave_the_memory_once_they_are_many(
    monkeypatch: pytest.MonkeyPatch, on_disk: Path
) -> None:
    monkeypatch.setattr(large_arrays, "_PASSING", 7)
    for count in (1, 79, 80, 81, 83, 200):
        states = np.random.default_rng(count).normal(size=(count, 3)).tolist()
        rows = (Row(number, "action", "go", None, tuple(one)) for number, one in enumerate(states))
        features = tuple(map(Feature, "abc"))
        shown = Demonstration.from_rows("d", features, rows, values=GrowingArray())
        assert is_mapped(shown.states) is (count >= 80)
        assert shown.states.tolist() == states
    assert not list(on_disk.iterdir())
    monkeypatch.setenv("TMPDIR", str(on_disk / "nowhere"))
    with pytest.raises(InputError, match=r"there is no room for 0\.0 GB of states in .*nowhere"):
        GrowingArray().extend(range(LARGE))


def test_tables_and_their_parts_are_the_same_on_disk(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    shown = [_demonstration(seed, rows) for seed, rows in enumerate((70, 40, 90))]
    odd = np.arange(200) % 2 == 1
    (memory,) = tabulate(shown)
    in_memory = (memory, memory.where(odd), with_lags(memory, 2))
    monkeypatch.setattr(large_arrays, "ON_DISK", LARGE)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    (disk,) = tabulate(shown)
    on_disk = (disk, disk.where(odd), with_lags(disk, 2))
    for one, other in zip(in_memory, on_disk, strict=True):
        assert is_mapped(other.states)
        assert not is_mapped(one.states)
        assert one.states.tobytes() == other.states.tobytes()
        assert one.features == other.features
