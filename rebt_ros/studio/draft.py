"""The tree that a person works on: every change gives another one, and can be taken back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.wording import Wording
from rebt_ros.errors import OptionError
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.options import PsaChoice
from rebt_ros.logic.conditions import Interval, Threshold

#: Most changes that can be taken back.
MOST_STEPS: Final = 200

#: What changes a policy.
Change: TypeAlias = Callable[[Learning], Learning]


@dataclass(frozen=True, eq=False, slots=True)
class Step:
    """A policy, and what made it."""

    what: str
    """In words, as on a button: "undo WHAT"."""
    learning: Learning


@dataclass(frozen=True, eq=False, slots=True)
class Draft:
    """The steps to a policy; never empty."""

    steps: tuple[Step, ...]
    place: int
    """Of the step that counts; those behind it were taken back."""

    @classmethod
    def begin(cls, learning: Learning) -> Draft:
        """The policy as it was learned."""
        return cls((Step("learning", learning),), 0)

    @property
    def learning(self) -> Learning:
        """The policy as it is now."""
        return self.steps[self.place].learning

    @property
    def undoes(self) -> str | None:
        """What `undone` takes back; None if there is nothing."""
        return self.steps[self.place].what if self.place else None

    @property
    def redoes(self) -> str | None:
        """What `redone` does again; None if there is nothing."""
        behind = self.steps[self.place + 1 : self.place + 2]
        return behind[0].what if behind else None

    def changed(self, what: str, change: Change) -> Draft:
        """The draft after a change; what was taken back before is forgotten.

        Raises:
            RebtError: The change cannot be made.
        """
        step = Step(what, change(self.learning))
        first, *others = (*self.steps[: self.place + 1], step)
        kept = (first, *others[-MOST_STEPS:])
        return Draft(kept, len(kept) - 1)

    def undone(self) -> Draft:
        """The draft before the last change.

        Raises:
            OptionError: There was none.
        """
        if not self.place:
            raise OptionError("there is nothing to undo.")
        return replace(self, place=self.place - 1)

    def redone(self) -> Draft:
        """The draft with the change again that was taken back last.

        Raises:
            OptionError: There is none.
        """
        if self.redoes is None:
            raise OptionError("there is nothing to redo.")
        return replace(self, place=self.place + 1)

    def reset(self) -> Draft:
        """The draft as it was learned; this can be taken back like any other change."""
        return self.changed("starting over", lambda _: self.steps[0].learning)


def chosen_level(number: int) -> Change:
    """Another pruning level."""
    return lambda learning: learning.level(number)


def attached(suggestion: str) -> Change:
    """A suggestion put into the tree."""
    return lambda learning: learning.with_attached(suggestion)


def detached(suggestion: str) -> Change:
    """A suggestion taken out of it again."""
    return lambda learning: learning.without(suggestion)


def removed(path: str) -> Change:
    """A tree without a branch."""
    return _edit(lambda tree: paths.removed(tree, paths.path_of(path)))


def moved(path: str, by: int) -> Change:
    """A tree in which a branch stands so many places further behind."""
    return _edit(lambda tree: paths.moved(tree, paths.path_of(path), by))


def resolved(path: str, choice: PsaChoice) -> Change:
    """A tree with one Parallel/Selector node made into what a person chose."""

    def edit(tree: nodes.Node) -> nodes.Node:
        node = paths.node_at(tree, paths.path_of(path))
        match node:
            case nodes.ParallelSelector() | nodes.Parallel() | nodes.Selector() if all(
                isinstance(child, nodes.Action) for child in nodes.children(node)
            ):
                kind = nodes.Selector if choice is PsaChoice.SELECTOR else nodes.Parallel
                return paths.replaced(tree, paths.path_of(path), kind(nodes.children(node)))
            case _:
                raise OptionError(f"the node at {path} is no Parallel/Selector node.")

    return _edit(edit)


def with_threshold(path: str, value: float, *, upper: bool = True) -> Change:
    """A tree with another number in one condition.

    Args:
        path: Of the condition.
        value: The number.
        upper: Whether it is the upper end, of an interval that has two.
    """

    def edit(tree: nodes.Node) -> nodes.Node:
        node = paths.node_at(tree, paths.path_of(path))
        if not isinstance(node, nodes.Condition):
            raise OptionError(f"the node at {path} is no condition.")
        try:
            match node.literal.condition:
                case Threshold() as threshold:
                    condition: Threshold | Interval = replace(threshold, value=value)
                case Interval() as interval if upper:
                    condition = replace(interval, at_most=value)
                case Interval() as interval:
                    condition = replace(interval, above=value)
                case _:
                    raise OptionError(f"the condition at {path} has no number to change.")
        except ValueError as err:
            raise OptionError(f"this cannot be: {err}.") from err
        literal = replace(node.literal, condition=condition)
        return paths.replaced(tree, paths.path_of(path), nodes.Condition(literal))

    return _edit(edit)


def words_at(learning: Learning, path: str) -> str:
    """A node in words, for the name of a change to it.

    Raises:
        OptionError: There is none.
    """
    try:
        node = paths.node_at(learning.learned.tree, paths.path_of(path))
    except LookupError as err:
        raise OptionError(f"{err}: the tree has changed since; try again.") from err
    wording = Wording(learning.learned)
    if nodes.children(node):
        labels = dict.fromkeys(action.label for action in nodes.actions(node))
        return " or ".join(labels) or wording.node(node)
    return wording.node(node)


def _edit(edit: Callable[[nodes.Node], nodes.Node]) -> Change:
    def change(learning: Learning) -> Learning:
        try:
            return learning.edited(edit)
        except LookupError as err:
            raise OptionError(f"{err}: the tree has changed since; try again.") from err
        except ValueError as err:
            raise OptionError(f"{err}.") from err

    return change
