"""Actions that take time: they run until the robot says how they ended."""

from __future__ import annotations

from py_trees.common import Status

from rebt_ros.behavior_tree import nodes

_RESULTS = {"success": Status.SUCCESS, "failure": Status.FAILURE}


class ActionResults:
    """A commander whose actions end with the result that the robot reports."""

    def __init__(self) -> None:
        self._running: nodes.Action | None = None
        self._result: Status | None = None
        self._updated = False
        self.started = False
        """Whether this tick began an action, also one that has just ended."""

    def begin_tick(self) -> None:
        """Must be called before each tick of the tree."""
        self._updated = self.started = False

    def update(self, action: nodes.Action) -> Status:
        """Running until there is a result.

        Where another action runs in this tick, as under a Parallel, it waits for the channel.
        """
        if self._updated and self._running not in (None, action):
            return Status.RUNNING
        self._updated = True
        if action != self._running:
            self._running, self._result, self.started = action, None, True
        if self._result is None:
            return Status.RUNNING
        result = self._result
        self._running = self._result = None
        return result

    def halt(self, action: nodes.Action) -> None:
        """Stops waiting, unless another node of the tree goes on with the same action."""
        if action == self._running and not self._updated:
            self._running = self._result = None

    def report(self, text: str) -> bool:
        """Takes a result, "success" or "failure", led by "label:" where it names its action.

        Capitals do not matter.
        Results that come while nothing runs, or for an action that does not run any longer, have
        no effect.

        Returns:
            Whether the text is a result at all.
        """
        label, _, word = text.rpartition(":")
        result = _RESULTS.get(word.strip().lower())
        if self._running is not None and label.strip() in ("", self._running.label):
            self._result = result or self._result
        return result is not None
