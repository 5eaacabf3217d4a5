"""The simulated robot, by the name that programs outside the package know it by.

`../shared/closed_loop`, which judges learned trees by driving, imports `rebt_ros.simulation.robot`
and its neighbors.
"""

from __future__ import annotations

import sys

from rebt_ros.simulated_robot import demonstrator, episode, robot, world

for _module in (demonstrator, episode, robot, world):
    sys.modules[f"{__name__}.{_module.__name__.rpartition('.')[2]}"] = _module
