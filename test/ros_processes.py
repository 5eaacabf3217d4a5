"""Real nodes in processes of their own, and a node in the test that talks to them.

Nothing here sleeps for a fixed time: tests wait for a condition, with a limit.
"""

from __future__ import annotations

import fcntl
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import prompt_answers
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String
from std_srvs.srv import SetBool, Trigger
from warm_processes import HOME, WarmProcess, can_start

CHECKOUT = Path(__file__).resolve().parents[1]

#: How long a test waits for something that should happen at once, on a busy machine (seconds).
PATIENCE = 60.0

#: A limit for what must not happen while a process of a test gets no time to run (seconds).
AGES = 600.0

#: How long a node may take to end by itself where a test has left it running (seconds).
_LAST_WORDS = 5.0

#: Between two looks at a condition no more than this counts as waiting (seconds).
_STOOD_STILL = 1.0

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def wait_until(
    condition: Callable[[], Any],
    timeout: float = PATIENCE,
    *,
    meanwhile: Callable[[], object] = lambda: time.sleep(0.005),
    what: str = "",
) -> Any:
    """Waits until the condition holds and returns its value.

    Raises:
        TimeoutError: It did not hold in time.  Time in which the test stood still, as where its
            machine was paused, does not count.
    """
    waited, before = 0.0, time.monotonic()
    while True:
        value = condition()
        if value:
            return value
        if waited > timeout:
            raise TimeoutError(f"waited {timeout} s in vain for {what or condition}")
        meanwhile()
        now = time.monotonic()
        waited += min(now - before, _STOOD_STILL)
        before = now


@contextmanager
def own_domain() -> Iterator[int]:
    """A ROS domain id that no other test on this machine uses at the same time."""
    ids = list(range(1, 102))
    random.SystemRandom().shuffle(ids)
    for domain in ids:
        with Path(tempfile.gettempdir(), f"rebt_ros_test_domain_{domain}.lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield domain
            return
    raise RuntimeError("all ROS domains are in use")


def command_of(node: str) -> list[str]:
    """What starts a node of the checkout like its installed executable does."""
    blocking = ["/usr/bin/env", "--block-signal=INT,TERM"]
    return [*blocking, sys.executable, "-m", "rebt_ros.ros.entry", node]


class NodeProcess:
    """A node of the package in a process of its own.

    Args:
        module: Name of its module in `rebt_ros.ros`.
        domain: ROS domain id.
        directory: Its working directory; its logs and standard error go there.
        parameters: Values of its parameters.
        arguments: Further ROS arguments, such as remappings.
        command: What starts it; see `command_of`.  None for a process that starts in no time.
    """

    def __init__(
        self,
        module: str,
        domain: int,
        directory: Path,
        parameters: Mapping[str, object] | None = None,
        arguments: Sequence[str] = (),
        command: Sequence[str] | None = None,
    ) -> None:
        node = module.removesuffix("_node")
        words = ["--ros-args"]
        for name, value in (parameters or {}).items():
            words += ["-p", f"{name}:={_yaml(value)}"]
        words += arguments
        environment = dict(
            os.environ,
            ROS_DOMAIN_ID=str(domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
            ROS_LOG_DIR=str(directory / "log"),
            PYTHONPATH=os.pathsep.join([str(HOME), os.environ.get("PYTHONPATH", "")]),
        )
        environment.pop(prompt_answers.VARIABLE, None)
        self._errors = directory / f"{module}.{time.monotonic_ns()}.stderr"
        self.process: subprocess.Popen[bytes] | WarmProcess
        with self._errors.open("wb") as errors, open(os.devnull) as nothing:
            if command is None and can_start(environment):
                self.process = WarmProcess(
                    "rebt_ros.ros.entry",
                    [node, *words],
                    environment=environment,
                    directory=directory,
                    files=(nothing.fileno(), errors.fileno(), errors.fileno()),
                    session=True,
                    blocked=(signal.SIGINT, signal.SIGTERM),
                )
                return
            self.process = subprocess.Popen(
                [*(command or command_of(node)), *words],
                cwd=directory,
                env=environment,
                stdout=errors,
                stderr=errors,
                # So that all that it starts can be told from what others start.
                start_new_session=True,
            )

    @property
    def stderr(self) -> str:
        """What it has written to standard error so far."""
        return self._errors.read_text(errors="replace")

    def says(self, text: str) -> None:
        """Waits until it has logged the text."""
        wait_until(lambda: text in self.stderr or self.process.poll() is not None, what=repr(text))
        assert text in self.stderr, self.stderr

    def catches(self, number: int) -> None:
        """Waits until it has a handler for the signal."""
        wait_until(lambda: self._has("SigCgt", number), meanwhile=lambda: None)

    def hears(self, number: int) -> None:
        """Waits until the signal cannot end it any more: it is blocked, then caught.

        That takes the few milliseconds in which `env` starts.
        """
        wait_until(
            lambda: (
                self._has("SigBlk", number)
                or self._has("SigCgt", number)
                or self.process.poll() is not None
            ),
            meanwhile=lambda: None,
        )

    def _has(self, kind: str, number: int) -> int:
        """Whether a set of signals in proc(5) has the signal."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        line = next(one for one in status.splitlines() if kind in one)
        return int(line.split()[1], 16) >> (number - 1) & 1

    def stop(self, number: int = signal.SIGINT) -> int:
        """Sends a signal and waits for the end.

        Returns:
            The exit code.
        """
        self.process.send_signal(number)
        return self.process.wait(PATIENCE)

    def wait(self) -> int:
        """Waits for its end by itself; returns the exit code."""
        return self.process.wait(PATIENCE)

    def __enter__(self) -> NodeProcess:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Those who leave the graph in order leave no shared memory behind in the middle of a
        # message: Fast DDS has crashed in a test that closed its own node just after a kill.
        if self.process.poll() is None:
            self.process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(_LAST_WORDS)
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        if kind is not None:
            print(f"--- {self._errors.name}\n{self.stderr}")


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_yaml, value))}]"
    return f"'{value}'" if isinstance(value, (str, Path)) else str(value)


class Peer:
    """The test's own node: publishes, listens and calls services.

    A process may stand still for seconds while the others go on.  So nothing here takes it for
    granted that who is known knows us as well, or that what comes late was also sent late.

    Args:
        domain: ROS domain id.
    """

    def __init__(self, domain: int) -> None:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        prompt_answers.use()
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("test_peer", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Any] = {}
        self._latest: Any = None
        self._clients: dict[str, Any] = {}
        self.diagnostics: dict[str, Any] = {}
        """The latest status by the name of its source."""
        self.reported: dict[str, int] = {}
        """When that was sent, nanoseconds."""
        self.stamps: dict[str, int] = {}
        """What time it was for the source, which may use simulated time, nanoseconds."""
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._note, 10)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def spin_once(self) -> None:
        self._executor.spin_once(timeout_sec=0.02)

    def wait_until(
        self, condition: Callable[[], Any], timeout: float = PATIENCE, what: str = ""
    ) -> Any:
        """Takes messages until the condition holds, and returns its value."""
        return wait_until(condition, timeout, meanwhile=self.spin_once, what=what)

    def connect(self, kind: type, topic: str, qos: Any = 1000, subscribers: int = 1) -> Any:
        """A publisher that has subscribers."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(kind, topic, qos)
        publisher = self._publishers[topic]
        self.wait_until(
            lambda: publisher.get_subscription_count() >= subscribers,
            what=f"{subscribers} subscribers of {topic}",
        )
        return publisher

    def state(
        self, *values: float, topic: str = "state", labels: Sequence[str] = ()
    ) -> Float64MultiArray:
        message = Float64MultiArray(data=list(values))
        message.layout.dim = [MultiArrayDimension(label=label) for label in labels]
        self.publish(message, topic)
        return message

    def action(self, label: str, topic: str = "action") -> None:
        self.publish(String(data=label), topic)

    def publish(self, message: Any, topic: str) -> None:
        """Publishes what all subscribers receive after that which was published before.

        Within a topic that is so anyway.  Otherwise a subscriber that does not know of a publisher
        yet, or stands still, would take messages late, and those of another topic before them.
        """
        first = topic not in self._publishers
        publisher = self.connect(type(message), topic)
        if self._latest not in (None, publisher):
            _wait_for_delivery(self._latest)
        publisher.publish(message)
        self._latest = publisher
        if first:
            _wait_for_delivery(publisher)

    def deliver(self) -> None:
        """Waits until all subscribers have received what was published."""
        for publisher in self._publishers.values():
            _wait_for_delivery(publisher)

    def listen(self, kind: type, topic: str, qos: Any = 1000) -> list[Any]:
        """A list to which the messages of a topic are added."""
        heard: list[Any] = []
        self.node.create_subscription(kind, topic, heard.append, qos)
        self.wait_until(lambda: self.node.count_publishers(topic), what=f"a publisher of {topic}")
        return heard

    def introduce(self, node: str) -> None:
        """Waits until a node knows all that was opened here so far.

        A process learns of others' publishers, subscribers and clients in the order in which they
        were opened, so that it knows those before a client whose call it answers.
        """
        self.ask(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=[]))

    def ask(self, kind: Any, service: str, request: Any) -> Any:
        """Calls a service to which it makes no difference how often it is called.

        An answer is lost where the service does not know yet who asks, so it is asked again.
        """
        client = self.node.create_client(kind, service)
        self.wait_until(client.service_is_ready, what=service)
        end = time.monotonic() + PATIENCE
        while True:
            future = client.call_async(request)
            try:
                self.wait_until(future.done, 3.0, what=f"the answer of {service}")
            except TimeoutError:
                if time.monotonic() > end:
                    raise
            else:
                self.node.destroy_client(client)
                return future.result()

    def begin(self, service: str, data: bool | None = None) -> Any:
        """Calls a service of a node; returns the future of its answer."""
        kind = Trigger if data is None else SetBool
        if service not in self._clients:
            self._clients[service] = self.node.create_client(kind, service)
            self.introduce(service.rpartition("/")[0])
        client = self._clients[service]
        self.wait_until(client.service_is_ready, what=service)
        return client.call_async(kind.Request() if data is None else kind.Request(data=data))

    def call(self, service: str, data: bool | None = None, timeout: float = PATIENCE) -> Any:
        """Calls a service once what was published is delivered, and waits for its answer."""
        self.deliver()
        future = self.begin(service, data)
        self.wait_until(future.done, timeout, what=f"the answer of {service}")
        return future.result()

    def anew(self, source: str) -> Callable[[], Any]:
        """A condition: the status that a source sends from now on, of what is so by then."""
        now = time.time_ns()
        return lambda: self.diagnostics[source] if self.reported.get(source, 0) > now else None

    def _note(self, message: DiagnosticArray, info: Mapping[str, Any]) -> None:
        for status in message.status:
            self.diagnostics[status.name] = status
            self.reported[status.name] = info["source_timestamp"]
            self.stamps[status.name] = Time.from_msg(message.header.stamp).nanoseconds


def _wait_for_delivery(publisher: Any) -> None:
    """Waits until all subscribers have received what was published reliably."""
    publisher.wait_for_all_acked(Duration(seconds=PATIENCE))


def values_of(status: Any) -> dict[str, str]:
    """The values of a diagnostic status."""
    return {one.key: one.value for one in status.values}
