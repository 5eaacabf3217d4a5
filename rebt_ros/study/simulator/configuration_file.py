"""Writing configuration files as the paper's authors did; `parse_config` reads them back."""

from __future__ import annotations

import json
from typing import Any

from rebt_ros.study.simulator.configuration import Act, Check, Group, Inverted, SimulatedNode


def format_config(root: Group) -> str:
    """The text of a configuration file.

    Raises:
        ValueError: A node is inverted twice, which the files cannot say.
    """
    encoded = _encoded(root)
    # Their roots are named so; nobody reads the names of groups.
    encoded["name"] += "_root"
    return json.dumps(encoded, indent=4, ensure_ascii=False) + "\n"


def _encoded(node: SimulatedNode) -> dict[str, Any]:
    match node:
        case Check(variable=variable, threshold=threshold, p_correct=probability):
            return {
                **_leaf(variable, "condition", probability),
                "threshold": threshold,
                "target_state": variable,
            }
        case Act(label=label, p_success=probability):
            return _leaf(label, "action", probability)
        case Group(kind=kind, children=children):
            return {
                "name": kind.value,
                "type_": kind.value,
                "child_list": [_encoded(child) for child in children],
            }
        case Inverted(child=Inverted()):
            raise ValueError("a configuration file cannot say that a node is inverted twice")
        case Inverted(child=child):
            return {**_encoded(child), "inverted": True}


def _leaf(name: str, kind: str, probability: float) -> dict[str, Any]:
    return {"name": name, "type_": kind, "p_success": probability, "inverted": False}
