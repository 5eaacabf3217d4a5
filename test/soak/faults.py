"""What is done to the nodes: one thing after the other, each until what must hold holds again."""

from __future__ import annotations

import math
import os
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from random import Random
from typing import TYPE_CHECKING, Final

from fuzz.mutation import mutated_json, mutated_text
from rclpy.serialization import serialize_message
from ros_processes import values_of
from std_msgs.msg import Float64MultiArray, String

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.errors import DocumentError
from soak.robot import WIDTH, state_of

if TYPE_CHECKING:
    from soak.campaign import Soak

#: Documents that are thrown or swapped in a row.
_ROW: Final = 20


def kill_node(soak: Soak, random: Random) -> str:
    """SIGKILL, and a start after a while."""
    name = random.choice(("recorder", "learner", "executor"))
    soak.fleet.kill(name)
    soak.wait(random.uniform(0.0, 1.0))
    soak.restart(name)
    return f"SIGKILL of the {name}"


def stop_node(soak: Soak, random: Random) -> str:
    """SIGINT or SIGTERM, and a start."""
    name = random.choice(("recorder", "learner", "executor"))
    number = random.choice((signal.SIGINT, signal.SIGTERM))
    soak.fleet.stop(name, number)
    soak.restart(name)
    return f"{number.name} to the {name}"


def kill_learning(soak: Soak, random: Random) -> str:
    """SIGKILL of the process that learns, while it does."""
    call = soak.peer.begin("/learner/relearn")
    soak.wait(random.uniform(0.0, 1.0))
    pid = values_of(soak.status("learner"))["learning process"]
    if pid.isdecimal():
        with soak.forgiving(ProcessLookupError):
            os.kill(int(pid), signal.SIGKILL)
    soak.expect_relearn(call, "the answer to a relearn whose process was killed")
    soak.note_tree(call)
    return "SIGKILL of the learning process"


def relearn(soak: Soak, random: Random) -> str:
    """Asks to learn; at times twice at once."""
    call = soak.peer.begin("/learner/relearn")
    second = soak.peer.begin("/learner/relearn") if random.random() < 0.5 else None
    soak.expect_relearn(call)
    if second is not None:
        soak.expect_relearn(second, "the answer to a second relearn")
        soak.note_tree(second)
    soak.note_tree(call)
    return "relearn" if second is None else "relearn, asked for twice"


def cancel_relearn(soak: Soak, random: Random) -> str:
    """Asks to learn, and to stop that, where the learner can."""
    call = soak.peer.begin("/learner/relearn")
    soak.wait(random.uniform(0.0, 0.5))
    names = dict(soak.peer.node.get_service_names_and_types())
    if "/learner/cancel" in names:
        soak.expect(soak.peer.begin("/learner/cancel").done, "the answer to a cancel")
    soak.expect_relearn(call, "the answer to a relearn that was cancelled")
    soak.note_tree(call)
    return "cancel of a relearn" if "/learner/cancel" in names else "relearn"


def malformed_trees(soak: Soak, random: Random) -> str:
    """Documents that are none."""
    for _ in range(_ROW):
        text = soak.documents[0]
        change = mutated_text if random.random() < 0.4 else mutated_json
        text = change(random, text).encode("utf-8", "replace").decode().replace("\0", "")
        try:
            loads(text)
        except DocumentError:
            soak.trees.publish(String(data=text))
            soak.wait(0.02)
    # A topic keeps the last document only, and an executor that starts later must get a tree.
    soak.publish_good_tree()
    return f"{_ROW} malformed trees"


def swap_trees(soak: Soak, random: Random) -> str:
    """Other trees that do the same, one after the other, while the robot is commanded."""
    learned = loads(soak.documents[0])
    for count in range(_ROW):
        tree = learned.tree
        for _ in range(random.randrange(1, 4)):
            tree = nodes.Selector((tree,))
        provenance = replace(learned.provenance, rows=soak.swaps + count)
        document = dumps(replace(learned, tree=tree, provenance=provenance))
        soak.trees.publish(String(data=document))
        soak.wait(random.uniform(0.0, 0.1))
    soak.swaps += _ROW
    soak.audit_commands()
    return f"{_ROW} hot swaps"


def malformed_states(soak: Soak, random: Random) -> str:
    """Messages that no state is: wrong lengths, numbers that are none, cut bytes."""
    good = state_of(0)
    for _ in range(_ROW):
        values = random.choice(
            (
                [],
                good[:-1],
                [*good, 0.0],
                [0.0] * 10_000,
                *([*good[:-1], odd] for odd in (math.nan, math.inf, -math.inf, 1e300)),
            )
        )
        message = Float64MultiArray(data=values)
        data = serialize_message(message)
        cut = random.random() < 0.2 and len(values) == WIDTH
        soak.states.publish(data[: random.randrange(len(data))] if cut else message)
        soak.wait(0.01)
    return f"{_ROW} malformed states"


def malformed_actions(soak: Soak, random: Random) -> str:
    """Labels that are none, cut bytes."""
    for _ in range(_ROW):
        label = random.choice(("\n", "a\tb", "\u202e", "\x1b[2J", "\x00x", "a\nb" * 1000))
        data = serialize_message(String(data=label.replace("\0", "\n")))
        cut = random.random() < 0.2
        soak.actions.publish(data[: random.randrange(4, 8)] if cut else data)
        soak.wait(0.01)
    return f"{_ROW} malformed actions"


def full_disk(soak: Soak, random: Random) -> str:
    """The recorder may not write for a while; afterwards it records again."""
    pid = soak.fleet.pid("recorder")
    unlimited = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, unlimited[1]))
    soak.wait(random.uniform(0.5, 2.0))
    resource.prlimit(pid, resource.RLIMIT_FSIZE, unlimited)
    soak.expect_rows()
    return "disk that takes nothing"


def freeze_recorder(soak: Soak, random: Random) -> str:
    """Its process stands still until the transport has no room and drops what the robot sends."""
    pid = soak.fleet.pid("recorder")
    os.kill(pid, signal.SIGSTOP)
    soak.wait(random.uniform(1.0, 4.0))
    os.kill(pid, signal.SIGCONT)
    soak.expect_rows()
    return "frozen recorder"


def stale_state(soak: Soak, random: Random) -> str:
    """The robot falls silent: the executor waits, and goes on by itself."""
    soak.robot.tell("pause")
    soak.expect_condition("waiting for state")
    since = time.time()
    soak.wait(random.uniform(0.5, 1.5))
    soak.robot.listen()
    count = sum(sent > since for sent, _ in soak.robot.commands)
    if count:
        soak.ledger.lose("commands on stale state", str(count), count)
    soak.robot.tell("resume")
    soak.expect_condition("running")
    return "stale state"


def disable(soak: Soak, random: Random) -> str:
    """No command between the answer and the next time that it is enabled."""
    soak.enable(False)
    soak.wait(random.uniform(0.0, 1.0))
    soak.audit_commands()
    return "disabled and enabled"


def new_demonstration(soak: Soak, random: Random) -> str:
    """Ends the demonstration, at times for good, and begins another."""
    what = random.choice(("renew", "discard", "stop"))
    match what:
        case "renew":
            soak.answer("/recorder/new_demonstration")
        case "discard":
            soak.answer("/recorder/discard_demonstration")
            soak.ledger.forgive_missing_files()
        case _:
            soak.answer("/recorder/record", False)
            soak.wait(random.uniform(0.0, 1.0))
            soak.answer("/recorder/record", True)
    soak.expect_rows()
    return {"renew": "new demonstration", "discard": "discarded demonstration"}.get(
        what, "recording off and on"
    )


FAULTS: Final[tuple[Callable[[Soak, Random], str], ...]] = (
    kill_node,
    kill_node,
    stop_node,
    kill_learning,
    relearn,
    cancel_relearn,
    malformed_trees,
    swap_trees,
    swap_trees,
    malformed_states,
    malformed_actions,
    full_disk,
    freeze_recorder,
    stale_state,
    disable,
    new_demonstration,
)
