"""Settings of every test, and the fixtures of those that use DDS."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import prompt_answers
import pytest
import warm_processes
from hypothesis import HealthCheck, Phase, settings

if TYPE_CHECKING:
    from ros_processes import Peer

# No test hears, or is heard by, another machine.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

# Whichever test uses the middleware first.
prompt_answers.use()
warm_processes.use()

# A script's background jobs ignore SIGINT, and so would every process that a test starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A slow machine is no failure, and the first example pays for imports.  A change is judged by the
# same examples wherever it is tested; pytest --hypothesis-profile search looks for others.
settings.register_profile(
    "rebt_ros",
    deadline=None,
    derandomize=True,
    # Why a failure fails can take minutes to find out.
    phases=set(Phase) - {Phase.explain},
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("search", settings.get_profile("rebt_ros"), derandomize=False)
settings.load_profile("rebt_ros")


@pytest.fixture(autouse=True, scope="session")
def cache_of_their_own(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keeps what commands read out of the user's cache; pictures keep the fonts that they know."""
    fonts = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"), "matplotlib")
    os.environ.setdefault("MPLCONFIGDIR", str(fonts))
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture
def matplotlib_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then no PNG files are drawn, which takes longer than all else that a command does."""
    for name in [*sys.modules, "matplotlib"]:
        if name.split(".")[0] == "matplotlib":
            monkeypatch.setitem(sys.modules, name, None)


# Their imports wait, because the tests of the core run without ROS.
@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain of the test's own."""
    from ros_processes import own_domain

    with own_domain() as number:
        yield number


@pytest.fixture
def peer(domain: int) -> Iterator[Peer]:
    """A node of the test in its domain."""
    from ros_processes import Peer

    with Peer(domain) as one:
        yield one
