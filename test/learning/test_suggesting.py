"""What is offered in the default and in the paper's mode."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import pytest
import strategies as some
from pruned_trees import train
from test_pipeline import there_and_back

from rebt_ros.beyond_the_paper import single_loops
from rebt_ros.decision_tree import training
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.errors import OptionError
from rebt_ros.learning import suggesting
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn_channels
from rebt_ros.paper import lat_trees

DEFAULT, PAPER = LearnOptions(), LearnOptions.paper()


@dataclass
class Asked:
    """What `suggest` asked of the algorithms."""

    rows: list[int] = field(default_factory=list)
    least_support: list[int] = field(default_factory=list)
    most_loops: list[int] = field(default_factory=list)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    asked = Asked()

    def fit(table: DemonstrationTable, options: training.FitOptions) -> FittedTree:
        asked.rows.append(len(table))
        return training.fit(table, options)

    def gen_lat_trees(*arguments: Any, least_support: int, **options: Any) -> Any:
        asked.least_support.append(least_support)
        return lat_trees.gen_lat_trees(*arguments, least_support=least_support, **options)

    def loop_trees(*arguments: Any, most: int, **options: Any) -> Any:
        asked.most_loops.append(most)
        return single_loops.loop_trees(*arguments, most=most, **options)

    monkeypatch.setattr(suggesting, "fit", fit)
    monkeypatch.setattr(suggesting, "gen_lat_trees", gen_lat_trees)
    monkeypatch.setattr(suggesting, "loop_trees", loop_trees)
    monkeypatch.setattr(suggesting, "_MOST_ROWS_FITTED", 4)
    return asked


#: Only one demonstration.
TABLE = some.table([(number / 10, 0.0, 0.0, 0.0) for number in range(8)], [0, 1, 0, 2] * 2)


def test_the_paper_learns_from_all_rows_and_offers_what_nobody_has_shown(asked: Asked) -> None:
    suggesting.suggest(TABLE, train(TABLE), 0.0, PAPER)
    assert asked == Asked([8], [0], [24])


def test_the_default_learns_from_a_part_and_offers_what_was_shown(asked: Asked) -> None:
    suggesting.suggest(TABLE, train(TABLE), 0.0, DEFAULT)
    assert asked == Asked([4], [1], [0])


def test_trees_of_any_size_are_minimized_for_the_paper_alone(
    monkeypatch: pytest.MonkeyPatch, asked: Asked
) -> None:
    monkeypatch.setattr(suggesting, "MOST_LEAVES_MINIMIZED", 1)
    notes = [suggesting.suggest(TABLE, train(TABLE), 0.0, one)[1] for one in (DEFAULT, PAPER)]
    assert notes[0][0].startswith("no PSA nodes and LAT trees are suggested")
    assert not any("no PSA nodes" in note for note in notes[1])
    assert asked.least_support == [0]


def test_with_one_channel_ids_to_attach_have_no_channel_in_front() -> None:
    table = tabulate([there_and_back("one")])[0]
    [offering] = learn_channels([table])
    first = offering.learned.suggestions[0].id
    assert "/" not in first
    [attached] = learn_channels([table], replace(DEFAULT, attach=(first,)))
    assert [one.id for one in attached.learned.suggestions if one.attached] == [first]
    with pytest.raises(OptionError, match=f"^there is no suggestion '{table.channel}/{first}'"):
        learn_channels([table], replace(DEFAULT, attach=(f"{table.channel}/{first}",)))
