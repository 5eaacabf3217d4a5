"""A differential-drive robot with range sensors, a battery and wheels that know a few words."""

from __future__ import annotations

import math
import random
from enum import StrEnum
from typing import Final, NamedTuple

from rebt_ros.simulated_robot.world import Point, World

#: Seconds of a time step at the usual 20 Hz.
TIME_STEP = 0.05

#: Charge below which the robot's target is the dock.
LOW_BATTERY = 0.35

#: Largest speed of the robot, m/s, and of its turns, rad/s.
SPEED: Final = 1.0
TURN_RATE: Final = 1.0

#: Of its hull, m.
RADIUS: Final = 0.2
_GOAL_RADIUS = 0.5
_DOCK_RADIUS = 0.5
_LONGEST_RANGE = 4.0

# Battery, in full charges per second.
_DRAIN = 0.015
_CHARGE = 0.1

#: Half the width of the front sensor's cone; the side sensors go on from there to 90 degrees.
_FRONT = math.radians(30.0)
_SIDE = math.radians(90.0)


class Action(StrEnum):
    """The words that the robot obeys; it stops at any other."""

    GO = "go"
    TURN_LEFT = "turn_left"
    TURN_RIGHT = "turn_right"
    CHARGE = "charge"


class Velocity(NamedTuple):
    """How fast the robot is to drive, as far as it can."""

    linear: float
    """Straight ahead, m/s."""
    angular: float
    """To the left, rad/s."""


STANDING: Final = Velocity(0.0, 0.0)

#: What the words mean that move the robot.
VELOCITIES: Final = {
    Action.GO: Velocity(SPEED, 0.0),
    Action.TURN_LEFT: Velocity(0.0, TURN_RATE),
    Action.TURN_RIGHT: Velocity(0.0, -TURN_RATE),
}


class State(NamedTuple):
    """What the robot measures."""

    left: float
    """Free meters between 30 and 90 degrees to the left, up to 4."""
    front: float
    """Free meters within 30 degrees of its heading, up to 4."""
    right: float
    """Free meters between 30 and 90 degrees to the right, up to 4."""
    target_bearing: float
    """Radians from its heading to where it has to go, -pi..pi, positive to the left.

    That is the charging dock while the battery is low, else the goal.
    """
    battery: float
    """Charge, 0 (empty) to 1."""
    docked: float
    """1 on the charging dock, else 0."""


class Robot:
    """A robot that turns on the spot and drives straight ahead.

    Driving and turning drain the battery, except on the dock, which feeds the motors.

    Args:
        world: The room it stands in.
        start: Number of its start, at least 0.  At every third one, from 0 on, the battery is so
            low that the robot has to charge first.
    """

    def __init__(self, world: World, start: int = 0) -> None:
        self.world = world
        self.begin(start)

    def begin(self, start: int) -> None:
        """Puts the robot at a start."""
        if start < 0:
            raise ValueError(f"a start is at least 0, not {start}")
        source = random.Random(start)
        self.start = start
        self.position = self._free_position(source)
        self.heading = source.uniform(-math.pi, math.pi)
        self.battery = source.uniform(0.2, 0.3) if start % 3 == 0 else source.uniform(0.6, 1.0)
        self.bumps = 0
        self.velocity = STANDING
        """How fast it has driven in the last time step."""
        self._touching = False

    @property
    def reached(self) -> bool:
        """Whether it is at the goal."""
        return self.position.distance(self.world.goal) <= _GOAL_RADIUS

    @property
    def docked(self) -> bool:
        """Whether it is on the charging dock."""
        return self.position.distance(self.world.dock) <= _DOCK_RADIUS

    @property
    def target(self) -> Point:
        """Where it has to go."""
        return self.world.dock if self.battery < LOW_BATTERY else self.world.goal

    @property
    def bearing(self) -> float:
        """Radians from its heading to its target, -pi..pi, positive to the left."""
        return _wrapped(self.position.direction(self.target) - self.heading)

    @property
    def state(self) -> State:
        """What it measures now."""
        return State(
            self._free(_FRONT, _SIDE),
            self._free(-_FRONT, _FRONT),
            self._free(-_SIDE, -_FRONT),
            self.bearing,
            self.battery,
            float(self.docked),
        )

    def step(self, command: str | Velocity | None, seconds: float = TIME_STEP) -> None:
        """Obeys for a time step; without a word that it knows, and without charge, it stands."""
        self.velocity = STANDING
        if self.battery <= 0 and not self.docked:
            return
        if command == Action.CHARGE:
            self.battery = min(self.battery + _CHARGE * seconds * self.docked, 1.0)
            return
        if isinstance(command, Velocity):
            self._drive(*command, seconds)
        elif command in VELOCITIES:
            self._drive(*VELOCITIES[Action(command)], seconds)

    def _drive(self, linear: float, angular: float, seconds: float) -> None:
        linear, angular = _bounded(linear, SPEED), _bounded(angular, TURN_RATE)
        if not (linear or angular):
            return
        self.velocity = Velocity(linear, angular)
        if not self.docked:
            self.battery = max(self.battery - _DRAIN * seconds, 0.0)
        if linear:
            self._go(linear * seconds)
        if angular:
            self.heading = _wrapped(self.heading + angular * seconds)

    def _go(self, distance: float) -> None:
        ahead = Point(
            self.position.x + distance * math.cos(self.heading),
            self.position.y + distance * math.sin(self.heading),
        )
        blocked = self.world.clearance(ahead) < RADIUS
        if not blocked:
            self.position = ahead
        elif not self._touching:
            self.bumps += 1
        self._touching = blocked

    def _free(self, first: float, last: float) -> float:
        """What a range sensor measures between two directions, relative to the heading."""
        nearest = self.world.nearest(self.position, self.heading + first, self.heading + last)
        return min(max(nearest - RADIUS, 0.0), _LONGEST_RANGE)

    def _free_position(self, source: random.Random) -> Point:
        """A place that is free to turn at, and not already at the goal."""
        while True:
            place = Point(source.uniform(0, self.world.size), source.uniform(0, self.world.size))
            if self.world.clearance(place) > 0.6 and place.distance(self.world.goal) > 3.0:
                return place


def _bounded(value: float, largest: float) -> float:
    """The value within -largest..largest; 0 where it is no number."""
    return 0.0 if math.isnan(value) else min(max(value, -largest), largest)


def _wrapped(angle: float) -> float:
    """The same direction in -pi..pi."""
    return math.remainder(angle, 2 * math.pi)
