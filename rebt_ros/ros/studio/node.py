"""The studio: see, teach, choose and steer the learned tree in a browser."""

from __future__ import annotations

import getpass
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from rclpy.node import Node
from std_msgs.msg import String

from rebt_ros.demonstration.builder import is_label
from rebt_ros.errors import OptionError, RebtError
from rebt_ros.live.recording_session import NO_ROWS, NOT_HEARD
from rebt_ros.offline.rules_files import rules_for
from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Diagnostics, Level, Report
from rebt_ros.ros.studio.calls import CallError, Calls
from rebt_ros.ros.studio.publishing import Proposals
from rebt_ros.ros.studio.robot_watch import RobotWatch
from rebt_ros.ros.studio.server import Server
from rebt_ros.ros.studio.settings import declare_settings
from rebt_ros.studio.board import Board, Section
from rebt_ros.studio.curating import Curating
from rebt_ros.studio.explaining import Explaining
from rebt_ros.studio.shelf import Shelf
from rebt_ros.studio.timeline import Timeline
from rebt_ros.studio.verbs import Arguments, Reply, Verbs, reply
from rebt_ros.studio.workbench import Workbench

#: Between two looks at files (seconds).
_LOOK: Final = 1.0


class StudioNode(Node):
    """Serves the page, hears the robot, and calls recorder, learner and executor.

    Raises:
        RebtError: A parameter makes no sense, or the page cannot be served.
    """

    def __init__(self) -> None:
        super().__init__("studio")
        self._settings = settings = declare_settings(self)
        rules = rules_for(settings.rules_file)
        self._board = Board()
        self._timeline = Timeline()
        self._shelf = Shelf(settings.demonstrations)
        self._workbench = Workbench(self._board, settings.output, rules, settings.user or _login())
        self._explaining = Explaining(
            lambda: self._workbench.learning, lambda: self._workbench.published, self._timeline
        )
        self._calls = Calls(self)
        self._calls.prepare(
            [f"{settings.recorder}/record", f"{settings.executor}/enable"],
            [
                *(
                    f"{settings.recorder}/{name}"
                    for name in ("new_demonstration", "discard_demonstration", "failed")
                ),
                *(f"{settings.learner}/{name}" for name in ("relearn", "cancel", "rollback")),
            ],
        )
        self._proposals = Proposals(self, settings.learner)
        self._actions = {
            topic: self.create_publisher(String, topic, 10) for topic in settings.action_topics
        }
        self._watch = RobotWatch(
            self, settings, self._board, self._timeline, self._workbench.take_published
        )
        self._verbs: Verbs = {**self._steering(), **self._teaching(), **self._curating()}
        self._server = Server(self._board, self._ask, settings.host, settings.port)
        self._problem = ""
        self._ended = threading.Event()
        self._looking = threading.Thread(target=self._keep_looking, daemon=True, name="files")
        self._looking.start()
        self._diagnostics = Diagnostics(self, "serving", self._report)
        self.get_logger().info(f"open {self._server.access.url} in a browser.")
        self.get_logger().info(
            f"demonstrations are in {settings.demonstrations.absolute()}, what was learned in "
            f"{settings.output.absolute()}."
        )

    def close(self) -> None:
        """Ends the server."""
        self._ended.set()
        self._calls.close()
        self._proposals.close()
        self._server.close()

    # --- threads ---

    def _ask(self, request: Any) -> Reply:
        try:
            return reply(self._verbs, request)
        except Exception as err:
            # One request must not end the studio, and its browser must not wait for ever.
            self.get_logger().error(f"a request failed: {type(err).__name__}: {err}")
            return Reply(
                request.get("id") if isinstance(request, dict) else None,
                False,
                f"this failed, which is a mistake in rebt_ros ({type(err).__name__}: {err}): "
                "please report it, with the studio's log.",
            )

    def _keep_looking(self) -> None:
        """Looks at the files of recorder and learner."""
        while True:
            try:
                self._shelf.tidy()
                self._show_demonstrations()
                self._workbench.look()
                self._problem = ""
            except RebtError as err:
                self._problem = str(err).rstrip(".")
            except Exception as err:
                self._problem = f"a mistake in rebt_ros: {type(err).__name__}: {err}"
            if self._ended.wait(_LOOK):
                return

    def _show_demonstrations(self) -> None:
        views = self._shelf.views()
        self._board.replace(Section.DEMONSTRATIONS, views)
        channel = self._settings.action_topics[0] if self._settings.action_topics else "action"
        known = self._board.section(Section.ACTIONS)
        shown = dict.fromkeys(label for view in views.values() for label in view.get("actions", ()))
        self._watch.know_actions({label: channel for label in shown if label not in known})

    def _report(self) -> Report:
        values = {"browsers": self._server.browsers}
        if self._problem:
            return Report(Level.WARN, self._problem, values)
        return Report(Level.OK, "serving", values)

    # --- what browsers ask for ---

    def _steering(self) -> Verbs:
        """The robot, and what it does."""
        calls, settings = self._calls, self._settings
        return {
            "enable": self._enable,
            "act": self._act,
            "learn": lambda _: self._workbench.learn(
                lambda: calls.trigger(f"{settings.learner}/relearn", works=self._is_learning)
            ),
            "cancel": lambda _: calls.trigger(f"{settings.learner}/cancel"),
            "rollback": lambda _: calls.trigger(f"{settings.learner}/rollback"),
            "ping": lambda _: "",
            "moment": lambda asked: self._explaining.moment(asked.number("t")),
            "explain": self._explaining.explain,
            "branch": self._explaining.branch,
        }

    def _enable(self, asked: Arguments) -> str:
        on = asked.flag("on")
        answer = self._calls.switch(f"{self._settings.executor}/enable", on)
        if not on:
            return "the tree has stopped."
        condition = answer.removeprefix("enabled: ")
        return "the tree drives the robot." if condition == "running." else answer

    def _is_learning(self) -> bool:
        learner = self._board.section(Section.NODES).get("learner", {})
        stage: str = learner.get("values", {}).get("stage", "idle")
        return stage != "idle"

    def _teaching(self) -> Verbs:
        """Demonstrations."""
        calls, recorder = self._calls, self._settings.recorder
        return {
            "record": lambda asked: _nothing_to_keep(
                lambda: calls.switch(f"{recorder}/record", asked.flag("on")),
                "recording has stopped; nothing was recorded since the last demonstration.",
            ),
            "new_demonstration": lambda _: _nothing_to_keep(
                lambda: calls.trigger(f"{recorder}/new_demonstration"),
                "there is nothing new to keep: drive the robot through the task first.",
            ),
            "discard": lambda _: calls.trigger(f"{recorder}/discard_demonstration"),
            "failed": lambda _: calls.trigger(f"{recorder}/failed"),
            "leave_out": partial(self._on_shelf, self._shelf.leave_out),
            "take_in": partial(self._on_shelf, self._shelf.take_in),
            "delete": partial(self._on_shelf, self._shelf.delete),
            "restore_demonstration": partial(self._on_shelf, self._shelf.restore),
            "trim": lambda asked: self._on_shelf(
                lambda name: self._shelf.trim(name, asked.number("from"), asked.number("to")), asked
            ),
            "split": lambda asked: self._on_shelf(
                lambda name: self._shelf.split(name, asked.number("at")), asked
            ),
        }

    def _curating(self) -> Verbs:
        """The draft."""
        bench, publish = self._workbench, self._proposals.publish
        return {
            **Curating(bench).verbs(),
            "undo": lambda _: bench.undo(),
            "redo": lambda _: bench.redo(),
            "reset": lambda _: bench.reset(),
            "rename": lambda asked: bench.rename(asked.text("name"), asked.text("shown")),
            "publish": lambda asked: bench.publish(publish, asked.optional_text("note")),
            "restore": lambda asked: bench.publish_version(publish, asked.text("version")),
        }

    def _act(self, asked: Arguments) -> str:
        label = asked.text("label")
        if not is_label(label):
            raise OptionError(f"{label!r} is no label of an action.")
        known = self._board.section(Section.ACTIONS).get(label)
        topic = known["topic"] if known else next(iter(self._actions), None)
        if topic not in self._actions:
            raise OptionError("there is no topic for actions: set the parameter 'action_topics'.")
        self._actions[topic].publish(String(data=label))
        return f"{label} on {topic}."

    def _on_shelf(self, change: Callable[[str], str], asked: Arguments) -> str:
        name = asked.text("name")
        writing = self._board.section(Section.NODES).get("recorder", {}).get("values", {})
        if f"{name}." in writing.get("demonstration", ""):
            raise OptionError(
                f"{name} is being recorded: end it first, with a new demonstration or by stopping."
            )
        sentence = change(name)
        self._show_demonstrations()
        return sentence


def _nothing_to_keep(end: Callable[[], str], sentence: str) -> str:
    """Ends a demonstration: that it has no rows is no fault, unless the recorder hears nothing."""
    try:
        return end()
    except CallError as err:
        if NO_ROWS in str(err) and NOT_HEARD not in str(err):
            return sentence
        raise


def _login() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "somebody"


def main(args: list[str] | None = None) -> None:
    """Runs the studio."""
    lifetime.run(StudioNode, args)


if __name__ == "__main__":
    main()
