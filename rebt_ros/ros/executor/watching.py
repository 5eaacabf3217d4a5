"""Programs that watch the tree while it runs: Groot2's monitor, Foxglove, and logs for Groot2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node

from rebt_ros.export.watched import WatchedTree
from rebt_ros.live.btlogs import BtLogs
from rebt_ros.live.groot2_server import Groot2Server
from rebt_ros.ros.executor.settings import WatchingSettings
from rebt_ros.ros.executor.status_topics import StatusTopics


class Watching:
    """Tells everyone who watches what the tree does; nothing here waits for anyone.

    Args:
        node: What publishes for those who watch topics.
        settings: Who watches.

    Raises:
        OptionError: Groot2 cannot be answered: pyzmq is missing, or the port is taken.
    """

    def __init__(self, node: Node, settings: WatchingSettings) -> None:
        self._server = Groot2Server(settings.groot2_port) if settings.groot2_port else None
        self._logs = BtLogs(settings.btlog_directory) if settings.btlog_directory else None
        self._topics = StatusTopics(node) if settings.topics else None
        self._tree: WatchedTree | None = None
        self._unseen = False

    def show(self, tree: WatchedTree | None) -> None:
        """Another tree runs; None for one that is too large to be watched."""
        self._tree = tree
        self._unseen = tree is None
        if self._server is not None:
            self._server.answers.show(tree)
        if self._topics is not None:
            self._topics.show(tree)

    def tick(self, outcomes: Mapping[int, str], state: Sequence[float]) -> None:
        """The tree was ticked.

        Args:
            outcomes: From `TreeRuntime.outcomes`.
            state: The values of the features.
        """
        if self._server is not None:
            self._server.answers.tick(outcomes, state)
        if self._logs is not None and self._tree is not None:
            self._logs.tick(self._tree, outcomes)
        if self._topics is not None:
            self._topics.tick(outcomes)

    def rest(self) -> None:
        """The tree was halted."""
        if self._server is not None:
            self._server.answers.rest()
        if self._logs is not None and self._tree is not None:
            self._logs.tick(self._tree, {})
        if self._topics is not None:
            self._topics.tick({})

    def close(self) -> None:
        """Ends the logs and answers nobody any more; waits ten seconds at most for a disk."""
        if self._server is not None:
            self._server.close()
        if self._logs is not None:
            self._logs.close()

    @property
    def values(self) -> dict[str, Any]:
        """What /diagnostics says of it; nothing where nobody may watch."""
        values: dict[str, Any] = {}
        if self._server is not None:
            values["groot2"] = f"127.0.0.1:{self._server.port}"
            values["bad groot2 requests"] = self._server.answers.bad_requests
        if self._logs is not None:
            values["ticks missing in btlogs"] = self._logs.lost
        if self._topics is not None:
            values["statuses on"] = self._topics.where
        return values

    @property
    def problems(self) -> list[str]:
        """What keeps it from being seen."""
        problems = []
        if self._unseen and (self._server or self._logs or self._topics):
            problems.append("the tree is too large to be watched")
        if self._logs is not None and self._logs.fault:
            problems.append(f"no log is written: {self._logs.fault.rstrip('.')}")
        return problems
