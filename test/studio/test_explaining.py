"""Where a branch comes from: the demonstrations in which it acts."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from test_draft import learned

from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import OptionError
from rebt_ros.studio.explaining import Explaining
from rebt_ros.studio.timeline import Moment, Timeline
from rebt_ros.studio.verbs import Arguments
from rebt_ros.verification.acting import acting_leaves


def asked(path: str, published: LearnedTree | None = None) -> tuple[str, list[dict[str, object]]]:
    """What is said of a branch: of the draft, or of the tree that is published."""
    explaining = Explaining(learned, lambda: published, Timeline())
    given = Arguments({"path": path, "robot": published is not None})
    message, data = explaining.branch(given)
    return message, data["from"]


def rows_in(message: str) -> int:
    found = re.fullmatch(r"its branch acts in (\d+) of 180 rows that were shown(: .*)?[.]", message)
    assert found, message
    return int(found[1])


def test_the_branches_of_a_node_share_the_rows_in_which_it_acts() -> None:
    tree = learned().learned.tree
    acting = np.count_nonzero(acting_leaves(tree, learned().table) >= 0)
    assert rows_in(asked("root")[0]) == acting > 0
    for path, node in paths.walk(tree):
        below = [paths.text_of((*path, place)) for place, _ in enumerate(nodes.children(node))]
        parts = [
            rows_in(asked(one)[0])
            for one, child in zip(below, nodes.children(node), strict=True)
            if any(nodes.actions(child))
        ]
        if parts:
            assert rows_in(asked(paths.text_of(path))[0]) == sum(parts)


def test_a_condition_tells_of_the_branch_that_it_is_in() -> None:
    for path, node in paths.walk(learned().learned.tree):
        if isinstance(node, nodes.Condition | nodes.Inverter):
            above = next(
                path[:end]
                for end in range(len(path) - 1, -1, -1)
                if any(nodes.actions(paths.node_at(learned().learned.tree, path[:end])))
            )
            assert asked(paths.text_of(path)) == asked(paths.text_of(above))


def test_it_leads_to_where_the_branch_acts_first() -> None:
    message, visits = asked("root", learned().learned)
    assert {str(visit["demonstration"]) for visit in visits} == {"one", "two", "three"}
    assert sum(int(str(visit["rows"])) for visit in visits) == rows_in(message)
    assert all(0 <= float(str(visit["seconds"])) < 6 for visit in visits)


def test_what_is_not_known_of_a_branch_is_said() -> None:
    its = learned().learned
    with pytest.raises(OptionError, match=r"no node at 99.*changed since"):
        asked("99")
    with pytest.raises(OptionError, match="'up' is no path"):
        asked("up")
    other = replace(its, features=(*its.features, Feature("z")), shown=())
    with pytest.raises(OptionError, match="not learned from the demonstrations that are here"):
        asked("root", other)
    nobody = Explaining(learned, lambda: None, Timeline())
    with pytest.raises(OptionError, match="no tree is published"):
        nobody.branch(Arguments({"path": "root", "robot": True}))


def test_values_of_a_moment_are_what_the_tree_read() -> None:
    explaining = Explaining(learned, lambda: None, Timeline())
    _, told = explaining.explain(Arguments({"demonstration": "one", "seconds": 2.0}))
    table = learned().table
    names = [feature.name for feature in table.features]
    assert told["values"] == dict(zip(names, table.states[20].tolist(), strict=True))


def test_values_of_a_moment_are_as_the_board_has_them() -> None:
    features = (
        Feature("speed"),
        Feature("gripper", FeatureKind.CATEGORICAL, ("open", "closed")),
        Feature("docked", FeatureKind.BINARY),
    )
    go = nodes.Action("go", "action")
    provenance = learned().learned.provenance
    tree = LearnedTree(features, (go,), go, provenance)
    timeline = Timeline()
    values: dict[str, float | str | None] = {"speed": None, "gripper": "closed", "docked": 1.0}
    timeline.note(Moment(1.0, "", ("RUNNING",), values, {"action": "go"}))
    _, told = Explaining(learned, lambda: tree, timeline).explain(Arguments({"t": 2.0}))
    assert told["values"] == values
