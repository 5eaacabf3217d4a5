"""Pictures of a behavior tree: terminal, DOT and SVG."""

from __future__ import annotations

import re
import time
import xml.etree.ElementTree as ET
from itertools import pairwise

import py_trees
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import (
    Figures,
    LearnedTree,
    Provenance,
    Root,
    Suggestion,
    SuggestionKind,
)
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.drawing.dot import render_dot
from rebt_ros.drawing.layout import Box, Layout, outline, top_down
from rebt_ros.drawing.node_figures import PALETTE
from rebt_ros.drawing.svg import render_svg
from rebt_ros.drawing.text import render_text
from rebt_ros.logic.conditions import (
    Difference,
    Interval,
    IsTrue,
    Literal,
    PreviousActionIs,
    Threshold,
    WeightedSum,
)

SVG = "{http://www.w3.org/2000/svg}"


def learned(tree: nodes.Node, *suggestions: Suggestion) -> LearnedTree:
    """A document around the tree that declares all it needs."""
    shown = [tree, *(suggestion.subtree for suggestion in suggestions)]
    features = frozenset().union(*map(nodes.features, shown))
    actions = [action for each in shown for action in nodes.actions(each)]
    conditions = [one.literal.condition for each in shown for one in nodes.conditions(each)]
    actions += [act(one.action) for one in conditions if isinstance(one, PreviousActionIs)]
    figures = Figures(0, 0.9, 0.95, 40)
    return LearnedTree(
        features=tuple(Feature(name) for name in sorted(features)),
        actions=tuple(dict.fromkeys(actions)),
        tree=tree,
        provenance=Provenance(3, 160, 0.1, None, 0.0, Root.SELECTOR, History.LAST, figures),
        suggestions=suggestions,
    )


def holds(feature: str) -> nodes.Condition:
    return nodes.Condition(Literal(IsTrue(feature)))


def act(label: str) -> nodes.Action:
    return nodes.Action(label, "action")


EXAMPLE = nodes.Selector(
    (
        nodes.Sequence(
            (
                nodes.Condition(Literal(Threshold("battery", 0.30000001192092896))),
                nodes.Inverter(holds("docked")),
                act("dock"),
            )
        ),
        nodes.Parallel((nodes.Sequence((act("go"), act("turn")), memory=True), act("beep"))),
        nodes.Inverter(nodes.Selector((act("wait"),), memory=True)),
        act("turn"),
    )
)
SUGGESTIONS = (
    Suggestion("psa-1", SuggestionKind.PSA, 31, nodes.ParallelSelector((act("go"), act("beep")))),
    Suggestion("lat-1", SuggestionKind.LAT_SEQUENCE, 1, nodes.Sequence((act("go"), act("turn")))),
    Suggestion("rep-1", SuggestionKind.LAT_REPEATER, 7, nodes.Repeater((act("go"), act("turn")))),
    Suggestion("old-1", SuggestionKind.PSA, 5, act("go"), attached=True),
)

HOSTILE = [
    '"',
    "\\",
    '\\"',
    "<b>&amp;</b>",
    "]]>",
    "{|}",
    "\n",
    "\x00\x1b[31m",
    "\ud800",
    "\ufffe",
    "池",
]
labels = st.one_of(st.sampled_from(HOSTILE), st.text(max_size=8))
quantities = st.one_of(
    labels,
    st.lists(labels, min_size=2, max_size=2, unique=True).map(lambda pair: Difference(*pair)),
    st.lists(labels, min_size=2, max_size=3, unique=True).map(
        lambda its: WeightedSum(tuple((name, 0.1 + place) for place, name in enumerate(its)))
    ),
)
leaves = st.one_of(
    labels.map(act),
    labels.map(holds),
    labels.map(lambda label: nodes.Condition(Literal(PreviousActionIs(label)))),
    st.builds(
        lambda quantity, value: nodes.Condition(Literal(Threshold(quantity, value))),
        quantities,
        st.floats(-1e9, 1e9),
    ),
    st.builds(
        lambda quantity, above: nodes.Condition(Literal(Interval(quantity, above, above + 1))),
        quantities,
        st.floats(-1e9, 1e9),
    ),
)


def _inner(children: st.SearchStrategy[nodes.Node]) -> st.SearchStrategy[nodes.Node]:
    several = st.lists(children, min_size=1, max_size=4).map(tuple)
    return st.one_of(
        st.builds(nodes.Sequence, several, st.booleans()),
        st.builds(nodes.Selector, several, st.booleans()),
        st.builds(nodes.Parallel, several),
        st.builds(nodes.ParallelSelector, several),
        st.builds(nodes.Repeater, several),
        st.builds(nodes.Inverter, children),
    )


trees = st.recursive(leaves, _inner, max_leaves=30)


def chain(depth: int) -> nodes.Node:
    node: nodes.Node = act("go")
    for number in range(depth - 1):
        node = nodes.Sequence((holds(f"f{number}"), node)) if number % 2 else nodes.Inverter(node)
    return node


# --- terminal -----------------------------------------------------------------------------------


def test_the_text_has_one_line_per_node_and_inverted_conditions_on_one() -> None:
    assert render_text(learned(EXAMPLE)) == (
        "[o] Selector\n"
        "│   [-] Sequence\n"
        "│   │   --> battery ≤ 0.3\n"
        "│   │   -^- not: docked\n"
        "│   │   --> dock\n"
        "│   /_/ Parallel\n"
        "│   │   {-} Sequence\n"
        "│   │   │   --> go\n"
        "│   │   │   --> turn\n"
        "│   │   --> beep\n"
        "│   -^- not\n"
        "│   │   {o} Selector\n"
        "│   │   │   --> wait\n"
        "│   --> turn\n"
    )


def test_every_view_shows_an_interval_as_a_person_writes_it() -> None:
    between = nodes.Condition(Literal(Interval("battery", 0.30000001192092896, 0.5)))
    document = learned(nodes.Sequence((between, act("go"))))
    assert "--> 0.3 < battery ≤ 0.5\n" in render_text(document)
    assert "0.3 < battery ≤ 0.5" in render_dot(document)
    svg = render_svg(document)
    assert "0.3 < battery ≤ 0.5" in [text.text for text in ET.fromstring(svg).iter(f"{SVG}text")]
    titles = [title.text for title in ET.fromstring(svg).iter(f"{SVG}title")]
    assert "Condition: 0.30000001192092896 < 'battery' <= 0.5" in titles


def test_the_text_looks_like_the_unicode_display_of_py_trees() -> None:
    def leaf(name: str) -> py_trees.behaviour.Behaviour:
        return py_trees.behaviours.Success(name=name)

    def with_children(
        composite: py_trees.composites.Composite, *children: py_trees.behaviour.Behaviour
    ) -> py_trees.composites.Composite:
        composite.add_children(list(children))
        return composite

    policy = py_trees.common.ParallelPolicy.SuccessOnAll()
    theirs = with_children(
        py_trees.composites.Selector(name="Selector", memory=False),
        with_children(
            py_trees.composites.Sequence(name="Sequence", memory=False), leaf("docked"), leaf("go")
        ),
        with_children(
            py_trees.composites.Parallel(name="Parallel", policy=policy),
            with_children(py_trees.composites.Sequence(name="Sequence", memory=True), leaf("go")),
            py_trees.decorators.Inverter(
                name="not",
                child=with_children(
                    py_trees.composites.Selector(name="Selector", memory=True), leaf("turn")
                ),
            ),
        ),
    )
    ours = nodes.Selector(
        (
            nodes.Sequence((holds("docked"), act("go"))),
            nodes.Parallel(
                (
                    nodes.Sequence((act("go"),), memory=True),
                    nodes.Inverter(nodes.Selector((act("turn"),), memory=True)),
                )
            ),
        )
    )
    text = render_text(learned(ours)).replace("│", " ")
    assert text == py_trees.display.unicode_tree(theirs)


def test_the_text_shows_the_suggestions_that_are_not_attached() -> None:
    text = render_text(learned(EXAMPLE, *SUGGESTIONS))
    assert text.endswith(
        "\n"
        "Suggestion psa-1: Parallel or Selector, shown in 31 rows\n"
        "[o] Parallel/Selector\n"
        "│   --> go\n"
        "│   --> beep\n"
        "\n"
        "Suggestion lat-1: LAT Sequence, shown 1 time\n"
        "[-] Sequence\n"
        "│   --> go\n"
        "│   --> turn\n"
        "\n"
        "Suggestion rep-1: LAT Repeater, shown 7 times\n"
        "{-} Repeater\n"
        "│   --> go\n"
        "│   --> turn\n"
    )
    assert "old-1" not in text


@given(trees)
def test_colours_add_nothing_but_escape_sequences(tree: nodes.Node) -> None:
    plain, painted = render_text(learned(tree)), render_text(learned(tree), color=True)
    assert painted != plain
    assert re.sub("\x1b\\[[0-9;]*m", "", painted) == plain
    assert "\x1b" not in plain


# --- DOT ----------------------------------------------------------------------------------------

_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|->|[A-Za-z_][A-Za-z0-9_]*|[0-9.]+|[{}\[\];,=]')


def tokens(dot: str) -> list[str]:
    """The tokens of a DOT file, which must not hold anything else."""
    assert not _TOKEN.sub("", dot).strip()
    return _TOKEN.findall(dot)


@settings(deadline=None)
@given(trees, labels)
def test_dot_shows_each_node_and_edge_once_whatever_the_labels(tree: nodes.Node, id_: str) -> None:
    subtree = nodes.Sequence((act(id_), act("go")))
    found = tokens(
        render_dot(learned(tree, Suggestion(id_, SuggestionKind.LAT_SEQUENCE, 2, subtree)))
    )
    declared = [
        one for one, after in pairwise(found) if after == "[" and re.fullmatch("n[0-9]+", one)
    ]
    size = nodes.size(tree) + 3
    assert declared == [f"n{number}" for number in range(size)]
    assert found.count("->") == size - 2
    for left, right in ("{}", "[]"):
        assert found.count(left) == found.count(right)


def test_dot_escapes_what_graphviz_would_interpret() -> None:
    dot = render_dot(learned(act('say "\\N" & <i>')))
    assert 'label="\'say \\"\\\\\\\\N\\" &amp; <i>\'"' in dot


def test_dot_draws_suggestions_as_dashed_clusters_and_a_legend_of_what_occurs() -> None:
    dot = render_dot(learned(EXAMPLE, *SUGGESTIONS))
    assert dot.count("style=dashed") == dot.count("subgraph cluster_suggestion_") == 3
    assert 'label="Suggestion psa-1: Parallel or Selector, shown in 31 rows"' in dot
    assert "old-1" not in dot
    assert dot.count("    legend_") == 7
    assert "legend_psa" not in render_dot(learned(EXAMPLE))


# --- layout -------------------------------------------------------------------------------------


@st.composite
def drawn_trees(draw: st.DrawFn) -> list[Box]:
    """Boxes in preorder: each hangs under the one before it or under an ancestor of that."""
    boxes: list[Box] = []
    path: list[int] = []
    for index in range(draw(st.integers(1, 60))):
        if path:
            del path[draw(st.integers(1, len(path))) :]
        width, height = draw(st.integers(1, 300)), draw(st.sampled_from([20, 30, 45]))
        boxes.append(Box(width, height, path[-1] if path else None))
        path.append(index)
    return boxes


def assert_apart(boxes: list[Box], layout: Layout) -> None:
    placed = [
        (x, y, x + box.width, y + box.height)
        for (x, y), box in zip(layout.corners, boxes, strict=True)
    ]
    for index, (left, top, right, bottom) in enumerate(placed):
        assert min(left, top) >= -1e-6
        assert right <= layout.width + 1e-6
        assert bottom <= layout.height + 1e-6
        for other in placed[index + 1 :]:
            beside = right <= other[0] - 5 or other[2] <= left - 5
            above = bottom <= other[1] - 5 or other[3] <= top - 5
            assert beside or above


@given(drawn_trees())
def test_top_down_boxes_do_not_overlap_and_parents_are_centred(boxes: list[Box]) -> None:
    layout = top_down(boxes)
    assert_apart(boxes, layout)
    middles = [x + box.width / 2 for (x, _), box in zip(layout.corners, boxes, strict=True)]
    for index in range(len(boxes)):
        below = [middles[child] for child, box in enumerate(boxes) if box.parent == index]
        assert below == sorted(below)
        if below:
            assert middles[index] == pytest.approx((below[0] + below[-1]) / 2, abs=1e-6)


@given(drawn_trees())
def test_the_mirror_image_of_a_tree_is_drawn_as_its_mirror_image(boxes: list[Box]) -> None:
    children: dict[int | None, list[int]] = {}
    for index, box in enumerate(boxes):
        children.setdefault(box.parent, []).append(index)
    mirrored: list[Box] = []
    origin: list[int] = []
    waiting: list[tuple[int, int | None]] = [(0, None)]
    while waiting:
        index, parent = waiting.pop()
        waiting.extend((child, len(mirrored)) for child in children.get(index, []))
        mirrored.append(Box(boxes[index].width, boxes[index].height, parent))
        origin.append(index)
    layout, image = top_down(boxes), top_down(mirrored)
    for index, (x, y) in zip(origin, image.corners, strict=True):
        expected = layout.width - layout.corners[index][0] - boxes[index].width
        assert (x, y) == pytest.approx((expected, layout.corners[index][1]), abs=1e-6)


@given(drawn_trees())
def test_outline_boxes_do_not_overlap_and_read_in_order(boxes: list[Box]) -> None:
    layout = outline(boxes, width=500)
    assert_apart(boxes, layout)
    previous = (-1.0, -1.0)
    for (x, y), box in zip(layout.corners, boxes, strict=True):
        here = (y + box.height / 2, x)
        assert here > previous
        previous = here
        if box.parent is not None:
            assert x > layout.corners[box.parent][0]


def test_a_rule_is_one_line_of_an_outline() -> None:
    rule = [Box(80, 30, 0), *[Box(100, 30, 1)] * 3]
    layout = outline([Box(80, 30), *rule, Box(60, 30, 0)], width=1000)
    assert [y for _, y in layout.corners] == [0, 40, 40, 40, 40, 80]


@pytest.mark.parametrize("boxes", [[], [Box(1, 1, 0)], [Box(1, 1), Box(1, 1, 5)]])
def test_a_layout_refuses_what_is_no_tree(boxes: list[Box]) -> None:
    for arrange in (top_down, outline):
        with pytest.raises(ValueError):
            arrange(boxes)


# --- SVG ----------------------------------------------------------------------------------------


def drawn_nodes(svg: str) -> list[tuple[str, str]]:
    """Text and tooltip of each node in the picture."""
    found = []
    for group in ET.fromstring(svg.encode()).iter(f"{SVG}g"):
        if group.get("class", "").startswith("node "):
            label, tooltip = group.find(f"{SVG}text"), group.find(f"{SVG}title")
            assert label is not None
            assert tooltip is not None
            found.append((label.text or "", tooltip.text or ""))
    return found


@settings(deadline=None)
@given(trees, labels)
def test_svg_is_valid_and_shows_each_node_once_whatever_the_labels(
    tree: nodes.Node, id_: str
) -> None:
    suggestion = Suggestion(id_, SuggestionKind.PSA, 2, nodes.Sequence((act(id_), act("go"))))
    assert len(drawn_nodes(render_svg(learned(tree)))) == nodes.size(tree)
    assert len(drawn_nodes(render_svg(learned(tree, suggestion)))) == nodes.size(tree) + 3


def test_svg_shows_wording_exact_thresholds_and_provenance() -> None:
    svg = render_svg(learned(EXAMPLE))
    assert ("battery ≤ 0.3", "Condition: 'battery' <= 0.30000001192092896") in drawn_nodes(svg)
    assert (
        "15 nodes · learned from 160 rows of 3 demonstrations · agrees on 95.0% of 40 held-out rows"
        in svg
    )


def test_svg_frames_the_suggestions_that_are_not_attached() -> None:
    svg = render_svg(learned(EXAMPLE, *SUGGESTIONS))
    assert svg.count("stroke-dasharray") == 3
    assert "Suggestion rep-1: LAT Repeater, shown 7 times" in svg
    assert "old-1" not in svg
    for kind in ("psa", "lat_sequence", "repeater"):
        assert f'class="node {kind}"' in svg


def test_texts_have_enough_contrast_to_their_boxes() -> None:
    def luminance(color: str) -> float:
        parts = [int(color[start : start + 2], 16) / 255 for start in (1, 3, 5)]
        red, green, blue = (
            one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts
        )
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    for kind, colors in PALETTE.items():
        dark, light = sorted([luminance(colors.fill), luminance(colors.text)])
        assert (light + 0.05) / (dark + 0.05) >= 4.5, kind


@pytest.mark.parametrize("depth", [1, 200, 3000])
def test_deep_trees_are_drawn(depth: int) -> None:
    document = learned(chain(depth))
    size = nodes.size(document.tree)
    assert len(drawn_nodes(render_svg(document))) == size
    assert render_dot(document).count("->") == size - 1
    assert render_text(document).count("\n") == size
    top_down([Box(10, 10, number - 1 if number else None) for number in range(depth)])


def test_layouts_take_linear_time() -> None:
    def seconds(size: int) -> float:
        bushy = [Box(20, 10, (number - 1) // 2 * 2 if number else None) for number in range(size)]
        best = float("inf")
        for _ in range(3):
            start = time.perf_counter()
            top_down(bushy)
            outline(bushy)
            best = min(best, time.perf_counter() - start)
        return best

    assert seconds(16_000) < 32 * seconds(2_000)
