"""``explain`` says why a tree does what it does, and what it would take to do something else."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import strategies as some
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from rule_examples import NAMES

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.commands import explain as command
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.storage.tree_file import write_tree
from rebt_ros.verification import explaining
from rebt_ros.verification.explaining import explain
from rebt_ros.verification.sweep import Sweep

GO, GRASP, TURN, WAIT = some.ACTIONS
NEAR, LOW = some.at_most("distance", 0.3), some.at_most("battery", 0.2)
CAREFUL = nodes.Selector((some.when(LOW, then=WAIT), some.when(NEAR, then=TURN), GO))


@settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
@given(some.trees(), some.states, st.lists(st.sampled_from(some.LABELS), max_size=4))
def test_the_action_is_what_a_tick_commands_and_each_change_leads_to_what_it_says(
    tree: nodes.Node, state: tuple[float, ...], earlier: list[str]
) -> None:
    learned = some.learned(tree)
    assume(nodes.actions(tree))
    [explained] = explain(learned, state, {some.CHANNEL: ActionHistory(earlier)})

    def commanded(values: tuple[float, ...], history: ActionHistory) -> nodes.Action | None:
        runtime = TreeRuntime(learned, tree=executable(tree), histories={some.CHANNEL: history})
        return next(iter(runtime.tick(values).commands), None)

    assert explained.action == commanded(state, ActionHistory(earlier))
    for flip in explained.flips or ():
        history = ActionHistory(earlier)
        if flip.feature is None and flip.point.before is not None:
            history = flip.point.before.history()
        assert flip.action == commanded(flip.point.values, history)
        assert flip.action != explained.action
        if flip.feature is not None:
            changed = [
                name
                for name, old, new in zip(NAMES, state, flip.point.values, strict=True)
                if old != new and not (math.isnan(old) and math.isnan(new))
            ]
            assert changed == [flip.feature]


def test_changes_of_single_features_are_the_same_where_branches_overlap_too_much() -> None:
    learned, state = some.learned(CAREFUL), (0.5, 0.5, 0.0, 0.0)
    [known] = explain(learned, state)
    whole = explaining.sweep

    def limited(*arguments: object) -> Sweep:
        return whole(*arguments, most=6 if len(arguments) > 4 else 0)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(explaining, "sweep", limited)
        [found] = explain(learned, state)
    assert known.flips
    assert found.flips == known.flips


def explained(
    directory: Path, capsys: pytest.CaptureFixture[str], *arguments: str, tree: nodes.Node = CAREFUL
) -> list[str]:
    write_tree(directory / "tree.json", some.learned(tree))
    command.main([str(directory / "tree.json"), *arguments])
    return capsys.readouterr().out.splitlines()


def table_file(directory: Path) -> str:
    path = directory / "shown.csv"
    path.write_text(
        "distance,battery,docked,kind,action\n"
        "0.9,0.5,0,box,go\n0.8,0.5,1,cup,turn\n0.25,0.4,0,box,turn\n0.2,0.1,1,tool,wait\n"
    )
    return str(path)


def test_a_state_is_explained_with_values_beside_thresholds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = explained(tmp_path, capsys, "--state", "distance=0.25,battery=0.5")
    apart = ("--state", "distance=0.25", "--state", "battery=0.5")
    assert explained(tmp_path, capsys, *apart) == lines
    assert lines[:4] == [
        "turn",
        "  because distance ≤ 0.3 (distance = 0.25)",
        "  Branches before it that did not act:",
        "    wait: does not hold: battery ≤ 0.2 (battery = 0.5)",
    ]
    assert lines[4] == "  Smallest changes that lead to another action:"
    assert lines[5].startswith("    distance = 0.3")
    assert lines[5].endswith("→ go")
    assert lines[6].endswith("→ wait")


def test_a_row_is_explained_from_the_rows_that_taught_its_branch(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = explained(tmp_path, capsys, "--row", "1", table_file(tmp_path))
    assert lines[0] == "where distance = 0.8, battery = 0.5, docked = 1, kind = cup"
    assert lines[1] == "go"
    assert (
        "  This branch acts in 2 rows that were shown, where this was done: go 1, turn 1" in lines
    )


def test_what_was_done_before_is_part_of_the_situation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = nodes.Selector((some.when(some.Literal(some.PreviousActionIs("turn")), then=TURN), GO))
    for done, action in (("turn", "turn"), ("turn,go", "go"), ("", "go")):
        lines = explained(tmp_path, capsys, "--state", "", "--done", done, tree=tree)
        assert lines[0] == action


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ([], "say what to explain: either --state, or --row with an INPUT"),
        (["--state", "front=1"], "there is no feature 'front': the tree has distance"),
        (["--state", "distance"], "'distance' needs a value, such as distance=0.2"),
        (["--state", "distance=far"], "'distance' is a number, not 'far'"),
        (["--state", "distance=inf"], "'distance' must be finite, not inf"),
        (["--state", "kind=bowl"], "'kind' has no category 'bowl': it has box, cup, tool"),
        (["--state", "", "--done", "fly"], "there is no action 'fly': there are go"),
        (["--row", "1"], "name the INPUT that has the row"),
        (["TABLE", "--row", "4"], "has 4 rows, from 0: there is no row 4"),
        (["TABLE", "--row", "0", "--demonstration", "x"], "there is no demonstration 'x'"),
    ],
)
def test_what_cannot_be_explained_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], why: str
) -> None:
    table = table_file(tmp_path)
    with pytest.raises(SystemExit) as ended:
        explained(tmp_path, capsys, *(table if one == "TABLE" else one for one in arguments))
    assert ended.value.code == 1
    assert why in capsys.readouterr().err
