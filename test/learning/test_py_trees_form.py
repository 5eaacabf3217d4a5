"""Learned trees as py_trees trees of behaviours from outside."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import py_trees
import pytest
import strategies as some
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from py_trees.common import Status

import rebt_ros
from rebt_ros.behavior_tree import document, nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.commands import export
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


def _parsed(
    learned: rebt_ros.LearnedTree, robot: _Robot, state: dict[str, rebt_ros.State], folder: Path
) -> py_trees.behaviour.Behaviour:
    """The root of the tree that py_trees makes of the XML."""
    parsers = pytest.importorskip("py_trees.parsers.behaviour_tree_xml", reason="needs 2.5")
    path = folder / "tree.xml"
    path.write_text(rebt_ros.to_py_trees_xml(learned), encoding="utf-8")
    known = rebt_ros.py_trees_nodes(learned, _behaviours(robot), lambda: state["now"])
    root = parsers.parse_behaviour_tree_xml(str(path), node_registry=known)
    assert isinstance(root, py_trees.behaviour.Behaviour)
    return root


def _behaviours(robot: _Robot) -> dict[str, Callable[[], py_trees.behaviour.Behaviour]]:
    return {
        label: lambda label=label: robot.behaviour(label)  # type: ignore[misc]
        for label in some.LABELS
    }


def _made(
    learned: rebt_ros.LearnedTree, robot: _Robot, state: dict[str, rebt_ros.State]
) -> py_trees.trees.BehaviourTree:
    return rebt_ros.to_py_trees(learned, _behaviours(robot), lambda: state["now"])


ACTING = some.trees().filter(lambda tree: bool(nodes.actions(tree)))
TWO_CHANNELS = st.tuples(ACTING, ACTING).map(
    lambda trees: nodes.Parallel(
        (some.on_channel("arm", trees[0]), some.on_channel("base", trees[1]))
    )
)


@pytest.mark.parametrize("from_xml", [False, True])
@settings(max_examples=60)
@given(
    st.one_of(some.trees(), some.trees(), TWO_CHANNELS),
    st.integers(0, 10**6),
    st.sampled_from(RowKind),
    st.integers(0, 20),
)
def test_own_behaviours_are_ticked_and_halted_as_the_runtime_commands(
    from_xml: bool,
    tmp_path_factory: pytest.TempPathFactory,
    tree: nodes.Node,
    seed: int,
    row_kind: RowKind,
    interrupted_after: int,
) -> None:
    learned, random = some.learned(tree, row_kind=row_kind), Random(seed)
    theirs, own = _Robot(), _Robot()
    runtime = TreeRuntime(learned, theirs, executable(learned.tree))
    state: dict[str, rebt_ros.State] = {}
    if from_xml:
        root = _parsed(learned, own, state, tmp_path_factory.getbasetemp())
    else:
        root = _made(learned, own, state).root
    encoding = {None: float("nan"), "box": 0.0, "cup": 1.0, "tool": 2.0}
    for number in range(20):
        now = [random.choice(values) for values in VALUES]
        theirs.endings = own.endings = {label: random.choice(ENDINGS) for label in some.LABELS}
        state["now"] = now
        root.tick_once()
        tick = runtime.tick([encoding.get(value, value) for value in now])  # type: ignore[arg-type]
        if number == interrupted_after:
            runtime.halt()
            root.stop(Status.INVALID)
        assert (own.ticked, own.halted) == (theirs.ticked, theirs.halted)
        if number != interrupted_after:
            assert root.status is tick.status


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


def test_a_behaviour_can_be_given_as_it_is_where_its_action_has_one_place() -> None:
    robot = _Robot()
    robot.endings = dict.fromkeys(some.LABELS, Status.SUCCESS)
    go = robot.behaviour("go")
    made = rebt_ros.to_py_trees(some.learned(some.action("go")), {"go": go}, lambda: [0.0] * 4)
    made.tick()
    assert (robot.ticked, go.status) == (["go"], Status.SUCCESS)


@pytest.mark.parametrize(
    ("give", "says"),
    [
        (lambda go, _: {"go": go}, "'go' stands in 2 places of the tree"),
        (lambda go, _: {"go": lambda: go}, "'my go', which carries out 'go', has a parent already"),
        (lambda _, turn: {"go": lambda: turn}, "'my turn', which carries out 'go', has a parent"),
        (lambda *_: {"go": lambda: "go"}, "what carries out 'go' is a str"),
        (lambda *_: {"go": "go"}, "what carries out 'go' is a str"),
        (lambda *_: {"go": None}, "'go' has no behaviour"),
    ],
)
def test_what_cannot_carry_out_an_action_is_refused(give: Any, says: str) -> None:
    tree = nodes.Selector((some.action("go"), some.action("go")))
    go, turn = _Robot().behaviour("go"), _Robot().behaviour("turn")
    py_trees.decorators.Inverter("other", turn)
    with pytest.raises(rebt_ros.OptionError, match=says):
        rebt_ros.to_py_trees(some.learned(tree), give(go, turn), dict)


@settings(max_examples=15)
@given(some.learned_trees())
def test_whatever_is_learned_has_names_that_the_parser_takes(
    tmp_path_factory: pytest.TempPathFactory, learned: rebt_ros.LearnedTree
) -> None:
    parsers = pytest.importorskip("py_trees.parsers.behaviour_tree_xml", reason="needs 2.5")
    # A state has the features of the present row.
    assume(not learned.features or any(not feature.lag for feature in learned.features))
    path = tmp_path_factory.getbasetemp() / "any.xml"
    path.write_text(rebt_ros.to_py_trees_xml(learned), encoding="utf-8")
    labels = {action.label for action in nodes.actions(learned.tree)}
    idle = {label: lambda: py_trees.behaviours.Running("idle") for label in labels}
    known = rebt_ros.py_trees_nodes(learned, idle, dict)
    root = parsers.parse_behaviour_tree_xml(str(path), node_registry=known)
    leaves = [node for node in root.iterate() if not node.children]
    assert len(leaves) == sum(
        isinstance(node, nodes.Condition | nodes.Action)
        for node in nodes.walk(executable(learned.tree))
    )


def test_a_registry_is_for_one_tree_and_its_own_xml(tmp_path: Path) -> None:
    parsers = pytest.importorskip("py_trees.parsers.behaviour_tree_xml", reason="needs 2.5")
    learned, robot = some.learned(some.action("go")), _Robot()
    path = tmp_path / "tree.xml"
    path.write_text(rebt_ros.to_py_trees_xml(learned), encoding="utf-8")
    known = rebt_ros.py_trees_nodes(learned, _behaviours(robot), dict)
    parsers.parse_behaviour_tree_xml(str(path), node_registry=known)
    with pytest.raises(parsers.XMLParserError, match="the place '0' of 'go' is taken"):
        parsers.parse_behaviour_tree_xml(str(path), node_registry=known)


def test_without_a_parser_the_version_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "py_trees.ports", None)
    with pytest.raises(rebt_ros.OptionError, match=r"py_trees \d.* reads no XML: install py_trees"):
        rebt_ros.py_trees_nodes(some.learned(some.action("go")), _behaviours(_Robot()), dict)


def test_the_examples_in_the_docs_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (_DOCS / "export.md").read_text(encoding="utf-8")
    first, second = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{x / 10},{'go' if x < 20 else 'turn'}\n" for x in range(40))
    (tmp_path / "shown.csv").write_text(f"front,action\n{rows}")
    names: dict[str, Any] = {"__name__": "example"}
    exec(compile(first, "docs/export.md", "exec"), names)
    assert capsys.readouterr().out.splitlines() == ["go", "go", "turn"]
    pytest.importorskip("py_trees.parsers.behaviour_tree_xml", reason="needs 2.5")
    (tmp_path / "tree.json").write_text(document.dumps(names["learned"]), encoding="utf-8")
    export.main(["tree.json", "--to", "py_trees", "--out", "tree.xml"])
    capsys.readouterr()
    exec(compile(second, "docs/export.md", "exec"), names)
    assert capsys.readouterr().out.splitlines() == ["go", "turn"]
