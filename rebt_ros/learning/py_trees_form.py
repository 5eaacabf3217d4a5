"""A learned tree as a py_trees tree of your own behaviours, for use in any program."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, ClassVar

import py_trees
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.errors import OptionError
from rebt_ros.export import py_trees_xml
from rebt_ros.learning.named_states import Encoding, State

#: A behaviour, or a function that makes one.
Carrying = py_trees.behaviour.Behaviour | Callable[[], py_trees.behaviour.Behaviour]


def to_py_trees(
    learned: LearnedTree,
    behaviours: Mapping[str, Carrying],
    state: Callable[[], State],
) -> py_trees.trees.BehaviourTree:
    """A learned tree as a py_trees tree, whose actions are your own behaviours.

    Tick it, or add its root to a tree of your own.  It remembers earlier actions and the earlier
    values of lagged features, if the tree tests them.

    Args:
        learned: The tree.
        behaviours: For each label, the behaviour that carries out the action, or a function that
            makes one, which is called once for each place of the action in the tree.
        state: Returns the current state; called once per tick.

    Raises:
        OptionError: An action of the tree has no behaviour, or one that cannot be used there.
    """
    runtime = _runtime(learned, behaviours)
    return py_trees.trees.BehaviourTree(_Learned("learned", runtime.root, _Ticks(runtime, state)))


def py_trees_nodes(
    learned: LearnedTree,
    behaviours: Mapping[str, Carrying],
    state: Callable[[], State],
) -> dict[str, Any]:
    """The nodes of `to_py_trees_xml`, as a ``node_registry`` of py_trees' XML parser.

    A registry is for one tree: each condition and action has one place.

    Args:
        learned: The tree whose XML is parsed.
        behaviours: As in `to_py_trees`.
        state: Returns the current state; called once per tick.

    Raises:
        OptionError: This py_trees has no parser, or as in `to_py_trees`.
    """
    try:
        from py_trees.ports import PortsMixin
    except ImportError as err:
        raise OptionError(
            f"py_trees {py_trees.version.__version__} reads no XML: install py_trees 2.5 or newer, "
            "or use to_py_trees."
        ) from err
    runtime = _runtime(learned, behaviours)
    ticks, free = _Ticks(runtime, state), set(range(len(runtime.snapshot())))

    class Whole(_NoPorts, PortsMixin, _Learned, register=False):
        """The learned tree, below the nodes that it needs."""

        def __init__(self, name: str, child: py_trees.behaviour.Behaviour, **own: Any) -> None:
            super().__init__(name, child, ticks, **own)

    class Leaf(_NoPorts, PortsMixin, _Stand, register=False):
        """A condition or an action."""

        def __init__(self, name: str, place: str, **own: Any) -> None:
            if not place.isascii() or not place.isdigit() or int(place) not in free:
                raise OptionError(
                    f"the place {place!r} of {name!r} is taken or none of this tree: read the XML "
                    "of to_py_trees_xml, once with each registry."
                )
            free.remove(int(place))
            super().__init__(name, runtime.behaviour(int(place)), **own)

    # py_trees 2.5 does not resolve the hints of modules that postpone them.
    Leaf.__init__.__annotations__["place"] = str

    class Together(_NoPorts, PortsMixin, py_trees.composites.Parallel, register=False):
        """A Parallel."""

    return {
        py_trees_xml.WHOLE: Whole,
        py_trees_xml.CONDITION: Leaf,
        py_trees_xml.ACTION: Leaf,
        py_trees_xml.PARALLEL: partial(
            Together, policy=py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)
        ),
    }


def _runtime(learned: LearnedTree, behaviours: Mapping[str, Carrying]) -> TreeRuntime:
    tree = executable(learned.tree)
    places = Counter(node.label for node in nodes.walk(tree) if isinstance(node, nodes.Action))
    for label, number in places.items():
        given = behaviours.get(label)
        if given is None:
            raise OptionError(
                f"the action {label!r} has no behaviour: give one for each label that the tree "
                "takes."
            )
        if number > 1 and isinstance(given, py_trees.behaviour.Behaviour):
            raise OptionError(
                f"the action {label!r} stands in {number} places of the tree, and a behaviour can "
                "stand in one: give a function that makes behaviours."
            )
    return TreeRuntime(
        learned, tree=tree, carry_out=lambda action: _own(action.label, behaviours[action.label])
    )


def _own(label: str, given: Carrying) -> py_trees.behaviour.Behaviour:
    made = given() if callable(given) else given
    if not isinstance(made, py_trees.behaviour.Behaviour):
        raise OptionError(
            f"what carries out {label!r} is a {type(made).__name__}: give a py_trees behaviour, or "
            "a function that makes one."
        )
    if made.parent is not None:
        raise OptionError(
            f"the behaviour {made.name!r}, which carries out {label!r}, has a parent already: give "
            "one of its own to each place in a tree."
        )
    return made


class _NoPorts:
    """The attributes that py_trees' parser needs: functions in 2.5, names in newer versions."""

    INPUT_PORTS: ClassVar[dict[str, Any]] = {}
    OUTPUT_PORTS: ClassVar[dict[str, Any]] = {}

    @classmethod
    def input_ports(cls) -> dict[str, Any]:
        return {}

    @classmethod
    def output_ports(cls) -> dict[str, Any]:
        return {}


class _Ticks:
    """Reads the state before a tick of a learned tree, and records afterwards what it did."""

    def __init__(self, runtime: TreeRuntime, state: Callable[[], State]) -> None:
        features = runtime.learned.features
        self.runtime = runtime
        self._read = state
        self._encoding = Encoding(features)
        self._past: deque[list[float]] = deque(
            maxlen=max((feature.lag for feature in features), default=0)
        )

    def begin(self) -> None:
        """A tick begins."""
        now = self._encoding.present(self._read())
        self.runtime.begin(self._encoding.row(now, self._past))
        self._past.appendleft(now)


class _Learned(py_trees.decorators.Decorator):
    """A learned tree below the nodes that read and record for it."""

    def __init__(
        self, name: str, child: py_trees.behaviour.Behaviour, ticks: _Ticks, **own: Any
    ) -> None:
        super().__init__(name=name, child=child, **own)
        self._ticks = ticks

    def tick(self) -> Iterator[py_trees.behaviour.Behaviour]:
        self._ticks.begin()
        yield from super().tick()

    def update(self) -> Status:
        self._ticks.runtime.finish()
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID:
            self._ticks.runtime.interrupted()


class _Stand(py_trees.behaviour.Behaviour):
    """A placeholder for a leaf of the runtime, which does what that leaf does."""

    def __init__(self, name: str, acting: py_trees.behaviour.Behaviour, **own: Any) -> None:
        super().__init__(name=name, **own)
        self._acting = acting

    def update(self) -> Status:
        self._acting.tick_once()
        return self._acting.status

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID and self._acting.status is Status.RUNNING:
            self._acting.stop(Status.INVALID)
