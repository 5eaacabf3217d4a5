"""What a laser scanner on the robot measures, beam by beam."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rebt_ros.arrays import FloatArray
from rebt_ros.simulated_robot.world import Point, World

#: Beams, from 90 degrees to the right to 90 degrees to the left, every 1.5 degrees.
BEAMS: Final = 121
FIRST_ANGLE: Final = -math.pi / 2
ANGLE_STEP: Final = math.pi / (BEAMS - 1)

#: Meters from the middle of the robot.
SHORTEST_RANGE: Final = 0.05
LONGEST_RANGE: Final = 4.2

#: A beam that meets a surface at less than 10 degrees comes back too weak to measure.
_LEAST_SINE: Final = math.sin(math.radians(10.0))

_ANGLES: Final = FIRST_ANGLE + ANGLE_STEP * np.arange(BEAMS)


def ranges(world: World, place: Point, heading: float) -> FloatArray:
    """The distances along the beams.

    Args:
        world: The room.
        place: Where the scanner is, in the free part of the room.
        heading: Where it looks, radians.

    Returns:
        Meters, (`BEAMS`,): infinite where nothing is within `LONGEST_RANGE`, NaN where a beam
        hardly grazes what it meets.
    """
    cosine, sine = np.cos(heading + _ANGLES), np.sin(heading + _ANGLES)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = [
            np.where(cosine > 0, world.size - place.x, -place.x) / cosine,
            np.where(sine > 0, world.size - place.y, -place.y) / sine,
        ]
    # The sines of the angles between beams and surfaces.
    slants = [np.abs(cosine), np.abs(sine)]
    for obstacle in world.obstacles:
        x, y = obstacle.center.x - place.x, obstacle.center.y - place.y
        along, across = x * cosine + y * sine, x * sine - y * cosine
        within = np.maximum(obstacle.radius**2 - across**2, 0.0)
        hit = (along > 0) & (np.abs(across) < obstacle.radius)
        distances.append(np.where(hit, along - np.sqrt(within), np.inf))
        slants.append(np.sqrt(within) / obstacle.radius)
    table = np.nan_to_num(np.array(distances), nan=np.inf)
    nearest = table.argmin(axis=0)
    beams = np.arange(BEAMS)
    measured: FloatArray = table[nearest, beams]
    measured[np.array(slants)[nearest, beams] < _LEAST_SINE] = np.nan
    measured[table[nearest, beams] > LONGEST_RANGE] = np.inf
    return measured
