"""Valid inputs of every kind, small and with everything that the formats have."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from random import Random
from typing import Final

import numpy as np
import strategies as some
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Suggestion, SuggestionKind
from rebt_ros.demonstration.demonstration import Row, RowKind
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
)
from rebt_ros.storage.recording import RecordingWriter

#: States of a bag, and actions.
MESSAGES: Final = 20

ACTION, STATE = "std_msgs/msg/String", "std_msgs/msg/Float64MultiArray"


def _everything() -> LearnedTree:
    """Every kind of node, condition, feature and suggestion."""
    features = (
        Feature("distance", topic="state", index=0),
        Feature("battery", topic="power/state", index=3),
        Feature("docked", FeatureKind.BINARY, topic="state", index=1),
        Feature("kind", FeatureKind.CATEGORICAL, ("0", "1", "2.5"), topic="state", index=2),
        Feature("distance before", topic="state", index=0, lag=2),
    )
    tree = nodes.Selector(
        (
            some.when(some.at_most("distance", 0.1 + 0.2), then=some.action("turn")),
            nodes.Selector((nodes.Inverter(nodes.Condition(Literal(IsTrue("docked")))),), True),
            nodes.Sequence((nodes.Condition(~Literal(HasCategory("kind", "1"))),), memory=True),
            nodes.ParallelSelector((some.action("go"), some.action("wait"))),
            nodes.Repeater(
                (
                    nodes.Condition(Literal(LastActionIs("go", ("turn", "wait")))),
                    some.action("turn"),
                )
            ),
            nodes.Condition(Literal(Interval("battery", 0.1, 0.7))),
            nodes.Condition(~some.at_most("distance before", 1e-300)),
            nodes.Condition(~Literal(PreviousActionIs("go"))),
            nodes.Condition(some.at_most(some.DIFFERENCE, 0.0)),
            nodes.Condition(Literal(Interval(some.DIFFERENCE, -0.1, 1e300))),
            nodes.Condition(Literal(Interval(some.SUM, -0.1, 1e300))),
        )
    )
    psa = Suggestion("psa-1", SuggestionKind.PSA, 3, tree.children[3], attached=True)
    loop = Suggestion("lat-1", SuggestionKind.LAT_REPEATER, 9, tree.children[4])
    origin = replace(some.PROVENANCE, history=History.PREVIOUS, late_rows=2, late_seconds=0.1 + 0.2)
    return LearnedTree(features, some.ACTIONS, tree, origin, (psa, loop), row_kind=RowKind.SAMPLE)


def simple(label: str = "go") -> LearnedTree:
    """What the executor of a campaign runs: go where the first value of the state is small."""
    features = (Feature("x", topic="state", index=0),)
    rule = some.when(some.at_most("x", 0.5), then=some.action(label))
    tree = nodes.Selector((rule, some.action("turn")))
    return LearnedTree(features, nodes.actions(tree), tree, some.PROVENANCE)


def _two_channels() -> LearnedTree:
    """Two policies side by side."""
    arm, base = nodes.Action("grasp", "arm/action"), nodes.Action("go", "/base/action")
    features = (Feature("x", topic="state", index=0),)
    tree = nodes.Parallel(
        (
            nodes.Selector((some.when(some.at_most("x", 0.5), then=arm), arm)),
            nodes.Selector((base,)),
        )
    )
    return LearnedTree(features, nodes.actions(tree), tree, some.PROVENANCE)


@cache
def documents() -> tuple[str, ...]:
    """Behavior tree documents, one of them without what may be absent."""
    written = tuple(map(dumps, (_everything(), simple(), _two_channels())))
    sparse = json.loads(written[1])
    origin = sparse["provenance"]
    for optional in ("late_rows", "late_seconds"):
        del origin[optional]
    del origin["figures"]["mean_recall"]
    return (*written, json.dumps(sparse))


def recordings(directory: Path) -> tuple[bytes, ...]:
    """A recording; a directory is needed to write it."""
    features = (Feature("x", topic="state", index=0), Feature("a,b", topic="state", index=1))
    random = Random(0)
    with RecordingWriter(directory, features, ("action", "/arm")) as writer:
        for count in range(30):
            label = random.choice(("go", "turn", 'say "hi", twice', "größer"))
            channel = random.choice(("action", "/arm"))
            state = (random.random(), -(10.0 ** random.randint(-9, 9)))
            stamp = 1_700_000_000_000_000_000 + count
            writer.write(Row(stamp, channel, label, None, state))
    return (writer.path.read_bytes(),)


def tables() -> tuple[bytes, ...]:
    """CSV tables."""
    return (
        b"x,y,docked,kind,action\r\n"
        + b'0.5,1e3,True,box,go\r\n,-2,False,"a, b",turn\r\n3,,TRUE,cup,\r\n' * 8,
        "stamp,größe,label\n1,0.5,vor\n2,0.25,zurück\n3,nan,vor\n".encode(),
        b"0.1,0.2,go\n0.3,0.4,turn\n" * 10,
    )


def experiments() -> tuple[str, ...]:
    """Configurations of experiments."""
    leaf = {"type_": "action", "name": "go", "p_success": 0.9, "inverted": True}
    check = {"type_": "condition", "name": "c", "target_state": "v1", "threshold": 0.25}
    kinds = ("sequence", "selector", "parallel", "parsel", "repeater")
    groups = [
        {"type_": kind, "name": kind, "p_success": 1.0, "child_list": [check, leaf]}
        for kind in kinds
    ]
    return (json.dumps({"type_": "selector", "name": "root", "child_list": groups}),)


def bag(
    path: Path, storage: StoragePlugin, compression: CompressionMode | None, count: int = MESSAGES
) -> Path:
    """Writes a bag of as many states, and as many actions."""
    types = get_typestore(Stores.ROS2_JAZZY)
    with_layout = types.types[STATE], types.types["std_msgs/msg/MultiArrayLayout"]
    writer = Writer(path, version=9, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        state = writer.add_connection("/state", STATE, typestore=types)
        action = writer.add_connection("/action", ACTION, typestore=types)
        for number in range(count):
            values = np.array([number / 3, -number, 1e9])
            message = with_layout[0](layout=with_layout[1](dim=[], data_offset=0), data=values)
            writer.write(state, 2 * number, types.serialize_cdr(message, STATE))
            label = types.types[ACTION](data=("go", "turn", "wait")[number % 3])
            writer.write(action, 2 * number + 1, types.serialize_cdr(label, ACTION))
    return path


def bags(directory: Path) -> tuple[Path, ...]:
    """A bag of every storage and compression that is written."""
    mcap, sqlite = StoragePlugin.MCAP, StoragePlugin.SQLITE3
    wanted = (
        ("mcap", mcap, None),
        ("mcap_chunks", mcap, CompressionMode.STORAGE),
        ("sqlite", sqlite, None),
        ("sqlite_messages", sqlite, CompressionMode.MESSAGE),
        ("sqlite_file", sqlite, CompressionMode.FILE),
    )
    return tuple(bag(directory / name, storage, mode) for name, storage, mode in wanted)
