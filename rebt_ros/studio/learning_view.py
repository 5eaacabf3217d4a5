"""What was learned, as a browser shows it: levels, recall, the draft and what it changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Final

import numpy as np

from rebt_ros.arrays import FloatArray
from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.condition_tests import StateTests
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import Wording, quantity_text, size_and_origin
from rebt_ros.errors import OptionError, RebtError
from rebt_ros.learning import evaluation
from rebt_ros.learning.learning import Learning
from rebt_ros.logic.conditions import Interval, Literal, Quantity, Threshold
from rebt_ros.studio.tree_view import Json, suggestion_views, tree_view
from rebt_ros.trial.tally import Tally
from rebt_ros.verification.contradictions import agreeing_demands
from rebt_ros.verification.proof import check
from rebt_ros.verification.robot_rules import rules_of, together
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.verdict import Answer, verdicts
from rebt_ros.verification.verdict_text import details

#: Levels on the chart.
_MOST_LEVELS: Final = 25

#: Bars of a histogram.
_BARS: Final = 40


def levels_view(
    learning: Learning, driven: Mapping[str, Tally] | None = None
) -> list[dict[str, Json]]:
    """The pruning levels for a chart: size against what the tree does.

    Args:
        learning: The policy.
        driven: How often trees succeeded in driving trials, by the fingerprints of their documents.
    """
    levels = learning.levels
    views = []
    for number in levels.selected(_MOST_LEVELS):
        level = levels.level(number)
        judged = level.cross_validated
        views.append(
            {
                "number": number,
                "leaves": level.leaves,
                "nodes": nodes.size(level.learned.tree),
                "agreement": judged and judged.agreement,
                "recall": judged and judged.recall,
                "chosen": level.chosen,
                "best": level.best,
                "drove": _drove((driven or {}).get(fingerprint(dumps(level.learned)))),
            }
        )
    return views


def _drove(tally: Tally | None) -> dict[str, Json] | None:
    if tally is None or tally.share is None:
        return None
    return {
        "successes": tally.successes,
        "episodes": tally.episodes,
        "share": tally.share,
        "interval": list(tally.interval),
    }


def learning_view(learning: Learning, levels: Sequence[Json]) -> dict[str, Json]:
    """What a person must know about a policy.

    Args:
        learning: The policy.
        levels: Its pruning levels, as `levels_view` makes them: that takes a while.
    """
    report = learning.report
    return {
        "levels": list(levels),
        "level": learning.levels.chosen,
        "rows": len(learning.table),
        "demonstrations": len(learning.table.demonstrations),
        "channel": learning.table.channel,
        "recalls": {action.label: action.recall for action in report.actions},
        "never": [action.label for action in report.actions if not action.taken],
        "baseline": report.most_frequent,
        "notes": list(learning.notes),
    }


def draft_view(
    learning: Learning, published: LearnedTree | None, rules: RuleSet | None
) -> dict[str, Json]:
    """A draft, and what it would change if it were published.

    Args:
        learning: The policy of the draft.
        published: The tree that is published; None if there is none.
        rules: What trees must keep beside the rules of their robot file; None: nothing.
    """
    learned = learning.learned
    return {
        "view": tree_view(learned),
        "summary": size_and_origin(learned),
        "suggestions": suggestion_views(learned),
        "changed": changed_rows(learning, published),
        "words": list(differences_in_words(published, learned)),
        "rules": rules_view(learning, rules),
        "published": published is not None and dumps(published) == dumps(learned),
    }


def changed_rows(learning: Learning, published: LearnedTree | None) -> dict[str, Json] | None:
    """In how many rows of which demonstrations the draft does something else.

    None where there is no published tree, or it has other features.
    """
    if published is None or published.features != learning.learned.features:
        return None
    table = learning.table
    mine = evaluation.teacher_forced_choices(learning.learned.tree, table)
    other = evaluation.teacher_forced_choices(published.tree, table)
    differ = np.flatnonzero(mine != other)
    counts = Counter(table.demonstration[differ].tolist())
    return {
        "rows": len(differ),
        "of": len(table),
        "demonstrations": {
            table.demonstrations[number]: count for number, count in counts.most_common()
        },
    }


def differences_in_words(published: LearnedTree | None, draft: LearnedTree) -> Iterator[str]:
    """Which branches come and go, each in a sentence.

    A branch is still there where conditions that stand side by side are in another order.
    """
    if published is None:
        return
    before, after = _branches(published), _branches(draft)
    yield from (f"no longer: {words}" for branch, words in before.items() if branch not in after)
    yield from (f"new: {words}" for branch, words in after.items() if branch not in before)
    kept = [branch for branch in before if branch in after]
    if kept != [branch for branch in after if branch in before]:
        yield "branches stand in another order"


def rules_view(learning: Learning, rules: RuleSet | None) -> list[dict[str, Json]]:
    """Which rules the draft is proven to keep, those of its robot file among them."""
    learned = learning.learned
    rules = together(rules, rules_of(learned.robot))
    if rules is None:
        return []
    try:
        demands = agreeing_demands(rules, learned)
        proofs = check(learned, demands, [learning.table])
    except RebtError as err:
        return [{"rule": rules.source, "kept": None, "sentence": str(err)}]
    kept = {Answer.PROVEN: True, Answer.BROKEN: False, Answer.UNKNOWN: None}
    return [
        {
            "rule": str(verdict.demand.rule),
            "kept": kept[verdict.answer],
            "sentence": "; ".join(list(details(learned, proofs, verdict, 1))[:2]),
        }
        for verdict in verdicts(proofs, demands)
    ]


def histogram(learning: Learning, path: str) -> dict[str, Json]:
    """How often each action was shown, over the values of what a condition compares.

    Args:
        learning: The policy.
        path: Of the condition in its tree.

    Returns:
        ``quantity`` (a feature, or what is computed from several, in words), ``edges`` of the bars,
        and ``counts`` of rows in each bar, by action.

    Raises:
        OptionError: There is no such condition, or it compares no number.
    """
    quantity = _compared(learning, path)
    words = quantity_text(quantity)
    table = learning.table
    # A value that is missing is NaN, and infinities may cancel out.
    with np.errstate(invalid="ignore", over="ignore"):
        values = StateTests(table.features).reading(quantity)(table.states.T)
    known = np.isfinite(values)
    edges = bar_edges(values[known], words)
    counts = {
        label: np.histogram(values[known & (table.chosen == code)], edges)[0].tolist()
        for code, label in enumerate(table.actions)
    }
    return {"quantity": words, "edges": edges.tolist(), "counts": counts}


def bar_edges(values: FloatArray, words: str) -> FloatArray:
    """The edges of the bars of a histogram.

    Args:
        values: Finite numbers.
        words: What they are of.

    Raises:
        OptionError: There are none, or no bars hold them.
    """
    if not values.size:
        raise OptionError(f"{words} was never known.")
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return np.histogram_bin_edges(values, bins=_BARS)
    except ValueError as err:
        # They lie too close together, or too far apart, for floating-point numbers between them.
        raise OptionError(f"there is no histogram of {words}: {str(err).rstrip('.')}.") from err


def _compared(learning: Learning, path: str) -> Quantity:
    """What the condition at a path compares with a number."""
    try:
        node = paths.node_at(learning.learned.tree, paths.path_of(path))
    except LookupError as err:
        raise OptionError(f"{err}: the tree has changed since; try again.") from err
    match node:
        case nodes.Condition(literal=Literal(condition=Threshold() | Interval() as condition)):
            return condition.quantity
        case _:
            raise OptionError(f"the node at {path} compares no number.")


def _branches(learned: LearnedTree) -> dict[nodes.Node, str]:
    """The branches below the root, with their conditions in one order, and each in words."""
    wording = Wording(learned)
    roots = nodes.children(learned.tree) or (learned.tree,)
    return {_in_order(branch): _branch_in_words(branch, wording) for branch in roots}


def _in_order(node: nodes.Node) -> nodes.Node:
    """A branch whose neighboring conditions stand in one order: theirs changes nothing."""
    match node:
        case nodes.Sequence() | nodes.Selector():
            ordered: list[nodes.Node] = []
            children = map(_in_order, nodes.children(node))
            for tests, group in groupby(children, key=_only_tests):
                stretch = list(group)
                ordered += sorted(stretch, key=repr) if tests else stretch
            return replace(node, children=tuple(ordered))
        case _:
            return node


def _only_tests(node: nodes.Node) -> bool:
    return not nodes.actions(node)


def _branch_in_words(branch: nodes.Node, wording: Wording) -> str:
    match branch:
        case nodes.Condition() | nodes.Action():
            return wording.node(branch)
        case nodes.Inverter(child=child):
            return f"not ({_branch_in_words(child, wording)})"
        case nodes.Sequence(children=children):
            return " → ".join(_branch_in_words(child, wording) for child in children)
        case nodes.Selector(children=children) | nodes.ParallelSelector(children=children):
            return f"({' or '.join(_branch_in_words(child, wording) for child in children)})"
        case nodes.Parallel(children=children):
            return f"({' and '.join(_branch_in_words(child, wording) for child in children)})"
        case nodes.Repeater(children=children):
            words = " → ".join(_branch_in_words(child, wording) for child in children)
            return f"again and again ({words})"
