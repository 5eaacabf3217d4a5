"""What was read, as columns in a file: all of it comes back, and nothing of a damaged one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.storage import column_file
from rebt_ros.storage.account import Account
from rebt_ros.storage.column_file import NoColumnFileError, packed, read_columns, unpacked_read
from rebt_ros.storage.read import Read

_TEXTS = st.text(min_size=1, max_size=5)
_FEATURES = st.one_of(
    st.builds(Feature, _TEXTS),
    st.builds(Feature, _TEXTS, st.just(FeatureKind.BINARY), topic=_TEXTS, index=st.integers(0, 9)),
    st.builds(
        Feature,
        _TEXTS,
        st.just(FeatureKind.CATEGORICAL),
        st.lists(_TEXTS, min_size=1, max_size=3, unique=True).map(tuple),
    ),
)


@st.composite
def _reads(draw: st.DrawFn) -> Read:
    features = tuple(draw(st.lists(_FEATURES, min_size=1, max_size=3)))
    rows = draw(
        st.lists(
            st.builds(
                Row,
                st.integers(-(2**63), 2**63 - 1),
                _TEXTS,
                _TEXTS,
                st.none(),
                st.tuples(*(st.floats() for _ in features)),
            ),
            max_size=4,
        )
    )
    shown = Demonstration.from_rows(draw(_TEXTS), features, rows, draw(st.sampled_from(RowKind)))
    counts = st.integers(0, 2**40)
    account = st.builds(
        Account, _TEXTS, counts, counts, counts, st.dictionaries(_TEXTS, counts, max_size=2)
    )
    return Read(
        shown,
        tuple(draw(st.lists(_TEXTS, max_size=2))),
        draw(st.none() | account),
        draw(st.frozensets(_TEXTS, max_size=2)),
    )


def assert_same(one: Read, other: Read) -> None:
    """All that was read is the same, to the bit."""
    mine, its = one.demonstration, other.demonstration
    assert (mine.name, mine.features, mine.actions, mine.channels, dict(mine.before)) == (
        its.name,
        its.features,
        its.actions,
        its.channels,
        dict(its.before),
    )
    assert mine.row_kind is its.row_kind
    for name in ("states", "stamps", "chosen", "channel"):
        column, another = getattr(mine, name), getattr(its, name)
        assert column.dtype == another.dtype
        assert column.tobytes() == another.tobytes()
    assert (one.notes, one.account, one.no_features) == (
        other.notes,
        other.account,
        other.no_features,
    )


@settings(max_examples=25)
@given(_reads())
def test_what_was_read_comes_back_to_the_bit(read: Read) -> None:
    found, words, has_robot = unpacked_read(b"".join(packed(read, {"path": "x"})))
    assert_same(found, read)
    assert (words, has_robot) == ({"path": "x"}, False)


@settings(max_examples=25)
@given(_reads(), st.data())
def test_a_file_that_is_cut_or_changed_in_one_byte_is_none(read: Read, data: st.DataObject) -> None:
    content = b"".join(packed(read))
    place = data.draw(st.integers(0, len(content) - 1))
    other = bytearray(content)
    other[place] ^= data.draw(st.integers(1, 255))
    for damaged in (content[:place], bytes(other), content + b"\0"):
        with pytest.raises(NoColumnFileError):
            unpacked_read(damaged)


def test_a_large_file_is_mapped_and_says_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = Row(1, "action", "go", None, (0.5, np.pi))
    shown = Demonstration.from_rows("one", (Feature("x"), Feature("y")), [row])
    path = tmp_path / "one"
    path.write_bytes(b"".join(packed(Read(shown))))
    small, _, _ = read_columns(path)
    monkeypatch.setattr(column_file, "_MAPPED", 1)
    mapped, _, _ = read_columns(path)
    assert_same(mapped, small)
    assert_same(mapped, Read(shown))
