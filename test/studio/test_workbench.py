"""The draft of a studio, with the files of a learner."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_draft import learned

from rebt_ros.errors import OptionError
from rebt_ros.learning.learning_file import NAME, write_learning
from rebt_ros.studio.board import Board, Section
from rebt_ros.studio.workbench import Workbench


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
