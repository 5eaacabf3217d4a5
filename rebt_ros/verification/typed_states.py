"""States that a person types in: ``front=0.2,docked=1,gripper=open``."""

from __future__ import annotations

import math
from typing import Final

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.schema import Feature, FeatureKind, number_of
from rebt_ros.errors import OptionError

_MISSING: Final = ("", "missing", "nan")
_TRUTH: Final = {"true": 1.0, "false": 0.0}


def state_of(text: str, learned: LearnedTree) -> tuple[float, ...]:
    """The values of all features; those that are not named are missing.

    Args:
        text: Names and values, with commas between.
        learned: The tree that knows the features.

    Raises:
        OptionError: There is no such feature, or it has no such value.
    """
    known = {feature.name: feature for feature in learned.features}
    values = dict.fromkeys(known, math.nan)
    for part in filter(None, (one.strip() for one in text.split(","))):
        name, sign, value = part.partition("=")
        name = name.strip()
        if name not in known:
            raise OptionError(
                f"there is no feature {name!r}: the tree has {', '.join(list(known)[:8])}."
            )
        if not sign:
            raise OptionError(f"{name!r} needs a value, such as {name}=0.2.")
        values[name] = _value(known[name], value.strip())
    return tuple(values.values())


def _value(feature: Feature, text: str) -> float:
    if text.lower() in _MISSING:
        return math.nan
    if feature.kind is FeatureKind.CATEGORICAL:
        number = number_of(text)
        for code, category in enumerate(feature.categories):
            if category == text or (number is not None and number_of(category) == number):
                return float(code)
        raise OptionError(f"{feature.name!r} has no category {text!r}: it has {feature.examples}.")
    try:
        value = _TRUTH.get(text.lower(), None)
        value = float(text) if value is None else value
    except ValueError as err:
        raise OptionError(f"{feature.name!r} is a number, not {text!r}.") from err
    if not math.isfinite(value):
        raise OptionError(f"{feature.name!r} must be finite, not {text}.")
    return value


def histories_of(actions: str, learned: LearnedTree) -> dict[str, ActionHistory]:
    """What was done before, on every channel that has the actions.

    Args:
        actions: Labels, the most recent one last, with commas between.
        learned: The tree that knows the actions.

    Raises:
        OptionError: There is no such action.
    """
    histories = {action.channel: ActionHistory() for action in learned.actions}
    for label in filter(None, (part.strip() for part in actions.split(","))):
        channels = [one.channel for one in learned.actions if one.label == label]
        if not channels:
            labels = ", ".join(dict.fromkeys(one.label for one in learned.actions))
            raise OptionError(f"there is no action {label!r}: there are {labels}.")
        for channel in channels:
            histories[channel].take(label)
    return histories
