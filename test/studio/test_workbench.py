"""The draft of a studio, with the files of a learner."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_draft import learned

from rebt_ros.errors import OptionError
from rebt_ros.learning.learning_file import NAME, write_learning
from rebt_ros.studio.board import Board, Section
from rebt_ros.studio.workbench import Workbench
from rebt_ros.trial.candidates import Candidate
from rebt_ros.trial.driven import NAME as TRIALS
from rebt_ros.trial.driven import write_driven
from rebt_ros.trial.tally import Tally


def test_what_was_learned_is_awaited_until_it_is_read(tmp_path: Path) -> None:
    board = Board()
    bench = Workbench(board, tmp_path, None, "someone")

    def learn() -> str:
        assert "awaited" not in board.section(Section.LEARNING)
        return "Learned."

    assert bench.learn(learn) == "Learned."
    bench.look()
    assert board.section(Section.LEARNING) == {"awaited": True}
    write_learning(tmp_path, learned())
    bench.look()
    shown = board.section(Section.LEARNING)
    assert shown["rows"] == 180
    assert "awaited" not in shown


def test_what_trees_did_when_they_drove_stands_beside_their_sizes(tmp_path: Path) -> None:
    board = Board()
    bench = Workbench(board, tmp_path, None, "someone")
    write_learning(tmp_path, learned())

    def driven() -> dict[int, object]:
        bench.look()
        levels = board.section(Section.LEARNING)["levels"]
        return {level["number"]: level["drove"] for level in levels if level["drove"]}

    assert driven() == {}
    level = learned().levels.level(1)
    other = learned().levels.level(2)
    trees = [Candidate("level", one.learned, tmp_path) for one in (level, other)]
    write_driven(tmp_path, zip(trees, (Tally(3, 4), Tally()), strict=True))
    tally = Tally(3, 4)
    entry = {"successes": 3, "episodes": 4, "share": 0.75, "interval": list(tally.interval)}
    assert driven() == {1: entry}
    (tmp_path / TRIALS).write_text("nothing")
    assert driven() == {}
    assert "trials.json cannot be used" in board.section(Section.LEARNING)["notes"][-1]
    (tmp_path / TRIALS).unlink()
    assert driven() == {}
    assert "trials.json" not in str(board.section(Section.LEARNING)["notes"])


def test_what_is_spoilt_is_not_awaited(tmp_path: Path) -> None:
    board = Board()
    bench = Workbench(board, tmp_path, None, "someone")
    bench.learn(lambda: "Learned.")
    (tmp_path / NAME).write_bytes(b"nothing")
    bench.look()
    assert set(board.section(Section.LEARNING)) == {"problem"}


def test_nothing_is_awaited_where_nothing_is_learned(tmp_path: Path) -> None:
    board = Board()
    bench = Workbench(board, tmp_path, None, "someone")

    def refuse() -> str:
        raise OptionError("no rows.")

    with pytest.raises(OptionError, match="no rows"):
        bench.learn(refuse)
    assert board.section(Section.LEARNING) == {}
