"""Having the learner publish a tree that a person made."""

from __future__ import annotations

import json
import threading
from typing import Any, Final

from rclpy.node import Node
from std_msgs.msg import String

from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.errors import RebtError
from rebt_ros.ros.studio.calls import Newcomers

#: For the learner's answer, proofs of rules included (seconds).
_PATIENCE: Final = 30.0
#: Between two looks at whether another learner has started (seconds).
_LOOK: Final = 1.0


class PublishingError(RebtError):
    """A tree was not published; the one before it stays."""


class Proposals:
    """Proposes trees to the learner, and waits for its answers.

    Args:
        node: The studio's.
        learner: Name of the learner.
    """

    def __init__(self, node: Node, learner: str) -> None:
        self._learner = learner
        self._proposals = node.create_publisher(String, f"{learner}/proposal", 1)
        self._answered = threading.Condition()
        self._answers: dict[str, dict[str, Any]] = {}
        self._ended = False
        node.create_subscription(String, f"{learner}/proposal_answer", self._on_answer, 10)

    def publish(self, document: str) -> str:
        """Has a tree published.

        Args:
            document: The tree.

        Returns:
            The number of the version.

        Raises:
            PublishingError: It refuses, or does not answer.
        """
        name = fingerprint(document)
        if not self._proposals.get_subscription_count():
            raise PublishingError(
                f"there is no {self._learner} to publish it: start it, or check its name."
            )
        with self._answered:
            self._answers.pop(name, None)
            learners = Newcomers(self._proposals.get_subscription_count)
            waited, unheard = 0.0, True
            while waited < _PATIENCE and not (name in self._answers or self._ended):
                # A learner that has started since knows nothing of it.
                if unheard:
                    learners.begin()
                    self._proposals.publish(String(data=document))
                unheard = False
                self._answered.wait_for(lambda: name in self._answers or self._ended, _LOOK)
                waited += _LOOK
                unheard = learners.have_come
            if name not in self._answers:
                raise PublishingError(
                    f"{self._learner} did not answer within {_PATIENCE:.0f} s: look at its log."
                )
            answer = self._answers.pop(name)
        if not answer["published"]:
            raise PublishingError(str(answer["message"]))
        return str(answer["version"])

    def close(self) -> None:
        """Ends all waiting."""
        with self._answered:
            self._ended = True
            self._answered.notify_all()

    def _on_answer(self, message: String) -> None:
        try:
            answer = json.loads(message.data)
            name = answer["document"]
        except (ValueError, KeyError, TypeError, RecursionError):
            return
        with self._answered:
            self._answers = {name: answer}
            self._answered.notify_all()
