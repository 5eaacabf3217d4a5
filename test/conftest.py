"""Settings of every test."""

import os

from hypothesis import settings

# No test hears, or is heard by, another machine.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

# A slow machine is no failure, and the first example pays for imports.
settings.register_profile("rebt_ros", deadline=None)
settings.load_profile("rebt_ros")
