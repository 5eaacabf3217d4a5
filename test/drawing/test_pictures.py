"""Pictures of decision trees, PNG files of any picture, and the plot of all pruning levels."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.drawing import png
from rebt_ros.drawing.accuracy_plot import AccuracyCurve, PlotFormat, render_accuracy_plot
from rebt_ros.drawing.decision_tree_dot import render_decision_tree_dot
from rebt_ros.drawing.decision_tree_picture import decision_tree_page
from rebt_ros.drawing.decision_tree_svg import render_decision_tree_svg
from rebt_ros.drawing.errors import MatplotlibMissingError, PictureTooLargeError
from rebt_ros.drawing.shapes import Drawing, Node, Page, Text, text_width
from rebt_ros.drawing.tree_picture import behavior_tree_page
from rebt_ros.drawing.tree_png import render_decision_tree_png, render_png
from rebt_ros.logic.conditions import (
    Difference,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
)

SVG = "{http://www.w3.org/2000/svg}"
GO, TURN = nodes.Action("go", "action"), nodes.Action("turn", "action")
PLAYED = DecisionTree(
    (GO, TURN),
    Split(
        Threshold("battery", 0.30000001192092896),
        Leaf((0, 40)),
        Split(LastActionIs("go"), Leaf((399, 1)), Leaf((1, 0))),
    ),
)
HOSTILE = ["$x^2$", "$", '\\"', "<b>&amp;</b>", "\n", "\x00\x1b[31m", "\ud800", "\ufffe", "池"]

needs_matplotlib = pytest.mark.usefixtures("matplotlib_is_there")


@pytest.fixture
def matplotlib_is_there() -> None:
    pytest.importorskip("matplotlib")


def learned(tree: nodes.Node) -> LearnedTree:
    return LearnedTree(
        tuple(map(Feature, sorted(nodes.features(tree)))),
        nodes.actions(tree),
        tree,
        Provenance(1, 10, 0.0, None, 0.0, Root.SELECTOR, History.NONE, Figures(0, None, None, 0)),
    )


def size_of(data: bytes) -> tuple[int, int]:
    """Width and height of a PNG file, read in full."""
    image = pytest.importorskip("PIL.Image").open(io.BytesIO(data))
    image.load()
    assert image.format == "PNG"
    return (image.width, image.height)


labels = st.one_of(st.sampled_from(HOSTILE), st.text(max_size=8))
decision_nodes: st.SearchStrategy[DecisionNode] = st.recursive(
    st.builds(lambda go, turn: Leaf((go, turn)), st.integers(0, 50), st.integers(1, 50)),
    lambda below: st.builds(
        Split,
        st.one_of(
            st.builds(Threshold, labels, st.floats(-1e9, 1e9)),
            st.builds(IsTrue, labels),
            st.builds(LastActionIs, labels),
            st.builds(PreviousActionIs, labels),
            st.builds(
                lambda pair, value: Threshold(Difference(*pair), value),
                st.lists(labels, min_size=2, max_size=2, unique=True),
                st.floats(-1e9, 1e9),
            ),
        ),
        below,
        below,
    ),
    max_leaves=20,
)


def chain(depth: int) -> DecisionTree:
    node: DecisionNode = Leaf((3, 4))
    for number in range(depth):
        node = Split(Threshold("x", float(number)), Leaf((1, 0)), node)
    return DecisionTree((GO, TURN), node)


# --- decision trees -----------------------------------------------------------------------------


def drawn(svg: str) -> list[tuple[list[str], str]]:
    """Lines of text and tooltip of each node in the picture."""
    found = []
    for group in ET.fromstring(svg.encode()).iter(f"{SVG}g"):
        tooltip = group.find(f"{SVG}title")
        assert tooltip is not None
        lines = [one.text or "" for one in group.iter(f"{SVG}text")]
        found.append((lines, tooltip.text or ""))
    return found


def test_a_decision_tree_shows_conditions_and_how_sure_its_leaves_are() -> None:
    svg = render_decision_tree_svg(PLAYED)
    assert drawn(svg) == [
        (["battery ≤ 0.3"], "Condition: 'battery' <= 0.30000001192092896"),
        (["turn", "all of 40"], "Leaf: 40 rows: turn 40 (100%)"),
        (
            ["last action = go"],
            "Condition: the most recent action other than the action being decided is 'go'",
        ),
        (["go", "99.75% of 400"], "Leaf: 400 rows: go 399 (99.75%), turn 1 (0.25%)"),
        (["go", "1 row"], "Leaf: 1 row: go 1 (100%)"),
    ]
    assert "3 leaves · 2 splits deep · 2 actions · learned from 441 rows" in svg


def test_the_answer_that_leads_to_a_node_stands_on_its_link() -> None:
    page = decision_tree_page(PLAYED)
    answers = [one for one in page.drawing.marks if isinstance(one, Text)]
    assert [one.text for one in answers if one.text in ("yes", "no")] == ["yes", "no"] * 2
    shown = {one.texts[0].text: one.panel for one in page.drawing.marks if isinstance(one, Node)}
    yes = next(one for one in answers if one.text == "yes")
    assert yes.x == pytest.approx(shown["turn"].x + shown["turn"].width / 2, abs=1)


def test_a_decision_tree_with_a_single_leaf_is_drawn() -> None:
    svg = render_decision_tree_svg(DecisionTree((GO, TURN), Leaf((3, 1))))
    assert drawn(svg) == [(["go", "75% of 4"], "Leaf: 4 rows: go 3 (75%), turn 1 (25%)")]
    assert "1 leaf · 0 splits deep · 1 action · learned from 4 rows" in svg


@settings(deadline=None)
@given(decision_nodes, labels)
def test_decision_trees_are_valid_svg_and_dot_whatever_the_labels(
    root: DecisionNode, label: str
) -> None:
    tree = DecisionTree((nodes.Action(label, "action"), TURN), root)
    size = sum(1 for _ in tree.walk())
    assert len(drawn(render_decision_tree_svg(tree))) == size
    token = r'"(?:[^"\\]|\\.)*"|->|[A-Za-z_][A-Za-z0-9_]*|[0-9.]+|[{}\[\];,=]'
    dot = render_decision_tree_dot(tree)
    assert not re.sub(token, "", dot).strip()
    found = re.findall(token, dot)
    declared = [one for one, after in pairwise(found) if after == "[" and re.match("n[0-9]", one)]
    assert len(set(declared)) == size
    assert found.count("->") == size - 1


@pytest.mark.parametrize("depth", [30, 2000])
def test_deep_decision_trees_are_drawn(depth: int) -> None:
    tree = chain(depth)
    assert tree.depth == depth
    assert len(drawn(render_decision_tree_svg(tree))) == 2 * depth + 1
    assert render_decision_tree_dot(tree).count("->") == 2 * depth


# --- PNG ----------------------------------------------------------------------------------------


@needs_matplotlib
def test_a_png_file_shows_the_whole_page_twice_as_large() -> None:
    tree = nodes.Selector((nodes.Condition(Literal(IsTrue("docked"))), GO))
    page = behavior_tree_page(learned(tree))
    width, height = size_of(render_png(learned(tree)))
    assert (width, height) == pytest.approx(
        (2 * page.drawing.width, 2 * page.drawing.height), abs=2
    )
    assert size_of(render_decision_tree_png(PLAYED))[0] > 300


@needs_matplotlib
@pytest.mark.parametrize("label", HOSTILE)
def test_png_files_are_made_without_a_warning_whatever_the_labels(
    label: str, recwarn: pytest.WarningsRecorder
) -> None:
    size_of(render_png(learned(nodes.Selector((nodes.Action(label, "action"), GO)))))
    assert [str(one.message) for one in recwarn] == []


@needs_matplotlib
def test_equal_trees_make_equal_png_files() -> None:
    assert render_decision_tree_png(PLAYED) == render_decision_tree_png(PLAYED)


@needs_matplotlib
def test_settings_of_the_user_do_not_change_a_png_file() -> None:
    import matplotlib

    before = render_decision_tree_png(PLAYED)
    with matplotlib.rc_context({"text.usetex": True, "font.size": 40.0, "savefig.dpi": 10.0}):
        assert render_decision_tree_png(PLAYED) == before


@needs_matplotlib
@pytest.mark.parametrize("text", ["Sharp-Right-Turn", "x14 ≤ 0.903", "WWW mmm", "→* Sequence", "?"])
@pytest.mark.parametrize("bold", [False, True])
def test_words_are_not_wider_than_the_room_they_get(text: str, bold: bool) -> None:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
    extents = TextPath((0, 0), text, size=13, prop=font).get_extents()
    assert extents.width <= text_width(text, 13, bold=bold) + 10


@needs_matplotlib
def test_a_huge_picture_is_made_smaller_or_refused() -> None:
    tall = Page("tall", Drawing((), 1000, 15_000))
    width, height = size_of(png.render_page_png(tall))
    assert height <= 16_000
    assert width / height == pytest.approx(1 / 15, rel=0.01)
    with pytest.raises(PictureTooLargeError, match="SVG"):
        png.render_page_png(Page("taller", Drawing((), 1000, 200_000)))


@pytest.mark.usefixtures("matplotlib_is_missing")
def test_without_matplotlib_there_is_a_sentence_and_no_picture() -> None:
    with pytest.raises(MatplotlibMissingError, match="pip install matplotlib"):
        render_decision_tree_png(PLAYED)
    with pytest.raises(MatplotlibMissingError, match="pip install matplotlib"):
        render_accuracy_plot(curve(), PlotFormat.SVG)
    assert render_decision_tree_svg(PLAYED)


# --- the plot -----------------------------------------------------------------------------------


def curve(levels: int = 6, chosen: float = 0.01) -> AccuracyCurve:
    alphas = np.concatenate(([0.0], np.geomspace(1e-4, 0.2, levels - 1))) if levels > 1 else [0.0]
    return AccuracyCurve(
        np.asarray(alphas),
        np.linspace(0.9, 0.5, levels),
        np.full(levels, 0.02),
        np.arange(levels, 0, -1) ** 3,
        chosen,
    )


@needs_matplotlib
@pytest.mark.parametrize("levels", [1, 2, 6, 300])
@pytest.mark.parametrize("chosen", [0.0, 0.01, 5.0])
def test_the_plot_is_a_valid_png_and_svg_file(levels: int, chosen: float) -> None:
    shown = curve(levels, chosen)
    width, height = size_of(render_accuracy_plot(shown, PlotFormat.PNG))
    assert width > height > 500
    root = ET.fromstring(render_accuracy_plot(shown, PlotFormat.SVG))
    assert root.tag == f"{SVG}svg"
    assert len(list(root.iter(f"{SVG}path"))) > 10


@needs_matplotlib
def test_the_plot_names_the_best_and_the_chosen_level() -> None:
    svg = render_accuracy_plot(curve(chosen=0.0002), PlotFormat.SVG).decode()
    # matplotlib draws letters as outlines and keeps the words as comments.
    assert "<!-- best: 90.0% with 216 leaves -->" in svg
    assert "<!-- chosen: 82.0% with 125 leaves -->" in svg


@needs_matplotlib
def test_equal_curves_make_equal_plots() -> None:
    for form in PlotFormat:
        assert render_accuracy_plot(curve(), form) == render_accuracy_plot(curve(), form)
