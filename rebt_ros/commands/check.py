"""``ros2 run rebt_ros check TREE``: what a learned tree does in every state, and its rules."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from rebt_ros.behavior_tree.wording import Wording
from rebt_ros.commands.shell import add_input_options, input_options, parse, run
from rebt_ros.offline import check_and_explain
from rebt_ros.offline.check_and_explain import Checked
from rebt_ros.storage.tree_file import write_tree
from rebt_ros.verification.comparing import Comparison
from rebt_ros.verification.describing import action_text
from rebt_ros.verification.findings import Findings
from rebt_ros.verification.sweep import Results
from rebt_ros.verification.verdict import Answer
from rebt_ros.verification.verdict_text import details, regions

#: Exit code where a rule is broken or unknown.
_NOT_KEPT: Final = 1


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="check",
        description="Proves rules about a learned tree for every state, or finds a state that "
        "breaks them, and reports what is noticeable about the tree. The exit code "
        "is 1 unless every rule is proven.",
    )
    parser.add_argument("tree", type=Path, metavar="TREE", help="tree.json of a learned tree")
    parser.add_argument("--rules", type=Path, metavar="FILE", help="rules.yaml (docs/rules.md)")
    parser.add_argument(
        "--against", type=Path, metavar="TREE", help="report where the tree differs from this one"
    )
    parser.add_argument(
        "--repair",
        type=Path,
        metavar="NEW",
        help="write a tree to this file whose guards make it keep the rules",
    )
    parser.add_argument(
        "--action-results",
        action="store_true",
        help="assume that the robot reports how actions end, so that they can fail or take "
        "several ticks (the executor's action_result_topic)",
    )
    parser.add_argument(
        "--regions",
        type=int,
        default=3,
        metavar="N",
        help="maximum number of regions to list (default: %(default)s)",
    )
    add_input_options(parser, required=False)
    parsed = parse(parser, arguments)
    run(lambda: _check(parsed), "check")


def _check(parsed: argparse.Namespace) -> None:
    checked = check_and_explain.check(
        parsed.tree,
        parsed.rules,
        parsed.inputs,
        against=parsed.against,
        reading=input_options(parsed),
        results=Results.REPORTED if parsed.action_results else Results.AT_ONCE,
    )
    most = max(parsed.regions, 1)
    print("\n".join(_lines(checked, most)))
    if parsed.repair is not None:
        mended = check_and_explain.repaired(checked)
        write_tree(parsed.repair, mended.learned)
        print(f"\nWritten to {parsed.repair}: {mended.change}; all rules are proven.")
    elif not checked.keeps_all:
        sys.stdout.flush()
        sys.exit(_NOT_KEPT)


def _lines(checked: Checked, most: int) -> Iterator[str]:
    for verdict in checked.verdicts:
        kept = verdict.answer is Answer.PROVEN
        answer = verdict.answer.value if kept else verdict.answer.value.upper()
        yield f"{answer:<8} {verdict.demand.rule}"
        for line in details(checked.learned, checked.proofs, verdict, most):
            yield f"         {line}"
    if checked.verdicts:
        yield ""
    if checked.not_found:
        yield f"What else is noticeable is not known: {checked.not_found}"
    several = len(checked.findings) > 1
    wording = Wording(checked.learned)
    for findings in checked.findings:
        if several:
            yield f"Channel {findings.channel}:"
        yield from _noticeable(findings, wording, most)
    for comparison in checked.comparisons:
        yield ""
        yield f"Against the other tree{f', channel {comparison.channel}' if several else ''}:"
        yield from _divergences(comparison, most)


def _noticeable(findings: Findings, wording: Wording, most: int) -> Iterator[str]:
    lines = [
        *(f"never reached: {wording.node(node)}" for node in findings.dead),
        *(f"never decides: {wording.node(node)}" for node in findings.pointless),
        *(f"shown, but never chosen: {action_text(one)}" for one in findings.never_chosen),
    ]
    if findings.idle.shape[1]:
        lines += regions("nothing is commanded", findings.idle, findings.grid, most)
    for leaf, boxes in findings.never_shown:
        lines += regions(f"never shown: {action_text(leaf)}", boxes, findings.grid, most)
    yield from lines or ["Nothing is noticeable about the tree."]


def _divergences(comparison: Comparison, most: int) -> Iterator[str]:
    if not comparison.complete:
        yield (
            "there may be more: the branches overlap in too many ways to look at each, so that "
            "whether the trees do the same elsewhere is unknown."
        )
    elif not comparison.divergences:
        yield "both do the same in every state."
    if not comparison.exact:
        yield "overestimated: of some states below it is not known whether they exist."
    if comparison.remembers:
        yield "in a first tick; later ones may differ elsewhere, as a tree remembers where it was."
    for divergence in comparison.divergences:
        what = f"{action_text(divergence.mine)} instead of {action_text(divergence.other)}"
        if divergence.boxes.shape[1]:
            yield from regions(what, divergence.boxes, comparison.grid, most)
        else:
            yield f"{what}: where is unknown"
        if divergence.rows is not None:
            rows = (
                "1 row that was shown lies"
                if divergence.rows == 1
                else f"{divergence.rows} rows shown lie"
            )
            yield f"    {rows} there"


if __name__ == "__main__":
    main()
