"""Changes a learned tree without learning again: its level, its suggestions, its PSA nodes."""

from __future__ import annotations

import argparse
from pathlib import Path

from rebt_ros.behavior_tree import nodes
from rebt_ros.commands.shell import aligned, directory, parse, run, use_color
from rebt_ros.drawing.text import render_text
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.learning_file import load_learning, write_learning
from rebt_ros.learning.options import PsaChoice
from rebt_ros.offline.exports import write_exports_again
from rebt_ros.offline.level_files import (
    nothing_of_before,
    write_behavior_tree,
    write_decision_tree,
)
from rebt_ros.storage.atomic import write_text_atomically


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="revise", description=__doc__)
    parser.add_argument(
        "learned",
        type=Path,
        metavar="DIR",
        help="directory that `learn` wrote; without options, lists what can be changed",
    )
    parser.add_argument("--level", type=int, metavar="K", help="switch to this pruning level")
    parser.add_argument(
        "--attach",
        action="append",
        default=[],
        metavar="ID",
        help="attach this suggestion, or `all`; repeatable",
    )
    parser.add_argument(
        "--detach",
        action="append",
        default=[],
        metavar="ID",
        help="detach this suggestion, or `all`; repeatable",
    )
    parser.add_argument(
        "--psa-choice",
        choices=[choice.value for choice in PsaChoice],
        help="replace all Parallel/Selector nodes by this kind of node",
    )
    parser.add_argument(
        "--out",
        type=directory,
        metavar="DIR",
        help="write to this directory instead of changing DIR itself",
    )
    parsed = parse(parser, arguments)
    run(lambda: _revise(parsed), "revise")


def _revise(parsed: argparse.Namespace) -> None:
    before = load_learning(parsed.learned)
    after = before
    if parsed.level is not None:
        after = after.level(parsed.level)
    if parsed.detach:
        after = after.without(*parsed.detach)
    if parsed.attach:
        after = after.with_attached(*parsed.attach)
    if parsed.psa_choice is not None:
        after = after.resolved(PsaChoice(parsed.psa_choice))
    if after is before and parsed.out is None:
        _list(before)
        return
    out = parsed.out or (
        parsed.learned if parsed.learned.is_dir() else parsed.learned.absolute().parent
    )
    notes = _write(out, after)
    print(render_text(after.learned, color=use_color()), end="")
    sizes = [nodes.size(learning.learned.tree) for learning in (before, after)]
    print(f"\n{sizes[0]} nodes before, {sizes[1]} now.")
    for note in notes:
        print(f"  - {note}.")
    print(f"Written to {out}.")


def _write(directory: Path, learning: Learning) -> tuple[str, ...]:
    """Writes the trees, their pictures and learning.npz; returns notes, each once."""
    # First what all else can be made of again.
    notes = list(write_learning(directory, learning))
    with nothing_of_before(directory):
        notes += write_behavior_tree(directory, learning.learned)
        write_text_atomically(directory / "tree.txt", render_text(learning.learned))
        notes += write_decision_tree(directory, learning.decision_tree.tree)
    notes += write_exports_again(directory, learning.learned)
    return tuple(dict.fromkeys(notes))


def _list(learning: Learning) -> None:
    levels = learning.levels
    rows = [("level", "leaves", "mean recall")]
    judged = learning.policy.levels
    for number, (alpha, leaves) in enumerate(
        zip(levels.ccp_alphas.tolist(), levels.leaves.tolist(), strict=True)
    ):
        recall = "" if judged is None else f"{judged.mean_recalls[judged.at(alpha)]:.1%}"
        taken = " (taken)" if number == levels.chosen else ""
        rows.append((f"--level {number}{taken}", str(leaves), recall))
    print("\n".join(aligned(rows)))
    suggestions = [("suggestion", "kind", "nodes", "")]
    for suggestion in learning.learned.suggestions:
        suggestions.append(
            (
                f"--attach {suggestion.id}",
                suggestion.kind.value,
                str(nodes.size(suggestion.subtree)),
                "attached" if suggestion.attached else "",
            )
        )
    print()
    print("\n".join(aligned(suggestions)) if suggestions[1:] else "Nothing is suggested.")


if __name__ == "__main__":
    main()
