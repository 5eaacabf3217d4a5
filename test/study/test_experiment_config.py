"""Configuration files of the paper's experiments."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rebt_ros.behavior_tree import nodes
from rebt_ros.errors import InputError
from rebt_ros.logic.conditions import Literal, Threshold
from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    Group,
    GroupKind,
    Inverted,
    as_behavior_tree,
)
from rebt_ros.study.simulator.configuration_file import DEEPEST_CONFIGURATION, parse_config

EXPERIMENTS = Path(__file__).resolve().parents[3] / "shared" / "experiments"
needs_experiments = pytest.mark.skipif(
    not EXPERIMENTS.is_dir(), reason=f"there is no {EXPERIMENTS}"
)

LEFT_OVER = {"name": "DEFAULT", "type_": "DEFAULT", "p_success": 1, "inverted": False}


def action(label: str, **fields: Any) -> dict[str, Any]:
    return {"name": label, "type_": "action", "p_success": 1, "inverted": False} | fields


def condition(variable: str, **fields: Any) -> dict[str, Any]:
    return {
        "name": variable,
        "type_": "condition",
        "target_state": variable,
        "threshold": 0.5,
    } | fields


def group(kind: str, *children: Any, **fields: Any) -> dict[str, Any]:
    return {"name": kind, "type_": kind, "child_list": list(children)} | fields


def parsed(value: object) -> Group:
    return parse_config(json.dumps(value), "it").root


def test_every_kind_of_node_is_read() -> None:
    root = group(
        "parallel",
        group("sequence", condition("/x"), action("a", p_success=0.9)),
        group("selector", condition("/y", threshold=0.2, p_success=0.8, inverted=True)),
        group("repeater", group("parsel", action("a"), action("b"))),
    )
    assert parsed(root) == Group(
        GroupKind.PARALLEL,
        (
            Group(GroupKind.SEQUENCE, (Check("/x", 0.5), Act("a", 0.9))),
            Group(GroupKind.SELECTOR, (Inverted(Check("/y", 0.2, 0.8)),)),
            Group(GroupKind.REPEATER, (Group(GroupKind.PARALLEL_SELECTOR, (Act("a"), Act("b"))),)),
        ),
    )


def test_variables_and_actions_are_those_that_occur_in_sorted_order() -> None:
    root = group("sequence", condition("/z"), group("parsel", action("b"), action("a")))
    root["child_list"] += [condition("/y", inverted=True), action("b")]
    config = parse_config(json.dumps(root), "it")
    assert config.variables == ("/y", "/z")
    assert config.actions == ("a", "b")


def test_nodes_of_type_default_are_skipped_with_a_note_each() -> None:
    root = group("sequence", LEFT_OVER, group("parsel", action("a"), LEFT_OVER))
    config = parse_config(json.dumps(root), "it")
    assert config.root.children == (Group(GroupKind.PARALLEL_SELECTOR, (Act("a"),)),)
    assert config.notes == (
        "it: the root.child_list[0] has type DEFAULT and is skipped",
        "it: the root.child_list[1].child_list[1] has type DEFAULT and is skipped",
    )


def test_a_group_in_which_nothing_is_left_is_skipped_with_a_note() -> None:
    config = parse_config(
        json.dumps(group("sequence", group("parsel", LEFT_OVER), action("a"))), "it"
    )
    assert config.root.children == (Act("a"),)
    assert config.notes[1] == "it: the root.child_list[0] is a parsel of nothing and is skipped"


def test_the_behavior_tree_has_the_same_shape() -> None:
    check = nodes.Condition(Literal(Threshold("/x", 0.5)))
    act = nodes.Action("a", "action")
    root = group(
        "parallel",
        group("sequence", condition("/x", inverted=True), action("a")),
        group("repeater", group("selector", condition("/x")), group("parsel", action("a"))),
    )
    assert as_behavior_tree(parsed(root)) == nodes.Parallel(
        (
            nodes.Sequence((nodes.Inverter(check), act), memory=True),
            nodes.Repeater((nodes.Selector((check,)), nodes.ParallelSelector((act,)))),
        )
    )


def nested(levels: int) -> dict[str, Any]:
    node = action("a")
    for _ in range(levels - 1):
        node = group("sequence", node)
    return node


def test_a_tree_may_be_as_deep_as_the_limit() -> None:
    assert parsed(nested(DEEPEST_CONFIGURATION))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([], "it: the root must be an object, not []."),
        (action("a"), "it: the root must be a group of nodes that mean something."),
        (LEFT_OVER, "it: the root must be a group of nodes that mean something."),
        (group("dance", action("a")), "it: the root has the unknown type 'dance'."),
        ({"type_": "sequence"}, "it: the root is a sequence without a child_list."),
        (
            group("sequence", {"type_": 3}),
            "it: the root.child_list[0].type_ must be a text, not 3.",
        ),
        (
            group("sequence", action("a", colour="red")),
            "it: the root.child_list[0] has the unknown field 'colour'.",
        ),
        (
            group("sequence", action("a\x1b[2J")),
            "it: the root.child_list[0] has the name 'a\\x1b[2J': "
            "write it with printable characters.",
        ),
        (
            group("sequence", condition(" ")),
            "it: the root.child_list[0] has the target_state ' ': "
            "write it with printable characters.",
        ),
        (
            group("sequence", action("a", p_success=1.5)),
            "it: the root.child_list[0].p_success must be a number from 0 to 1, not 1.5.",
        ),
        (
            group("sequence", action("a"), p_success=0.5),
            "it: the root is a sequence, whose p_success can only be 1.",
        ),
        (
            group("sequence", condition("/x", threshold=True)),
            "it: the root.child_list[0].threshold must be a number, not True.",
        ),
        (
            group("sequence", condition("/x", threshold=float("nan"))),
            "it is not JSON: NaN is not a number.",
        ),
        (
            group("sequence", condition("/x", threshold=10**400)),
            "it: the root.child_list[0].threshold must be a number from -1e+300 to 1e+300, not "
            "100000000000000000...0000000000000000000.",
        ),
        (
            group("sequence", action("a", inverted="no")),
            "it: the root.child_list[0].inverted must be true or false, not 'no'.",
        ),
    ],
)
def test_a_malformed_file_is_refused_with_the_place(value: object, message: str) -> None:
    with pytest.raises(InputError) as refused:
        parsed(value)
    assert str(refused.value) == message


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '"' + "x" * 1_000_001 + '"'])
def test_text_that_is_no_such_file_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^it "):
        parse_config(text, "it")


def test_a_tree_that_is_too_deep_is_refused() -> None:
    with pytest.raises(InputError, match="lies below more than 99 others"):
        parsed(nested(DEEPEST_CONFIGURATION + 1))


@needs_experiments
def test_the_authors_files_are_read_as_they_are() -> None:
    configs = [
        parse_config(path.read_text(encoding="utf-8"), path.stem)
        for path in EXPERIMENTS.glob("*.json")
    ]
    assert len(configs) == 100
    assert sum(bool(config.notes) for config in configs) == 13
    assert sum(len(config.notes) for config in configs) == 18
    assert {len(config.subtrees) for config in configs} == {2, 3}
