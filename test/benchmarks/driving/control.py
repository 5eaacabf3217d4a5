"""Gymnasium's classic control tasks, with scripted experts."""

from __future__ import annotations

import warnings
from typing import Any, ClassVar

import gymnasium

from driving.task import State


class Control:
    """An environment of numbers; episodes end here as the task says, not as gymnasium does."""

    environment: ClassVar[str]
    """Name without a version: the newest one is taken."""
    actions: ClassVar[tuple[str, ...]]
    """In the order of the environment's numbers."""
    needs_memory = False
    most_steps: ClassVar[int]

    def __init__(self) -> None:
        self.world: Any = newest(self.environment)

    def reset(self, seed: int) -> State:
        self.observed, _ = self.world.reset(seed=seed)
        self._steps, self._total, self._ended = 0, 0.0, False
        return self._state

    @property
    def _state(self) -> State:
        return tuple(map(float, self.observed))

    def step(self, action: str) -> State:
        number = self.actions.index(action)
        self.observed, reward, self._ended, _, _ = self.world.step(number)
        self._steps += 1
        self._total += float(reward)
        return self._state

    @property
    def over(self) -> bool:
        return self._ended or self._steps >= self.most_steps

    @property
    def success(self) -> bool:
        """Most of these tasks end when they are done."""
        return self._ended


def newest(name: str, **options: Any) -> Any:
    """The newest version of an environment, bare: without a limit of time and without checks."""
    with warnings.catch_warnings():
        # That it is the newest version.
        warnings.simplefilter("ignore")
        return gymnasium.make(name, disable_env_checker=True, **options).unwrapped


class CartPole(Control):
    """Keeps a pole upright on a cart for 500 steps."""

    name, environment = "cartpole", "CartPole"
    features = ("position", "velocity", "angle", "spin")
    actions = ("left", "right")
    most_steps = 500

    @property
    def success(self) -> bool:
        return not self._ended and self._steps >= self.most_steps

    def expert(self) -> str:
        position, velocity, angle, spin = self.observed
        falls = angle + 0.5 * spin + 0.06 * position + 0.12 * velocity
        return "right" if falls > 0 else "left"


class MountainCar(Control):
    """Swings a weak car out of a valley within 200 steps."""

    name, environment = "mountaincar", "MountainCar"
    features = ("position", "velocity")
    actions = ("left", "none", "right")
    most_steps = 200

    def expert(self) -> str:
        """Rests at the bottom for a step, and pushes where it rolls."""
        velocity = self.observed[1]
        if velocity == 0:
            return "none"
        return "right" if velocity > 0 else "left"


class Acrobot(Control):
    """Swings a double pendulum up, by its elbow, within 200 steps."""

    name, environment = "acrobot", "Acrobot"
    features = ("cos_1", "sin_1", "cos_2", "sin_2", "spin_1", "spin_2")
    actions = ("back", "none", "forth")
    most_steps = 200

    def expert(self) -> str:
        """Bends against the upper arm's swing, which feeds it."""
        return "back" if self.observed[4] > 0 else "forth"
