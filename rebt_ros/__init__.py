"""Learn a robot's behavior tree from demonstrations, while the robot runs or from files.

`learn` and `replay` are what most scripts need; `LearnOptions` and `InputOptions` hold their
options.  They are imported when first used, so that nodes which do not learn start quickly.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rebt_ros.behavior_tree.learned_tree import LearnedTree, Root
    from rebt_ros.decision_tree.upsampling import Upsampling
    from rebt_ros.demonstration.last_action import History
    from rebt_ros.errors import RebtError
    from rebt_ros.learning.options import LearnOptions, Use
    from rebt_ros.learning.policy import Policy
    from rebt_ros.offline.learn_and_replay import learn, replay
    from rebt_ros.storage.inputs import InputOptions

__all__ = [
    "History",
    "InputOptions",
    "LearnOptions",
    "LearnedTree",
    "Policy",
    "RebtError",
    "Root",
    "Upsampling",
    "Use",
    "learn",
    "replay",
]

_HOMES = {
    "History": "rebt_ros.demonstration.last_action",
    "InputOptions": "rebt_ros.storage.inputs",
    "LearnOptions": "rebt_ros.learning.options",
    "LearnedTree": "rebt_ros.behavior_tree.learned_tree",
    "Policy": "rebt_ros.learning.policy",
    "RebtError": "rebt_ros.errors",
    "Root": "rebt_ros.behavior_tree.learned_tree",
    "Upsampling": "rebt_ros.decision_tree.upsampling",
    "Use": "rebt_ros.learning.options",
    "learn": "rebt_ros.offline.learn_and_replay",
    "replay": "rebt_ros.offline.learn_and_replay",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
