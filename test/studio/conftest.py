"""A real browser without a window, and a studio without a robot."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from chromium import Browser
    from pretend_robot import Pretend


# Imports wait, because other tests of this room need neither a browser nor a web server.


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Chromium, for all tests of a module."""
    missing = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
    if missing:
        reason = f"needs {' and '.join(missing)} (Debian's chromium and chromium-driver)"
        if os.environ.get("REBT_ROS_CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    from chromium import started

    with started(tmp_path_factory.mktemp("chromium")) as browser:
        yield browser


@pytest.fixture
def studio() -> Iterator[Pretend]:
    """A studio with an empty board."""
    from pretend_robot import pretended

    with pretended() as pretend:
        yield pretend


@pytest.fixture
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where pictures of the page are kept.

    ``REBT_ROS_PICTURES`` names the directory; otherwise pytest's own, of which it keeps three.
    """
    kept = os.environ.get("REBT_ROS_PICTURES")
    return Path(kept) if kept else tmp_path_factory.getbasetemp() / "pictures"
