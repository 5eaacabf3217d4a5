"""Numbers and lists in the docs are those of the code."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import robot_file_reference
import strategies as some

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
        f"by more than {timing.FENCE:g} times the range between the quartiles, and than "
        f"{timing.MANY_TIMES:g} times their median; told from {timing.FEWEST_INTERVALS} times on",
        f"at least {idle.IDLE_SECONDS:g} s (`--idle SECONDS`) and {idle.IDLE_ROWS} rows in which",
        f"varies by more than {idle.STILL * 100:g} % of its",
        f"of at least {duplicates.FEWEST_ROWS} rows that is as long as an earlier one "
        f"(to {duplicates.LENGTH * 100:g} %",
        f"alike in {duplicates.MOST_ROWS * 100:g} % of the rows",
        f"differs by more than {duplicates.ALIKE * 100:g} % of its",
        f"among more than {duplicates.MOST_DEMONSTRATIONS:,} demonstrations",
        f"of at least {outliers.FEWEST} demonstrations",
        f"modified z-score above {outliers.SCORE:g}",
        f"by a factor of {outliers.FACTOR:g}, by {outliers.SHARE:g}, or by half",
        f"by at least {outliers.OUTSIDE * 100:g} % of its usual range",
        f"{timing.MOST_LISTED} gaps, idle stretches and contradicting rows",
        f"{outliers.MOST_LISTED} outliers",
    ):
        assert said.casefold() in page.casefold()
    assert (outliers.RANGE, contradictions.MOST_LISTED) == (0.5, timing.MOST_LISTED)


def test_no_page_has_what_a_conflict_leaves() -> None:
    checkout = _DOCS.parent
    pages = [*_DOCS.glob("*.md"), *checkout.glob("*.md"), checkout / "CHANGELOG.rst"]
    marks = re.compile(r"^(<{7}|={7}$|>{7})", re.MULTILINE)
    assert [page.name for page in pages if marks.search(page.read_text(encoding="utf-8"))] == []
