"""``ros2 run rebt_ros learn INPUT... --out DIR``: learns a behavior tree from files."""

from __future__ import annotations

import argparse
from pathlib import Path

from rebt_ros import offline
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.behavior_tree.text import render_text
from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import add_input_options, input_options, run, use_color
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import OptionError
from rebt_ros.pipeline import LastActionUse, LearnOptions, summary_sentence


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parsed = _parser().parse_args(arguments)
    run(lambda: _learn(parsed), "learn")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="learn",
        description="Learns a behavior tree from demonstrations (RE:BT-Espresso) and writes "
        "tree.json, summary.json and pictures of the tree.",
    )
    add_input_options(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("learned"), metavar="DIR", help="default: %(default)s"
    )
    defaults = LearnOptions()
    learning = parser.add_argument_group("learning (paper, section III)")
    learning.add_argument(
        "--delta",
        type=float,
        default=defaults.delta,
        help="actions with at least (1 - DELTA) of a leaf's largest share are offered together "
        "as a Parallel/Selector node; 0 to 1, the paper has 0.3 (default: %(default)s)",
    )
    learning.add_argument(
        "--max-depth",
        type=_depth,
        default=defaults.max_depth,
        metavar="N|none",
        help="depth of the decision tree (default: %(default)s)",
    )
    learning.add_argument(
        "--ccp-alpha",
        type=float,
        default=defaults.ccp_alpha,
        help="complexity parameter of pruning; larger means smaller trees (default: %(default)s)",
    )
    learning.add_argument(
        "--root",
        type=Root,
        choices=list(Root),
        default=defaults.root,
        metavar="|".join(root.value for root in Root),
        help=f"kind of the root node (default: {defaults.root.value})",
    )
    learning.add_argument(
        "--last-action",
        type=LastActionUse,
        choices=list(LastActionUse),
        default=defaults.last_action,
        metavar="|".join(use.value for use in LastActionUse),
        help="whether the tree may test the last action taken; auto: only where that raises "
        "own-history agreement on the held-out rows (default: auto)",
    )
    learning.add_argument(
        "--test-fraction",
        type=float,
        default=defaults.test_fraction,
        metavar="SHARE",
        help="share that is held out to judge the tree: of the rows, or of the demonstrations if "
        "there are several (default: %(default)s)",
    )
    learning.add_argument(
        "--refit", action="store_true", help="once judged, learn again from all rows"
    )
    learning.add_argument(
        "--random-state", type=int, default=defaults.random_state, help="default: %(default)s"
    )
    for kind in FeatureKind:
        learning.add_argument(
            f"--{kind.value}",
            action="append",
            default=[],
            metavar="FEATURE",
            help=f"take this feature as {kind.value}, whatever it looks like; repeatable",
        )
    return parser


def _depth(text: str) -> int | None:
    return None if text == "none" else int(text)


def _learn(parsed: argparse.Namespace) -> None:
    options = LearnOptions(
        delta=parsed.delta,
        max_depth=parsed.max_depth,
        ccp_alpha=parsed.ccp_alpha,
        root=parsed.root,
        last_action=parsed.last_action,
        test_fraction=parsed.test_fraction,
        refit=parsed.refit,
        random_state=parsed.random_state,
    )
    progress = ProgressBar()
    try:
        result = offline.learn(
            parsed.inputs,
            out=parsed.out,
            options=options,
            reading=input_options(parsed),
            declared=_declared(parsed),
            progress=progress,
        )
    finally:
        progress.clear()
    for note in result.notes:
        print(f"note: {note}.")
    print()
    print(render_text(result.learned, color=use_color()))
    print(summary_sentence(result.learned))
    print(_judgement(result))
    print(f"Written to {parsed.out}: tree.json, summary.json, tree.svg, tree.dot, tree.txt.")


def _declared(parsed: argparse.Namespace) -> dict[str, FeatureKind]:
    declared: dict[str, FeatureKind] = {}
    for kind in FeatureKind:
        for name in getattr(parsed, kind.value):
            if declared.setdefault(name, kind) is not kind:
                raise OptionError(
                    f"feature {name!r} is declared {declared[name].value} and {kind.value}: "
                    "give it one kind."
                )
    return declared


def _judgement(result: offline.OfflineLearning) -> str:
    provenance = result.learned.provenance
    figures = provenance.figures
    lines = [
        ("decision tree and behavior tree differ on", f"{figures.fidelity_mismatches} rows"),
        ("tests the last action taken", "yes" if provenance.uses_last_action else "no"),
    ]
    if figures.own_history_agreement is not None:
        assert figures.teacher_forced_agreement is not None
        lines += [
            ("agreement, own history", f"{figures.own_history_agreement:.1%}"),
            ("agreement, teacher-forced", f"{figures.teacher_forced_agreement:.1%}"),
        ]
    width = max(len(name) for name, _ in lines)
    return "\n".join(f"  {name:<{width}}  {value}" for name, value in lines)


if __name__ == "__main__":
    main()
