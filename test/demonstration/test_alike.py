"""Labels that may be one, written in several ways, are noted."""

from __future__ import annotations

from pathlib import Path

import pytest

import rebt_ros
from rebt_ros.demonstration.together import notes_together
from rebt_ros.inspection.inspecting import inspect
from rebt_ros.storage.inputs import load


def _notes(directory: Path, *tables: list[tuple[str, str]]) -> list[str]:
    paths = []
    for number, rows in enumerate(tables):
        lines = [f"{place},{door},{action}" for place, (door, action) in enumerate(rows)]
        paths.append(directory / f"{number}.csv")
        paths[-1].write_text("\n".join(("x,door,action", *lines)) + "\n")
    return [one for one in notes_together(load(paths).demonstrations) if "write them alike" in one]


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        (("Go", "go", "turn"), "'Go' and 'go'"),
        (("move-forward", "Move Forward", "move_forward", "turn"), "'Move Forward' and"),
        (("MoveForward", "move_forward"), "'MoveForward' and 'move_forward'"),
        (("1", "1.0", "01", "2"), "'01' and '1' and '1.0'"),
        (("1", "-1", "10"), ""),
        (("1-2", "12"), ""),
        (("go", "goal", "go on"), ""),
        (("left", "right"), ""),
    ],
)
def test_actions_that_differ_only_in_how_they_are_written_are_noted(
    labels: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    notes = _notes(tmp_path, [("open", label) for label in labels for _ in range(3)])
    assert len(notes) == bool(said)
    assert all(one.startswith(said) and "are different actions" in one for one in notes)


def test_values_are_compared_over_demonstrations(tmp_path: Path) -> None:
    first = [("open", "go"), ("shut", "stop")] * 3
    second = [("Open", "Go"), ("shut", "stop")] * 3
    assert not _notes(tmp_path, first)
    actions, values = _notes(tmp_path, first, second)
    assert actions == "'Go' and 'go' are different actions: write them alike where they are one"
    assert values == (
        "'Open' and 'open' are different values of feature 'door': write them alike where they are "
        "one"
    )
    notes = rebt_ros.learn([tmp_path / "0.csv", tmp_path / "1.csv"]).notes
    assert actions in notes
    assert actions in inspect(load([tmp_path / "0.csv", tmp_path / "1.csv"]).demonstrations).notes
