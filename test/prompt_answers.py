"""Quick waiting for deliveries, in the process of the tests and not in the nodes."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"


def use() -> None:
    """Has subscribers asked at once, instead of every three seconds, what they have received.

    To be called before the middleware is used first, as it reads the file only then.
    """
    os.environ.setdefault(VARIABLE, str(Path(__file__).with_suffix(".xml")))
