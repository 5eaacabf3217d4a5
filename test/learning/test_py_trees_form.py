"""Learned trees as py_trees trees of behaviours from outside."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from random import Random

import py_trees
import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import Literal, PreviousActionIs, Threshold

_DOCS = Path(__file__).resolve().parents[2] / "docs"
ENDINGS = (Status.RUNNING, Status.RUNNING, Status.SUCCESS, Status.FAILURE)
NUMBERS = (-0.5, 0.0, 0.1, 0.2, 0.3, 0.5, None)
#: Values of `some.FEATURES`.
VALUES = (NUMBERS, NUMBERS, (0.0, 1.0, None), ("box", "cup", "tool", None))


class _Robot:
    """What was told to do, and how it ends; a commander, and the maker of behaviours."""

    def __init__(self) -> None:
        self.endings: dict[str, Status] = {}
        self.ticked: list[str] = []
        self.halted: Counter[str] = Counter()

    def update(self, action: nodes.Action) -> Status:
        self.ticked.append(action.label)
        return self.endings[action.label]

    def halt(self, action: nodes.Action) -> None:
        self.halted[action.label] += 1

    def behaviour(self, label: str) -> py_trees.behaviour.Behaviour:
        return _Own(self, label)


class _Own(py_trees.behaviour.Behaviour):
    def __init__(self, robot: _Robot, label: str) -> None:
        super().__init__(f"my {label}")
        self._robot, self._label = robot, label

    def update(self) -> Status:
        return self._robot.update(some.action(self._label))

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID and self.status is Status.RUNNING:
            self._robot.halt(some.action(self._label))


def _made(
    learned: rebt_ros.LearnedTree, robot: _Robot, state: dict[str, rebt_ros.State]
) -> py_trees.trees.BehaviourTree:
    behaviours = {
        label: lambda label=label: robot.behaviour(label)  # type: ignore[misc]
        for label in some.LABELS
    }
    return rebt_ros.to_py_trees(learned, behaviours, lambda: state["now"])


@given(some.trees(), st.integers(0, 10**6), st.sampled_from(RowKind), st.integers(0, 20))
def test_own_behaviours_are_ticked_and_halted_as_the_runtime_commands(
    tree: nodes.Node, seed: int, row_kind: RowKind, interrupted_after: int
) -> None:
    learned, random = some.learned(tree, row_kind=row_kind), Random(seed)
    theirs, own = _Robot(), _Robot()
    runtime = TreeRuntime(learned, theirs, executable(learned.tree))
    state: dict[str, rebt_ros.State] = {}
    made = _made(learned, own, state)
    encoding = {None: float("nan"), "box": 0.0, "cup": 1.0, "tool": 2.0}
    for number in range(20):
        now = [random.choice(values) for values in VALUES]
        theirs.endings = own.endings = {label: random.choice(ENDINGS) for label in some.LABELS}
        state["now"] = now
        made.tick()
        tick = runtime.tick([encoding.get(value, value) for value in now])  # type: ignore[arg-type]
        if number == interrupted_after:
            runtime.halt()
            made.root.stop(Status.INVALID)
        assert (own.ticked, own.halted) == (theirs.ticked, theirs.halted)
        if number != interrupted_after:
            assert made.root.status is tick.status


def test_what_was_done_before_is_known_where_it_is_a_part_of_another_tree() -> None:
    after_go = Literal(PreviousActionIs("go"))
    tree = nodes.Selector((some.when(after_go, then=some.action("turn")), some.action("go")))
    robot, state = _Robot(), {"now": {}}
    robot.endings = dict.fromkeys(some.LABELS, Status.SUCCESS)
    made = _made(some.learned(tree), robot, state)  # type: ignore[arg-type]
    whole = py_trees.composites.Selector("robot", memory=False, children=[made.root])
    for _ in range(4):
        whole.tick_once()
    assert robot.ticked == ["go", "turn", "go", "turn"]


def test_lagged_features_look_back_at_earlier_ticks() -> None:
    features = (Feature("x"), Feature("x 1 before", index=0, lag=1))
    tests = Literal(Threshold("x 1 before", 0.5))
    tree = nodes.Selector((some.when(tests, then=some.action("go")), some.action("turn")))
    robot, state = _Robot(), {}
    robot.endings = dict.fromkeys(some.LABELS, Status.SUCCESS)
    made = _made(some.learned(tree, features), robot, state)
    for x in (0.0, 1.0, 1.0):
        state["now"] = {"x": x}
        made.tick()
    assert robot.ticked == ["turn", "go", "turn"]


def test_an_action_without_a_behaviour_is_named() -> None:
    with pytest.raises(rebt_ros.OptionError, match="'go' has no behaviour"):
        rebt_ros.to_py_trees(some.learned(some.action("go")), {}, dict)


def test_the_example_in_the_docs_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (_DOCS / "export.md").read_text(encoding="utf-8")
    [program] = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{x / 10},{'go' if x < 20 else 'turn'}\n" for x in range(40))
    (tmp_path / "shown.csv").write_text(f"front,action\n{rows}")
    exec(compile(program, "docs/export.md", "exec"), {"__name__": "example"})
    assert capsys.readouterr().out.splitlines() == ["go", "go", "turn"]
