"""The studio's parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rclpy.node import Node

from rebt_ros.ros.parameters import Parameters, at_home


@dataclass(frozen=True, slots=True)
class StudioSettings:
    """What the studio was started with."""

    host: str
    """Address to listen on."""
    port: int
    executor: str
    """Name of the node, as are the next two."""
    recorder: str
    learner: str
    demonstrations: Path
    """The recorder's directory."""
    output: Path
    """The learner's directory."""
    action_topics: tuple[str, ...]
    """Where a person's actions go: the recorder's channels."""
    state_topic: str
    """Of features that come from a table."""
    rules_file: Path | None
    user: str
    """Who works here, for the list of versions."""


def declare_settings(node: Node) -> StudioSettings:
    """Declares and reads the parameters.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    rules = declare.text(
        "rules_file", "", "Rules that trees must keep (docs/rules.md); empty for none."
    )()
    settings = StudioSettings(
        host=declare.text(
            "host",
            "localhost",
            "Address to listen on; other machines reach 0.0.0.0, with the token in the URL.",
        )(),
        port=declare.integer("port", 8970, "Port of the page; 0 for any that is free.", 0, 65535)(),
        executor=declare.text("executor", "executor", "Name of the executor.")(),
        recorder=declare.text("recorder", "recorder", "Name of the recorder.")(),
        learner=declare.text("learner", "learner", "Name of the learner.")(),
        demonstrations=declare.directory(
            "demonstrations", "demonstrations", "The recorder's directory; ~ is your home."
        )(),
        output=declare.directory(
            "output", "learned", "The learner's directory: what it learned, and earlier trees."
        )(),
        action_topics=declare.texts(
            "action_topics", ["action"], "String topics of a person's actions: the channels."
        )(),
        state_topic=declare.text(
            "state_topic", "state", "Topic of the features of a tree that was learned from a table."
        )(),
        rules_file=at_home("rules_file", rules) if rules else None,
        user=declare.text(
            "user", "", "Who works here, for the list of versions; empty for the user's login."
        )(),
    )
    declare.refuse_others()
    return settings
