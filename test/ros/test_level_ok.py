"""Level OK means that the job is being done: whatever keeps a node from it is said."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import robot_bags as some
from builtin_interfaces.msg import Time
from executor_examples import GO, READS_X, STOP, Robot, learned, report, where_x_is_small
from geometry_msgs.msg import Twist
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_processes import LATCHED, NodeProcess, Peer, values_of
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Joy, LaserScan
from std_msgs.msg import Bool, Float64MultiArray, Int32, String

import rebt_ros
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.simulated_robot.robot import State
from rebt_ros.storage.recording import read_recording

PROMPT = {"reorder_window": 0.0}
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
WARN = b"\x01"


def _warns(peer: Peer, source: str, *texts: str) -> None:
    """Waits until the node warns of something with all these texts."""

    def said() -> bool:
        reports = [one for name, one in peer.diagnostics.items() if name.startswith(f"{source}: ")]
        return any(
            one.level == WARN and all(text in one.message for text in texts) for one in reports
        )

    peer.wait_until(said, what=f"a warning of {texts}")


def test_a_recorder_says_whose_qos_does_not_fit(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.state(0.0)
        peer.node.create_publisher(String, "action", BEST_EFFORT)
        _warns(peer, "recorder", "/test_peer offers incompatible QoS on /action", "reliable")
        recorder.says("offers incompatible QoS on /action")
        answer = peer.call("/recorder/new_demonstration")
        assert not answer.success
        assert "Not heard so far: action" in answer.message


def test_what_helps_against_states_of_best_effort_was_tried(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    publisher = peer.node.create_publisher(Float64MultiArray, "state", BEST_EFFORT)
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        _warns(
            peer, "recorder", "offers incompatible QoS on /state", "set state_qos to sensor_data"
        )
    with NodeProcess("recorder_node", domain, tmp_path, {**PROMPT, "state_qos": "sensor_data"}):
        peer.diagnostics.clear()

        def recorded() -> bool:
            publisher.publish(Float64MultiArray(data=[1.0]))
            peer.action("go")
            status = peer.diagnostics.get("recorder: recording")
            return status is not None and int(values_of(status)["rows"]) > 0

        peer.wait_until(recorded)


def test_a_recorder_says_who_publishes_another_type(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.node.create_publisher(Int32, "state", 10)
        _warns(peer, "recorder", "/test_peer publishes std_msgs/msg/Int32 on /state")
        recorder.says("not std_msgs/msg/Float64MultiArray")


@pytest.mark.parametrize("sample_rate", [0.0, 10.0])
def test_a_recorder_says_that_simulated_time_does_not_come(
    domain: int, peer: Peer, tmp_path: Path, sample_rate: float
) -> None:
    parameters = PROMPT | {"use_sim_time": True, "sample_rate": sample_rate}
    with NodeProcess("recorder_node", domain, tmp_path, parameters) as recorder:
        peer.state(0.0)
        peer.action("go")
        _warns(peer, "recorder", "action 'go' on 'action' is not recorded", "waiting for /clock")
        recorder.says("waiting for /clock")
        report = values_of(peer.diagnostics["recorder: recording"])
        assert (report["rows"], report["action before the first /clock"]) == ("0", "1")
        answer = peer.call("/recorder/new_demonstration")
        assert (answer.success, "/clock; wait for ~/ready" in answer.message) == (False, True)
        assert "no rows were recorded" in peer.call("/recorder/record", False).message
    assert list(tmp_path.glob("demonstrations/*")) == []


def test_a_recorder_is_not_ready_before_simulated_time_is(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT | {"use_sim_time": True}):
        said = peer.listen(Bool, "recorder/ready", LATCHED)
        peer.connect(String, "action")
        peer.state(0.0)
        _warns(peer, "recorder", "waiting for /clock")
        peer.wait_until(lambda: [one.data for one in said] == [False])

        def ready() -> bool:
            peer.publish(Clock(clock=Time(sec=5)), "/clock")
            peer.spin_once()
            return [one.data for one in said] == [False, True]

        peer.wait_until(ready)
        peer.action("go")
        assert "recorded 1 row" in peer.call("/recorder/record", False).message
    [path] = tmp_path.glob("demonstrations/*.rec")
    assert read_recording(path).demonstration.stamps.tolist() == [5_000_000_000]


def test_a_recorder_that_does_not_record_has_looked_at_the_graph(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT | {"recording": False}):
        peer.state(0.0)
        peer.node.create_publisher(String, "action", BEST_EFFORT)
        _warns(peer, "recorder", "not recording", "offers incompatible QoS on /action")


def test_a_finding_that_comes_back_is_logged_again(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        sentence = "publishes std_msgs/msg/Int32 on /state"
        for times in (1, 2):
            other = peer.node.create_publisher(Int32, "state", 10)
            _warns(peer, "recorder", sentence)
            peer.wait_until(lambda times=times: recorder.stderr.count(sentence) == times)
            peer.node.destroy_publisher(other)
            peer.wait_until(lambda: sentence not in peer.diagnostics["recorder: recording"].message)


def test_a_recorder_says_once_that_nobody_publishes_and_what_was_not_recorded(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        _warns(peer, "recorder", "nobody publishes on /state", "nobody publishes on /action")
        recorder.says("nobody publishes on /action.")
        answer = peer.call("/recorder/record", False)
        assert not answer.success
        assert "no rows were recorded" in answer.message
    assert recorder.stderr.count("nobody publishes on /action.") == 1


def test_a_recorder_that_is_stopped_without_rows_warns_in_its_own_name(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.state(0.0)
    said = next(line for line in recorder.stderr.splitlines() if "no rows were recorded" in line)
    assert said.startswith("[WARN]")
    assert "[recorder.stop]" in said
    assert "Failed to publish" not in recorder.stderr


def test_a_recorder_is_ready_once_it_has_heard_every_topic(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        said = peer.listen(Bool, "recorder/ready", LATCHED)
        peer.wait_until(lambda: [one.data for one in said] == [False])
        peer.connect(String, "action")
        peer.connect(Float64MultiArray, "state")
        assert [one.data for one in said] == [False]
        peer.state(0.0)
        peer.wait_until(lambda: [one.data for one in said] == [False, True])


def test_a_recorder_that_heard_no_usable_state_is_not_ready_and_says_why(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    latched = peer.node.create_publisher(Float64MultiArray, "state", LATCHED)
    latched.publish(Float64MultiArray(data=[1.0]))
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        peer.connect(String, "action")
        _warns(peer, "recorder", "before this node was there is not received", "/state")
        ready = peer.listen(Bool, "recorder/ready", LATCHED)
        latched.publish(Float64MultiArray(data=[float("nan")]))
        _warns(peer, "recorder", "state topic 'state' sent nan at index 0")
        assert not any(one.data for one in ready)
        latched.publish(Float64MultiArray(data=[1.0]))
        peer.wait_until(lambda: ready and ready[-1].data, what="the recorder to be ready")


def test_with_two_learners_all_who_are_concerned_say_so(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    names = []
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}) as executor:
        nodes = []
        try:
            for name in ("one", "two"):
                directory = tmp_path / name
                directory.mkdir()
                tree = directory / "tree.json"
                tree.write_text(dumps(READS_X))
                rename = ["-r", f"__node:={name}"]
                nodes.append(
                    NodeProcess("learner_node", domain, directory, {"output": directory}, rename)
                )
                names.append(name)
            _warns(peer, "executor", "2 nodes publish trees on behavior_tree (/one, /two)")
            executor.says("2 nodes publish trees on behavior_tree")
            for name in names:
                _warns(peer, name, "2 nodes publish trees on behavior_tree")
            executor.stop()
            assert executor.stderr.count("2 nodes publish trees") == 1
        finally:
            for one in nodes:
                one.stop()


@pytest.mark.parametrize("name", ["one", "/two"])
def test_an_executor_follows_the_learner_that_a_parameter_names(
    name: str, domain: int, peer: Peer, tmp_path: Path
) -> None:
    trees = {"one": READS_X, "two": learned(where_x_is_small(STOP, GO))}
    with ExitStack() as running:
        for other, tree in trees.items():
            directory = tmp_path / other
            directory.mkdir()
            (directory / "tree.json").write_text(dumps(tree))
            rename = ["-r", f"__node:={other}"]
            running.enter_context(
                NodeProcess("learner_node", domain, directory, {"output": directory}, rename)
            )
        for other in trees:
            peer.wait_until(lambda other=other: f"{other}: learning" in peer.diagnostics)
        executor = running.enter_context(
            NodeProcess("executor_node", domain, tmp_path, {"learner": name})
        )
        wanted = fingerprint(dumps(trees[name.strip("/")]))

        def report() -> Any:
            return peer.diagnostics.get("executor: execution")

        peer.wait_until(lambda: report() and values_of(report()).get("document") == wanted)
        assert values_of(report())["trees from"] == f"/{name.strip('/')}/behavior_tree"
        assert "publish trees" not in report().message
        executor.says(f"following the trees of {name}")


def test_an_executor_says_that_the_learner_it_should_follow_is_not_there(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path, {"learner": "/other"}):
        _warns(peer, "executor", "nobody publishes on /other/behavior_tree")


def test_an_executor_says_that_trees_are_not_kept_for_it(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path):
        peer.node.create_publisher(String, "behavior_tree", 10)
        _warns(peer, "executor", "/test_peer offers incompatible QoS on /behavior_tree")


@pytest.mark.parametrize("second", ["executor", "another"])
def test_two_executors_say_so_whatever_their_names(
    second: str, domain: int, peer: Peer, tmp_path: Path
) -> None:
    rename = ["-r", f"__node:={second}"]
    with (
        NodeProcess("executor_node", domain, tmp_path) as one,
        NodeProcess("executor_node", domain, tmp_path, {}, rename) as other,
    ):
        names = ", ".join(sorted(("/executor", f"/{second}")))
        for node, process in (("executor", one), (second, other)):
            _warns(peer, node, f"2 nodes publish commands on /command ({names})")
            process.says("2 nodes publish commands on /command")
        for process in (one, other):
            process.stop()
            assert process.stderr.count("2 nodes publish commands") == 1


def test_a_demonstrator_says_that_nobody_is_there_and_who_gets_no_actions(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("demonstrator_node", domain, tmp_path, {"plain": True}) as demonstrator:
        _warns(peer, "demonstrator", "nobody publishes on /state", "nobody listens to /action")
        heard = peer.listen(String, "action")
        values = [0.0] * len(State._fields)

        def answered() -> bool:
            peer.state(*values, labels=State._fields)
            peer.spin_once()
            return bool(heard)

        peer.wait_until(answered)
        # One who cannot be connected is waited for, and then not any longer.
        peer.node.create_subscription(String, "action", lambda _: None, LATCHED)
        peer.wait_until(lambda: answered() and "are not connected" in demonstrator.stderr)


def test_the_robots_say_who_is_missing(domain: int, peer: Peer, tmp_path: Path) -> None:
    config = tmp_path / "config.json"
    config.write_text('{"type_": "sequence", "child_list": [{"type_": "action", "name": "wave"}]}')
    with (
        NodeProcess("robot_node", domain, tmp_path, {"plain": True}, ["-r", "action:=own_action"]),
        NodeProcess("synthetic_robot_node", domain, tmp_path, {"config": config}),
    ):
        _warns(peer, "robot", "nobody publishes on /command", "nobody publishes on /own_action")
        _warns(peer, "synthetic_robot", "nobody listens to /state", "nobody listens to /action")


def test_an_executor_says_that_nobody_obeys_it(domain: int, peer: Peer, tmp_path: Path) -> None:
    path = tmp_path / "tree.json"
    path.write_text(dumps(READS_X))
    parameters: dict[str, Any] = {"tree_file": path, "enabled": True}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        peer.connect(Float64MultiArray, "state")
        _warns(peer, "executor", "nobody listens to /command")
        peer.node.create_subscription(String, "command", lambda _: None, LATCHED)
        _warns(peer, "executor", "/test_peer requests incompatible QoS on /command")


def test_an_executor_whose_labels_are_messages_says_that_nobody_hears_those(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "tree.json").write_text(dumps(READS_X))
    labels = [action.label for action in READS_X.actions]
    commands = "".join(
        f"  {label}: {{publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {{}}}}\n"
        for label in labels
    )
    (tmp_path / "robot.yaml").write_text(f"state: {{far: /scan.range_max}}\ncommands:\n{commands}")
    parameters: dict[str, Any] = {
        "tree_file": "tree.json",
        "robot_file": "robot.yaml",
        "enabled": True,
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        peer.connect(Float64MultiArray, "state")
        _warns(peer, "executor", "nobody listens to /cmd_vel")
        peer.node.create_subscription(Twist, "cmd_vel", lambda _: None, LATCHED)
        _warns(peer, "executor", "/test_peer requests incompatible QoS on /cmd_vel")


def test_an_executor_says_whom_it_cannot_hear(domain: int, peer: Peer, tmp_path: Path) -> None:
    path = tmp_path / "tree.json"
    path.write_text(dumps(READS_X))
    parameters: dict[str, Any] = {
        "tree_file": path,
        "enabled": True,
        "action_result_topic": "result",
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        peer.node.create_publisher(String, "action", BEST_EFFORT)
        peer.node.create_publisher(String, "result", BEST_EFFORT)
        _warns(
            peer,
            "executor",
            "/test_peer offers incompatible QoS on /action",
            "/test_peer offers incompatible QoS on /result",
        )


def test_who_uses_simulated_time_says_that_it_has_stopped(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    path = tmp_path / "tree.json"
    path.write_text(dumps(READS_X))
    parameters: dict[str, Any] = {"use_sim_time": True, "tree_file": path, "enabled": True}
    with (
        NodeProcess("recorder_node", domain, tmp_path, {"use_sim_time": True}),
        NodeProcess("executor_node", domain, tmp_path, parameters),
    ):
        states = peer.connect(Float64MultiArray, "state", subscribers=2)
        clock = peer.connect(Clock, "/clock", subscribers=2)

        def said() -> bool:
            clock.publish(Clock(clock=Time(sec=5)))
            states.publish(Float64MultiArray(data=[0.0, 0.0]))
            peer.spin_once()
            told = [
                one.message
                for one in peer.diagnostics.values()
                if one.level == WARN and "/clock has stopped" in one.message
            ]
            return len(told) == 2 and any(one.startswith("waiting for /clock") for one in told)

        peer.wait_until(said)


@pytest.mark.parametrize(
    ("node", "parameter", "said"),
    [
        ("executor", "takeover_topics", "disabled until ~/enable is called."),
        ("recorder", "state_fields", "recording action with state"),
        ("learner", "units", "call ~/relearn to learn one"),
    ],
)
@pytest.mark.parametrize("form", ["argument", "file"])
def test_an_empty_list_means_none(
    node: str, parameter: str, said: str, form: str, domain: int, tmp_path: Path
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(f"{node}:\n  ros__parameters:\n    {parameter}: []\n")
    arguments = {"argument": ["-p", f"{parameter}:=[]"], "file": ["--params-file", str(file)]}
    with NodeProcess(f"{node}_node", domain, tmp_path, {}, arguments[form]) as process:
        process.says(said)
        assert "not initialized" not in process.stderr


@pytest.mark.parametrize(
    ("node", "parameter", "sentence"),
    [
        ("recorder", "state_topics", "at least one state topic and action topic"),
        ("recorder", "action_topics", "at least one state topic and action topic"),
        ("robot", "command_topics", "name at least one topic"),
    ],
)
def test_an_empty_list_is_refused_where_there_must_be_something(
    node: str, parameter: str, sentence: str, domain: int, tmp_path: Path
) -> None:
    arguments = ["-p", f"{parameter}:=[]"]
    with NodeProcess(f"{node}_node", domain, tmp_path, {}, arguments) as process:
        assert process.wait() == 1
        assert sentence in process.stderr
        assert len(process.stderr.splitlines()) == 1


@pytest.fixture(scope="module")
def tree_of_texts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree that was learned from a table of texts."""
    directory = tmp_path_factory.mktemp("texts")
    table = directory / "table.csv"
    rows = "".join(
        f"{color},{'stop' if color == 'red' else 'go'}\n" for color in ("red", "blue") * 20
    )
    table.write_text("color,action\n" + rows)
    result = rebt_ros.learn(table, out=directory / "out")
    assert any("'color', which holds texts (blue, red)" in note for note in result.notes)
    return directory / "out" / "tree.json"


def test_a_tree_that_tests_texts_is_not_run_and_whoever_sends_states_is_told(
    domain: int, peer: Peer, tmp_path: Path, tree_of_texts: Path
) -> None:
    parameters = {"tree_file": tree_of_texts, "enabled": True}
    reason = "tree.json is not run: the tree tests 'color' for texts (blue, red), which no state"
    with NodeProcess("executor_node", domain, tmp_path, parameters) as executor:
        commands = peer.listen(String, "command")
        peer.state(1.0)
        _warns(peer, "executor", "waiting for a tree: ", reason)
        executor.says(reason)
        assert reason in peer.call("/executor/enable", True).message
        assert commands == []
        # One that can be run takes its place.
        peer.connect(String, "behavior_tree", LATCHED).publish(String(data=dumps(READS_X)))
        robot = Robot(peer)
        robot.obeys("go")
        assert reason not in report(peer)["condition"]
        assert executor.stop() == 0
    assert "Traceback" not in executor.stderr


def test_a_tree_of_texts_that_is_published_is_refused(
    domain: int, peer: Peer, tmp_path: Path, tree_of_texts: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path) as executor:
        publisher = peer.connect(String, "behavior_tree", LATCHED)
        publisher.publish(String(data=tree_of_texts.read_text()))
        executor.says("a behavior tree was refused (there is no tree yet): the tree tests 'color'")


_JOY_ROBOT = """\
state:
  ahead: {path: "/scan.ranges[-30deg:30deg].@min"}
  behind: {path: "/scan.ranges[170deg:190deg].@min"}
actions: {action: {joy: /joy, press: {0: go, 12: stop}, axes: {7: {0.5: back}}}}
"""


def test_a_recorder_says_which_feature_has_no_value_and_which_buttons_are_not_there(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "robot.yaml").write_text(_JOY_ROBOT)
    with NodeProcess("recorder_node", domain, tmp_path, {"robot_file": "robot.yaml"}) as recorder:
        scans = peer.connect(LaserScan, "/scan")
        pressed = peer.connect(Joy, "/joy")

        def says() -> bool:
            scans.publish(some.scan(2.0))
            pressed.publish(some.joy())
            status = peer.diagnostics.get("recorder: recording")
            return status is not None and all(
                text in status.message
                for text in (
                    "feature 'behind' had no value in any message on '/scan'",
                    "messages on '/joy' do not have button 12 (there are 3, from 0) and axis 7 "
                    "(there are 2, from 0), which the actions 'action' name",
                )
            )

        peer.wait_until(says, what="a warning")
        assert "'ahead'" not in peer.diagnostics["recorder: recording"].message
        recorder.says("do not have button 12")
        assert recorder.stop() == 0


def test_an_executor_says_that_it_cannot_hear_who_takes_over_by_the_robot_file(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    commands = "commands: {go: {publish: /lamp, type: std_msgs/msg/Bool, message: {data: true}}}"
    (tmp_path / "robot.yaml").write_text(f"{_JOY_ROBOT}{commands}\n")
    peer.node.create_publisher(String, "/joy", 10)
    parameters = {"robot_file": "robot.yaml", "takeover_timeout": 1.0}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        _warns(peer, "executor", "topic '/joy' must carry sensor_msgs/msg/Joy")


@pytest.mark.parametrize(
    ("node", "parameter", "service", "kind"),
    [
        ("learner", "output", "relearn", None),
        ("recorder", "demonstrations", "record", True),
    ],
)
def test_a_directory_that_cannot_be_written_is_said_at_the_start(
    node: str,
    parameter: str,
    service: str,
    kind: bool | None,
    domain: int,
    peer: Peer,
    tmp_path: Path,
) -> None:
    blocked = tmp_path / "blocked"
    blocked.write_text("a file where a directory should be")
    wanted = f"nothing can be written to {blocked}/there ({blocked}: Not a directory)"
    with NodeProcess(f"{node}_node", domain, tmp_path, {parameter: f"{blocked}/there"}) as process:
        process.says(wanted)
        _warns(peer, node, wanted)
        blocked.unlink()
        peer.wait_until(
            lambda: not any("nothing can" in one.message for one in peer.diagnostics.values()),
            what="no warning",
        )
        assert not blocked.exists()
        blocked.write_text("again")
        answer = peer.call(f"/{node}/{service}", *([kind] if kind is not None else []))
        assert (answer.success, wanted in answer.message) == (False, True)
