"""The tree's hands on the robot: when it is ticked, when it rests, and what comes of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Protocol

from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.export.watched import WatchedTree
from rebt_ros.live.last_tick import LastTick
from rebt_ros.live.novelty_guard import NoveltyGuard
from rebt_ros.live.takeover import Takeover
from rebt_ros.ros.command_channels import CommandChannels
from rebt_ros.ros.diagnostics import Faults
from rebt_ros.ros.executor.settings import ExecutorSettings
from rebt_ros.ros.executor.tick_clock import TickClock
from rebt_ros.ros.executor.tree_program import TreeProgram

#: What states outside what was shown are counted as.
NOVEL: Final = "states outside what was shown"


class Watcher(Protocol):
    """Is told what runs, and what it does; see `Watching`."""

    def show(self, tree: WatchedTree | None) -> None:
        """Another tree runs."""

    def tick(self, outcomes: Mapping[int, str], state: Sequence[float]) -> None:
        """The tree was ticked."""

    def rest(self) -> None:
        """The tree was halted."""


class Driving:
    """Ticks the tree while it is enabled and nothing speaks against it.

    What does: a state that is not fresh, a person who has taken over, and, where that is asked
    for, a state outside what was shown.

    Args:
        settings: The executor's parameters.
        clock: Tells the time.
        channels: Carries out what the tree commands.
        histories: What was taken on each channel, by whatever tree or person.
        faults: Told of states outside what was shown.
        say: Told whether the robot is in the tree's hands, whenever that changes.
        watching: Told what runs, and what it does.
    """

    def __init__(
        self,
        settings: ExecutorSettings,
        clock: TickClock,
        channels: CommandChannels,
        histories: dict[str, ActionHistory],
        faults: Faults,
        say: Callable[[bool], None],
        watching: Watcher,
    ) -> None:
        self._clock = clock
        self._channels = channels
        self._histories = histories
        self._faults = faults
        self._say = say
        self._watching = watching
        self._said: bool | None = None
        self._halt_action = settings.halt_action
        self._guard = NoveltyGuard(settings.novelty.mode)
        self._takeover = Takeover(settings.takeover.timeout)
        self._resting = True
        # Whether the robot may still do what it was told last, by the tree or by a person.
        self._moving = False
        self.enabled = settings.enabled
        """Whether the tree may command the robot."""
        self.program: TreeProgram | None = None
        """What is ticked."""
        self.last_tick: LastTick | None = None
        """What was done last, and why."""
        self.ticks = 0
        """How often the tree was ticked."""
        self.commands = 0
        """How many commands went out."""
        self.longest = 0.0
        """The longest tick since someone set this to zero (seconds)."""

    # --- what runs ---

    def take(self, program: TreeProgram) -> TreeProgram | None:
        """Takes a tree into use; the action that runs is interrupted, the history goes on.

        Returns:
            What ran before.

        Raises:
            DocumentError: A channel's name cannot be part of a topic's name.
        """
        self.interrupt()
        self._guard.release()
        self._channels.follow(program.channels)
        before, self.program = self.program, program
        self._watching.show(program.watched)
        return before

    def enable(self) -> None:
        """Lets the tree command the robot."""
        if not self.enabled:
            # Nothing was done before it, as in a demonstration's first row.
            for history in self._histories.values():
                history.clear()
        self.enabled = True
        self._guard.release()
        self.tell()

    def disable(self) -> None:
        """Halts tree and robot."""
        # A person who drives goes on to do so.
        self._moving = self._moving and not self._person_drives
        self._rest()
        self.enabled = False
        self.tell()

    def close(self) -> None:
        """Interrupts what runs."""
        self.enabled = False
        self.interrupt()

    # --- persons ---

    @property
    def takeovers(self) -> int:
        """How often a person has taken over."""
        return self._takeover.count

    def hand_over(self) -> bool:
        """A person has done something.

        Returns:
            Whether the tree's hands are off the robot with it.
        """
        begins = self._takeover.note(self._clock.now())
        interrupted = begins and self.enabled and self.program is not None
        if interrupted:
            self.interrupt()
            self._channels.rest()
            self._guard.release()
        self._moving = self.enabled and self.program is not None
        self.tell()
        return interrupted

    def did(self, channel: str, label: str) -> None:
        """A person has taken an action."""
        self._histories.setdefault(channel, ActionHistory()).take(label)

    @property
    def _person_drives(self) -> bool:
        return self._takeover.lasts(self._clock.now())

    # --- ticks ---

    def tick(self) -> None:
        """Ticks the tree, unless something speaks against it."""
        program, now = self.program, self._clock.now()
        if program is None or not self.enabled or self._takeover.lasts(now):
            return
        self.tell()
        if program.inputs.stale(now) or not self._is_familiar(program):
            self._rest()
            return
        began = time.perf_counter()
        self._resting = False
        self._moving = True
        self._channels.begin_tick()
        state = program.inputs.state()
        commands = program.runtime.tick(state).commands
        self.commands += self._channels.send(commands)
        # The robot waits for its command, and nobody for this.
        self.last_tick = LastTick(program.learned, tuple(state), program.runtime.outcomes())
        self._watching.tick(self.last_tick.outcomes, self.last_tick.values)
        self.ticks += 1
        self.longest = max(self.longest, time.perf_counter() - began)

    def set_back(self) -> None:
        """The clock was set back: what was received then is not from now, and thus stale."""
        if self.program is not None:
            self.program.inputs.forget()
        self._takeover.restart(self._clock.now())
        # Time may stand still now, and the next tick be far away.
        if self.enabled and not self._person_drives:
            self._rest()

    def interrupt(self) -> None:
        """Halts the tree."""
        if self.program is not None and not self._resting:
            self._channels.begin_tick()
            self.program.runtime.halt()
            self.program.inputs.reset()
            self._watching.rest()
        self._resting = True

    def _is_familiar(self, program: TreeProgram) -> bool:
        if self._guard.holding:
            return False
        familiar = self._guard.passes(program.novelty, program.inputs.values)
        if self._guard.departure is not None:
            held = "" if familiar else ": the robot is held until a person takes over"
            self._faults.note(
                NOVEL, f"the state is outside what was shown{held}: {self._guard.departure}."
            )
        return familiar

    def _rest(self) -> None:
        """Halts the tree, and the robot; what is commanded next is sent, be it what was last."""
        self.interrupt()
        self._channels.rest()
        if self._moving:
            self._channels.stop()
        if self._moving and self._halt_action:
            self._channels.send_to_all(self._halt_action)
            for history in self._histories.values():
                # LAT knows of it.  The previous action stays: the tree goes on with what it did.
                history.begin(self._halt_action)
        self._moving = False

    # --- what it says ---

    @property
    def novelty(self) -> str:
        """How the state differs from what was shown; empty where it does not."""
        return str(self._guard.departure or "")

    def tell(self) -> None:
        """Tells others, above all the recorder, whether the robot is in the tree's hands."""
        ready = self.enabled and self.program is not None
        driving = ready and not self._person_drives
        if driving != self._said:
            self._said = driving
            self._say(driving)

    def stale(self) -> dict[str, str]:
        """The tree's topics without a fresh message, and the age of their last one, in words."""
        return {} if self.program is None else self.program.inputs.stale(self._clock.now())

    def condition(self) -> str:
        """What the tree does, or what it waits for."""
        if not self.enabled:
            return "disabled"
        if self._clock.stands:
            return "waiting for /clock"
        if self._person_drives:
            return "paused: a person has taken over"
        stale = self.stale()
        if stale:
            ages = ", ".join(f"{topic} ({age})" for topic, age in stale.items())
            return f"waiting for state: {ages}"
        if self._guard.holding:
            return f"held until a person takes over: {self._guard.departure}"
        return "running"
