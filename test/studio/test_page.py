"""The page in a real browser, against a studio without a robot."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("aiohttp")
pytest.importorskip("selenium")

from chromium import STOPWATCH, Browser
from pretend_robot import (
    DOCUMENT,
    EARLIER,
    LABELS,
    NAMES,
    QUIET,
    Pretend,
    demonstration,
    draft,
    fill,
    histogram,
    large_tree,
    node,
    pretended,
    small_tree,
    tick,
    values_at,
)
from selenium.webdriver import ActionChains
from selenium.webdriver.common.keys import Keys

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import Difference, Literal, Threshold, WeightedSum
from rebt_ros.studio.board import Section
from rebt_ros.studio.tree_view import published_view

SECTIONS = ("live", "teach", "learn", "curate", "explain")
#: What would show that a label was taken for markup.
MARKUP = "<img src=x onerror=\"document.title='taken'\"><script>1</script>&amp;"


def number_text(value: float) -> str:
    """A number as the page shows it."""
    return f"{value:.3g}"


@pytest.fixture
def page(chromium: Browser, studio: Pretend) -> Browser:
    """The page of a studio that has seen some minutes of work."""
    fill(studio)
    chromium.look()
    chromium.open(studio.url)
    return chromium


@pytest.fixture(scope="module")
def worked_in() -> Iterator[Pretend]:
    """A studio that tests only look at."""
    with pretended() as pretend:
        fill(pretend)
        yield pretend


@pytest.fixture
def seen(chromium: Browser, worked_in: Pretend) -> Browser:
    """Its page, which is loaded once for tests that follow each other."""
    chromium.look()
    if chromium.driver.current_url.partition("#")[0] != f"{worked_in.url}/":
        chromium.open(worked_in.url)
    return chromium


@pytest.fixture
def asked(studio: Pretend, chromium: Browser) -> Any:
    """Waits for a request of the page, and returns its arguments."""

    def wait(verb: str, times: int = 1) -> dict[str, Any]:
        chromium.until(
            lambda: len(studio.verbs(verb)) >= times,
            f"{verb} was not asked for, but {[one['do'] for one in studio.asked]}",
        )
        last = dict(studio.verbs(verb)[-1])
        del last["id"], last["do"]
        return last

    return wait


# --- what is seen ---


def test_an_empty_studio_says_what_to_do_next(chromium: Browser, studio: Pretend) -> None:
    roles = ("executor", "recorder", "learner")
    studio.board.replace(
        Section.NODES,
        {
            role: node(f"no {role} is running: start it", there=False, level="WARN")
            for role in roles
        },
    )
    chromium.open(studio.url)
    chromium.sees("The robot has no tree yet", "#panel-live")
    for role in roles:
        chromium.sees(f"No {role} is running: start it.", "#panel-live")
        chromium.sees(f"{role}\nnot running", "#health")
    hints = {
        "teach": "There are none yet: press “Start recording”",
        "learn": "No learner is running: start it.",
        "curate": "Go to Learn and press “Learn”",
        "explain": "Press a point of the strip",
    }
    for section, hint in hints.items():
        chromium.section(section)
        chromium.sees(hint, f"#panel-{section}")
    assert not chromium.one("#learn").is_enabled()
    assert not chromium.one("#learn-rollback").is_enabled()
    studio.board.replace(Section.DEMONSTRATIONS, {NAMES[0]: demonstration(time.time())})
    chromium.section("live")
    chromium.sees("✓ The robot was shown what to do, in 1 demonstration.", "#live-empty")
    studio.board.replace(Section.DEMONSTRATIONS, {})
    chromium.sees("1. Go to Teach", "#live-empty")
    assert chromium.errors() == []


def test_what_is_in_trouble_is_said_beside_the_tree(page: Browser, studio: Pretend) -> None:
    studio.board.update(Section.NODES, {"executor": node("no state arrives", level="ERROR")})
    page.sees("executor: No state arrives.", "#live-advice")
    studio.board.update(Section.NODES, {"executor": node("ticking")})
    page.until(lambda: not page.one("#live-advice").is_displayed())


def test_the_live_tree_tells_statuses_values_and_the_command(page: Browser) -> None:
    page.sees("turn_left", "#command")
    page.sees("The tree drives the robot.", "#condition")
    tree = "#live-tree"
    assert page.one(f"{tree} svg").get_attribute("role") == "tree"
    for path, words, level in (
        ("root", "Selector, control node; runs", "1"),
        ("0.0", "docked, condition; does not hold", "3"),
        ("1.0", "target_bearing > 0.25, condition; holds", "3"),
        ("1.1", "turn_left, action; runs", "3"),
        ("2.1.0", "0.1 < right ≤ 0.6, condition; was not reached", "4"),
    ):
        page.until(
            lambda path=path, words=words: (
                words in (page.node(tree, path).get_attribute("aria-label") or "")
            ),
            f"{path} does not say {words!r}",
        )
        assert page.node(tree, path).get_attribute("aria-level") == level
    active = page.run(
        "return [...document.querySelectorAll('#live-tree .active.node')].map(n => n.dataset.path)"
    )
    assert active == ["root", "1", "1.1"]
    hue = "return getComputedStyle(document.querySelector(arguments[0]))[arguments[1]]"
    swatch = page.run(hue, "#command .swatch", "backgroundColor")
    assert page.run(hue, f'{tree} [data-path="1.1"] .hue', "fill") == swatch
    assert page.run(hue, f'{tree} [data-path="3"] .hue', "fill") != swatch
    shown = f"{values_at(QUIET)['target_bearing']:.3g}"
    page.sees(shown, f'{tree} [data-path="1.0"] .meter')
    page.sees(shown, '#live-values [data-key="target_bearing"]')


def test_every_tick_reaches_the_picture(page: Browser, studio: Pretend) -> None:
    learned = small_tree()
    commands = {studio.run(learned, second / 2) for second in range(20)}
    assert len(commands) > 1
    for second in (0.0, EARLIER, QUIET):
        command = studio.run(learned, second)
        statuses, _ = tick(learned, values_at(second))
        page.sees(command, "#command")
        page.until(
            lambda statuses=statuses: (
                page.run(
                    "return [...document.querySelectorAll('#live-tree .node')]"
                    ".map(n => n.dataset.status)"
                )
                == statuses
            )
        )


def test_statuses_of_another_tree_are_not_shown(page: Browser, studio: Pretend) -> None:
    studio.board.update(Section.RUN, {"document": "another"})
    page.until(lambda: not page.all("#live-tree [data-status]"))
    studio.board.update(Section.RUN, {"document": DOCUMENT})
    page.until(lambda: page.all("#live-tree [data-status]"))


def test_markup_in_names_is_shown_as_text(chromium: Browser, studio: Pretend) -> None:
    feature = Feature(MARKUP, FeatureKind.NUMERIC)
    action = nodes.Action(MARKUP, MARKUP)
    condition = nodes.Condition(Literal(Threshold(MARKUP, 0.5)))
    rest = nodes.Action("rest", MARKUP)
    tree = nodes.Selector((nodes.Sequence((condition, action)), rest))
    plain = small_tree()
    learned = LearnedTree((feature,), (action, rest), tree, plain.provenance)
    fill(studio)
    board = studio.board
    board.replace(Section.TREE, published_view(learned, DOCUMENT))
    board.replace(Section.VALUES, {MARKUP: 0.1})
    board.replace(Section.RUN, {"condition": MARKUP, "commands": {MARKUP: MARKUP}, "document": ""})
    board.replace(Section.ACTIONS, {MARKUP: {"channel": MARKUP, "topic": MARKUP}})
    board.replace(Section.NAMES, {"rest": MARKUP})
    board.replace(
        Section.NODES,
        {role: node(MARKUP, level="ERROR") for role in ("executor", "recorder", "learner")},
    )
    shown = demonstration(time.time(), notes=[MARKUP], actions={MARKUP: 3}, bands=[[0, 1, MARKUP]])
    board.replace(Section.DEMONSTRATIONS, {MARKUP: shown | {"series": {MARKUP: [[0, 1], [1, 2]]}}})
    board.replace(Section.LEARNING, {"levels": [], "problem": MARKUP, "notes": [MARKUP]})
    rules = [{"rule": MARKUP, "kept": None, "sentence": MARKUP}]
    board.replace(Section.DRAFT, draft(learned, words=[MARKUP], rules=rules, undo=MARKUP))
    board.replace(
        Section.VERSIONS, {"000001": {"when": 1.0, "who": MARKUP, "what": MARKUP, "nodes": 2}}
    )
    board.replace(
        Section.TIMELINE,
        {"1": {"t": time.time(), "kind": "command", "text": MARKUP, "channel": MARKUP}},
    )
    studio.answers["explain"] = lambda _: (
        MARKUP,
        {
            "lines": [MARKUP],
            "values": {MARKUP: MARKUP},
            "from": [{"demonstration": MARKUP, "rows": 1, "seconds": 1}],
            "least": [MARKUP],
        },
    )
    studio.answers["discard"] = lambda _: (MARKUP, None)
    chromium.open(studio.url)
    chromium.sees(MARKUP, "#command")
    chromium.press_node("#live-tree", "0.0")
    chromium.sees(MARKUP, "#why-text")
    chromium.section("teach")
    chromium.press("#recorder-buttons button", "Discard")
    chromium.sees(MARKUP, "#toasts")
    chromium.sees(MARKUP, "#demonstrations")
    for section in SECTIONS:
        chromium.section(section)
        chromium.until(lambda section=section: MARKUP in chromium.text(f"#panel-{section}"))
    assert chromium.driver.title == "Robot studio"
    assert chromium.all("main img, #toasts img, main script") == []
    assert chromium.errors() == []


def test_every_control_has_a_name(seen: Browser) -> None:
    for section in SECTIONS:
        seen.section(section)
        if section == "curate":
            seen.press_node("#curate-tree", "0.1")
            seen.one("#editor .histogram")
        nameless = seen.run(
            """return [...document.querySelectorAll(
                 'button, input, select, [tabindex="0"], [role=slider], svg[role]')]
               .filter(one => one.checkVisibility() && !(one.getAttribute('aria-label')
                 || one.textContent.trim() || one.labels?.length))
               .map(one => one.outerHTML.slice(0, 200))"""
        )
        assert nameless == []


def test_every_button_says_what_it_will_do(seen: Browser) -> None:
    for section in SECTIONS:
        seen.section(section)
        if section == "curate":
            seen.press_node("#curate-tree", "0.1")
            seen.one("#editor .histogram")
        silent = seen.run(
            """return [...document.querySelectorAll('main button, header button')]
               .filter(one => one.checkVisibility() && !one.title && one.role !== 'tab')
               .map(one => one.outerHTML.slice(0, 200))"""
        )
        assert silent == []


def test_controls_are_large_enough_for_a_finger(seen: Browser) -> None:
    for section in SECTIONS:
        seen.section(section)
        small = seen.run(
            """return [...document.querySelectorAll('button, select, input:not([type=radio])')]
               .filter(one => one.checkVisibility() && one.getBoundingClientRect().height < 44)
               .map(one => one.outerHTML.slice(0, 200))"""
        )
        assert small == []


@pytest.mark.parametrize("dark", [False, True])
def test_words_stand_out_from_what_is_behind_them(seen: Browser, dark: bool) -> None:
    seen.look(dark=dark)
    for section in SECTIONS:
        seen.section(section)
        assert seen.run(_FAINT) == []


@pytest.mark.parametrize(
    ("width", "height"), [(800, 1280), (390, 844), (320, 640)], ids=["tablet", "phone", "zoomed"]
)
def test_it_fits_a_narrow_window(seen: Browser, width: int, height: int) -> None:
    seen.look(width=width, height=height)
    for section in SECTIONS:
        seen.section(section)
        seen.drawn()
        wide = seen.run("return document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, section
        # Nor is anything cut off at the edge of what holds it; trees scroll.
        assert seen.run(_CUT_OFF) == [], section


def test_a_demonstration_is_called_the_same_everywhere(
    page: Browser, studio: Pretend, asked: Any
) -> None:
    """By when it began, on the clock of who looks."""
    page.command("Emulation.setTimezoneOverride", timezoneId="America/New_York")
    try:
        page.open(studio.url)
        page.section("teach")
        name = NAMES[0]
        title = page.text(f'#demonstrations [data-key="{name}"] h3')
        page.section("explain")
        page.sees(title, f'#explain-which [data-key="{name}"]')
        page.section("curate")
        page.sees(title, "#changed-demonstrations")
        page.press_node("#curate-tree", "0.1")
        page.sees(title, "#editor-body .from")
        studio.answers["delete"] = lambda given: (f"{given['name']} is deleted.", None)
        page.section("teach")
        page.press(f'#demonstrations [data-key="{name}"] button', "Delete")
        page.sees(f"{title} is deleted.", "#toasts")
        # Of a robot with a simulated clock, the file's name says when it was recorded.
        board = studio.board
        board.replace(Section.DEMONSTRATIONS, {name: demonstration(12.5)})
        page.until(
            lambda: page.text(f'#demonstrations [data-key="{name}"] h3').endswith("04:15:02")
        )
    finally:
        page.command("Emulation.setTimezoneOverride", timezoneId="")


def test_nothing_is_loaded_from_elsewhere(seen: Browser, worked_in: Pretend) -> None:
    seen.section("learn")
    seen.one("#learn-chart .main-svg")
    loaded = seen.run("return performance.getEntriesByType('resource').map(one => one.name)")
    assert f"{worked_in.url}/plotly.js" in loaded
    assert [name for name in loaded if not name.startswith((f"{worked_in.url}/", "data:"))] == []
    assert seen.errors() == []


def test_two_trees_stand_side_by_side(seen: Browser) -> None:
    seen.section("learn")
    seen.sees("acts differently from the robot's tree in 31 of 1,677 rows (2%)", "#learn-changed")
    seen.sees("New: docked → battery ≤ 0.95 → charge.", "#learn-words")
    size = len(list(nodes.walk(small_tree().tree)))
    for tree in ("#learn-published", "#learn-draft"):
        seen.until(lambda tree=tree: len(seen.all(f"{tree} .node")) == size)


def test_pictures_of_all_sections(seen: Browser, pictures: Path) -> None:
    heights = {"learn": 1000, "curate": 1320, "explain": 1000}
    for section in SECTIONS:
        seen.look(height=heights.get(section, 900))
        seen.section(section)
        if section == "learn":
            seen.until(lambda: seen.all("#learn-chart .point"))
        if section == "curate":
            seen.press_node("#curate-tree", "0.1")
            seen.one("#editor .handle")
        if section == "explain":
            seen.run(_CHOOSE, "#explain-which", NAMES[0])
            seen.run(_SLIDE, "#explain-seconds", 14)
            seen.until(lambda: seen.all("#explain-tree .active.kind-action"))
        seen.run("scrollTo(0, 0)")
        seen.drawn()
        seen.picture(pictures / f"{section}.png")
    seen.look(dark=True)
    seen.picture(pictures / "explain_dark.png")
    seen.run(_CHOOSE, "#explain-which", "")


# --- the connection ---


def test_a_studio_that_comes_back_heals_the_page_without_a_reload(
    page: Browser, studio: Pretend
) -> None:
    page.run("window.untouched = true")
    token = studio.server.access.token
    studio.close()
    page.sees("The studio cannot be reached", "#banner")
    studio.board.update(Section.RUN, {"commands": {"action": "charge"}})
    studio.start_again()
    assert studio.server.access.token != token
    page.until(lambda: not page.one("#banner").is_displayed())
    page.sees("charge", "#command")
    page.press("#stop")
    page.until(lambda: studio.verbs("enable"))
    assert page.run("return window.untouched")


def test_what_is_asked_of_a_lost_studio_is_not_done_and_said_so(
    page: Browser, studio: Pretend
) -> None:
    studio.close()
    page.sees("The studio cannot be reached", "#banner")
    page.press("#stop")
    page.sees("Not done.", "#toasts")
    assert studio.verbs("enable") == []
    studio.start_again()


def test_two_browsers_show_the_same(page: Browser, studio: Pretend) -> None:
    driver = page.driver
    first = driver.current_window_handle
    driver.switch_to.new_window("window")
    try:
        page.open(studio.url)
        page.sees("turn_left", "#command")
        studio.board.update(Section.RUN, {"commands": {"action": "charge"}})
        page.sees("charge", "#command")
        driver.switch_to.window(first)
        page.sees("charge", "#command")
        driver.switch_to.window(driver.window_handles[-1])
    finally:
        driver.close()
        driver.switch_to.window(first)


# --- live ---


def test_a_pause_steps_back_and_returns(page: Browser, studio: Pretend, asked: Any) -> None:
    page.press("#live-strip button", "Pause")
    first = asked("moment")["t"]
    page.press("#live-strip button", "Earlier")
    assert asked("moment", 2)["t"] < first
    page.until(lambda: page.text("#command .name") == tick(small_tree(), values_at(EARLIER))[1])
    page.sees("What the tree commanded at that moment", "#condition")
    studio.board.update(Section.RUN, {"commands": {"action": "charge"}})
    page.press("#live-strip button", "Back to now")
    page.sees("charge", "#command")
    page.one("#live-strip canvas").send_keys(Keys.ARROW_LEFT)
    before = asked("moment", 3)["t"]
    page.one("#live-strip canvas").send_keys(Keys.PAGE_UP)
    assert asked("moment", 4)["t"] < before
    page.one("#live-strip canvas").send_keys(Keys.END)
    page.sees("charge", "#command")


def test_a_node_tells_why(page: Browser, studio: Pretend, asked: Any) -> None:
    page.press_node("#live-tree", "1.0")
    assert asked("explain") == {}
    assert asked("branch") == {"path": "1.0", "robot": True}
    page.sees("Its branch acts in 68 of 1677 rows", "#why-node-from")
    page.sees("because target_bearing > 0.25", "#why-text")
    page.sees("holds, by", "#why-node-now")
    page.press("#why-text .from button")
    page.until(lambda: page.one("#panel-explain").is_displayed())
    assert asked("explain", 2) == {"demonstration": NAMES[0], "seconds": 3.4}
    page.press_node("#explain-tree", "1.1")
    page.sees("Its branch acts in 68 of 1677 rows", "#explain-branch")
    assert asked("branch", 2) == {"path": "1.1", "robot": False}
    assert studio.verbs("moment") == []


def test_the_tree_is_walked_with_the_keyboard(page: Browser, asked: Any) -> None:
    def focused() -> str:
        return str(page.run("return document.activeElement.dataset.path"))

    def keys(*pressed: str) -> None:
        page.driver.switch_to.active_element.send_keys(*pressed)

    page.run("arguments[0].focus()", page.one('#live-tree [tabindex="0"]'))
    assert focused() == "root"
    keys(Keys.ARROW_DOWN)
    assert focused() == "0"
    assert page.node("#live-tree", "0").get_attribute("aria-expanded") == "true"
    keys(Keys.ARROW_LEFT)
    assert page.node("#live-tree", "0").get_attribute("aria-expanded") == "false"
    assert not page.node("#live-tree", "0.0").is_displayed()
    keys(Keys.ARROW_DOWN)
    assert focused() == "1"
    keys(Keys.ARROW_UP, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    assert focused() == "0.0"
    keys(Keys.END)
    assert focused() == "3"
    keys(Keys.HOME, Keys.ENTER)
    assert asked("branch") == {"path": "root", "robot": True}


def test_the_sections_are_walked_with_the_keyboard(page: Browser) -> None:
    page.run("document.getElementById('tab-live').focus()")
    for name in (*SECTIONS[1:], "live"):
        page.driver.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
        page.until(lambda name=name: page.one(f"#panel-{name}").is_displayed())


def test_words_are_found_in_a_large_tree(chromium: Browser, studio: Pretend) -> None:
    learned = large_tree(300)
    studio.show_tree(learned)
    assert any(studio.run(learned, second / 4) for second in range(100))
    chromium.look()
    chromium.open(studio.url)
    chromium.until(lambda: len(chromium.all("#live-tree .node")) >= 300)
    chromium.press("#live-tools button", "Fold up")
    chromium.until(lambda: not chromium.node("#live-tree", "30.4").is_displayed())
    field = chromium.one("#live-tools input")
    field.send_keys("turn_right")
    chromium.sees("1 of 12", "#live-tools")
    chromium.until(lambda: chromium.node("#live-tree", "3.4").is_displayed())
    field.send_keys(Keys.ENTER)
    chromium.sees("2 of 12", "#live-tools")
    chromium.press("#live-tools button", "Jump to what runs")
    chromium.until(
        lambda: any(one.is_displayed() for one in chromium.all("#live-tree .kind-action.active"))
    )


# --- teach ---


def test_recording_is_steered_by_buttons(page: Browser, studio: Pretend, asked: Any) -> None:
    page.section("teach")
    page.press("#recorder-buttons button", "Start recording")
    assert asked("record") == {"on": True}
    page.sees("Record: done.", "#toasts")
    name = f"{NAMES[1]}.rec"
    values = {"demonstration": f"/tmp/{name}", "rows of the demonstration": "37"}
    studio.board.update(
        Section.NODES,
        {"recorder": node("late state; no messages on state", level="WARN", **values)},
    )
    page.sees("Recording: 37 rows of this demonstration", "#recorder-state")
    page.sees("No messages on state.", "#recorder-warnings")
    page.sees("charge", "#recorder-actions")
    for words, verb in (
        ("Well done", "new_demonstration"),
        ("Discard", "discard"),
        ("failed", "failed"),
    ):
        page.press("#recorder-buttons button", words)
        asked(verb)
    page.press("#recorder-buttons button", "Stop recording")
    page.until(lambda: studio.verbs("record")[-1]["on"] is False)


def test_an_action_is_sent_for_as_long_as_its_button_is_held(
    page: Browser, studio: Pretend, asked: Any
) -> None:
    page.section("teach")
    button = page.one('#takeover [data-key="turn_left"]')
    ActionChains(page.driver).click_and_hold(button).perform()
    assert asked("act", 3) == {"label": "turn_left"}
    assert button.get_attribute("aria-pressed") == "true"
    ActionChains(page.driver).release().perform()
    page.until(lambda: button.get_attribute("aria-pressed") == "false")
    assert _ends(page, studio)


def test_a_held_key_drives_and_a_lost_studio_lets_go(
    page: Browser, studio: Pretend, asked: Any
) -> None:
    page.section("teach")
    page.one("#takeover button")
    press = "dispatchEvent(new KeyboardEvent('key' + arguments[0], {key: '2', bubbles: true}))"
    page.run(press, "down")
    assert asked("act", 2) == {"label": "go"}
    page.run(press, "up")
    assert _ends(page, studio)
    page.run(press, "down")
    asked("act", len(studio.verbs("act")) + 1)
    studio.close()
    page.until(lambda: page.one("#banner").is_displayed())
    assert page.all('#takeover [aria-pressed="true"]') == []
    studio.start_again()
    page.until(lambda: not page.one("#banner").is_displayed())
    assert _ends(page, studio)


def test_a_gamepad_drives(page: Browser, studio: Pretend, asked: Any) -> None:
    page.section("teach")
    page.one("#takeover button")
    page.run(
        """window.pad = {connected: true, id: 'Pad (Vendor)', buttons:
             Array.from({length: 16}, () => ({pressed: false}))};
           navigator.getGamepads = () => [window.pad];
           dispatchEvent(new Event('gamepadconnected'));"""
    )
    page.sees("Gamepad: Pad", "#gamepad")
    page.run("window.pad.buttons[2].pressed = true")
    assert asked("act", 2) == {"label": LABELS[2]}
    page.run("window.pad.buttons[2].pressed = false")
    page.until(lambda: not page.all('#takeover [aria-pressed="true"]'))
    page.press("#gamepad-set")
    page.sees("Press the gamepad button for “charge”", "#gamepad")
    page.run("window.pad.buttons[7].pressed = true")
    page.sees("gamepad R2", '#takeover [data-key="charge"]')
    page.run("window.pad.buttons[7].pressed = false; window.pad.connected = false")
    assert _ends(page, studio)


def test_an_action_that_nobody_has_shown_yet_can_be_added(
    chromium: Browser, studio: Pretend, asked: Any
) -> None:
    chromium.open(studio.url)
    chromium.section("teach")
    chromium.sees("No actions are known yet", "#takeover-hint")
    chromium.one("#new-action-name").send_keys("dock", Keys.ENTER)
    ActionChains(chromium.driver).click_and_hold(
        chromium.one('#takeover [data-key="dock"]')
    ).perform()
    assert asked("act") == {"label": "dock"}
    ActionChains(chromium.driver).release().perform()


def test_what_was_deleted_can_be_had_back(page: Browser, studio: Pretend, asked: Any) -> None:
    page.section("teach")
    item = f'#demonstrations [data-key="{NAMES[0]}"]'
    page.press(f"{item} button", "Delete")
    assert asked("delete") == {"name": NAMES[0]}
    page.press("#toasts button", "Undo")
    assert asked("restore_demonstration") == {"name": NAMES[0]}
    gone = studio.board.section(Section.DEMONSTRATIONS)[NAMES[0]] | {"deleted": True, "kept": False}
    studio.board.update(Section.DEMONSTRATIONS, {NAMES[0]: gone})
    page.sees("deleted, goes soon", item)
    page.press(f"{item} button", "Undo delete")
    asked("restore_demonstration", 2)


def test_demonstrations_are_left_out_trimmed_and_split(page: Browser, asked: Any) -> None:
    page.section("teach")
    item = f'#demonstrations [data-key="{NAMES[1]}"]'
    page.press(f"{item} button", "Leave out")
    assert asked("leave_out") == {"name": NAMES[1]}
    page.press(f"{item} button", "Trim ends")
    page.run(_SLIDE, f'{item} input[aria-label="From"]', 6)
    page.run(_SLIDE, f'{item} input[aria-label="To"]', 18)
    page.press(f"{item} .editor button", "Keep only 6.0 s to 18 s")
    trimmed = asked("trim")
    assert trimmed["name"] == NAMES[1]
    assert (trimmed["from"], trimmed["to"]) == pytest.approx((6, 18), abs=0.05)
    page.until(lambda: not page.all(f"{item} .editor input"))
    page.press("#toasts .toast:last-child button", "Undo")
    assert asked("restore_demonstration") == {"name": NAMES[1]}
    page.press(f"{item} button", "Split in two")
    page.run(_SLIDE, f'{item} input[aria-label="Split at"]', 9)
    page.press(f"{item} .editor button", "Make two of it")
    assert asked("split")["at"] == pytest.approx(9, abs=0.05)


# --- learn ---


def test_learning_shows_how_far_it_is_and_can_be_cancelled(
    page: Browser, studio: Pretend, asked: Any
) -> None:
    page.section("learn")
    page.press("#learn", "Learn from 2 demonstrations")
    asked("learn")
    learner = node("learning", **{"stage": "cross-validating", "progress (%)": "40"})
    studio.board.update(Section.NODES, {"learner": learner})
    page.sees("Cross-validating. 40%", "#learn-stage")
    assert page.run("return document.getElementById('learn-bar').value") == 40
    page.press("#learn-cancel")
    asked("cancel")
    studio.board.update(Section.NODES, {"learner": node("idle", stage="idle")})
    page.until(lambda: not page.one("#learn-progress").is_displayed())
    studio.board.update(Section.LEARNING, {"awaited": True})
    page.sees("its sizes are being prepared", "#learn-stage")
    studio.board.update(Section.LEARNING, {"awaited": None})
    page.until(lambda: not page.one("#learn-progress").is_displayed())


_ROOM_OF_A_CHART = """const chart = document.createElement('div');
    chart.className = 'chart';
    chart.innerHTML = '<p class="hint drawing">Drawing the chart…</p>';
    document.getElementById('learn-chart').after(chart);
    const room = chart.offsetHeight;
    chart.remove();
    return room;"""


def test_a_size_is_chosen_on_the_chart_and_in_the_list(page: Browser, asked: Any) -> None:
    page.section("learn")
    page.sees("never does it", '#learn-recalls [data-key="charge"]')
    # Its room was there before it was drawn, so that nothing moves from under a finger.
    assert page.run(_ROOM_OF_A_CHART) == page.one("#learn-chart .main-svg").size["height"]
    # Agreement, recall, driving trials, and the one in the draft.
    page.until(lambda: len(page.all("#learn-chart .scatterlayer .trace")) == 4)
    page.until(lambda: len(page.all("#learn-chart .errorbar")) == 2)
    page.sees("succeeded in 18 of 20 episodes", '#learn-levels [data-key="0"]')
    page.press_at("#learn-chart .scatterlayer .trace:first-child .point:nth-child(2)", 0.5)
    assert asked("level") == {"number": 2}
    page.press('#learn-levels [data-key="1"]')
    assert asked("level", 2) == {"number": 1}
    page.press("#toasts button", "Undo")
    asked("undo")


# --- curate ---


def test_a_threshold_is_dragged_on_its_histogram(page: Browser, asked: Any) -> None:
    page.section("curate")
    page.press_node("#curate-tree", "0.1")
    handle = page.one("#editor .handle")
    assert not page.one("#editor-body .primary").is_enabled()
    page.run("arguments[0].scrollIntoView({block: 'center'})", handle)
    ActionChains(page.driver).drag_and_drop_by_offset(handle, -150, 0).perform()
    value = float(handle.get_attribute("aria-valuenow") or "nan")
    assert 0.2 < value < 0.9
    handle.send_keys(Keys.ARROW_LEFT)
    smaller = float(handle.get_attribute("aria-valuenow") or "nan")
    assert smaller < value
    page.press("#editor-body button", "Change it to")
    assert asked("threshold") == {"path": "0.1", "value": smaller, "end": "at_most"}


def test_sums_and_differences_have_values_margins_and_histograms(
    page: Browser, studio: Pretend, asked: Any
) -> None:
    plain = small_tree()
    weighted = WeightedSum((("front", 1.0), ("right", 2.5)))
    tests = (Threshold(weighted, 6.0), Threshold(Difference("left", "right"), 0.4))
    go, rest = plain.actions[1], plain.actions[2]
    sequence = nodes.Sequence((*(nodes.Condition(Literal(one)) for one in tests), go))
    learned = replace(plain, tree=nodes.Selector((sequence, rest)))
    studio.answers["histogram"] = lambda asked: ("", histogram(learned, asked["path"]))
    studio.show_tree(learned)
    studio.board.replace(Section.DRAFT, draft(learned))
    values = values_at(QUIET) | {"left": 1.0, "front": 3.0, "right": 0.75}
    studio.board.replace(Section.VALUES, values)
    studio.board.replace(Section.NAMES, {"front": "right ahead"})
    page.sees("4.88", '#live-tree [data-path="0.0"] .meter')
    page.sees("0.25", '#live-tree [data-path="0.1"] .meter')
    page.sees("right ahead + 2.5 × right\n4.88", "#live-values")
    page.sees("left − right\n0.25", "#live-values")
    page.press_node("#live-tree", "0.0")
    page.sees("Now 4.88: holds, by 1.13.", "#why-node-now")
    page.section("curate")
    page.press_node("#curate-tree", "0.0")
    page.sees("at which right ahead + 2.5 × right. Drag the line.", "#editor-body")
    handle = page.one("#editor .handle")
    ends = [float(handle.get_attribute(f"aria-value{end}") or "nan") for end in ("min", "max")]
    assert ends == pytest.approx([0.8, 14.0])
    page.run("arguments[0].scrollIntoView({block: 'center'})", handle)
    ActionChains(page.driver).drag_and_drop_by_offset(handle, 80, 0).perform()
    value = float(handle.get_attribute("aria-valuenow") or "nan")
    assert 6.0 < value < 14.0
    page.press("#editor-body button", "Change it to")
    assert asked("threshold") == {"path": "0.0", "value": value, "end": "at_most"}


def test_nodes_are_chosen_moved_and_deleted(page: Browser, asked: Any) -> None:
    page.section("curate")
    page.press_node("#curate-tree", "2.2")
    page.press("#editor-body button", "The first one that can")
    assert asked("psa") == {"path": "2.2", "choice": "selector"}
    page.press("#editor-body button", "All at the same time")
    assert asked("psa", 2) == {"path": "2.2", "choice": "parallel"}
    page.press_node("#curate-tree", "1")
    page.sees("Its branch acts in 68 of 1677 rows", "#editor-body")
    page.press("#editor-body button", "Earlier")
    assert asked("move") == {"path": "1", "by": -1}
    page.press("#editor-body button", "Later")
    assert asked("move", 2) == {"path": "1", "by": 1}
    page.press("#editor-body button", "Delete this branch of 3 nodes")
    assert asked("remove") == {"path": "1"}
    page.press_node("#curate-tree", "root")
    page.until(lambda: not page.one("#editor-body .careful").is_enabled())


def test_suggestions_are_attached_and_detached(page: Browser, studio: Pretend, asked: Any) -> None:
    page.section("curate")
    page.until(lambda: len(page.all("#suggestions svg.tree .node")) == 4)
    page.press("#suggestions button", "Put it into the draft")
    assert asked("attach") == {"suggestion": "lat-sequence-1"}
    suggestions = draft(small_tree())["suggestions"]
    studio.board.update(Section.DRAFT, {"suggestions": [suggestions[0] | {"attached": True}]})
    page.press("#suggestions button", "Take it out of the draft")
    assert asked("detach") == {"suggestion": "lat-sequence-1"}


def test_the_draft_tells_what_it_changes_before_it_is_published(
    page: Browser, studio: Pretend, asked: Any
) -> None:
    page.section("curate")
    page.sees("31 of 1,677 rows", "#changed")
    page.sees(": 31 rows", "#changed-demonstrations")
    page.sees("broken", '#rules [data-kept="false"]')
    page.sees("kept", '#rules [data-kept="true"]')
    page.press("#undo", "Undo: changing battery")
    asked("undo")
    assert not page.one("#redo").is_enabled()
    page.one("#publish-note").send_keys("charges earlier")
    page.press("#publish")
    assert asked("publish") == {"note": "charges earlier"}
    studio.board.update(Section.DRAFT, {"published": True})
    page.sees("The robot follows this draft.", "#curate-state")
    page.until(lambda: not page.one("#publish").is_enabled())
    page.press('#versions [data-key="000001"] button', "Bring it back")
    assert asked("restore") == {"version": "000001"}


def test_a_refusal_is_a_sentence(page: Browser, studio: Pretend) -> None:
    def refuse(_: dict[str, Any]) -> tuple[str, Any]:
        raise ValueError

    studio.answers["publish"] = refuse
    page.section("curate")
    page.press("#publish")
    page.sees("Not done. Publish cannot be done.", "#toasts")
    page.until(lambda: page.one("#publish").is_enabled())


def test_a_long_answer_is_its_first_sentence_until_more_is_wanted(
    page: Browser, studio: Pretend
) -> None:
    first, rest = "A tree of 3.5 nodes, as far as it goes, was made", "The rest, at length" * 20
    studio.answers["undo"] = lambda _: (f"{first}. {rest}.", None)
    page.section("curate")
    page.press("#undo")
    page.until(lambda: page.one("#toasts .words").text == f"{first}.")
    page.press("#toasts button", "Say more")
    page.sees(rest, "#toasts")
    assert len(page.all("#toasts button")) == 1


def test_other_names_are_shown_everywhere(page: Browser, studio: Pretend, asked: Any) -> None:
    page.section("curate")
    field = page.one('#names [data-key="turn_left"] input')
    page.run("arguments[0].scrollIntoView({block: 'center'})", field)
    field.send_keys("links herum", Keys.ENTER)
    assert asked("rename") == {"name": "turn_left", "shown": "links herum"}
    studio.board.replace(Section.NAMES, {"turn_left": "links herum", "battery": "Ladung"})
    page.until(lambda: "links herum" in page.text('#curate-tree [data-path="1.1"] text'))
    assert page.text('#curate-tree [data-path="0.1"] > text') == "Ladung ≤ 0.95"
    page.section("live")
    page.sees("links herum", "#command")
    page.section("teach")
    page.sees("links herum", "#takeover")


# --- explain ---


def test_a_moment_of_a_demonstration_is_explained(page: Browser, asked: Any) -> None:
    page.section("explain")
    page.run(_CHOOSE, "#explain-which", NAMES[0])
    assert asked("explain") == {"demonstration": NAMES[0], "seconds": 0}
    page.run(_SLIDE, "#explain-seconds", 12)
    page.until(lambda: asked("explain", 2)["seconds"] == pytest.approx(12))
    page.sees("turn_left", "#explain-why .first")
    page.sees("target_bearing 1.24 → 0.25 → go", "#explain-why")
    page.until(lambda: page.text('#explain-values [data-key="docked"]') == "dockedno")
    battery = number_text(values_at(QUIET)["battery"])
    page.until(lambda: page.text('#explain-values [data-key="battery"]') == f"battery{battery}")
    page.until(lambda: battery in page.text('#explain-tree [data-path="0.1"] .meter'))
    page.until(lambda: page.all('#explain-tree [data-path="1.1"].active'))
    page.press_at("#explain-picture .cut", 0.25)
    page.until(lambda: asked("explain", 3)["seconds"] == pytest.approx(6, abs=0.5))


def test_a_moment_of_the_robot_is_explained(page: Browser, asked: Any) -> None:
    page.section("explain")
    page.press("#explain-strip button", "Earlier")
    assert time.time() - asked("explain")["t"] < 600
    page.sees("because target_bearing > 0.25", "#explain-why")


# --- speed ---


def test_an_update_costs_far_less_than_drawing_a_large_tree(
    chromium: Browser, studio: Pretend, record_property: Any
) -> None:
    learned, longer = large_tree(300), large_tree(306)
    sizes = [sum(1 for _ in nodes.walk(tree.tree)) for tree in (longer, learned)]
    assert len(set(sizes)) == 2
    count = "return document.querySelectorAll('#live-tree .node').length"

    def draw(number: int) -> None:
        studio.show_tree((longer, learned)[number % 2])
        chromium.until(lambda: chromium.run(count) == sizes[number % 2])

    def update(number: int) -> None:
        seen = chromium.run("return window.paints.length")
        studio.run(learned, (1 + number) / 10)
        chromium.until(lambda: chromium.run("return window.paints.length") > seen)

    studio.show_tree(learned)
    studio.run(learned, 0.0)
    chromium.look()
    chromium.command("Page.addScriptToEvaluateOnNewDocument", source=STOPWATCH)
    chromium.open(studio.url)
    # Of the processor's time: what others do on this machine must not count.
    chromium.command("Performance.enable", timeDomain="threadTicks")
    costs = {}
    for act, times in ((draw, 6), (update, 20)):
        busy = chromium.busy()
        for number in range(times):
            act(number)
        costs[act.__name__] = (chromium.busy() - busy) / times
    paints = sorted(chromium.run("return window.paints"))
    record_property("costs", costs)
    print(
        f"drawing {1e3 * costs['draw']:.0f} ms, an update {1e3 * costs['update']:.0f} ms of the "
        f"main thread; update to paint median {paints[len(paints) // 2]:.0f} ms, "
        f"p95 {paints[int(len(paints) * 0.95)]:.0f} ms"
    )
    assert costs["update"] < costs["draw"] / 2


def _ends(browser: Browser, studio: Pretend) -> bool:
    """Whether nothing is sent any more: longer than three times the period of what is held."""
    sent = len(studio.verbs("act"))
    browser.run(
        "window.over = false; setTimeout(() => { window.over = true }, 700)",
    )
    browser.until(lambda: browser.run("return window.over"))
    # One may have been under way.
    return len(studio.verbs("act")) <= sent + 1


_SLIDE = """const one = document.querySelector(arguments[0]);
    one.value = arguments[1];
    one.dispatchEvent(new Event('input', {bubbles: true}));"""

_CHOOSE = """const one = document.querySelector(arguments[0]);
    one.value = arguments[1];
    one.dispatchEvent(new Event('change', {bubbles: true}));"""

#: Words with a contrast below 4.5 to the colour behind them (WCAG 2 AA), or 3 where they are large.
_CUT_OFF = """const bounds = (one) => one.getBoundingClientRect();
    return [...document.querySelectorAll('main .card *')]
      .filter(one => one.checkVisibility() && !one.closest('svg, .tree-host, .plotly, .chart'))
      .filter(one => bounds(one).right > bounds(one.closest('.card')).right + 1)
      .map(one => one.outerHTML.slice(0, 200))"""

_FAINT = """
    const channel = (value) => {
      const share = value / 255;
      return share <= 0.03928 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    };
    const parsed = (color) => color.match(/[\\d.]+/g).map(Number);
    const light = ([red, green, blue]) =>
      0.2126 * channel(red) + 0.7152 * channel(green) + 0.0722 * channel(blue);
    const behind = (one) => {
      for (let at = one; at; at = at.parentElement) {
        const color = parsed(getComputedStyle(at).backgroundColor);
        if (color.length === 3 || color[3] > 0.9) return color;
      }
      return [255, 255, 255];
    };
    const faint = [];
    for (const one of document.querySelectorAll('body *')) {
      const words = [...one.childNodes].some((child) => child.nodeType === 3 && child.data.trim());
      if (!words || one instanceof SVGElement || !one.checkVisibility() || one.disabled) continue;
      const style = getComputedStyle(one);
      const both = [light(parsed(style.color)), light(behind(one))];
      const [first, second] = both.sort((left, right) => right - left);
      const large = parseFloat(style.fontSize) >= 24;
      if ((first + 0.05) / (second + 0.05) < (large ? 3 : 4.5)) {
        faint.push(`${one.tagName} ${one.className}: ${one.textContent.slice(0, 60)}`);
      }
    }
    return faint;"""
