"""Live updates for a long time: whether the page or the server grows.

    .venv/bin/python test/studio/soak.py [MINUTES]

Prints, each minute, the page's heap and elements, and the memory of this process, in which the
server runs.  The first minute does not count: caches fill then.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent), str(HERE)]

from chromium import Browser, started  # noqa: E402
from pretend_robot import REACH, fill, large_tree, pretended  # noqa: E402

from rebt_ros.studio.board import Section  # noqa: E402


def main(minutes: float) -> None:
    """Updates a large tree ten times a second, and the timeline once a second."""
    with (
        tempfile.TemporaryDirectory() as profile,
        pretended() as studio,
        started(Path(profile)) as browser,
    ):
        fill(studio)
        learned = large_tree(300)
        studio.show_tree(learned)
        browser.open(studio.url)
        browser.command("Performance.enable")
        begun, next_look, first = time.monotonic(), 60.0, None
        number = 0
        while (passed := time.monotonic() - begun) < minutes * 60 + 61:
            studio.run(learned, passed)
            number += 1
            if number % 10 == 0:
                event = {"t": time.time(), "kind": "command", "text": "go", "channel": "action"}
                old = {f"s{number - 10 * REACH}": None}
                studio.board.update(Section.TIMELINE, {f"s{number}": event, **old})
            if passed >= next_look:
                next_look += 60.0
                page, elements, server = now = _sizes(browser)
                first = first or now
                print(
                    f"{passed / 60:5.1f} min: page {page:.1f} MB ({page - first[0]:+.1f}), "
                    f"{elements:.0f} elements, server {server:.1f} MB ({server - first[2]:+.1f}), "
                    f"{number} updates",
                    flush=True,
                )
            time.sleep(max(0.0, number / 10 - (time.monotonic() - begun)))


def _sizes(browser: Browser) -> tuple[float, float, float]:
    """The page's heap (MB) and elements, and the memory of this process (MB)."""
    browser.command("HeapProfiler.collectGarbage")
    metrics = {
        one["name"]: one["value"] for one in browser.command("Performance.getMetrics")["metrics"]
    }
    status = Path("/proc/self/status").read_text(encoding="ascii")
    resident = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return metrics["JSHeapUsedSize"] / 1e6, metrics["Nodes"], int(resident.split()[1]) / 1e3


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 30.0)
