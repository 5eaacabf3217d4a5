"""Chromium without a window and without a network, as tests of the page drive it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from selenium.common.exceptions import (
    StaleElementReferenceException,
    TimeoutException,
    WebDriverException,
)
from selenium.webdriver import ActionChains, Chrome, ChromeOptions
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import WebDriverWait

#: How long a test waits for something that should happen at once, on a busy machine (seconds).
PATIENCE: Final = 60.0
#: Of the window: a tablet's (pixels).
WIDTH: Final = 1280
HEIGHT: Final = 900

_SWITCHES: Final = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-extensions",
    "--disable-background-timer-throttling",
    "--disable-backgrounding-occluded-windows",
    "--disable-renderer-backgrounding",
    "--force-prefers-reduced-motion",
    # No name but that of this machine leads anywhere.
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE localhost",
    f"--window-size={WIDTH},{HEIGHT}",
)

#: From a message of the studio to the next picture that is on the screen (ms).
STOPWATCH: Final = """window.paints = [];
    const Plain = window.WebSocket;
    window.WebSocket = class extends Plain {
      constructor(...given) {
        super(...given);
        this.addEventListener('message', () => {
          const begun = performance.now();
          requestAnimationFrame(() => {
            const channel = new MessageChannel();
            channel.port1.onmessage = () => window.paints.push(performance.now() - begun);
            channel.port2.postMessage(0);
          });
        });
      }
    };"""


class Browser:
    """One Chromium, and what tests ask of it.

    Args:
        driver: Drives it.
    """

    def __init__(self, driver: Chrome) -> None:
        self.driver = driver

    def open(self, url: str) -> None:
        """Opens a page and waits until it shows what the studio has told."""
        self.driver.get("about:blank")
        # What the page before could not reach is no fault of this one.
        self.driver.get_log("browser")
        self.driver.get(url)
        self.until(lambda: self.run("return document.getElementById('loading').hidden"))
        self.drawn()

    def drawn(self) -> None:
        """Waits until the page has drawn what it knows; it draws once a frame."""
        self.driver.execute_async_script(
            "requestAnimationFrame(() => requestAnimationFrame(arguments[0]))"
        )

    def run(self, script: str, *given: Any) -> Any:
        """Runs a script in the page."""
        return self.driver.execute_script(script, *given)

    def until(self, condition: Callable[[], Any], what: str | Callable[[], str] = "") -> Any:
        """Waits until a condition holds and returns its value.

        Elements that went meanwhile make it look again.

        Args:
            condition: Is looked at again and again.
            what: What to say if it never holds; looked at then.
        """

        def look(_: object) -> Any:
            try:
                return condition()
            except StaleElementReferenceException:
                return None

        try:
            return WebDriverWait(self.driver, PATIENCE, 0.05).until(look)
        except TimeoutException as err:
            raise TimeoutException(what if isinstance(what, str) else what()) from err

    def all(self, selector: str) -> list[WebElement]:
        """All elements of a CSS selector."""
        return list(self.driver.find_elements(By.CSS_SELECTOR, selector))

    def one(self, selector: str) -> WebElement:
        """An element, as soon as it is there."""
        found = self.until(lambda: self.all(selector), f"there is no {selector}")
        return found[0]

    def text(self, selector: str) -> str:
        """The text of an element, shown or not."""
        self.one(selector)
        found = "return document.querySelector(arguments[0])?.textContent"
        return str(self.run(found, selector))

    def sees(self, words: str, selector: str = "body") -> None:
        """Waits until a text can be seen in an element."""
        self.until(
            lambda: words in self.one(selector).text,
            lambda: f"{words!r} is not in {selector}, which says {self._said(selector)}",
        )

    def press(self, selector: str, words: str = "") -> None:
        """Clicks an element, or the one with these words among several, once it can be clicked."""

        def press() -> bool:
            for found in self.all(selector):
                if found.is_displayed() and found.is_enabled() and words in found.text:
                    self.run("arguments[0].scrollIntoView({block: 'center'})", found)
                    found.click()
                    return True
            return False

        self.until(lambda: _tried(press), f"{selector} {words!r} cannot be pressed")

    def press_at(self, selector: str, share: float) -> None:
        """Presses a point of an element, so much of its width from its left end."""

        def press() -> bool:
            found = self.one(selector)
            self.run("arguments[0].scrollIntoView({block: 'center'})", found)
            offset = round(found.size["width"] * (share - 0.5))
            actions = ActionChains(self.driver)
            actions.move_to_element_with_offset(found, offset, 0).click().perform()
            return True

        self.until(lambda: _tried(press), f"{selector} cannot be pressed")

    def section(self, name: str) -> None:
        """Goes to a section of the page."""
        self.press(f"#tab-{name}")
        self.until(lambda: self.one(f"#panel-{name}").is_displayed())

    def node(self, tree: str, path: str) -> WebElement:
        """A node of a drawn tree."""
        return self.one(f'{tree} [data-path="{path}"]')

    def press_node(self, tree: str, path: str) -> None:
        """Presses a node of a drawn tree, at its words."""
        self.until(
            lambda: _tried(lambda: self._press_box(self.node(tree, path))),
            f"the node {path} of {tree} cannot be pressed",
        )

    def errors(self) -> list[str]:
        """What the page has complained about since the last call, but for plotly's own styles."""
        log = self.driver.get_log("browser")
        return [one["message"] for one in log if "plotly.js" not in one["message"]]

    def command(self, name: str, **given: Any) -> Any:
        """A command of Chrome's DevTools protocol."""
        return self.driver.execute_cdp_cmd(name, given)

    def busy(self) -> float:
        """For how long the page's main thread has worked (seconds); `Performance` is enabled."""
        metrics = self.command("Performance.getMetrics")["metrics"]
        return float(next(one["value"] for one in metrics if one["name"] == "TaskDuration"))

    def look(self, *, width: int = WIDTH, height: int = HEIGHT, dark: bool = False) -> None:
        """Sets the size of the window, and light or dark."""
        self.command(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        scheme = "dark" if dark else "light"
        self.command(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": scheme}],
        )

    def picture(self, path: Path) -> None:
        """Keeps a picture of what can be seen."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(self.driver.get_screenshot_as_png())

    def _press_box(self, node: WebElement) -> bool:
        box = node.find_element(By.CSS_SELECTOR, ".box")
        self.run("arguments[0].scrollIntoView({block: 'center', inline: 'center'})", box)
        box.click()
        return True

    def _said(self, selector: str) -> str:
        said = """return [...document.querySelectorAll(arguments[0])]
            .map(one => (one.innerText ?? one.textContent).slice(0, 500))"""
        return json.dumps(self.run(said, selector))


def _tried(act: Callable[[], bool]) -> bool:
    """Whether something could be done; something else lay above it, say, or it went."""
    try:
        return act()
    except WebDriverException:
        return False


@contextmanager
def started(profile: Path) -> Iterator[Browser]:
    """A browser with a profile of its own."""
    options = ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for switch in (*_SWITCHES, f"--user-data-dir={profile}"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = Chrome(options=options, service=Service(shutil.which("chromedriver") or ""))
    try:
        yield Browser(driver)
    finally:
        driver.quit()
