"""A studio without a robot: the real server and board, with contents and answers of the test's own.

So tests of the page need neither ROS nor learning, and can put it into any state at once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

import strategies as some

from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Suggestion, SuggestionKind
from rebt_ros.behavior_tree.shown import ShownChannel, ShownLeaf, Span
from rebt_ros.behavior_tree.wording import quantity_text
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import Interval, IsTrue, Literal, Quantity, Threshold
from rebt_ros.ros.studio.server import Server
from rebt_ros.studio.board import Board, Section
from rebt_ros.studio.tree_view import published_view, suggestion_views, tree_view
from rebt_ros.studio.verbs import Reply

DOCUMENT: Final = "0123abcd"
#: How far back the timeline reaches (seconds).
REACH: Final = 600
#: Seconds of two states, in which the small tree turns left, and right.
QUIET: Final = 1.0
EARLIER: Final = 5.0
LABELS: Final = ("charge", "go", "turn_left", "turn_right")
#: Name and range of each feature.
RANGES: Final = {
    "left": (0.2, 4.0),
    "front": (0.3, 4.0),
    "right": (0.2, 4.0),
    "target_bearing": (-3.1, 3.1),
    "battery": (0.2, 1.0),
    "docked": (0.0, 1.0),
}
NAMES: Final = ("20261128T091502.120000Z-1-aaaaaa", "20261128T091744.500000Z-1-bbbbbb")
_FEATURES: Final = tuple(
    Feature(name, FeatureKind.BINARY if name == "docked" else FeatureKind.NUMERIC)
    for name in RANGES
)


def _action(label: str) -> nodes.Action:
    return nodes.Action(label, "action")


def _at_most(feature: str, value: float, *, positive: bool = True) -> nodes.Condition:
    return nodes.Condition(Literal(Threshold(feature, value), positive))


def small_tree() -> LearnedTree:
    """The tree of the demonstration robot, with a node to be chosen and a suggestion."""
    docked = nodes.Condition(Literal(IsTrue("docked")))
    tree = nodes.Selector(
        (
            nodes.Sequence((docked, _at_most("battery", 0.95), _action("charge"))),
            nodes.Sequence(
                (_at_most("target_bearing", 0.25, positive=False), _action("turn_left"))
            ),
            nodes.Sequence(
                (
                    _at_most("target_bearing", -0.25),
                    nodes.Inverter(nodes.Condition(Literal(Interval("right", 0.1, 0.6)))),
                    nodes.ParallelSelector((_action("turn_right"), _action("go"))),
                )
            ),
            _action("go"),
        )
    )
    routine = nodes.Sequence((_at_most("front", 0.4), _action("turn_right"), _action("go")))
    suggestion = Suggestion("lat-sequence-1", SuggestionKind.LAT_SEQUENCE, 104, routine)
    shown = ShownChannel("action", (ShownLeaf(10, tuple(Span(*ends) for ends in RANGES.values())),))
    actions = tuple(map(_action, LABELS))
    return LearnedTree(_FEATURES, actions, tree, some.PROVENANCE, (suggestion,), (shown,))


def large_tree(size: int) -> LearnedTree:
    """A tree of so many nodes, or a few more: conditions on numbers, mostly."""
    branches: list[nodes.Node] = []
    while 1 + 6 * len(branches) < size:
        number = len(branches)
        tests = [
            _at_most(feature, low + (high - low) * ((number * 7 + place) % 50 + 1) / 52)
            for place, (feature, (low, high)) in enumerate(list(RANGES.items())[:4])
        ]
        branches.append(nodes.Sequence((*tests, _action(LABELS[number % len(LABELS)]))))
    return LearnedTree(
        _FEATURES, tuple(map(_action, LABELS)), nodes.Selector(tuple(branches)), some.PROVENANCE
    )


def values_at(seconds: float) -> dict[str, float]:
    """A state of the robot, which is another one at any other time."""
    return {
        name: round(low + (high - low) * (0.5 + 0.5 * math.sin(seconds * (1 + place) / 3)), 5)
        for place, (name, (low, high)) in enumerate(RANGES.items())
        if name != "docked"
    } | {"docked": 0.0}


def demonstration(start: float, seconds: float = 24.0, **given: Any) -> dict[str, Any]:
    """A demonstration, as the studio shows it."""
    bands = [[place * 4.0, place * 4.0 + 4.0, LABELS[(place * 3) % 4]] for place in range(6)]
    actions = {label: 20 * sum(one[2] == label for one in bands) for label in LABELS}
    times = [seconds * point / 40 for point in range(41)]
    series = {
        name: [[at, values_at(at + start % 7)[name]] for at in times] for name in list(RANGES)[:5]
    }
    return {
        "rows": sum(actions.values()),
        "seconds": seconds,
        "start": start,
        "origin": "demonstration",
        "kept": True,
        "deleted": False,
        "actions": {label: rows for label, rows in actions.items() if rows},
        "bands": bands,
        "series": series,
        "notes": [],
        **given,
    }


def node(message: str, *, there: bool = True, level: str = "OK", **values: str) -> dict[str, Any]:
    """What is known of one of the other programs."""
    return {"there": there, "level": level, "message": message, "values": values}


def levels() -> list[dict[str, Any]]:
    """Pruning levels."""
    drove = {"successes": 18, "episodes": 20, "share": 0.9, "interval": [0.7, 0.97]}
    trials = (drove, drove | {"successes": 8, "episodes": 10, "share": 0.8}, None, None)
    figures = [(9, 19, 0.92, 0.84), (6, 14, 0.89, 0.79), (3, 8, 0.76, 0.48), (1, 1, 0.62, 0.25)]
    return [
        {
            "number": number,
            "leaves": leaves,
            "nodes": size,
            "agreement": agreement,
            "recall": recall,
            "chosen": number == 0,
            "best": number == 0,
            "drove": drove,
        }
        for number, ((leaves, size, agreement, recall), drove) in enumerate(
            zip(figures, trials, strict=True)
        )
    ]


def draft(learned: LearnedTree, **given: Any) -> dict[str, Any]:
    """What is worked on."""
    return {
        "view": tree_view(learned),
        "summary": "a draft of the test",
        "suggestions": suggestion_views(learned),
        "changed": {"rows": 31, "of": 1677, "demonstrations": {f"{NAMES[0]}.rec": 31}},
        "words": ["new: docked → battery ≤ 0.95 → charge"],
        "rules": [
            {"rule": "never go while docked", "kept": True, "sentence": "proven for all states"},
            {"rule": "charge when battery <= 0.3", "kept": False, "sentence": "not at battery 0.2"},
        ],
        "undo": "changing battery ≤ 0.95 to 0.9",
        "redo": None,
        "published": False,
        **given,
    }


def tick(learned: LearnedTree, values: dict[str, float]) -> tuple[list[str], str]:
    """Statuses of all nodes in preorder after a tick, and what it commands; "" for nothing."""
    found: dict[int, str] = {}
    commands: list[str] = []

    def run(one: nodes.Node) -> str:
        children = nodes.children(one)
        match one:
            case nodes.Condition(literal=literal):
                condition = literal.condition
                match condition:
                    case Threshold(quantity=str(feature), value=value):
                        held = values[feature] <= value
                    case Interval(quantity=str(feature), above=above, at_most=at_most):
                        held = above < values[feature] <= at_most
                    case IsTrue(feature=feature):
                        held = values[feature] > 0.5
                    case _:
                        raise AssertionError(condition)
                status = "SUCCESS" if held is literal.positive else "FAILURE"
            case nodes.Action(label=label):
                commands.append(label)
                status = "RUNNING"
            case nodes.Inverter():
                status = {"SUCCESS": "FAILURE", "FAILURE": "SUCCESS"}[run(children[0])]
            case nodes.Selector() | nodes.ParallelSelector():
                status = next((done for done in map(run, children) if done != "FAILURE"), "FAILURE")
            case _:
                status = next((done for done in map(run, children) if done != "SUCCESS"), "SUCCESS")
        found[id(one)] = status
        return status

    run(learned.tree)
    statuses = [found.get(id(one), "INVALID") for one in nodes.walk(learned.tree)]
    return statuses, commands[0] if commands else ""


class Pretend:
    """A board, a server, and a record of what browsers asked for.

    Args:
        port: Of the server; 0: any that is free.
    """

    def __init__(self, port: int = 0) -> None:
        self.asked: list[dict[str, Any]] = []
        self.answers: dict[str, Callable[[dict[str, Any]], tuple[str, Any]]] = {}
        self.board = Board()
        self.server = Server(self.board, self._ask, "localhost", port)

    @property
    def url(self) -> str:
        """Of the page."""
        return self.server.access.url

    @property
    def port(self) -> int:
        """Of the server."""
        return self.server.access.port

    def verbs(self, verb: str) -> list[dict[str, Any]]:
        """The requests with this verb, oldest first."""
        return [one for one in list(self.asked) if one["do"] == verb]

    def show_tree(self, learned: LearnedTree) -> None:
        """Publishes a tree."""
        self.board.replace(Section.TREE, published_view(learned, DOCUMENT))

    def run(self, learned: LearnedTree, seconds: float) -> str:
        """Shows a tick at a time; returns what it commands."""
        values = values_at(seconds)
        statuses, acting = tick(learned, values)
        self.board.update(
            Section.RUN,
            {
                "condition": "running",
                "status": "RUNNING",
                "tip": acting,
                "commands": {"action": acting},
                "statuses": statuses,
                "document": DOCUMENT,
                "driving": True,
            },
        )
        self.board.replace(Section.VALUES, values)
        return acting

    def start_again(self) -> None:
        """A server with another token, on the same port."""
        self.server = Server(self.board, self._ask, "localhost", self.port)

    def close(self) -> None:
        """Ends the server."""
        self.server.close()

    def _ask(self, request: Any) -> Reply:
        self.asked.append(request)
        verb, number = request["do"], request["id"]
        if verb not in self.answers:
            return Reply(number, True, "" if verb in {"act", "ping"} else f"{verb}: done.")
        with suppress(ValueError):
            message, data = self.answers[verb](request)
            return Reply(number, True, message, data)
        return Reply(number, False, f"{verb} cannot be done")


def fill(pretend: Pretend) -> LearnedTree:
    """Puts everything on the board, as after some minutes of teaching, learning and driving."""
    learned, now = small_tree(), time.time()
    board = pretend.board
    pretend.show_tree(learned)
    pretend.run(learned, QUIET)
    board.replace(
        Section.NODES,
        {
            "executor": node("running", enabled="True"),
            "recorder": node("not recording", rows="480", takeovers="1"),
            "learner": node("idle", stage="idle"),
        },
    )
    board.replace(
        Section.ACTIONS, {label: {"channel": "action", "topic": "action"} for label in LABELS}
    )
    board.replace(
        Section.DEMONSTRATIONS,
        {name: demonstration(now - 900 + 300 * place) for place, name in enumerate(NAMES)},
    )
    events = [("driving", "the tree drives", ""), ("tree", "a tree of 14 nodes was published", "")]
    events += [("command", LABELS[place % 4], "action") for place in range(40)]
    events += [("person", "turn_right", "action"), ("command", "turn_left", "action")]
    board.replace(
        Section.TIMELINE,
        {
            str(place): {"t": now - 100 + 2.2 * place, "kind": kind, "text": text, "channel": topic}
            for place, (kind, text, topic) in enumerate(events)
        },
    )
    board.replace(
        Section.LEARNING,
        {
            "levels": levels(),
            "level": 0,
            "rows": 1677,
            "demonstrations": 2,
            "channel": "action",
            "recalls": {"charge": 0.0, "go": 0.978, "turn_left": 0.917, "turn_right": 0.976},
            "never": ["charge"],
            "baseline": 0.579,
            "problem": None,
        },
    )
    board.replace(Section.DRAFT, draft(learned))
    board.replace(
        Section.VERSIONS,
        {
            f"{number:06}": {
                "when": now - 4000 + 900 * number,
                "who": "maria",
                "what": ("as learned", "turns earlier", "with the docking routine")[number - 1],
                "nodes": 12 + number,
                "current": number == 3,
            }
            for number in (1, 2, 3)
        },
    )
    pretend.answers |= {
        "explain": lambda _: ("then", explanation()),
        "branch": lambda _: (
            "its branch acts in 68 of 1677 rows that were shown: turn_left 68.",
            {"from": explanation()["from"]},
        ),
        "histogram": lambda asked: ("", histogram(learned, asked["path"])),
        "moment": lambda asked: (
            "then",
            {
                "t": asked["t"],
                "document": DOCUMENT,
                "statuses": tick(learned, values_at(EARLIER))[0],
                "values": values_at(EARLIER),
                "commands": {"action": tick(learned, values_at(EARLIER))[1]},
            },
        ),
    }
    return learned


def explanation() -> dict[str, Any]:
    """An answer to "why?"."""
    return {
        "lines": [
            "turn_left",
            "  because target_bearing > 0.25 (1.24)",
            "  Branches before it that did not act:",
            "    charge: does not hold: docked (no)",
        ],
        "statuses": None,
        "values": values_at(QUIET),
        "acting": "1.1",
        "from": [{"demonstration": NAMES[0], "rows": 68, "seconds": 3.4}],
        "least": ["target_bearing 1.24 → 0.25 → go", "docked no → yes → charge"],
    }


def histogram(learned: LearnedTree, path: str) -> dict[str, Any]:
    """Rows of each action over the values of what a condition compares."""
    node = paths.node_at(learned.tree, paths.path_of(path))
    assert isinstance(node, nodes.Condition)
    assert isinstance(node.literal.condition, Threshold | Interval)
    quantity = node.literal.condition.quantity
    low, high = _range(quantity)
    edges = [low + (high - low) * place / 30 for place in range(31)]
    counts = {
        label: [round(60 * math.exp(-(((bin_ - 5 - 6 * place) / 4) ** 2))) for bin_ in range(30)]
        for place, label in enumerate(LABELS)
    }
    return {"quantity": quantity_text(quantity), "edges": edges, "counts": counts}


def _range(quantity: Quantity) -> tuple[float, float]:
    if isinstance(quantity, str):
        return RANGES[quantity]
    ends = [sorted(weight * end for end in RANGES[name]) for name, weight in quantity.terms]
    return sum(low for low, _ in ends), sum(high for _, high in ends)


@contextmanager
def pretended(port: int = 0) -> Iterator[Pretend]:
    """A studio with an empty board."""
    pretend = Pretend(port)
    try:
        yield pretend
    finally:
        pretend.close()
