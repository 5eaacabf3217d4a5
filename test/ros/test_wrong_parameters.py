"""Every parameter of every node, given as what it cannot be, is refused in a sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy")

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_processes import CHECKOUT, NodeProcess, own_domain

from rebt_ros.errors import OptionError
from rebt_ros.ros.executor import settings as executor_settings
from rebt_ros.ros.learner import settings as learner_settings
from rebt_ros.ros.recorder import settings as recorder_settings
from rebt_ros.ros.robots import demonstrator, robot, synthetic_robot
from rebt_ros.ros.studio import settings as studio_settings

NODES: Mapping[str, Callable[[Node], object]] = {
    "demonstrator": demonstrator.declare_settings,
    "executor": executor_settings.declare_settings,
    "learner": learner_settings.declare_settings,
    "recorder": recorder_settings.declare_settings,
    "robot": robot.declare_settings,
    "studio": studio_settings.declare_settings,
    "synthetic_robot": synthetic_robot.declare_settings,
}

#: What a parameter of each type cannot be, as it is written in YAML.
WRONG: Mapping[type, tuple[str, ...]] = {
    bool: ("1", "0.5", "perhaps", "''", "[true]", "[]"),
    int: ("1.5", "many", "true", "''", "[1]", "[]", "-99999999999", "99999999999999", ".nan"),
    float: ("1", "fast", "true", "''", "[1.0]", "[]", ".nan", ".inf", "-.inf", "-1e12", "1e12"),
    str: ("5", "0.5", "true", "[word]", "[]"),
    list: ("5", "0.5", "word", "true", "[1, 2]", "[0.5]", "[true]"),
}

#: Texts that must be one of a few words.
CHOICES = {
    *("differences", "history", "novelty", "pair_by", "psa", "publish", "root", "state_qos"),
    *("sums", "tick_on", "upsample"),
}


def _parameters() -> Iterator[tuple[str, str, type]]:
    for node in NODES:
        listed = yaml.safe_load((CHECKOUT / "config" / f"{node}.yaml").read_text(encoding="utf-8"))
        for name, default in listed["/**"]["ros__parameters"].items():
            yield node, name, type(default)


@pytest.fixture(scope="module")
def context() -> Iterator[Context]:
    context = Context()
    with own_domain() as domain:
        rclpy.init(context=context, domain_id=domain)
        yield context
        rclpy.try_shutdown(context=context)


def _refusal(node: str, context: Context, arguments: list[str]) -> str:
    """What is said where a node is started with these arguments."""
    one = Node(
        node,
        context=context,
        cli_args=["--ros-args", *arguments],
        use_global_arguments=False,
        enable_rosout=False,
        start_parameter_services=False,
    )
    try:
        with pytest.raises(OptionError) as refused:
            NODES[node](one)
    finally:
        one.destroy_node()
    return str(refused.value)


@pytest.mark.parametrize(("node", "name", "kind"), _parameters())
def test_what_a_parameter_cannot_be_is_refused_with_its_name(
    node: str, name: str, kind: type, context: Context, tmp_path: Path
) -> None:
    file = tmp_path / "parameters.yaml"
    words = ("no_such_word", "''") if name in CHOICES else ()
    for place, value in enumerate((*WRONG[kind], *words)):
        file.write_text(f"{node}:\n  ros__parameters:\n    {name}: {value}\n")
        # In turn, from another one on for each name: a node takes long to make.
        forms = (["-p", f"{name}:={value}"], ["--params-file", str(file)])
        sentence = _refusal(node, context, forms[(place + len(name)) % 2])
        assert sentence.startswith(f"parameter '{name}' must be "), (value, sentence)
        assert sentence.endswith(".")
        assert "\n" not in sentence
        assert "array(" not in sentence


@pytest.mark.parametrize("node", NODES)
def test_a_mistyped_parameter_is_refused_with_what_was_meant(
    node: str, context: Context, tmp_path: Path
) -> None:
    needed = ["-p", "config:=tree.json"] if node == "synthetic_robot" else []
    for name in (name for one, name, _ in _parameters() if one == node):
        mistyped = name[:-1] + "_"
        sentence = _refusal(node, context, [*needed, "-p", f"{mistyped}:=1"])
        assert sentence == f"there is no parameter '{mistyped}': did you mean '{name}'?"
    file = tmp_path / "parameters.yaml"
    file.write_text("/**:\n  ros__parameters:\n    x: {y: 1}\n")
    sentence = _refusal(node, context, [*needed, "--params-file", str(file)])
    assert sentence.startswith("there is no parameter 'x.y': there are ")
    assert "under /** is for every node" in sentence


@pytest.mark.parametrize(
    ("name", "kind"), [(name, kind) for node, name, kind in _parameters() if node == "learner"]
)
def test_what_the_learner_cannot_take_is_refused_while_it_runs_as_well(
    name: str, kind: type, context: Context
) -> None:
    node = Node("learner", context=context, enable_rosout=False, start_parameter_services=False)
    try:
        learner_settings.declare_settings(node)
        words = ("no_such_word", "''") if name in CHOICES else ()
        for text in (*WRONG[kind], *words):
            value: Any = yaml.safe_load(text.replace("e12", ".0e+12"))
            if value == []:
                continue
            [result] = node.set_parameters([Parameter(name, value=value)])
            assert not result.successful, value
    finally:
        node.destroy_node()


@pytest.mark.parametrize("units", ["[left]", "['=m']", "['left=']", "[left=m, right]"])
def test_units_that_name_no_feature_or_no_unit_are_refused_at_once(
    units: str, context: Context
) -> None:
    sentence = _refusal("learner", context, ["-p", f"units:={units}"])
    assert sentence.endswith("which is not FEATURE=UNIT, such as left=m.")


@pytest.mark.parametrize("node", NODES)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["-p", "no_such_parameter:=1"], "there is no parameter 'no_such_parameter': there are "),
        (["-p", "use_sim_time:=[1, word]"], "these arguments are not understood: "),
        (["-p", "use_sim_time"], "these arguments are not understood: "),
        (["--params-file", "absent.yaml"], "these arguments are not understood: "),
    ],
)
def test_a_node_ends_with_one_line_and_exit_code_1(
    node: str, arguments: list[str], sentence: str, domain: int, tmp_path: Path
) -> None:
    needed = ["-p", "config:=tree.json"] if node == "synthetic_robot" else []
    with NodeProcess(f"{node}_node", domain, tmp_path, {}, [*needed, *arguments]) as process:
        assert process.wait() == 1
        # rcl says a line of its own.
        [line] = (line for line in process.stderr.splitlines() if "[rcl]" not in line)
        assert sentence in line
