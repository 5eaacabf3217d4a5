"""The paper's agent-based simulation (IV-A): a behavior tree acts in a random environment.

At each step all environment variables take new values, uniform in [0, 1], and the tree is ticked
once.  An action that has been tried returns RUNNING with some chance, and nothing is logged; else
it is logged with what it returned and the environment of that moment.

Choices that the paper leaves open are those of its authors' simulator: Sequences have memory, a
Parallel/Selector node runs as a Parallel, a Parallel does not tick a child again that has succeeded
while others run, and a Repeater goes through its children three times.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import NamedTuple, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL, Demonstration
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import OptionError
from rebt_ros.study.simulator.configuration import Act, Check, ExperimentConfig
from rebt_ros.study.simulator.ticking import Outcome, ticker

#: The paper's settings (IV-B; repeats: its authors' simulator).
TICKS = 20_000
RUNNING_CHANCE = 0.4
REPEATS = 3

#: Simulated time from one tick to the next, in nanoseconds; the first tick is at this time.
TICK_PERIOD = 100_000_000

#: The only environment variable of a robot whose configuration has no conditions.
UNREAD_VARIABLE = "/unread"

_SUCCESS, _FAILURE, _RUNNING = Outcome.SUCCESS, Outcome.FAILURE, Outcome.RUNNING


class LoggedAction(NamedTuple):
    """An action that is done."""

    label: str
    succeeded: bool


#: Gets the stamp of a tick (nanoseconds), the environment's values, and the actions that are done.
Watch: TypeAlias = Callable[[int, tuple[float, ...], Sequence[LoggedAction]], None]


class ExperimentBody:
    """Senses and acts by chance.

    Args:
        variables: The environment variables.
        seed: Determines every draw, on every version of Python; any text.
        running_chance: Probability that a tried action returns RUNNING, in [0, 1).
    """

    def __init__(self, variables: tuple[str, ...], seed: str, running_chance: float) -> None:
        if not 0 <= running_chance < 1:
            raise OptionError(
                f"the running chance is {running_chance:g}: it must be at least 0 and below 1."
            )
        self.environment = dict.fromkeys(variables, 0.0)
        """The variables' values."""
        self.log: list[LoggedAction] = []
        """Actions done since the environment changed, in order."""
        self._running_chance = running_chance
        # Streams of their own: the environment does not depend on what the tree does.
        self._draw_value = Random(f"{seed} environment").random
        self._draw_chance = Random(f"{seed} chance").random

    def change_environment(self) -> None:
        """Draws new values and begins a new log."""
        draw, environment = self._draw_value, self.environment
        for variable in environment:
            environment[variable] = draw()
        self.log.clear()

    def sense(self, check: Check) -> bool:
        """What the check says, which is right with its probability."""
        below = self.environment[check.variable] < check.threshold
        if check.p_correct < 1 and self._draw_chance() >= check.p_correct:
            return not below
        return below

    def attempt(self, act: Act) -> Outcome:
        """Tries the action; logs it if it is done."""
        if self._draw_chance() < self._running_chance:
            return _RUNNING
        succeeded = act.p_success == 1 or self._draw_chance() < act.p_success
        self.log.append(LoggedAction(act.label, succeeded))
        return _SUCCESS if succeeded else _FAILURE


class ExperimentRobot:
    """A robot that acts as a configuration says.

    The draws follow from the seed and the configuration's name, so that simulations of a hundred
    configurations with one seed are independent of each other.

    Args:
        config: Its behavior tree.
        seed: Equal numbers give equal robots.
        running_chance: Probability that a tried action returns RUNNING, in [0, 1).
        repeats: How often Repeaters run their children, at least once.
        variables: Environment variables, those that the configuration reads among them; by default
            only these.

    Raises:
        OptionError: A setting makes no sense.
    """

    def __init__(
        self,
        config: ExperimentConfig,
        seed: int,
        *,
        running_chance: float = RUNNING_CHANCE,
        repeats: int = REPEATS,
        variables: tuple[str, ...] | None = None,
    ) -> None:
        self.config = config
        self.variables = config.variables if variables is None else variables
        missing = sorted(set(config.variables) - set(self.variables))
        if missing:
            raise OptionError(
                f"{config.name} reads the variable {missing[0]!r}: name it among the variables."
            )
        if repeats < 1:
            raise OptionError(f"repeats is {repeats}: it must be at least 1.")
        self._body = ExperimentBody(self.variables, f"{seed} {config.name}", running_chance)
        self._root = ticker(config.root, self._body, repeats)

    @property
    def state(self) -> tuple[float, ...]:
        """The environment's values, in the order of `variables`."""
        return tuple(self._body.environment.values())

    def step(self) -> list[LoggedAction]:
        """Changes the environment and ticks the tree once.

        Returns:
            The actions that are done, in order; valid until the next step.
        """
        self._body.change_environment()
        self._root.tick()
        return self._body.log


def published_variables(config: ExperimentConfig) -> tuple[str, ...]:
    """The variables of a robot that others learn from: a state needs at least one."""
    return config.variables or (UNREAD_VARIABLE,)


@dataclass(frozen=True, eq=False, slots=True)
class SimulatedRun:
    """What a simulation logged."""

    demonstration: Demonstration
    """One row per action that was done; its features are the environment variables, and its stamp
    is the simulated time of the tick."""
    succeeded: BoolArray
    """Whether each row's action returned success, shape (rows,)."""
    ticks: int


def simulate(
    robot: ExperimentRobot,
    ticks: int = TICKS,
    progress: Callable[[float], None] | None = None,
    watch: Watch | None = None,
) -> SimulatedRun:
    """Lets a robot act for a number of ticks.

    The outcome of an action and the clock are no features: they are known only afterwards.

    Args:
        robot: Fresh, or from where it stands.
        ticks: At least 1.
        progress: Called now and then with the share that is done.
        watch: Called at every tick, also where no action is done.

    Raises:
        OptionError: No ticks.
    """
    if ticks < 1:
        raise OptionError(f"ticks is {ticks}: simulate at least 1.")
    code = {label: position for position, label in enumerate(robot.config.actions)}
    stamps, chosen, succeeded, values = array("q"), array("q"), array("b"), array("d")
    for tick in range(ticks):
        done = robot.step()
        if done:
            state = robot.state
            stamp = (tick + 1) * TICK_PERIOD
            for label, success in done:
                stamps.append(stamp)
                chosen.append(code[label])
                succeeded.append(success)
                values.extend(state)
        if watch is not None:
            watch((tick + 1) * TICK_PERIOD, robot.state, done)
        if progress is not None and tick % 1000 == 0:
            progress(tick / ticks)
    rows = len(stamps)
    # Labels that never occurred leave no gap.
    occurring, positions = np.unique(np.frombuffer(chosen, dtype=np.int64), return_inverse=True)
    demonstration = Demonstration(
        robot.config.name,
        tuple(Feature(variable) for variable in robot.variables),
        np.frombuffer(values).reshape(rows, len(robot.variables)),
        np.frombuffer(stamps, dtype=np.int64),
        tuple(robot.config.actions[one] for one in occurring),
        positions.astype(np.int64),
        (DEFAULT_CHANNEL,),
        np.zeros(rows, dtype=np.int64),
    )
    return SimulatedRun(demonstration, np.frombuffer(succeeded, dtype=np.bool_), ticks)
