"""Learn a robot's behavior tree from demonstrations, while the robot runs or from files.

`learn`, `replay` and `Policy` are what most scripts need; `LearnOptions` and `InputOptions` hold
their options.  The other names are the types of their parameters and results.  All are imported
when first used, so that nodes which do not learn start quickly.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rebt_ros.behavior_tree.learned_tree import (
        ChannelProvenance,
        Figures,
        LearnedTree,
        Mended,
        Provenance,
        Root,
        Suggestion,
        SuggestionKind,
    )
    from rebt_ros.behavior_tree.nodes import (
        Action,
        Condition,
        Inverter,
        Node,
        Parallel,
        ParallelSelector,
        Repeater,
        Selector,
        Sequence,
    )
    from rebt_ros.behavior_tree.shown import ShownChannel, ShownLeaf, Span
    from rebt_ros.beyond_the_paper.reductions import Reductions
    from rebt_ros.decision_tree.upsampling import Upsampling
    from rebt_ros.demonstration.builder import StateTopic
    from rebt_ros.demonstration.demonstration import RowKind
    from rebt_ros.demonstration.last_action import History
    from rebt_ros.demonstration.schema import Feature, FeatureKind
    from rebt_ros.errors import DocumentError, InputError, OptionError, RebtError
    from rebt_ros.export.btcpp import to_btcpp
    from rebt_ros.export.py_trees_xml import to_py_trees_xml
    from rebt_ros.learning.learning import Learning
    from rebt_ros.learning.learning_file import load_learning
    from rebt_ros.learning.named_states import State
    from rebt_ros.learning.options import LearnOptions, PsaChoice, Use
    from rebt_ros.learning.policy import Decision, Policy
    from rebt_ros.learning.progress import Progress
    from rebt_ros.learning.py_trees_form import py_trees_nodes, to_py_trees
    from rebt_ros.learning.replaying import Disagreement, Replay
    from rebt_ros.logic.conditions import (
        Difference,
        HasCategory,
        Interval,
        IsTrue,
        LastActionIs,
        Literal,
        PreviousActionIs,
        Threshold,
        WeightedSum,
    )
    from rebt_ros.offline.learning_from_files import learn
    from rebt_ros.offline.replay_over_files import replay
    from rebt_ros.offline.result import OfflineLearning
    from rebt_ros.robot_file.robot_file import RobotFile
    from rebt_ros.storage.account import Account
    from rebt_ros.storage.input_options import Aside, InputOptions, ReadCounts, ReadingPlan

__all__ = [
    "Account",
    "Action",
    "Aside",
    "ChannelProvenance",
    "Condition",
    "Decision",
    "Difference",
    "Disagreement",
    "DocumentError",
    "Feature",
    "FeatureKind",
    "Figures",
    "HasCategory",
    "History",
    "InputError",
    "InputOptions",
    "Interval",
    "Inverter",
    "IsTrue",
    "LastActionIs",
    "LearnOptions",
    "LearnedTree",
    "Learning",
    "Literal",
    "Mended",
    "Node",
    "OfflineLearning",
    "OptionError",
    "Parallel",
    "ParallelSelector",
    "Policy",
    "PreviousActionIs",
    "Progress",
    "Provenance",
    "PsaChoice",
    "ReadCounts",
    "ReadingPlan",
    "RebtError",
    "Reductions",
    "Repeater",
    "Replay",
    "RobotFile",
    "Root",
    "RowKind",
    "Selector",
    "Sequence",
    "ShownChannel",
    "ShownLeaf",
    "Span",
    "State",
    "StateTopic",
    "Suggestion",
    "SuggestionKind",
    "Threshold",
    "Upsampling",
    "Use",
    "WeightedSum",
    "learn",
    "load_learning",
    "py_trees_nodes",
    "replay",
    "to_btcpp",
    "to_py_trees",
    "to_py_trees_xml",
]

_HOMES = {
    "Account": "rebt_ros.storage.account",
    "Action": "rebt_ros.behavior_tree.nodes",
    "Aside": "rebt_ros.storage.input_options",
    "ChannelProvenance": "rebt_ros.behavior_tree.learned_tree",
    "Condition": "rebt_ros.behavior_tree.nodes",
    "Decision": "rebt_ros.learning.policy",
    "Difference": "rebt_ros.logic.conditions",
    "Disagreement": "rebt_ros.learning.replaying",
    "DocumentError": "rebt_ros.errors",
    "Feature": "rebt_ros.demonstration.schema",
    "FeatureKind": "rebt_ros.demonstration.schema",
    "Figures": "rebt_ros.behavior_tree.learned_tree",
    "HasCategory": "rebt_ros.logic.conditions",
    "History": "rebt_ros.demonstration.last_action",
    "InputError": "rebt_ros.errors",
    "InputOptions": "rebt_ros.storage.input_options",
    "Interval": "rebt_ros.logic.conditions",
    "Inverter": "rebt_ros.behavior_tree.nodes",
    "IsTrue": "rebt_ros.logic.conditions",
    "LastActionIs": "rebt_ros.logic.conditions",
    "LearnOptions": "rebt_ros.learning.options",
    "LearnedTree": "rebt_ros.behavior_tree.learned_tree",
    "Learning": "rebt_ros.learning.learning",
    "Literal": "rebt_ros.logic.conditions",
    "Mended": "rebt_ros.behavior_tree.learned_tree",
    "Node": "rebt_ros.behavior_tree.nodes",
    "OfflineLearning": "rebt_ros.offline.result",
    "OptionError": "rebt_ros.errors",
    "Parallel": "rebt_ros.behavior_tree.nodes",
    "ParallelSelector": "rebt_ros.behavior_tree.nodes",
    "Policy": "rebt_ros.learning.policy",
    "PreviousActionIs": "rebt_ros.logic.conditions",
    "Progress": "rebt_ros.learning.progress",
    "Provenance": "rebt_ros.behavior_tree.learned_tree",
    "PsaChoice": "rebt_ros.learning.options",
    "ReadCounts": "rebt_ros.storage.input_options",
    "ReadingPlan": "rebt_ros.storage.input_options",
    "RebtError": "rebt_ros.errors",
    "Reductions": "rebt_ros.beyond_the_paper.reductions",
    "Repeater": "rebt_ros.behavior_tree.nodes",
    "Replay": "rebt_ros.learning.replaying",
    "RobotFile": "rebt_ros.robot_file.robot_file",
    "Root": "rebt_ros.behavior_tree.learned_tree",
    "RowKind": "rebt_ros.demonstration.demonstration",
    "Selector": "rebt_ros.behavior_tree.nodes",
    "Sequence": "rebt_ros.behavior_tree.nodes",
    "ShownChannel": "rebt_ros.behavior_tree.shown",
    "ShownLeaf": "rebt_ros.behavior_tree.shown",
    "Span": "rebt_ros.behavior_tree.shown",
    "State": "rebt_ros.learning.named_states",
    "StateTopic": "rebt_ros.demonstration.builder",
    "Suggestion": "rebt_ros.behavior_tree.learned_tree",
    "SuggestionKind": "rebt_ros.behavior_tree.learned_tree",
    "Threshold": "rebt_ros.logic.conditions",
    "Upsampling": "rebt_ros.decision_tree.upsampling",
    "Use": "rebt_ros.learning.options",
    "WeightedSum": "rebt_ros.logic.conditions",
    "learn": "rebt_ros.offline.learning_from_files",
    "load_learning": "rebt_ros.learning.learning_file",
    "py_trees_nodes": "rebt_ros.learning.py_trees_form",
    "replay": "rebt_ros.offline.replay_over_files",
    "to_btcpp": "rebt_ros.export.btcpp",
    "to_py_trees": "rebt_ros.learning.py_trees_form",
    "to_py_trees_xml": "rebt_ros.export.py_trees_xml",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
