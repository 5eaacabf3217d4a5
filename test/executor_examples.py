"""What the tests of the executor share: a tree, a robot, and what the executor says."""

from __future__ import annotations

import time
from collections.abc import Callable
from collections.abc import Sequence as Sequence_
from dataclasses import dataclass, replace
from typing import Any

from ros_processes import LATCHED, Peer, values_of
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.behavior_tree.nodes import Action, Condition, Node, Selector, Sequence, actions
from rebt_ros.behavior_tree.shown import ShownChannel, ShownLeaf, Span
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import Literal, Threshold

#: The executor's reports.
EXECUTION = "executor: execution"

GO, TURN, STOP = (Action(label, "action") for label in ("go", "turn", "stop"))


def learned(tree: Node, topic: str | None = "state", *others: Action) -> LearnedTree:
    """Features y and x; y, the first value of the state, is never tested."""
    return LearnedTree(
        tuple(
            Feature(name, topic=topic, index=None if topic is None else index)
            for index, name in enumerate(("y", "x"))
        ),
        (*actions(tree), *others),
        tree,
        Provenance(1, 10, 0.0, 5, 0.0, Root.SELECTOR, History.NONE, Figures(0, 1.0, 1.0, 2)),
    )


def where_x_is_small(small: Action, otherwise: Action) -> Node:
    return Selector((Sequence((Condition(Literal(Threshold("x", 0.5))), small)), otherwise))


READS_X = learned(where_x_is_small(GO, TURN))


def status(
    peer: Peer, condition: str, *, robot: Any = None, anew: bool = False, **values: str
) -> Any:
    """Waits until the executor reports a condition, or does so anew.

    A robot sends its state meanwhile.
    """
    since = time.time_ns() if anew else 0
    keys = {key.replace("_", " "): value for key, value in values.items()}

    def reported() -> Any:
        latest = peer.diagnostics.get(EXECUTION)
        if latest is None or values_of(latest)["condition"] != condition:
            return None
        if peer.reported[EXECUTION] <= since:
            return None
        return latest if keys.items() <= values_of(latest).items() else None

    return (robot.until if robot else peer.wait_until)(
        reported, what=f"the condition {condition!r} {keys or ''}"
    )


def report(peer: Peer, *, robot: Any = None) -> dict[str, str]:
    """What the executor reports from now on; a robot sends its state meanwhile."""
    until = robot.until if robot else peer.wait_until
    return values_of(until(peer.anew(EXECUTION), what="a report"))


class Robot:
    """Publishes a state all the time and hears the commands.

    Args:
        peer: What publishes and listens.
        executor: The name of the node that commands.
        topic: Where it does.
    """

    def __init__(self, peer: Peer, executor: str = "executor", topic: str = "command") -> None:
        self._peer = peer
        self.state = (7.0, 0.0)
        self.commands = peer.listen(String, topic)
        peer.introduce(executor)

    def until(self, condition: Any, what: str = "") -> Any:
        def published() -> Any:
            self._peer.state(*self.state)
            return condition()

        return self._peer.wait_until(published, what=what)

    def obeys(self, label: str) -> None:
        """Waits for a command that is sent from now on."""
        seen = len(self.commands)
        self.until(
            lambda: any(one.data == label for one in self.commands[seen:]), f"command {label!r}"
        )


def publish(peer: Peer, tree: LearnedTree | str) -> None:
    document = tree if isinstance(tree, str) else dumps(tree)
    peer.connect(String, "behavior_tree", LATCHED).publish(String(data=document))


def shown(tree: LearnedTree, *leaves: Sequence_[tuple[float, float]]) -> LearnedTree:
    """The tree with what it was learned from: of each leaf, the ranges of y and x."""
    ranges = tuple(ShownLeaf(10, tuple(Span(*span) for span in leaf)) for leaf in leaves)
    return replace(tree, shown=(ShownChannel("action", ranges),))


def large(nodes: int, only: Action) -> LearnedTree:
    """A tree of about so many nodes that does one thing, and finds that out at once."""
    never = [
        Sequence((*(Condition(Literal(Threshold("x", -1.0 - one))) for _ in range(8)), STOP))
        for one in range(nodes // 10)
    ]
    return learned(Selector((where_x_is_small(only, only), *never)))


@dataclass(frozen=True, slots=True)
class Sent:
    """A command and when it was sent and received, nanoseconds."""

    label: str
    sent: int
    received: int

    def follows(self, answer: Sent) -> bool:
        """Whether it was received after an answer, though not because it had to be sent again.

        That happens where the process that receives stood still; it takes longer than this.
        """
        return self.received > answer.received and self.received - self.sent < 50_000_000


def timed_commands(peer: Peer, topic: str = "command") -> list[Sent]:
    """A list to which the commands are added."""
    heard: list[Sent] = []

    def note(message: String, info: dict[str, Any]) -> None:
        heard.append(Sent(message.data, info["source_timestamp"], info["received_timestamp"]))

    peer.node.create_subscription(String, topic, note, 10_000)
    peer.wait_until(lambda: peer.node.count_publishers(topic), what=f"a publisher of {topic}")
    peer.introduce("executor")
    return heard


class SimulatedTime:
    """Moves /clock, so that nothing happens to an executor between two steps.

    Args:
        peer: What publishes.
        commands: To which the executor's commands are added.
    """

    #: What the state is, where there is one.
    STATE = (7.0, 0.0)

    def __init__(self, peer: Peer, commands: Sequence_[Any]) -> None:
        self._peer = peer
        self._commands = commands
        self.now = 0
        """Nanoseconds."""

    def set(self, nanoseconds: int) -> None:
        """Sets the time."""
        self.now = nanoseconds
        self.repeat()

    def repeat(self) -> None:
        """Says again what time it is, as only the latest word is sure to be heard."""
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(self.now, 10**9)
        self._peer.publish(message, "/clock")

    def step(self, milliseconds: int = 10) -> None:
        """Goes on a little, without a state."""
        self.set(self.now + milliseconds * 10**6)

    def wait(self, condition: Callable[[], Any], what: str = "") -> Any:
        """Waits while time stands still."""

        def repeated() -> Any:
            self.repeat()
            return condition()

        return self._peer.wait_until(repeated, what=what)

    def until(self, condition: Callable[[], Any], what: str = "") -> Any:
        """Waits while time stands still, with a state that is sent again and again."""

        def published() -> Any:
            self._peer.state(*self.STATE)
            return condition()

        return self.wait(published, what)

    def report(self) -> dict[str, str]:
        """What the executor reports once it is as late for it as it is here."""
        anew = self._peer.anew(EXECUTION)

        def arrived() -> Any:
            return anew() if self._peer.stamps.get(EXECUTION) == self.now else None

        return values_of(self.wait(arrived, "a report of now"))

    def feed(self) -> None:
        """Sends the state until the executor has it, so that the next tick does not come first.

        The state and the time go by two topics: nothing says which of them is heard first.
        """

        anew = self._peer.anew(EXECUTION)

        def running() -> bool:
            said = anew()
            return said is not None and values_of(said)["condition"] == "running"

        self.until(running, "a report that the state has arrived")

    def go_on(self, ticks: int) -> None:
        """Goes on, whatever that sets off; the executor may not come along and miss some ticks."""
        for _ in range(ticks):
            self._peer.state(*self.STATE)
            self.step()

    def jump(self, seconds: float) -> None:
        """Sets the time, either way, where no state is under way any longer."""
        self.report()
        self.set(self.now + round(seconds * 1e9))

    def tick(self) -> Any:
        """Goes on to the next tick, and returns its command."""
        count = len(self._commands)
        self._peer.state(*self.STATE)
        self.step()
        self.until(lambda: len(self._commands) > count, "a command")
        return self._commands[-1]

    def commanded(self) -> None:
        """Goes on until the first command; from then on, a step is a tick."""
        self.set(10**9)
        seen = len(self._commands)

        def stepped() -> bool:
            self.go_on(1)
            return len(self._commands) > seen

        self._peer.wait_until(stepped, what="the first command")
        said = self.report()["commands"]
        self._peer.wait_until(lambda: len(self._commands) == int(said), what="all commands")
