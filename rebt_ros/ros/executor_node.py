"""The executor: runs the learned tree on the robot's state and sends its commands."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.builder import BadMessageError
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL
from rebt_ros.errors import DocumentError
from rebt_ros.ros import lifetime
from rebt_ros.ros.command_channels import CommandChannels
from rebt_ros.ros.diagnostics import Diagnostics, Faults, Level, Report
from rebt_ros.ros.parameters import Parameters
from rebt_ros.ros.topic_names import check_topics
from rebt_ros.ros.tree_inputs import Message, TreeInputs
from rebt_ros.storage.tree_file import read_tree

_TREE_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: The newest state only; best effort hears reliable publishers as well.
_STATE_QOS: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)

#: Least time between two snapshots (seconds).
_SNAPSHOT_PERIOD: Final = 0.2

_REFUSED: Final = "refused trees"


class ExecutorNode(Node):
    """Ticks the latest tree at a fixed rate, while it is enabled and the state is fresh.

    Raises:
        RebtError: A parameter makes no sense, or the tree file cannot be used.
    """

    def __init__(self) -> None:
        super().__init__("executor")
        declare = Parameters(self)
        tree_file = declare.text(
            "tree_file", "", "Behavior tree document to begin with; empty for none."
        )()
        rate = declare.number(
            "rate",
            20.0,
            "Ticks per second; the recording's sample rate if the tree has lagged features.",
            0.1,
            1000.0,
        )()
        timeout = declare.number(
            "state_timeout", 0.5, "How long a state message is good for (seconds).", 0.001, 3600.0
        )()
        every_tick = (
            declare.text(
                "publish",
                "every_tick",
                "When to send the command.",
                choices=("every_tick", "on_change"),
            )()
            == "every_tick"
        )
        self._enabled = declare.flag(
            "enabled", False, "Whether to command the robot from the start, see ~/enable."
        )()
        result_topic = declare.text(
            "action_result_topic",
            "",
            "String topic that says 'success' or 'failure' (or 'label:success') when an action "
            "has ended; empty if an action is done once its command is out.",
        )()
        state_topic = declare.text(
            "state_topic", "state", "State topic of a tree that was learned from a table."
        )()

        self._faults = Faults(self.get_logger())
        self._channels = CommandChannels(self, result_topic, every_tick, self._note_result)
        # Open before there is a tree, whose first command may then be heard.
        self._channels.follow([DEFAULT_CHANNEL])
        self._new_inputs: Callable[[LearnedTree], TreeInputs] = partial(
            TreeInputs, default_topic=state_topic, timeout=round(timeout * 1e9)
        )
        self._document = ""
        self._runtime: TreeRuntime | None = None
        self._inputs: TreeInputs | None = None
        self._subscriptions_by_topic: dict[str, Subscription] = {}
        self._resting = True
        self._ticks = 0
        self._commands = 0
        self._slowest = 0.0
        self._last_snapshot = ""
        self._watchers = 0

        # Simulated time where that is used; else a clock that nobody sets.
        simulated = bool(self.get_parameter("use_sim_time").value)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._time = self.get_clock() if simulated else steady

        self._snapshot = self.create_publisher(String, "~/snapshot", 10)
        if tree_file:
            learned = read_tree(Path(tree_file).expanduser())
            self._run(learned, dumps(learned))
        self.create_subscription(String, "behavior_tree", self._on_document, _TREE_QOS)
        self.create_service(SetBool, "~/enable", self._enable)
        self.create_timer(1.0 / rate, self._tick, clock=self._time)
        self.create_timer(_SNAPSHOT_PERIOD, self._publish_snapshot, clock=steady)
        self._diagnostics = Diagnostics(self, "execution", self._report)
        self.get_logger().info(
            f"{'enabled' if self._enabled else 'disabled until ~/enable is called'}: "
            f"{self._condition()}."
        )

    def close(self) -> None:
        """Interrupts what runs."""
        self._enabled = False
        self._rest()

    def _on_document(self, message: String) -> None:
        if message.data == self._document:
            return
        try:
            self._run(loads(message.data), message.data)
        except DocumentError as err:
            kept = "the tree before it stays" if self._runtime else "there is no tree yet"
            self._faults.note(_REFUSED, f"a behavior tree was refused ({kept}): {err}", severe=True)

    def _run(self, learned: LearnedTree, document: str) -> None:
        """Takes a tree into use; the action that runs is interrupted, the history goes on.

        Raises:
            DocumentError: This node cannot run the tree.
        """
        commanded = {action.channel for action in nodes.actions(learned.tree)}
        if commanded != set(nodes.policies(learned.tree)):
            raise DocumentError(
                f"the tree mixes the channels {', '.join(sorted(commanded))} in one policy: "
                "put the policies of several channels side by side under a Parallel."
            )
        inputs = self._new_inputs(learned)
        channels = sorted({action.channel for action in learned.actions})
        check_topics(self, inputs.topics, self._channels.topics_of(channels))
        self._rest()
        self._channels.follow(channels)
        histories = self._runtime.histories if self._runtime else {}
        runtime = TreeRuntime(learned, self._channels, executable(learned.tree), histories)
        known = {} if self._inputs is None else self._inputs.latest
        self._document, self._runtime, self._inputs = document, runtime, inputs
        self._subscribe(inputs)
        for topic in known.keys() & set(inputs.topics):
            self._accept(topic, known[topic])
        self.get_logger().info(
            f"running a tree of {nodes.size(learned.tree)} nodes that reads "
            f"{', '.join(inputs.topics) or 'no state'}."
        )

    def _subscribe(self, inputs: TreeInputs) -> None:
        for topic in self._subscriptions_by_topic.keys() - set(inputs.topics):
            self.destroy_subscription(self._subscriptions_by_topic.pop(topic))
        for topic in inputs.topics:
            if topic not in self._subscriptions_by_topic:
                self._subscriptions_by_topic[topic] = self.create_subscription(
                    Float64MultiArray, topic, partial(self._on_state, topic), _STATE_QOS
                )

    def _on_state(self, topic: str, message: Float64MultiArray) -> None:
        self._accept(topic, Message(message.data, self._now()))

    def _accept(self, topic: str, message: Message) -> None:
        # A message may still come on a topic that the present tree does not read.
        if self._inputs is None or topic not in self._inputs.topics:
            return
        try:
            self._inputs.accept(topic, message)
        except BadMessageError as err:
            self._faults.note(err.fault.value, str(err))

    def _note_result(self, text: str) -> None:
        self._faults.note(
            "unknown action result",
            f"the action result {text!r} is not understood: "
            "send 'success' or 'failure', or 'label:success' or 'label:failure'.",
        )

    def _enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._enabled = request.data
        if not self._enabled:
            self._rest()
        response.success = True
        response.message = f"enabled: {self._condition()}." if self._enabled else "disabled."
        self.get_logger().info(response.message)
        return response

    def _tick(self) -> None:
        if self._runtime is None or self._inputs is None or not self._enabled:
            return
        if self._inputs.stale(self._now()):
            self._rest()
            return
        began = time.perf_counter()
        self._resting = False
        self._channels.begin_tick()
        actions = self._runtime.tick(self._inputs.state()).actions
        self._ticks += 1
        self._commands += self._channels.send(actions)
        self._slowest = max(self._slowest, time.perf_counter() - began)

    def _rest(self) -> None:
        """Halts the tree; what it commands next is sent, be it what it commanded last."""
        if self._resting or self._runtime is None or self._inputs is None:
            return
        self._channels.begin_tick()
        self._runtime.halt()
        self._inputs.reset()
        self._resting = True
        self._channels.rest()

    def _now(self) -> int:
        return int(self._time.now().nanoseconds)

    def _condition(self) -> str:
        """What the executor does, or what it waits for."""
        if self._runtime is None or self._inputs is None:
            return "waiting for a tree"
        if not self._enabled:
            return "disabled"
        stale = self._inputs.stale(self._now())
        if stale:
            ages = ", ".join(f"{topic} ({age})" for topic, age in stale.items())
            return f"waiting for state: {ages}"
        return "running"

    def _publish_snapshot(self) -> None:
        watchers = self._snapshot.get_subscription_count()
        newcomers, self._watchers = watchers > self._watchers, watchers
        if self._runtime is None or not watchers:
            return
        tip = self._runtime.root.tip()
        snapshot = json.dumps(
            {
                "condition": self._condition().split(":")[0],
                "status": self._runtime.root.status.name,
                "tip": tip.name if tip else "",
                "commands": self._channels.sent,
                "nodes": self._runtime.snapshot(),
            },
            ensure_ascii=False,
        )
        if newcomers or snapshot != self._last_snapshot:
            self._last_snapshot = snapshot
            self._snapshot.publish(String(data=snapshot))

    def _report(self) -> Report:
        condition = self._condition()
        values: dict[str, Any] = {
            "condition": condition.split(":")[0],
            "enabled": self._enabled,
            "ticks": self._ticks,
            "commands": self._commands,
            "longest tick (ms)": f"{self._slowest * 1e3:.1f}",
            _REFUSED: 0,
        }
        self._slowest = 0.0
        if self._runtime is not None and self._inputs is not None:
            learned = self._runtime.learned
            values |= {
                "nodes": nodes.size(learned.tree),
                "actions": len(learned.actions),
                "rows": learned.provenance.rows,
                "own-history agreement": learned.provenance.figures.own_history_agreement,
            }
            stale = self._inputs.stale(self._now())
            values |= {f"state of {one}": stale.get(one, "fresh") for one in self._inputs.topics}
        values |= self._faults.counts
        if self._faults.recent:
            return Report(Level.WARN, f"{condition}; {self._faults.recent}", values)
        blocked = self._enabled and condition != "running"
        return Report(Level.WARN if blocked else Level.OK, condition, values)


def main(args: list[str] | None = None) -> None:
    """Runs the executor."""
    lifetime.run(ExecutorNode, args)


if __name__ == "__main__":
    main()
