"""Explanations in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import Wording, name_text
from rebt_ros.verification.acting import Outcome, Step
from rebt_ros.verification.describing import action_text, before_text, value_text
from rebt_ros.verification.explaining import Explanation, Flip, failing, values_read
from rebt_ros.verification.support import Support

#: How many changes are listed.
_CHANGES: Final = 3


def lines(learned: LearnedTree, values: Sequence[float], explained: Explanation) -> Iterator[str]:
    """Why one channel does what it does.

    Args:
        learned: The tree.
        values: Of its features.
        explained: What is known.
    """
    words = _Words(learned, values)
    yield f"{action_text(explained.action)}"
    branches = _branches(explained.trace)
    # A branch whose action failed leaves the tick to those after it.
    acting = [
        branch for branch in branches if branch.acts and branch.outcome is not Outcome.FAILURE
    ] or [branch for branch in branches if branch.acts][-1:]
    for branch in acting:
        yield from _remembered(branch)
        fallback = "it goes on" if _goes_on(branch) else "no branch before it acts"
        yield f"  because {', '.join(words.reasons(branch)) or fallback}"
    passed = [branch for branch in branches if branch not in acting]
    if passed:
        yield "  Branches before it that did not act:" if explained.action else "  No branch acts:"
        for branch in passed:
            why = f"does not hold: {', '.join(words.failures(branch))}"
            if branch.acts:
                why = "was taken, and failed"
            yield f"    {_named(branch.node)}: {why}"
    if explained.support is not None:
        yield from _supported(explained.support)
    if explained.flips:
        yield "  Smallest changes that lead to another action:"
        for flip in explained.flips[:_CHANGES]:
            yield f"    {_changed(learned, values, flip)} → {action_text(flip.action)}"
    elif explained.flips is not None:
        yield "  Nothing else is ever commanded."


def _branches(traced: Step) -> tuple[Step, ...]:
    return traced.children if isinstance(traced.node, nodes.Selector) else (traced,)


def _goes_on(branch: Step) -> bool:
    return any(step.skipped for step in branch.walk())


def _remembered(branch: Step) -> Iterator[str]:
    """What of a branch was decided in ticks before."""
    for step in branch.walk():
        if step.skipped:
            count = len(nodes.children(step.node))
            yield (
                f"  goes on with step {step.skipped + 1} of {count}, where the tick before left "
                "it: what stands before is not asked again"
            )


def _named(node: nodes.Node) -> str:
    return (
        " or ".join(dict.fromkeys(name_text(action.label) for action in nodes.actions(node))) or "?"
    )


class _Words:
    def __init__(self, learned: LearnedTree, values: Sequence[float]) -> None:
        self._wording = Wording(learned)
        self._texts = {
            feature.name: value_text(feature, value)
            for feature, value in zip(learned.features, values, strict=True)
        }

    def failures(self, branch: Step) -> list[str]:
        """The conditions that kept a branch from acting, with the values."""
        return list(dict.fromkeys(map(self._condition, failing(branch)))) or ["reached"]

    def reasons(self, branch: Step) -> list[str]:
        """The conditions that let a branch act, with the values."""
        return list(
            dict.fromkeys(
                self._condition(step.node)
                for step in branch.walk()
                if isinstance(step.node, nodes.Condition) and step.outcome is Outcome.SUCCESS
            )
        )

    def _condition(self, node: nodes.Condition) -> str:
        text = self._wording.literal(node.literal)
        values = ", ".join(self._texts[name] for name in values_read(node))
        return f"{text} ({values})" if values else text


def _supported(support: Support) -> Iterator[str]:
    if not support.rows:
        yield "  This branch acts in no row that was shown."
        return
    shown = ", ".join(f"{name_text(label)} {count}" for label, count in support.actions)
    rows = "1 row" if support.rows == 1 else f"{support.rows} rows"
    yield f"  This branch acts in {rows} that were shown, where this was done: {shown}"
    for name, count, seconds in support.demonstrations:
        yield f"    {name}: {count}, the first after {seconds:.1f} s"


def _changed(learned: LearnedTree, values: Sequence[float], flip: Flip) -> str:
    changes = [
        value_text(feature, new)
        for feature, old, new in zip(learned.features, values, flip.point.values, strict=True)
        if new != old and not (new != new and old != old)
    ]
    if not changes and flip.point.before is not None:
        changes.append(before_text(flip.point.before))
    return ", ".join(changes) or "the same state"
