"""Rows that several demonstrations hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.demonstration import repeated as module
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.repeated import repeated
from rebt_ros.demonstration.schema import Feature

_BEGIN = 1_700_000_000_000_000_000


def _shown(name: str, first: int, rows: int, *, begin: int = _BEGIN) -> Demonstration:
    """Rows of a world that goes on whoever looks, from a first one on."""
    steps = np.arange(first, first + rows)
    return Demonstration(
        name,
        (Feature("x"), Feature("y")),
        np.column_stack([steps % 10, -(steps % 3) * 0.0]),
        begin + steps * 100_000_000,
        ("go", "stop"),
        steps % 2,
        ("action",),
        np.zeros(rows, dtype=np.int64),
    )


@given(st.integers(0, 60), st.integers(1, 60), st.integers(1, 60))
def test_two_recorders_of_one_demonstration_are_noticed(late: int, first: int, second: int) -> None:
    shared = len(set(range(first)) & set(range(late, late + second)))
    notes = list(repeated([_shown("a", 0, first), _shown("b", late, second)]))
    same = shared >= 5 and 2 * shared >= min(first, second)
    assert notes == (
        [f"a and b share {shared} rows, which count twice: leave one of them out"] if same else []
    )


@pytest.mark.parametrize("what", ["stamps", "states", "chosen", "positions"])
def test_rows_that_differ_are_no_rows_in_common(what: str) -> None:
    one = _shown("a", 0, 50)
    other = {
        "stamps": replace(one, stamps=one.stamps + 1),
        "states": replace(one, states=one.states + 0.5),
        "chosen": replace(one, chosen=1 - one.chosen),
        # Tables have the same positions, but for one row.
        "positions": replace(one, stamps=np.arange(50), chosen=one.chosen ^ (np.arange(50) == 7)),
    }[what]
    first = replace(one, stamps=np.arange(50)) if what == "positions" else one
    assert list(repeated([first, replace(other, name="b")])) == []


def test_copies_of_a_table_are_noticed() -> None:
    table = replace(_shown("a.csv", 0, 50), stamps=np.arange(50))
    [note] = repeated([table, replace(table, name="b.csv")])
    assert note.startswith("a.csv and b.csv share 50 rows")


def test_actions_are_compared_by_their_names() -> None:
    one = _shown("a", 0, 50)
    turned = replace(one, name="b", actions=("stop", "go"))
    assert list(repeated([one, turned])) == []
    assert len(list(repeated([one, replace(turned, chosen=1 - one.chosen)]))) == 1
    other = replace(one, name="b", actions=("back", "go", "stop"), chosen=one.chosen + 1)
    assert len(list(repeated([one, other]))) == 1


def test_of_many_copies_a_few_are_named() -> None:
    notes = list(repeated([_shown(f"copy {number}", 0, 20) for number in range(9)]))
    assert len(notes) == 6
    assert notes[-1] == "3 more pairs of demonstrations share rows"


def test_a_part_of_many_rows_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOST", 500)
    [note] = repeated([_shown("a", 0, 2000), _shown("b", 0, 2000), _shown("c", 5000, 2000)])
    count = int(note.removeprefix("a and b share about ").split()[0])
    assert 1200 < count < 2800


_parts = st.tuples(
    st.integers(0, 40), st.integers(0, 30), st.sampled_from((_BEGIN, 0, 10_000_000_000, -(10**9)))
)


@given(st.lists(_parts, min_size=1, max_size=6), st.data())
def test_of_many_rows_those_that_are_not_looked_into_share_none(
    parts: list[tuple[int, int, int]], data: st.DataObject
) -> None:
    shown = [
        _shown(f"run_{place}", first, rows, begin=begin)
        for place, (first, rows, begin) in enumerate(parts)
    ]
    copied = data.draw(st.lists(st.sampled_from(shown), max_size=3))
    shown += [replace(one, name=f"copy_{place}") for place, one in enumerate(copied)]
    with pytest.MonkeyPatch.context() as patched:
        # Every row is compared, as if there were many.
        patched.setattr(module, "_MOST", 1)
        patched.setattr(module, "_hashes", lambda one, part, hashes=module._hashes: hashes(one, 1))
        found = list(repeated(shown))
        everything = np.ones(len(shown), dtype=bool)
        patched.setattr(module, "_may_share", lambda demonstrations: everything)
        assert list(repeated(shown)) == found


def test_texts_have_the_same_numbers_in_every_process() -> None:
    assert module._texts(("go", "stop")).tolist() == [11176960828788041012, 15668649924750310089]


def test_without_demonstrations_there_is_nothing_to_say() -> None:
    assert list(repeated([])) == []


def test_rows_that_a_demonstration_holds_twice_are_noticed() -> None:
    once = _shown("bag", 0, 50)
    twice = replace(
        once,
        states=np.repeat(once.states, 2, axis=0),
        stamps=np.repeat(once.stamps, 2),
        chosen=np.repeat(once.chosen, 2),
        channel=np.repeat(once.channel, 2),
    )
    [note] = repeated([twice])
    assert note.startswith("bag holds 50 rows again")
    assert list(repeated([once])) == []
