"""The parameter files: they work as they are, and say what holds without them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python
from ros_processes import CHECKOUT, NodeProcess, Peer, own_domain

#: What every node has.
_BUILT_IN = re.compile(r"use_sim_time|start_type_description_service|qos_overrides\..*")


def _parameters(node: str, directory: Path, arguments: list[str]) -> dict[str, Any]:
    """The value of each parameter, once it is checked that it is described."""
    with (
        own_domain() as domain,
        NodeProcess(f"{node}_node", domain, directory, arguments=arguments) as process,
        Peer(domain) as peer,
    ):
        listed = peer.ask(ListParameters, f"{node}/list_parameters", ListParameters.Request())
        names = [name for name in listed.result.names if not _BUILT_IN.fullmatch(name)]
        described = peer.ask(
            DescribeParameters,
            f"{node}/describe_parameters",
            DescribeParameters.Request(names=names),
        )
        assert [one.name for one in described.descriptors if not one.description] == []
        got = peer.ask(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names))
        assert process.stop() == 0
    return dict(zip(names, map(parameter_value_to_python, got.values), strict=True))


#: What a node cannot do without.
_NEEDED = {"synthetic_robot": ["-p", "config:=tree.json"]}
_TREE = '{"type_": "sequence", "child_list": [{"type_": "action", "name": "wave"}]}'


@pytest.mark.parametrize("node", ["recorder", "learner", "executor", "studio", "synthetic_robot"])
def test_a_parameter_file_lists_every_parameter_with_its_default(node: str, tmp_path: Path) -> None:
    (tmp_path / "tree.json").write_text(_TREE)
    file = CHECKOUT / "config" / f"{node}.yaml"
    needed = _NEEDED.get(node, [])
    defaults = _parameters(node, tmp_path, needed)
    assert _parameters(node, tmp_path, ["--params-file", str(file), *needed]) == defaults
    listed = re.findall(r"^    (\w+):", file.read_text(), flags=re.MULTILINE)
    assert sorted(listed) == sorted(defaults)
