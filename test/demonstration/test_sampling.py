"""A sample of a large table has whole demonstrations, and those of rare actions before all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.arrays import IntArray
from rebt_ros.demonstration.sampling import sample_of
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable


def _table(chosen: IntArray, lengths: list[int]) -> DemonstrationTable:
    actions = int(chosen.max()) + 1
    return DemonstrationTable(
        channel="action",
        features=(Feature("x"),),
        states=np.zeros((len(chosen), 1)),
        actions=tuple(f"a{code}" for code in range(actions)),
        chosen=chosen,
        demonstrations=tuple(f"d{number}" for number in range(len(lengths))),
        demonstration=np.repeat(np.arange(len(lengths)), lengths),
        stamps=np.arange(len(chosen)),
    )


def _sampled(table: DemonstrationTable, rows: int) -> IntArray:
    """The demonstrations that are in the sample, which must be there as a whole."""
    inside = sample_of(table, rows).rows
    counts = np.bincount(table.demonstration[inside], minlength=len(table.demonstrations))
    lengths = np.bincount(table.demonstration, minlength=len(table.demonstrations))
    assert set(counts[counts > 0] - lengths[counts > 0]) == {0}
    return np.flatnonzero(counts)


def test_it_has_whole_demonstrations_evenly_spread() -> None:
    table = _table(np.arange(10_000) % 2, [10] * 1000)
    shown = _sampled(table, 1000)
    assert len(shown) == pytest.approx(100, abs=5)
    # About as many from each tenth of the time.
    assert np.bincount(shown // 100).tolist() == pytest.approx([10] * 10, abs=3)


def test_all_demonstrations_of_a_rare_action_are_in_it() -> None:
    chosen = np.arange(10_000) % 2
    rare = [3, 4, 517, 998]
    chosen[np.array(rare) * 10 + 5] = 2
    sample = sample_of(_table(chosen, [10] * 1000), 1000)
    assert set(rare) <= set(_sampled(_table(chosen, [10] * 1000), 1000).tolist())
    assert sample.complete == ("a2",)
    assert len(sample) == pytest.approx(1000, abs=50)
    assert sample.demonstrations == pytest.approx(100, abs=5)


def test_an_action_of_which_there_is_too_much_has_its_part_of_it() -> None:
    chosen = np.arange(10_000) % 2
    # In every second demonstration once: not all of them have room.
    chosen[5::20] = 2
    table = _table(chosen, [10] * 1000)
    sample = sample_of(table, 1000)
    assert 10 <= np.count_nonzero(chosen[sample.rows] == 2) <= 80
    assert not sample.complete
    assert len(sample) == pytest.approx(1000, abs=50)


def test_a_long_demonstration_is_cut_into_stretches_from_all_over() -> None:
    table = _table(np.arange(10_000) % 2, [10_000])
    rows = np.flatnonzero(sample_of(table, 1000).rows)
    assert len(rows) == pytest.approx(1000, abs=50)
    assert np.bincount(rows // 1000, minlength=10).tolist() == pytest.approx([100] * 10, abs=40)
    # Stretches, no single rows.
    assert np.count_nonzero(np.diff(rows) > 1) < 60


@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(1, 60), min_size=1, max_size=80),
    st.integers(1, 6),
    st.integers(1, 300),
)
def test_it_has_every_action_and_about_as_many_rows_as_asked_for(
    seed: int, lengths: list[int], actions: int, rows: int
) -> None:
    random = np.random.default_rng(seed)
    # The last actions are rare.
    chosen = np.minimum(random.geometric(0.6, sum(lengths)) - 1, actions - 1)
    table = _table(chosen.astype(np.int64), lengths)
    sample = sample_of(table, rows)
    assert set(chosen[sample.rows]) == set(chosen)
    longest = min(max(rows // 50, 1), max(lengths))
    # At most a unit more for each action.
    assert len(sample) <= rows + (actions + 1) * longest
    assert len(sample) >= min(rows, len(table)) / 2 - (actions + 2) * longest
    for label in sample.complete:
        assert sample.rows[table.chosen == table.actions.index(label)].all()
    assert np.array_equal(sample_of(table, rows).rows, sample.rows)
