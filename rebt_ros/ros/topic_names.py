"""Whether a node can use the topics that a document names, looked at before anything is opened.

A document comes from outside.  Some names are no names, and some are those of topics that the node
has open with another type; rclpy raises one of several exceptions for each, and half of what the
document needs would be open by then.
"""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.validate_full_topic_name import validate_full_topic_name
from rclpy.validate_topic_name import validate_topic_name
from std_msgs.msg import Float64MultiArray, String

from rebt_ros.errors import DocumentError

#: Longest name of a topic: the middleware's 255 characters without its prefix.
_LONGEST = 247

#: Opened by rcl, which tells nobody.
_LOG = "/rosout"


def check_topics(node: Node, states: Iterable[str], commands: Iterable[str]) -> None:
    """Refuses a tree whose topics the node cannot open.

    Args:
        node: The node.
        states: Topics of Float64MultiArray.
        commands: Topics of String.

    Raises:
        DocumentError: A name is none, or is taken by a topic of another type.
    """
    types: dict[str, object] = {_LOG: None}
    types |= {publisher.topic_name: publisher.msg_type for publisher in node.publishers}
    types |= {subscription.topic_name: subscription.msg_type for subscription in node.subscriptions}
    wanted = [("commands on", name, String) for name in commands]
    wanted += [("reads the state topic", name, Float64MultiArray) for name in states]
    for does, name, kind in wanted:
        full = full_name(node, name)
        if full is None:
            raise DocumentError(f"the tree {does} {name!r}, which is no name of a topic.")
        if types.setdefault(full, kind) is not kind:
            raise DocumentError(f"the tree {does} {name!r}, which carries something else.")


def full_name(node: Node, name: str) -> str | None:
    """The name after expansion and remapping; None where there is none."""
    # Names are C strings to ROS, so that it would not see what follows a NUL.
    if not name.isprintable():
        return None
    try:
        validate_topic_name(name)
        full = str(node.resolve_topic_name(name))
        validate_full_topic_name(full)
    except (NameValidationException, ValueError, RuntimeError):
        return None
    return full if len(full) <= _LONGEST else None
