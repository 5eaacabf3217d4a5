"""The SROS 2 policy: what it allows is what the nodes have, no more and no less."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import pytest

CHECKOUT: Final = Path(__file__).resolve().parents[2]
POLICY: Final = CHECKOUT / "config" / "sros2_policy.xml"

#: Elements, what may stand in each, and its attributes: policy.xsd of sros2, version 0.2.0.
CHILDREN: Final = {
    "policy": {"enclaves"},
    "enclaves": {"enclave"},
    "enclave": {"profiles"},
    "profiles": {"profile"},
    "profile": {"topics", "services", "actions"},
    "topics": {"topic"},
    "services": {"service"},
}
REQUIRED: Final = {"policy": {"version"}, "enclave": {"path"}, "profile": {"ns", "node"}}
QUALIFIERS: Final = {"topics": {"publish", "subscribe"}, "services": {"reply", "request"}}

NODES: Final[Mapping[str, Mapping[str, object]]] = {
    "recorder": {},
    "learner": {},
    "executor": {"action_result_topic": "action_result", "status_topics": True},
    "studio": {"port": 0},
}


@dataclass(frozen=True)
class Rights:
    """Full names of what a node may do, or does."""

    publish: frozenset[str]
    subscribe: frozenset[str]
    reply: frozenset[str]
    request: frozenset[str]


def elements() -> Iterator[ElementTree.Element]:
    return ElementTree.parse(POLICY).getroot().iter()


def granted(node: str) -> Rights:
    """What the policy allows a node."""
    (profile,) = (one for one in elements() if one.get("node") == node)

    def names(qualifier: str) -> frozenset[str]:
        lists = [one for one in profile if one.get(qualifier) == "ALLOW"]
        return frozenset(full(one.text or "", node) for names in lists for one in names)

    return Rights(*(names(one) for one in ("publish", "subscribe", "reply", "request")))


def full(name: str, node: str) -> str:
    if name.startswith("~"):
        return f"/{node}{name[1:]}"
    return name if name.startswith("/") else f"/{name}"


def possible(node: str) -> Rights:
    """What the policy allows a node, and what is installed lets it have."""
    rights = granted(node)
    if find_spec("nav2_msgs") is None:
        published = rights.publish - {"/executor/behavior_tree_log"}
        return replace(rights, publish=published)
    return rights


def test_the_policy_has_the_form_that_sros2_reads() -> None:
    root = ElementTree.parse(POLICY).getroot()
    assert (root.tag, root.get("version")) == ("policy", "0.2.0")
    for element in root.iter():
        assert {child.tag for child in element} <= CHILDREN.get(element.tag, set())
        attributes = element.attrib.keys()
        if element.tag in QUALIFIERS:
            assert len(element) > 0
            assert attributes <= QUALIFIERS[element.tag]
            assert attributes
            assert set(element.attrib.values()) == {"ALLOW"}
        else:
            assert attributes == REQUIRED.get(element.tag, set())
        if element.tag in {"topic", "service"}:
            assert element.text
            assert "*" not in element.text


def test_every_node_has_an_enclave_of_its_own() -> None:
    enclaves = [one.get("path") for one in elements() if one.tag == "enclave"]
    nodes = [one.get("node") for one in elements() if one.tag == "profile"]
    assert enclaves == [f"/rebt_ros/{node}" for node in nodes]
    assert len(set(nodes)) == len(nodes)
    assert {*NODES, "operator"} == set(nodes)


def test_the_executor_alone_may_command() -> None:
    assert [node for node in (*NODES, "operator") if "/command" in granted(node).publish] == [
        "executor"
    ]


def test_an_operator_may_call_what_the_nodes_offer_beside_parameters() -> None:
    offered = set().union(*(granted(node).reply for node in NODES))
    common = {name.rsplit("/", 1)[1] for name in granted("learner").reply}
    for node in NODES:
        common &= {name.rsplit("/", 1)[1] for name in granted(node).reply}
    assert granted("operator").request == {
        name for name in offered if name.rsplit("/", 1)[1] not in common
    }


def test_the_documented_table_is_the_policy() -> None:
    common = {
        qualifier: set.intersection(*(set(getattr(granted(node), qualifier)) for node in NODES))
        for qualifier in ("publish", "subscribe")
    }
    parameters = {name.rsplit("/", 1)[1] for name in granted("learner").reply} - {
        "relearn",
        "cancel",
        "rollback",
    }
    lines = (CHECKOUT / "docs" / "security.md").read_text(encoding="utf-8").splitlines()
    for node in NODES:
        (line,) = (one for one in lines if one.startswith(f"| `/rebt_ros/{node}` |"))
        published, subscribed, offered = (
            {full(name, node) for name in re.findall(r"`([^`]+)`", cell)}
            for cell in line.split("|")[2:5]
        )
        rights = granted(node)
        assert published == rights.publish - common["publish"]
        assert subscribed == rights.subscribe - common["subscribe"]
        assert offered == {
            name for name in rights.reply if name.rsplit("/", 1)[1] not in parameters
        }


def test_the_policy_allows_what_the_running_nodes_have_and_nothing_else(tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    from contextlib import ExitStack

    from fuzz import corpus
    from ros_processes import NodeProcess, Peer, own_domain

    from rebt_ros.storage.tree_file import write_tree

    write_tree(tmp_path / "tree.json", corpus.simple())
    # The learner publishes it, upon which the studio shows the state.
    write_tree(tmp_path / "learned" / "tree.json", corpus.simple())
    trees = {"executor": {"tree_file": tmp_path / "tree.json"}}

    def found(peer: Peer, node: str) -> Rights:
        # What it sends can be heard before it is known by its name.
        if node not in peer.node.get_node_names():
            return Rights(*[frozenset()] * 4)

        def names(kind: str) -> frozenset[str]:
            pairs = getattr(peer.node, f"get_{kind}_names_and_types_by_node")(node, "/")
            return frozenset(name for name, _ in pairs)

        return Rights(*map(names, ("publisher", "subscriber", "service", "client")))

    with own_domain() as domain, Peer(domain) as peer, ExitStack() as running:
        for node, parameters in NODES.items():
            settings = {**parameters, **trees.get(node, {}), "use_sim_time": True}
            running.enter_context(NodeProcess(f"{node}_node", domain, tmp_path, settings))
        # A node reports once it has opened everything.
        reports = (
            ("recorder", "recording"),
            ("learner", "learning"),
            ("executor", "execution"),
            ("studio", "serving"),
        )
        for node, task in reports:
            peer.wait_until(lambda key=f"{node}: {task}": key in peer.diagnostics, what=node)
            peer.wait_until(
                lambda node=node: found(peer, node) == possible(node),
                what=f"{possible(node)}, while the node has {found(peer, node)}",
            )
