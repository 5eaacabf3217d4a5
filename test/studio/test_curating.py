"""What browsers ask for to change the draft."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from test_draft import learned

from rebt_ros.learning.learning_file import write_learning
from rebt_ros.studio.board import Board, Section
from rebt_ros.studio.curating import Curating
from rebt_ros.studio.verbs import reply
from rebt_ros.studio.workbench import Workbench


class Bench:
    """A workbench with a policy that was learned.

    Args:
        output: The learner's directory.
    """

    def __init__(self, output: Path) -> None:
        write_learning(output, learned())
        self.board = Board()
        self.bench = Workbench(self.board, output, None, "someone")
        self.bench.look()
        self._verbs = Curating(self.bench).verbs()

    @property
    def draft(self) -> Mapping[str, Any]:
        """What is shown of it."""
        return self.board.section(Section.DRAFT)

    def does(self, verb: str, **given: Any) -> str:
        """What a browser is told."""
        return reply(self._verbs, {"do": verb, **given}).message


def test_a_level_is_called_by_its_size(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    sizes = {
        one["number"]: one["leaves"] for one in bench.board.section(Section.LEARNING)["levels"]
    }
    number = next(one for one, leaves in sizes.items() if leaves > 1)
    words = f"choosing the tree with {sizes[number]} leaves"
    assert bench.does("level", number=number).lower().startswith(words)
    assert bench.draft["undo"] == words
    assert bench.bench.undo() == f"undone: {words}."
    assert "there is no pruning level 999" in bench.does("level", number=999)


def test_what_is_published_is_called_by_its_version(tmp_path: Path) -> None:
    bench = Bench(tmp_path).bench
    told = bench.publish(lambda _: "000007", "")
    assert told == "the robot has the draft now, as version 7."


def test_a_draft_tells_no_figures_of_the_tree_before_it_was_changed(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    nodes = bench.draft["view"]["nodes"]
    path = next(node["path"] for node in nodes if node.get("at_most") is not None)
    bench.does("threshold", path=path, value=0.123)
    assert "held-out" not in bench.draft["summary"]
    assert "180 rows" in bench.draft["summary"]


@pytest.mark.parametrize("verb", ["psa", "threshold", "remove", "move"])
def test_what_cannot_be_changed_is_said(tmp_path: Path, verb: str) -> None:
    given = {"choice": "parallel", "value": 1.0, "by": 1}
    assert "the tree has changed since" in Bench(tmp_path).does(verb, path="99.99", **given)
