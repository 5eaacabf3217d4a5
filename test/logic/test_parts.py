"""Trees of parts of a table that share a matrix are those of tables of their own."""

from __future__ import annotations

import numpy as np
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import FitOptions, fit, fit_parts
from rebt_ros.demonstration.table import DemonstrationTable


def same(one: FittedTree, other: FittedTree) -> bool:
    return (
        one.at(0.0).tree == other.at(0.0).tree
        and one.path.alphas.tolist() == other.path.alphas.tolist()
        and one.path.collapse.tolist() == other.path.collapse.tolist()
    )


@settings(max_examples=60, deadline=None)
@given(some.tables(min_rows=2, max_rows=40), some.vocabularies, st.data())
def test_a_part_has_the_tree_of_its_own_table(
    table: DemonstrationTable, vocabulary: Vocabulary, data: st.DataObject
) -> None:
    rows = st.lists(st.booleans(), min_size=len(table), max_size=len(table)).filter(any)
    parts = [np.array(data.draw(rows)) for _ in range(3)]
    whole, *of_parts = fit_parts(table, parts, FitOptions(vocabulary=vocabulary))
    assert same(whole, fit(table, FitOptions(vocabulary=vocabulary)))
    for part, fitted in zip(parts, of_parts, strict=True):
        assert same(fitted, fit(table.where(part), FitOptions(vocabulary=vocabulary)))
        assert table.last_where(part).tolist() == table.where(part).last.tolist()


@given(some.tables(min_rows=1, max_rows=20), st.data())
def test_rows_that_stand_together_are_the_same_rows(
    table: DemonstrationTable, data: st.DataObject
) -> None:
    first = data.draw(st.integers(0, len(table)))
    end = data.draw(st.integers(first, len(table)))
    place = np.arange(len(table))
    part = table.where((place >= first) & (place < end))
    assert part.chosen.tolist() == table.chosen[first:end].tolist()
    assert part.stamps.tolist() == table.stamps[first:end].tolist()
    assert part.previous.tolist() == table.previous[first:end].tolist()
    assert np.array_equal(part.states, table.states[first:end], equal_nan=True)
