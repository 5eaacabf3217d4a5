"""The room that the robot drives in, and the distances that can be measured in it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Point:
    """A place in the room, meters from its lower left corner."""

    x: float
    y: float

    def distance(self, other: Point) -> float:
        """Meters between two places."""
        return math.hypot(other.x - self.x, other.y - self.y)

    def direction(self, other: Point) -> float:
        """Heading from here to the other place, radians in -pi..pi."""
        return math.atan2(other.y - self.y, other.x - self.x)


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A round thing that stands in the way."""

    center: Point
    radius: float
    """Meters."""


@dataclass(frozen=True, slots=True)
class World:
    """A square room with everything in it that does not move.

    Raises:
        ValueError: The goal or the dock is not in the free part of the room.
    """

    size: float
    """Length of a wall, meters."""
    obstacles: tuple[Obstacle, ...]
    goal: Point
    dock: Point

    def __post_init__(self) -> None:
        for name, place in (("goal", self.goal), ("dock", self.dock)):
            if self.clearance(place) <= 0:
                raise ValueError(f"the {name} at {place} is inside an obstacle or a wall")

    def clearance(self, place: Point) -> float:
        """Meters to the nearest wall or obstacle; negative inside of one."""
        walls = min(place.x, place.y, self.size - place.x, self.size - place.y)
        return min(
            walls,
            *(place.distance(obstacle.center) - obstacle.radius for obstacle in self.obstacles),
            math.inf,
        )

    def nearest(self, place: Point, first: float, last: float) -> float:
        """Meters to the nearest thing that a sensor sees in its cone.

        It is exact: a wall or an obstacle is nearest straight ahead of it, or at the border of the
        cone.  A fan of rays instead would let the distance jump while the robot turns.

        Args:
            place: Where the sensor is, in the free part of the room.
            first: Right border of the cone, as a heading in radians.
            last: Left border; at most pi more than the right one.
        """
        straight = [place.direction(obstacle.center) for obstacle in self.obstacles] + _WALLS
        inside = [one for one in straight if (one - first) % math.tau < last - first]
        return min(self._ray(place, heading) for heading in (first, last, *inside))

    def _ray(self, place: Point, heading: float) -> float:
        """Meters to what a ray hits first."""
        cosine, sine = math.cos(heading), math.sin(heading)
        hit = min(_until_wall(place.x, cosine, self.size), _until_wall(place.y, sine, self.size))
        for obstacle in self.obstacles:
            x, y = obstacle.center.x - place.x, obstacle.center.y - place.y
            along, across = x * cosine + y * sine, x * sine - y * cosine
            if along > 0 and abs(across) < obstacle.radius:
                hit = min(hit, along - math.sqrt(obstacle.radius**2 - across**2))
        return hit


#: Headings straight towards the four walls.
_WALLS = [0.0, math.pi / 2, math.pi, -math.pi / 2]


def _until_wall(position: float, slope: float, size: float) -> float:
    """Length of a ray until one coordinate leaves 0..size."""
    if abs(slope) < 1e-12:
        return math.inf
    return (size - position if slope > 0 else -position) / slope


def furnished_room() -> World:
    """The room of the demo, 10 m by 10 m, with wide gaps between the obstacles."""
    return World(
        size=10.0,
        obstacles=(
            Obstacle(Point(2.5, 2.5), 0.6),
            Obstacle(Point(2.4, 7.2), 0.7),
            Obstacle(Point(7.5, 2.6), 0.6),
            Obstacle(Point(6.6, 6.4), 0.7),
            Obstacle(Point(0.2, 4.9), 0.6),
            Obstacle(Point(9.9, 5.0), 0.6),
        ),
        goal=Point(8.4, 8.4),
        dock=Point(4.7, 4.7),
    )
