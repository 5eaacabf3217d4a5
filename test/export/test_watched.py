"""Trees as programs that watch trees of BehaviorTree.CPP see them."""

from __future__ import annotations

from random import Random
from xml.etree import ElementTree

import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.errors import DocumentError
from rebt_ros.export import watched as module
from rebt_ros.export.watched import NodeStatus, watched

STATES = ((0.0, 0.0, 0.0, 0.0), (0.5, 0.1, 1.0, 2.0), (-0.5, 0.3, 1.0, 1.0))


@given(some.trees(), st.integers(0, 10**6))
def test_each_node_that_was_ticked_has_its_status_and_the_others_are_idle(
    tree: nodes.Node, seed: int
) -> None:
    learned, random = some.learned(tree), Random(seed)
    seen, runtime = watched(learned), TreeRuntime(learned, tree=executable(learned.tree))
    ticked = list(nodes.walk(executable(learned.tree)))
    for _ in range(5):
        runtime.tick(random.choice(STATES))
        outcomes, snapshot = runtime.outcomes(), runtime.snapshot()
        for node, status in zip(seen.nodes, seen.statuses(outcomes), strict=True):
            expected = snapshot[node.place] if node.place in outcomes else "IDLE"
            # A Parallel halts in the same tick what runs beside what has failed.
            assert expected in (status.name, "INVALID")
            if isinstance(ticked[node.place], nodes.Action):
                assert node.name.startswith(ticked[node.place].label)  # type: ignore[union-attr]


@given(some.trees())
def test_its_xml_numbers_every_node_and_btview_reads_it(tree: nodes.Node) -> None:
    parser = pytest.importorskip("btview.parser")
    seen = watched(some.learned(tree))
    root = ElementTree.fromstring(seen.xml)
    numbered = [one for one in root.iter() if one.get("_uid")]
    assert [(int(one.attrib["_uid"]), one.get("name")) for one in numbered] == [
        (node.uid, node.name) for node in seen.nodes
    ]
    assert [node.uid for node in seen.nodes] == list(range(1, len(seen.nodes) + 1))
    places = {node.place for node in seen.nodes}
    assert places == set(range(nodes.size(executable(tree))))
    read = parser.parse_bt_xml(seen.xml)
    assert [(node.uid, node.name) for node in read.walk()] == [
        (node.uid, node.name) for node in seen.nodes
    ]


def test_an_action_that_is_called_like_a_condition_is_told_apart() -> None:
    seen = watched(some.learned(nodes.Action("Test", "action")))
    models = ElementTree.fromstring(seen.xml).find("TreeNodesModel")
    assert models is not None
    names = [one.get("ID") for one in models]
    assert len(set(names)) == len(names) == 2


def test_changes_are_those_between_two_ticks() -> None:
    seen = watched(some.learned(nodes.Selector((some.action("go"), some.action("turn")))))
    before, after = {0: "SUCCESS", 1: "SUCCESS"}, {0: "SUCCESS", 1: "FAILURE", 2: "SUCCESS"}
    assert [(node.uid, old, new) for node, old, new in seen.changes(before, after)] == [
        (2, NodeStatus.SUCCESS, NodeStatus.FAILURE),
        (3, NodeStatus.IDLE, NodeStatus.SUCCESS),
    ]
    assert list(seen.changes(after, after)) == []


def test_a_tree_whose_nodes_cannot_be_numbered_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_NODES", 2)
    with pytest.raises(DocumentError, match="has 3 nodes"):
        watched(some.learned(nodes.Selector((some.action("go"), some.action("turn")))))
