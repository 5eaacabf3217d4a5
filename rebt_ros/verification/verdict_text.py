"""Verdicts in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import name_text
from rebt_ros.verification.describing import BoxWords, action_text, point_text
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.rules import RuleKind
from rebt_ros.verification.verdict import Answer, ChannelProof, Verdict


def what_breaks(
    learned: LearnedTree, proofs: Sequence[ChannelProof], verdicts: Sequence[Verdict]
) -> str:
    """The rules that a tree was not shown to keep, for a sentence; empty if there are none."""
    failed = [verdict for verdict in verdicts if verdict.answer is not Answer.PROVEN]
    if not failed:
        return ""
    first = _in_short(learned, proofs, failed[0])
    return f"{first}; and {len(failed) - 1} more" if len(failed) > 1 else first


def _in_short(learned: LearnedTree, proofs: Sequence[ChannelProof], verdict: Verdict) -> str:
    rule = f"'{verdict.demand.rule}'"
    if verdict.witness is None:
        return f"it cannot be proven to keep {rule} ({verdict.why})"
    grid = _proof_of(verdict, proofs).grid
    state = point_text(verdict.witness.point, grid, learned.features) or "everywhere"
    return f"it breaks {rule}: where {state}, it does {_done(verdict)}"


def details(
    learned: LearnedTree, proofs: Sequence[ChannelProof], verdict: Verdict, most: int
) -> Iterator[str]:
    """What is known of a rule beside the answer, in lines.

    Args:
        learned: The tree.
        proofs: Of all channels.
        verdict: Of the rule.
        most: How many regions are listed.
    """
    witness = verdict.witness
    grid = _proof_of(verdict, proofs).grid
    if verdict.why:
        yield verdict.why
    if witness is not None:
        state = point_text(witness.point, grid, learned.features)
        yield f"where {state or 'nothing is asked'}: {_done(verdict)}"
        if witness.row is not None:
            row = witness.row
            yield (
                f"nearest row that was shown: row {row.row} of {row.demonstration} "
                f"({name_text(row.action)})"
            )
        if verdict.region is None:
            yield "broken in more regions than can be listed"
        else:
            yield from regions("broken", verdict.region, grid, most)
    if verdict.coverage is not None:
        yield _covered(verdict)


def regions(what: str, boxes: Boxes, grid: Grid, most: int) -> Iterator[str]:
    """Where something is so, in lines.

    Args:
        what: What is so there.
        boxes: The states.
        grid: Theirs.
        most: How many regions are listed.
    """
    lines, more = BoxWords(grid).boxes(boxes, most)
    for place, line in enumerate(lines):
        yield f"{what} where {line}" if not place else f"{'or':>{len(what) + 6}} {line}"
    if more:
        yield f"{'or':>{len(what) + 6}} in {more} more regions"


def _proof_of(verdict: Verdict, proofs: Sequence[ChannelProof]) -> ChannelProof:
    return next(proof for proof in proofs if proof.channel == verdict.demand.action.channel)


def _done(verdict: Verdict) -> str:
    assert verdict.witness is not None
    return action_text(verdict.witness.command)


def _covered(verdict: Verdict) -> str:
    coverage, action = verdict.coverage, action_text(verdict.demand.action)
    assert coverage is not None
    about = f"{coverage.rows} of {coverage.all_rows} rows were shown in such states"
    if not coverage.rows:
        return f"none of the {coverage.all_rows} rows was shown in such a state"
    if verdict.demand.rule.kind is RuleKind.ALWAYS:
        return f"{about}, {coverage.breaking} of them without {action}"
    return f"{about}, {coverage.breaking} of them with {action}"
