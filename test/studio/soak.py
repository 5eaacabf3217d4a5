"""Live updates for a long time: how busy and how late the page is, and whether anything grows.

    .venv/bin/python test/studio/soak.py [MINUTES]

Prints, each minute, how much of the time the page's main thread was busy, how long updates took
until they were painted, the page's heap and elements, and the memory of this process, in which the
server runs.  Before the first minute, in which caches fill, nothing is counted.  With less than a
minute it prints how busy and how late the page was, once.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent), str(HERE)]

from chromium import STOPWATCH, Browser, started  # noqa: E402
from pretend_robot import REACH, fill, large_tree, pretended  # noqa: E402

from rebt_ros.studio.board import Section  # noqa: E402

#: Before something is counted (seconds).
_WARMING: Final = 5.0


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
        browser.command("Page.addScriptToEvaluateOnNewDocument", source=STOPWATCH)
        browser.open(studio.url)
        browser.command("Performance.enable")
        every = min(60.0, minutes * 60)
        begun, next_look, first = time.monotonic(), _WARMING, None
        number, looked, busy = 0, 0.0, 0.0
        while (passed := time.monotonic() - begun) < minutes * 60 + _WARMING + 1.0:
            studio.run(learned, passed)
            number += 1
            if number % 10 == 0:
                event = {"t": time.time(), "kind": "command", "text": "go", "channel": "action"}
                old = {f"s{number - 10 * REACH}": None}
                studio.board.update(Section.TIMELINE, {f"s{number}": event, **old})
            if passed >= next_look:
                paints = sorted(browser.run("return window.paints.splice(0)"))
                now = browser.busy()
                if next_look > _WARMING:
                    print(
                        f"{(passed - _WARMING) / 60:5.1f} min: busy "
                        f"{(now - busy) / (passed - looked):.0%}, update to paint median "
                        f"{paints[len(paints) // 2]:.0f} ms, "
                        f"p95 {paints[int(len(paints) * 0.95)]:.0f} ms of {len(paints)}",
                        end="" if minutes >= 1 else "\n",
                    )
                    if minutes >= 1:
                        sizes = _sizes(browser)
                        first = first or sizes
                        print(_growth(sizes, first), flush=True)
                next_look += every
                looked, busy = passed, browser.busy()
            time.sleep(max(0.0, number / 10 - (time.monotonic() - begun)))


def _growth(now: tuple[float, float, float], first: tuple[float, float, float]) -> str:
    page, elements, server = now
    return (
        f"; page {page:.1f} MB ({page - first[0]:+.1f}), {elements:.0f} elements, "
        f"server {server:.1f} MB ({server - first[2]:+.1f})"
    )


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
