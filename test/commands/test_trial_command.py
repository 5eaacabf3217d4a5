"""``trial`` with a real executor and a simulated robot, over DDS."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

import warm_processes
from ros_processes import (
    LATCHED,
    PATIENCE,
    NodeProcess,
    Peer,
    own_domain,
    values_of,
    wait_until,
)
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import Trigger
from trial_examples import ALWAYS_GO, ALWAYS_LEFT, ANOTHER, BAD, GOOD
from warm_processes import WarmProcess

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.commands import trial as trial_command
from rebt_ros.learning.learning_file import write_learning
from rebt_ros.ros.trial import driving
from rebt_ros.storage.tree_file import write_tree
from rebt_ros.trial.candidates import Candidate
from rebt_ros.trial.driven import read_driven
from rebt_ros.trial.outcome import Ending, Episode

ROBOT = {"plain": True, "speedup": 100.0, "lockstep": True, "time_limit": 40.0}
EXECUTOR = {"tick_on": "state", "state_timeout": 5.0}
WORLD = [
    *("--outcome-topic", "robot/episode", "--outcome-field", "reached"),
    *("--reset-service", "robot/reset", "--start-parameter", "robot/first_start"),
    *("--first-start", "1000"),
]
EXECUTION = "executor: execution"


class TrialProcess:
    """The command in a process of its own.

    Args:
        arguments: Its arguments.
        domain: ROS domain id.
        directory: Its working directory.
    """

    def __init__(self, arguments: list[str], domain: int, directory: Path) -> None:
        environment = dict(
            warm_processes.as_begun(),
            ROS_DOMAIN_ID=str(domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
            ROS_LOG_DIR=str(directory / "log"),
        )
        self._paths = [directory / f"trial.{time.monotonic_ns()}.{one}" for one in ("out", "err")]
        theirs, ours = os.pipe()
        self.stdin = os.fdopen(ours, "wb")
        """What is typed."""
        with (
            os.fdopen(theirs) as typed,
            self._paths[0].open("wb") as out,
            self._paths[1].open("wb") as err,
        ):
            self.process = WarmProcess(
                "rebt_ros.commands.trial",
                arguments,
                environment=environment,
                directory=directory,
                files=(typed.fileno(), out.fileno(), err.fileno()),
            )

    @property
    def out(self) -> str:
        return self._paths[0].read_text()

    @property
    def err(self) -> str:
        return self._paths[1].read_text()

    @property
    def over(self) -> bool:
        return self.process.poll() is not None

    def answers(self, line: str) -> None:
        """Types a line."""
        self.stdin.write(f"{line}\n".encode())
        self.stdin.flush()

    def ends(self, peer: Peer, code: int = 0) -> str:
        """Waits for its end, while the test's node goes on; returns what it has printed."""
        peer.wait_until(lambda: self.over, 3 * PATIENCE, "the end of the trial")
        assert self.process.returncode == code, self.out + self.err
        assert "Traceback" not in self.err
        return self.out


@contextmanager
def trial(domain: int, directory: Path, *arguments: str | Path) -> Iterator[TrialProcess]:
    one = TrialProcess(list(map(str, arguments)), domain, directory)
    try:
        yield one
    except BaseException:
        print(one.out, one.err)
        raise
    finally:
        if not one.over:
            one.process.kill()
        one.process.wait()
        one.stdin.close()


class World:
    """A world in the test's node, where going ahead is all that it takes.

    Args:
        peer: Hears the commands.
        tells: Whether it says on the topic ``outcome`` how an episode went, once it knows.
        judges: Whether the answer of its service ``reset`` says so.
        kind: Of that topic.
    """

    def __init__(
        self, peer: Peer, *, tells: bool = True, judges: bool = False, kind: type = Bool
    ) -> None:
        self.tells = tells
        self.judges = judges
        self.resets = 0
        self.commands: list[str] = []
        """Since the last reset."""
        self._outcome = peer.node.create_publisher(kind, "outcome", 10)
        peer.node.create_subscription(String, "command", self._on_command, 10)
        peer.node.create_service(Trigger, "reset", self._on_reset)

    @property
    def success(self) -> bool:
        return self.commands[-1:] == ["go"]

    def tell(self, outcome: Bool | String) -> None:
        self._outcome.publish(outcome)

    def _on_command(self, message: String) -> None:
        self.commands.append(message.data)
        if self.tells:
            self.tell(Bool(data=self.success))

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.success or not self.judges
        self.commands.clear()
        self.resets += 1
        return response


@contextmanager
def executor(domain: int, directory: Path, peer: Peer, **parameters: object) -> Iterator[None]:
    """The executor, which knows the test's node."""
    with NodeProcess("executor_node", domain, directory, parameters):
        peer.introduce("executor")
        yield


def _write(directory: Path, **trees: LearnedTree) -> list[str]:
    for name, tree in trees.items():
        write_tree(directory / f"{name}.json", tree)
    return [f"{name}.json" for name in trees]


def _found(directory: Path) -> dict[str, Any]:
    """What the trial found, by the trees' names."""
    found = json.loads((directory / "trial.json").read_text())
    return {"winner": found["winner"]} | {one["name"]: one for one in found["candidates"]}


def _disabled(peer: Peer) -> dict[str, str]:
    """What the executor reports once it is disabled."""
    status = peer.anew(EXECUTION)
    return peer.wait_until(
        lambda: (one := status()) and values_of(one)["condition"] == "disabled" and values_of(one),
        what="a disabled executor",
    )


def test_the_tree_that_arrives_wins_and_stays_published(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    trees = _write(tmp_path, bad=BAD, good=GOOD)
    arguments = [*trees, *WORLD, "--episodes", "3", "--publish", "--out", "trial.json"]
    with (
        NodeProcess("robot_node", domain, tmp_path, ROBOT),
        NodeProcess("executor_node", domain, tmp_path, EXECUTOR),
        trial(domain, tmp_path, *arguments) as running,
    ):
        wait_until(lambda: "until Ctrl-C" in running.out or running.over, 3 * PATIENCE)
        assert not running.over
        # Also for who comes late.
        heard = peer.listen(String, "behavior_tree", LATCHED)
        peer.wait_until(lambda: heard, what="the winner")
        assert [one.data for one in heard] == [dumps(GOOD)]
        assert _disabled(peer)["nodes"] == "16"
        running.process.send_signal(signal.SIGINT)
        said = running.ends(peer)
        assert _disabled(peer)["nodes"] == "16"
    assert "good.json wins: 3 of 3 episodes succeeded" in said
    assert "has the tree of good.json" in said
    found = _found(tmp_path)
    assert found["winner"] == "good.json"
    for name, success in (("good.json", 1.0), ("bad.json", 0.0)):
        outcomes = found[name]["outcomes"]
        assert [one["start"] for one in outcomes] == [1000, 1001, 1002]
        assert {one["ending"] for one in outcomes} == {"told"}
        assert found[name]["success"] == success


def test_what_was_published_before_is_published_again(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    world = World(peer)
    trees = _write(tmp_path, left=ALWAYS_LEFT, go=ALWAYS_GO)
    arguments = ["--outcome-topic", "outcome", "--reset-service", "reset", "--episodes", "5"]
    with executor(domain, tmp_path, peer):
        peer.connect(String, "behavior_tree", LATCHED).publish(String(data=dumps(ANOTHER)))
        heard = peer.listen(String, "behavior_tree", LATCHED)
        with trial(domain, tmp_path, *trees, *arguments, "--out", "trial.json") as running:
            said = running.ends(peer)
        assert _disabled(peer)["nodes"] == "3"
        peer.wait_until(lambda: len(heard) > 1 and heard[-1].data == dumps(ANOTHER))
    assert world.resets == 10
    assert "has the tree again that was published before" in said
    assert "go.json wins: 5 of 5 episodes succeeded" in said
    found = _found(tmp_path)
    assert [one["success"] for one in found["left.json"]["outcomes"]] == [False] * 5


def test_a_tree_that_others_publish_meanwhile_comes_afterwards(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    world = World(peer, tells=False)
    (tree,) = _write(tmp_path, go=ALWAYS_GO)
    arguments = [tree, "--outcome-topic", "outcome", "--reset-service", "reset"]
    with (
        executor(domain, tmp_path, peer),
        trial(domain, tmp_path, *arguments, "--episodes", "1", "--time-limit", "100") as running,
    ):
        peer.wait_until(lambda: world.commands or running.over)
        publisher = peer.connect(String, "behavior_tree", LATCHED, subscribers=2)
        publisher.publish(String(data=dumps(ANOTHER)))
        # The episode is driven again, by the trial's tree.
        peer.wait_until(lambda: (world.resets >= 2 and world.commands) or running.over)
        assert set(world.commands) == {"go"}
        world.tell(Bool(data=True))
        said = running.ends(peer)
        assert _disabled(peer)["nodes"] == "3"
    assert "1 of 1 episodes succeeded" in said
    assert "has the tree again that was published before" in said


def test_the_answer_of_a_reset_says_how_it_went(domain: int, peer: Peer, tmp_path: Path) -> None:
    world = World(peer, tells=False, judges=True)
    trees = _write(tmp_path, left=ALWAYS_LEFT, go=ALWAYS_GO)
    arguments = ["--reset-service", "reset", "--time-limit", "1.5", "--episodes", "2"]
    with (
        executor(domain, tmp_path, peer),
        trial(domain, tmp_path, *trees, *arguments, "--out", "trial.json") as running,
    ):
        running.ends(peer)
    # Once before the first one, too.
    assert world.resets == 5
    found = _found(tmp_path)
    assert found["winner"] == "go.json"
    assert (found["go.json"]["successes"], found["left.json"]["successes"]) == (2, 0)
    assert min(one["seconds"] for one in found["go.json"]["outcomes"]) >= 1.5


def test_a_person_says_how_it_went(domain: int, peer: Peer, tmp_path: Path) -> None:
    world = World(peer, tells=False)
    trees = _write(tmp_path, left=ALWAYS_LEFT, go=ALWAYS_GO)
    with (
        executor(domain, tmp_path, peer),
        trial(
            domain, tmp_path, *trees, "--ask", "--episodes", "1", "--out", "trial.json"
        ) as running,
    ):

        def asks(text: str, count: int) -> None:
            peer.wait_until(lambda: running.err.count(text) >= count or running.over, what=text)

        asks("press Enter", 1)
        running.answers("")
        asks("Has it succeeded?", 1)
        running.answers("perhaps")
        asks("Has it succeeded?", 2)
        running.answers("r")
        asks("press Enter", 2)
        world.commands.clear()
        running.answers("")
        peer.wait_until(lambda: world.commands)
        assert set(world.commands) == {"turn_left"}
        running.answers("n")
        asks("press Enter", 3)
        world.commands.clear()
        running.answers("")
        peer.wait_until(lambda: world.commands)
        assert set(world.commands) == {"go"}
        running.answers("yes")
        running.ends(peer)
        assert "json" not in running.err
    found = _found(tmp_path)
    assert found["winner"] == "go.json"
    assert (found["go.json"]["success"], found["left.json"]["success"]) == (1.0, 0.0)


class PretendedDriving:
    """Trees that drive without a robot: those of several nodes well."""

    farewell = "No robot was here."

    def drive(self, candidate: Candidate, number: int) -> Episode:
        return Episode(candidate.nodes > 1, 1.0, Ending.TOLD)


def test_the_levels_of_what_was_learned_drive_and_are_kept_for_the_studio(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    rows = [(x / 40, "back" if x < 10 else "go" if x < 25 else "stop") for x in range(40)]
    table = "x,action\n" + "".join(f"{x},{label}\n" for x, label in rows)
    for name in ("one.csv", "two.csv"):
        (tmp_path / name).write_text(table)
    policy = rebt_ros.learn([tmp_path / "one.csv", tmp_path / "two.csv"]).learnings[0]
    write_learning(tmp_path, policy)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(driving, "driving", lambda *_: nullcontext(PretendedDriving()))
    trial_command.main(["--levels", str(tmp_path), "--episodes", "2", "--outcome-topic", "outcome"])
    assert "level 00 (chosen)" in capsys.readouterr().out
    levels = [policy.levels.level(number).learned for number in policy.levels.selected(25)]
    sizes = {fingerprint(dumps(level)): nodes.size(level.tree) for level in levels}
    driven = read_driven(tmp_path)
    assert driven.keys() == sizes.keys()
    assert len(sizes) > 2
    assert {name: tally.share for name, tally in driven.items()} == {
        name: float(size > 1) for name, size in sizes.items()
    }


def test_too_long_or_stopped_by_a_person_is_a_failure(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    world = World(peer, tells=False)
    (tree,) = _write(tmp_path, go=ALWAYS_GO)
    arguments = [tree, "--outcome-topic", "outcome", "--episodes", "2", "--out", "trial.json"]
    with (
        executor(domain, tmp_path, peer, takeover_timeout=0.1),
        trial(domain, tmp_path, *arguments, "--time-limit", "2") as running,
    ):
        peer.wait_until(lambda: world.commands or running.over)
        peer.action("turn_right")
        running.ends(peer)
    outcomes = _found(tmp_path)["go.json"]["outcomes"]
    assert [one["success"] for one in outcomes] == [False, False]
    assert [one["ending"] for one in outcomes] == ["stopped", "time limit"]
    assert outcomes[0]["seconds"] < 2.0 <= outcomes[1]["seconds"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_trial_stops_the_robot_and_tells_what_it_knows(
    domain: int, peer: Peer, tmp_path: Path, number: int
) -> None:
    world = World(peer, tells=False)
    trees = _write(tmp_path, left=ALWAYS_LEFT, go=ALWAYS_GO)
    arguments = [*trees, "--outcome-topic", "outcome", "--out", "trial.json"]
    with executor(domain, tmp_path, peer):
        peer.connect(String, "behavior_tree", LATCHED).publish(String(data=dumps(ANOTHER)))
        with trial(domain, tmp_path, *arguments) as running:
            peer.wait_until(lambda: "turn_left" in world.commands or running.over)
            world.tell(Bool(data=True))
            peer.wait_until(lambda: "go" in world.commands or running.over)
            running.process.send_signal(number)
            said = running.ends(peer, 130)
        assert _disabled(peer)["nodes"] == "3"
    assert "interrupted after 1 episodes: there is no winner" in said
    found = _found(tmp_path)
    assert found["winner"] is None
    assert (found["left.json"]["successes"], found["go.json"]["episodes"]) == (1, 0)


def test_a_person_who_is_asked_may_end_it_instead(domain: int, peer: Peer, tmp_path: Path) -> None:
    (tree,) = _write(tmp_path, go=ALWAYS_GO)
    with executor(domain, tmp_path, peer), trial(domain, tmp_path, tree, "--ask") as running:
        peer.wait_until(lambda: "press Enter" in running.err or running.over)
        running.process.send_signal(signal.SIGINT)
        assert "The executor is disabled" in running.ends(peer, 130)


def test_a_trial_ends_where_nobody_answers(domain: int, peer: Peer, tmp_path: Path) -> None:
    (tree,) = _write(tmp_path, go=ALWAYS_GO)
    with executor(domain, tmp_path, peer), trial(domain, tmp_path, tree, "--ask") as running:
        running.stdin.close()
        running.ends(peer, 1)
    assert "standard input was closed" in running.err


def test_an_outcome_of_another_type_is_refused(domain: int, peer: Peer, tmp_path: Path) -> None:
    peer.node.create_publisher(Float64, "outcome", 10)
    (tree,) = _write(tmp_path, go=ALWAYS_GO)
    with trial(domain, tmp_path, tree, "--outcome-topic", "outcome") as running:
        running.ends(peer, 1)
    assert "/outcome carries std_msgs/msg/Float64" in running.err


def _reading(topic: str) -> LearnedTree:
    """A good tree whose state is on another topic."""
    return replace(GOOD, features=tuple(replace(one, topic=topic) for one in GOOD.features))


def test_what_a_trial_waits_for_in_vain_is_named_and_no_failure(tmp_path: Path) -> None:
    # At the same time, as each of them is patient.
    without_an_executor, without_a_world, without_a_state = (
        "there is no service /executor/enable",
        "nobody publishes on /outcome",
        "the executor does not drive: waiting for state: silent (never received)",
    )
    with ExitStack() as stack:
        running = []
        for said in (without_an_executor, without_a_world, without_a_state):
            domain = stack.enter_context(own_domain())
            directory = tmp_path / str(domain)
            directory.mkdir()
            peer = stack.enter_context(Peer(domain))
            if said != without_a_world:
                World(peer)
            if said == without_a_state:
                stack.enter_context(executor(domain, directory, peer))
            (tree,) = _write(directory, tree=_reading("silent"))
            one = stack.enter_context(trial(domain, directory, tree, "--outcome-topic", "outcome"))
            running.append((one, peer, said))
        for one, peer, said in running:
            one.ends(peer, 1)
            assert said in one.err


def test_an_outcome_that_says_nothing_ends_the_trial(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    world = World(peer, tells=False, kind=String)
    (tree,) = _write(tmp_path, go=ALWAYS_GO)
    with (
        executor(domain, tmp_path, peer),
        trial(domain, tmp_path, tree, "--outcome-topic", "outcome") as running,
    ):
        peer.wait_until(lambda: world.commands or running.over)
        world.tell(String(data="42"))
        running.ends(peer, 1)
        assert _disabled(peer)["enabled"] == "False"
    assert "'42' is neither success nor failure" in running.err


def test_a_tree_that_the_executor_refuses_is_named(domain: int, peer: Peer, tmp_path: Path) -> None:
    World(peer)
    (tree,) = _write(tmp_path, odd=_reading("no topic"))
    with (
        executor(domain, tmp_path, peer),
        trial(domain, tmp_path, tree, "--outcome-topic", "outcome") as running,
    ):
        running.ends(peer, 1)
    assert "executor refuses odd.json" in running.err
    assert "is no name of a topic" in running.err


def test_names_can_be_remapped(domain: int, peer: Peer, tmp_path: Path) -> None:
    World(peer)
    (tree,) = _write(tmp_path, go=ALWAYS_GO)
    arguments = [tree, "--outcome-topic", "/outcome", "--reset-service", "/reset"]
    arguments += ["--episodes", "1", "--executor", "driver"]
    names = ["-r", "__ns:=/robot1"]
    renamed = [*names, "-r", "__node:=driver", "-r", "command:=/command"]
    with (
        NodeProcess("executor_node", domain, tmp_path, arguments=renamed),
        trial(domain, tmp_path, *arguments, "--ros-args", *names) as running,
    ):
        assert "go.json wins: 1 of 1" in running.ends(peer)
