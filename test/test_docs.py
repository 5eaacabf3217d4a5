"""Numbers and lists in the docs are those of the code."""

from __future__ import annotations

import ast
import contextlib
import json
import random
import re
import shlex
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import references
import robot_file_reference
import strategies as some
import yaml

from rebt_ros.behavior_tree import document
from rebt_ros.behavior_tree.shown import MOST_SHOWN_LEAVES
from rebt_ros.beyond_the_paper import reductions
from rebt_ros.decision_tree import simplest
from rebt_ros.inspection import contradictions, duplicates, idle, outliers, timing
from rebt_ros.learning import suggesting
from rebt_ros.robot_file.reading import json_schema

#: And the kind of a feature that has one.
KINDS_OF_NODES = frozenset({"action", "condition", "inverter", "categorical"})
_DOCS = Path(__file__).resolve().parents[1] / "docs"


def text_of(name: str) -> str:
    """A page with its lines joined."""
    return " ".join((_DOCS / name).read_text(encoding="utf-8").split())


def test_the_page_on_formats_says_what_the_reader_of_documents_takes() -> None:
    page = text_of("formats.md")
    assert f"more than 100 levels or {document.LARGEST_DOCUMENT // 10**6} million char" in page
    assert f'`"{document.FORMAT}"`, `{document.VERSION}`' in page
    assert f"at most {MOST_SHOWN_LEAVES} leaves for a channel" in page
    written = json.loads(document.dumps(some.learned(some.ACTIONS[0])))
    assert [name for name in written if f"`{name}`" not in page] == []


def test_the_page_on_formats_names_each_type_of_condition() -> None:
    schema = json.dumps(document.json_schema())
    types = set(
        re.findall(r'"const": "((?:\w+_)?(?:is|threshold|interval|category|true)\w*)"', schema)
    )
    assert {"threshold", "previous_action_is"} <= types
    page = text_of("formats.md")
    assert [
        name for name in sorted(types) if f"`{name}`" not in page and f'"{name}"' not in page
    ] == []


def test_the_reference_of_robot_files_is_that_of_their_schema() -> None:
    made = robot_file_reference.reference()
    assert made == robot_file_reference.PAGE.read_text(encoding="utf-8")
    schema: Any = json_schema()
    maps = {name for name, form in schema["$defs"].items() if "properties" in form}
    assert maps == robot_file_reference._TITLES.keys()


@pytest.mark.parametrize("name", references.PAGES)
def test_a_reference_page_is_what_the_code_declares(name: str) -> None:
    pytest.importorskip("rclpy")
    page = (_DOCS / name).read_text(encoding="utf-8")
    assert references.PAGES[name]() == page, "the page is not fresh: run 'make references'"


def pages() -> list[Path]:
    checkout = _DOCS.parent
    return [*sorted(_DOCS.glob("*.md")), checkout / "README.md", checkout / "CONTRIBUTING.md"]


def code_of(page: Path) -> list[str]:
    """The lines of a page's blocks of code for a shell, those that go on joined."""
    lines: list[str] = []
    language: str | None = None
    for line in page.read_text(encoding="utf-8").replace("\\\n", " ").splitlines():
        if line.startswith("```"):
            language = line.strip("`") if language is None else None
        elif language in ("", "bash"):
            lines.append(line)
    return lines


def command_lines(page: Path) -> Iterator[tuple[str, list[str]]]:
    """The executables of this package that a page runs, with their arguments."""
    for line in code_of(page):
        _, run, rest = re.sub(r"\$\([^)]*\)", "X", line).partition("ros2 run rebt_ros ")
        if run:
            words = shlex.split(rest, comments=True)
            ends = [place for place, word in enumerate(words) if word in {">", "&", "|", "&&"}]
            name, *arguments = words[: min(ends, default=len(words))]
            yield name, arguments


def test_every_command_in_the_docs_has_the_options_that_it_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy")
    monkeypatch.chdir(tmp_path)
    # Read while the command line is.
    (tmp_path / "robot.yaml").write_text("state: {x: /o.x}\nactions: {a: /a.data}\n")
    parameters = (_DOCS / "parameter_reference.md").read_text(encoding="utf-8")
    commands = references.commands()
    checked = 0
    for page in pages():
        for name, arguments in command_lines(page):
            checked += 1
            if name in commands:
                with contextlib.redirect_stderr(None):
                    try:
                        references.parser_of(name).parse_intermixed_args(arguments)
                    except SystemExit:
                        pytest.fail(f"{page.name}: {name} {shlex.join(arguments)}")
                continue
            [section] = re.findall(rf"^## {name}\n(.*?)(?:^## |\Z)", parameters, re.M | re.DOTALL)
            given = pairwise(arguments)
            for parameter in (word.split(":=")[0] for flag, word in given if flag == "-p"):
                assert f"| `{parameter}` |" in section, (page.name, name, parameter)
    assert checked >= 60


def test_every_make_target_in_the_docs_exists() -> None:
    makefile = (_DOCS.parent / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    used = {
        (page.name, target)
        for page in pages()
        for line in (*code_of(page), *re.findall(r"`(make [^`]*)`", page.read_text("utf-8")))
        for target in re.findall(r"^make ([a-z][\w-]*)", line)
    }
    assert len(used) >= 10
    assert {one for one in used if one[1] not in targets} == set()


def anchors(page: Path) -> set[str]:
    """What links may name in a page, as GitHub makes it of headings."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", one).strip().lower().replace(" ", "-") for one in headings}


def test_every_link_leads_somewhere() -> None:
    broken = []
    for page in [*pages(), _DOCS.parent / "QUALITY_DECLARATION.md"]:
        text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"https?:", link):
                continue
            file, _, anchor = link.partition("#")
            target = page.parent / file if file else page
            if not target.exists() or (anchor and anchor not in anchors(target)):
                broken.append((page.name, link))
    assert broken == []


def test_every_page_is_in_a_drawer() -> None:
    index = (_DOCS / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (\w[\w-]*):", index, re.MULTILINE) == [
        "Tutorials",
        "How-to",
        "Reference",
        "Explanation",
    ]
    named = set(re.findall(r"\]\((\w+\.md)", index))
    assert {page.name for page in _DOCS.glob("*.md")} - named == {"README.md"}


def test_the_page_on_the_paper_names_functions_that_name_their_lines() -> None:
    page = (_DOCS / "paper.md").read_text(encoding="utf-8")
    package = _DOCS.parent / "rebt_ros"
    rows = re.findall(r"^\| ([\d to]+) \| .* \| `([\w/]+\.py)` \| `(\w+)` \|$", page, re.MULTILINE)
    assert len(rows) >= 18
    algorithms = [package / "paper" / name for name in ("re_bt_espresso.py", "lat_trees.py")]
    for lines, module, function in rows:
        text = (package / module).read_text(encoding="utf-8")
        defined = {one.name for one in ast.parse(text).body if isinstance(one, ast.FunctionDef)}
        assert function in defined, (lines, module, function)
        said = text + "".join(one.read_text(encoding="utf-8") for one in algorithms)
        assert re.search(rf"\b[Ll]ines? {lines}\b", said), (lines, module, function)


#: What other tests run: with data from elsewhere, nodes, or a recording by its name.
_ELSEWHERE = re.compile(r"--no-header|^experiment|^trial|--demonstration|SCHEDULER")

#: An address in place of which commands get that of a cluster.
_SCHEDULER = "tcp://10.0.0.1:8786"


def _write(path: Path, header: str, rows: Iterable[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([header, *rows]) + "\n")


def _rows() -> Iterator[str]:
    return (f"{x / 10},{'go' if x < 20 else 'turn'}" for x in range(40))


def _data_of_many_bags() -> None:
    """Tables in place of bags and recordings."""
    names = ("my_bag/1", "demonstrations/1", *(f"fleet/{one}" for one in ("run_1", "run_7")))
    for name in (*names, "fleet/run_9", "fleet/tuesday_1", "fleet/2026-11/run_1/1"):
        _write(Path(f"{name}.csv"), "front,action", _rows())
    Path("bad.txt").write_text("run_9.csv\n")
    Path("good.txt").write_text("# comment\nfleet/run_1.csv\nfleet/run_7.csv\n")
    # The names on the page are examples.
    weights = code_of(_DOCS / "learning.md")
    start = weights.index("demonstration,weight")
    Path("weights.csv").write_text("\n".join(weights[start : start + 4]) + "\n")
    _write(Path("fleet/expert_1.csv"), "front,action", _rows())


def _data_of_the_readme() -> None:
    """Bags, tables with several columns of actions, and what has routines."""
    bags = pytest.importorskip("robot_bags")
    messages = bags.plain(float(x) / 10 for x in range(40))
    bags.write_bag(Path("my_bag"), messages)
    bags.write_bag(Path("another"), messages)
    next(Path("another").glob("*.mcap")).rename("another.mcap")
    bags.write_bag(Path("your_bag"), bags.shown())
    _write(Path("demonstrations/1.csv"), "front,action", _rows())
    both = (
        f"{row},{'up' if place % 7 > 3 else 'down'},{'turn' if place % 9 > 5 else 'go'}"
        for place, row in enumerate(_rows())
    )
    _write(Path("table.csv"), "front,action,arm,base", both)
    draw = random.Random(3)
    for number in range(2):
        fronts = (round(4 * draw.random(), 2) for _ in range(100))
        each = ((x, ("lift", "grasp", "place") if x < 2 else ("go",)) for x in fronts)
        rows = (f"{x},{action}" for x, actions in each for action in actions)
        _write(Path(f"fleet/{number}.csv"), "front,action", rows)
    Path("rules.yaml").write_text("rules:\n- {never: place, when: front > 3.5}\n")


def _data_of_a_robot() -> None:
    bags = pytest.importorskip("robot_bags")
    for name in ("my_bag", "another_bag"):
        bags.write_bag(Path(name), bags.shown())


def _data_of_rules() -> None:
    def action(front: float, battery: float, docked: int) -> str:
        if docked and battery < 0.9:
            return "charge"
        return "go" if front > 0.5 else "turn_left"

    draw = random.Random(1)
    states = [(draw.random() * 2, draw.random(), draw.randrange(2)) for _ in range(200)]
    rows = (f"{x:.3f},{1 - x:.3f},{b:.3f},{d},{action(x, b, d)}" for x, b, d in states)
    _write(Path("demonstrations/1.csv"), "front,target_bearing,battery,docked,action", rows)
    [rules] = re.findall(
        r"```yaml\n(# rules.yaml\n.*?)```", (_DOCS / "rules.md").read_text("utf-8"), re.DOTALL
    )
    Path("rules.yaml").write_text(rules)


def _exit_code(main: Callable[[list[str]], None], arguments: list[str]) -> object:
    try:
        main(arguments)
    except SystemExit as ended:
        return ended.code
    return 0


@pytest.mark.parametrize(
    ("pages", "prepare", "number"),
    [
        ("export.md groot2.md inspect.md learning.md", _data_of_many_bags, 7),
        ("scale.md", _data_of_many_bags, 5),
        ("../README.md", _data_of_the_readme, 15),
        ("robot_file.md", _data_of_a_robot, 3),
        ("rules.md trial.md", _data_of_rules, 5),
        ("simulation.md", lambda: None, 3),
    ],
)
def test_the_commands_on_a_page_work_as_printed(
    pages: str,
    prepare: Callable[[], None],
    number: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    prepare()
    lines = [line for page in pages.split() for line in command_lines(_DOCS / page)]
    ran = 0
    with contextlib.ExitStack() as stack:
        for name, arguments in lines:
            if name not in references.commands() or _ELSEWHERE.search(
                shlex.join([name, *arguments])
            ):
                continue
            if _SCHEDULER in arguments:
                distributed = pytest.importorskip("distributed")
                cluster = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
                    )
                )
                arguments[arguments.index(_SCHEDULER)] = cluster.scheduler_address
            # A rule that is broken or unknown is what `check` is asked about.
            code = _exit_code(references.main_of(name), arguments)
            assert code == 0 or (name, code) == ("check", 1), (arguments, capsys.readouterr().err)
            ran += 1
    assert ran >= number
    assert "Traceback" not in capsys.readouterr().err


def test_rosdoc2_can_read_its_settings_and_finds_the_pages() -> None:
    checkout = _DOCS.parent
    head, settings = yaml.safe_load_all((checkout / "rosdoc2.yaml").read_text(encoding="utf-8"))
    assert head == {"type": "rosdoc2 config", "version": 1}
    assert [list(builder) for builder in settings["builders"]] == [["sphinx"]]
    assert isinstance(settings["settings"], dict)
    assert (checkout / "doc" / "README.md").samefile(_DOCS / "README.md")


def test_the_page_on_learning_names_the_limits() -> None:
    page = " ".join(text_of("learning.md").split())
    rows, leaves, each = simplest._MOST_ROWS, simplest._MOST_LEAVES, simplest._LEAST_ROWS_PER_LEAF
    assert (
        f"trees of up to {leaves} leaves, with at least {each} rows for each, and at most {rows}"
        in page
    )
    for limit in (
        reductions.MOST_LEAVES_BY_DOMAIN,
        reductions.MOST_LEAVES_IN_BEST_ORDER,
        reductions.MOST_LEAVES_MINIMIZED,
    ):
        assert f" {limit} leaves" in page
    assert suggesting._MOST_SUGGESTIONS == 12
    assert "at most twelve suggestions" in page


def test_the_page_on_inspecting_names_the_thresholds() -> None:
    page = text_of("inspect.md")
    for said in (
        f"by more than {timing.FENCE:g} times the range between the quartiles",
        f"more than {timing.MANY_TIMES:g} times their median",
        f"takes at least {timing.FEWEST_INTERVALS} distances to tell",
        f"at least {idle.IDLE_SECONDS:g} s (`--idle SECONDS`) and {idle.IDLE_ROWS} rows in which",
        f"varies by more than {idle.STILL * 100:g} % of its",
        f"of at least {duplicates.FEWEST_ROWS} rows that is nearly the same as an earlier one",
        f"as long (to {duplicates.LENGTH * 100:g} %",
        f"alike in {duplicates.MOST_ROWS * 100:g} % of the rows",
        f"differs by more than {duplicates.ALIKE * 100:g} % of its",
        f"among more than {duplicates.MOST_DEMONSTRATIONS:,} demonstrations",
        f"among at least {outliers.FEWEST} demonstrations",
        f"modified z-score above {outliers.SCORE:g}",
        f"| a factor of {outliers.FACTOR:g} |",
        f"| the share of an action | {outliers.SHARE:g} |",
        "| the median of a feature | half of its usual range |",
        f"by at least {outliers.OUTSIDE * 100:g} % of its usual range",
        f"{timing.MOST_LISTED} gaps, idle stretches and contradicting rows",
        f"{outliers.MOST_LISTED} outliers",
    ):
        assert said.casefold() in page.casefold()
    assert (outliers.RANGE, contradictions.MOST_LISTED) == (0.5, timing.MOST_LISTED)


def test_the_sample_on_the_page_on_inspecting_is_what_the_command_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fleet").mkdir()
    for name, going in (("a", 120), ("b", 140)):
        lines = ["stamp,front,load,action"]
        for row in range(200):
            front, load, late = 3 - row / 100, row % 7, 2.9 * (row > 120)
            if name == "b":
                standing, undecided = row < 43, row in {138, 139, 140}
                front = 2.0 if standing else 1.505 if undecided else front + 0.001
                load, late = 3, 0.0
            stamp = 1_700_000_000_000_000_000 + round((row / 10 + late) * 1e9)
            lines.append(f"{stamp},{front},{load},{'go' if row < going else 'turn'}")
        (tmp_path / "fleet" / f"{name}.csv").write_text("\n".join(lines) + "\n")
    references.main_of("inspect")(["fleet", "--no-cache"])
    shown = (_DOCS / "inspect.md").read_text(encoding="utf-8").split("```")[3]
    assert capsys.readouterr().out.splitlines() == shown.strip().splitlines()


def test_no_page_has_what_a_conflict_leaves() -> None:
    checkout = _DOCS.parent
    pages = [*_DOCS.glob("*.md"), *checkout.glob("*.md"), checkout / "CHANGELOG.rst"]
    marks = re.compile(r"^(<{7}|={7}$|>{7})", re.MULTILINE)
    assert [page.name for page in pages if marks.search(page.read_text(encoding="utf-8"))] == []


#: British spellings; behaviours are what py_trees calls them.
_BRITISH = re.compile(
    r"\b(?:colour|neighbour|honour|favour|metres?\b|centred?\b|grey\b|licence|catalogue|judgement"
    r"|(?:organ|recogn|minim|optim|normal|summar|initial|synchron|general|random|visual|special)is"
    r"(?:e[ds]?|ing|ation)\b)\w*",
    re.IGNORECASE,
)


def test_all_pages_are_spelled_as_in_the_united_states() -> None:
    root = _DOCS.parent
    pages = [*_DOCS.rglob("*.md"), *root.glob("*.md"), root / "CHANGELOG.rst"]
    settings = (root / "config").glob("*.yaml")
    found = {
        (page.name, word)
        for page in (*pages, *settings)
        for word in _BRITISH.findall(page.read_text(encoding="utf-8"))
    }
    assert not found
