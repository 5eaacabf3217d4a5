"""``ros2 run rebt_ros learn INPUT... --out DIR``: learns a behavior tree from files."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Root
from rebt_ros.behavior_tree.wording import how_often
from rebt_ros.beyond_the_paper.reductions import Reductions
from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import (
    add_input_options,
    aligned,
    directory,
    input_options,
    parse,
    print_notes,
    run,
    use_color,
    word_of,
)
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.drawing.text import render_text
from rebt_ros.errors import OptionError
from rebt_ros.export.languages import LANGUAGES
from rebt_ros.learning.chosen_policy import ChosenPolicy
from rebt_ros.learning.judged_levels import JudgedLevels
from rebt_ros.learning.options import LearnOptions, PsaChoice, Use
from rebt_ros.learning.pipeline import summary_sentence
from rebt_ros.learning.report import FORECAST, LearningReport
from rebt_ros.offline import learning_from_files
from rebt_ros.offline.exports import write_export
from rebt_ros.offline.result import OfflineLearning
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.weights_file import read_weights

_REDUCTIONS = {
    "domain": "do not use that thresholds, categories and last actions rule each other out",
    "repeated_factoring": "factor out common conditions only once, as in the paper",
    "priority": "make each rule complete in itself, instead of ordering rules by priority",
    "intervals": "test x > 0.3 and x ≤ 0.5 separately, instead of 0.3 < x ≤ 0.5",
}


#: Smaller trees that are listed.
_OFFERED = 4

#: Options that are left as they are unless they are asked for, by their names in `LearnOptions`.
_ASKED = (
    "delta",
    "max_depth",
    "ccp_alpha",
    "level",
    "history",
    "differences",
    "sums",
    "reaction_time",
    "leave_out_mistakes",
    "leave_out_conditions",
    "readable_thresholds",
    "simplest",
    "refit",
    "exact",
    "root",
    "psa",
)


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parsed = parse(_parser(), arguments)
    run(lambda: _learn(parsed), "learn")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="learn",
        description="Learns a behavior tree from demonstrations (RE:BT-Espresso) and writes "
        "tree.json, summary.json and pictures of the tree.",
    )
    add_input_options(parser)
    _add_output(parser)
    defaults = LearnOptions()
    _add_rows(parser, defaults)
    _add_learning(parser, defaults)
    _add_vocabulary(parser)
    _add_form(parser)
    _add_judging(parser, defaults)
    return parser


def _add_output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out", type=directory, default=Path("learned"), metavar="DIR", help="default: %(default)s"
    )
    parser.add_argument(
        "--export",
        choices=list(LANGUAGES),
        help="also export the tree to another engine; btcpp: BehaviorTree.CPP 4 XML in "
        "DIR/btcpp.xml; py_trees: XML for py_trees 2.5 and later in DIR/py_trees.xml",
    )
    parser.add_argument(
        "--rules",
        type=Path,
        metavar="FILE",
        help="rules file (docs/rules.md): write nothing unless the tree is proven to keep these "
        "rules; rules in the robot file always apply",
    )
    parser.add_argument(
        "--repair",
        action="store_true",
        help="add guards to a tree that breaks a rule, instead of refusing it",
    )
    parser.add_argument(
        "--levels",
        action="store_true",
        help="also write every pruning level, from the unpruned tree to a single action, to "
        "DIR/levels, and agreement over ccp_alpha as a plot",
    )
    parser.add_argument(
        "--most-levels",
        type=int,
        default=100,
        metavar="N",
        help="with --levels: at most this many levels, evenly spread (default: %(default)s)",
    )


def _add_rows(parser: argparse.ArgumentParser, defaults: LearnOptions) -> None:
    rows = parser.add_argument_group("rows to learn from")
    for kind in FeatureKind:
        rows.add_argument(
            f"--{kind.value}",
            action="append",
            default=[],
            metavar="FEATURE",
            help=f"treat this feature as {kind.value}; repeatable",
        )
    rows.add_argument(
        "--unit",
        action="append",
        type=_unit,
        default=[],
        metavar="FEATURE=UNIT",
        help="unit of a feature; features with different units, or with and without one, are not "
        "compared with each other; repeatable",
    )
    rows.add_argument(
        "--lags",
        type=int,
        default=defaults.lags,
        metavar="N",
        help="also use the values of each feature 1 to N rows earlier; needs evenly spaced rows, "
        "and the same rate in the executor (default: %(default)s)",
    )
    rows.add_argument(
        "--reaction-time",
        type=_amount,
        metavar="SECONDS|auto",
        help="the demonstrator's reaction time, which is corrected before learning; auto: "
        "estimated if rows are samples, else 0 (default: auto)",
    )
    rows.add_argument(
        "--weights",
        type=_weights,
        metavar="FILE",
        help="weights of demonstrations: lines NAME,WEIGHT, or a JSON object; names as in "
        "--exclude; others have weight 1, and 0 leaves one out (docs/learning.md)",
    )
    rows.add_argument(
        "--upsample",
        type=word_of(Upsampling),
        default=defaults.upsample,
        metavar=_values(Upsampling),
        help="synthesize rows for rare actions; they are used for training, never for "
        "evaluation; svm-smote needs the package imbalanced-learn (default: none)",
    )


def _weights(text: str) -> Path:
    if not text.strip():
        raise argparse.ArgumentTypeError("a file needs a name: name one, or leave it out")
    return Path(text)


def _add_learning(parser: argparse.ArgumentParser, defaults: LearnOptions) -> None:
    learning = parser.add_argument_group("learning (paper, section III)")
    learning.add_argument(
        "--paper",
        action="store_true",
        help="use the paper's settings: Algorithm 1 as printed, depth 5, no pruning, last "
        "actions and PSA nodes always, a Parallel root; other options override them",
    )
    learning.add_argument(
        "--max-depth",
        type=_depth,
        metavar="N|auto",
        help="maximum depth of the decision tree; auto: no limit, then prune (default: auto)",
    )
    learning.add_argument(
        "--ccp-alpha",
        type=_amount,
        metavar="ALPHA|auto",
        help="complexity parameter for pruning; larger values give smaller trees; auto: the "
        "largest tree whose mean recall in cross-validation is not clearly below the best, "
        "unless a smaller one explains the rows clearly more simply (default: auto)",
    )
    learning.add_argument(
        "--level",
        type=int,
        metavar="N",
        help="pruning level, instead of --ccp-alpha; larger numbers give smaller trees; learn "
        "lists some levels with their figures",
    )
    learning.add_argument(
        "--delta",
        type=float,
        help="actions with at least (1 - DELTA) of the largest share in a leaf may form a "
        f"Parallel/Selector (PSA) node; 0 to 1 (default: {defaults.delta})",
    )
    learning.add_argument(
        "--psa",
        type=word_of(Use),
        metavar=_values(Use),
        help="whether to use PSA nodes; auto: where they raise agreement in cross-validation "
        "(default: auto)",
    )
    learning.add_argument(
        "--exact",
        action="store_true",
        default=None,
        help="grow trees on all rows even if there are more than 100,000; by default they grow "
        "on a sample of whole demonstrations, and all rows are used for pruning, choosing "
        "and figures",
    )
    learning.add_argument(
        "--random-state", type=int, default=defaults.random_state, help="default: %(default)s"
    )


def _add_vocabulary(parser: argparse.ArgumentParser) -> None:
    learning = parser.add_argument_group("what a tree may test")
    learning.add_argument(
        "--history",
        type=_history,
        metavar=f"auto|{_values(History)}",
        help="what the tree may test about earlier actions: the previous action, the paper's "
        "last action taken, or nothing; auto: the previous action, if it makes the rows "
        "simpler to explain (default: auto)",
    )
    learning.add_argument(
        "--differences",
        type=word_of(Use),
        metavar=_values(Use),
        help="whether the tree may compare two features, as in left < right; auto: if that makes "
        "it a quarter smaller at the same agreement (default: auto)",
    )
    learning.add_argument(
        "--sums",
        type=word_of(Use),
        metavar=_values(Use),
        help="whether the tree may test weighted sums of features, as in angle + 0.4 × spin > "
        "0.02; auto: where they describe the demonstrations more briefly (default: auto)",
    )


def _add_form(parser: argparse.ArgumentParser) -> None:
    form = parser.add_argument_group("form of the tree")
    form.add_argument(
        "--root", type=word_of(Root), metavar=_values(Root), help="(default: selector)"
    )
    form.add_argument(
        "--attach",
        action="append",
        default=[],
        metavar="ID|all",
        help="attach a suggested subtree to the root; repeatable",
    )
    form.add_argument(
        "--psa-as",
        type=word_of(PsaChoice),
        metavar=_values(PsaChoice),
        help="replace all PSA nodes by this kind of node (default: keep them)",
    )
    for reduction in fields(Reductions):
        form.add_argument(
            f"--no-{reduction.name.replace('_', '-')}",
            dest=reduction.name,
            action="store_false",
            help=_REDUCTIONS[reduction.name],
        )
    form.add_argument(
        "--greedy",
        dest="simplest",
        action="store_false",
        default=None,
        help="keep the decision tree as grown, instead of the simplest one that fits the rows "
        "equally well",
    )
    form.add_argument(
        "--exact-thresholds",
        dest="readable_thresholds",
        action="store_false",
        default=None,
        help="keep thresholds halfway between two rows, instead of moving them to shared round "
        "values",
    )
    form.add_argument(
        "--keep-mistakes",
        dest="leave_out_mistakes",
        action="store_false",
        default=None,
        help="also learn from rows that look like mistakes",
    )
    form.add_argument(
        "--keep-conditions",
        dest="leave_out_conditions",
        action="store_false",
        default=None,
        help="keep conditions that no shown row needs, so that the behavior tree does in every "
        "state what the decision tree does",
    )
    form.add_argument(
        "--no-routines",
        dest="routines",
        action="store_false",
        help="do not look for Sequences and Repeaters among rows with the same state",
    )


def _add_judging(parser: argparse.ArgumentParser, defaults: LearnOptions) -> None:
    judging = parser.add_argument_group("judging")
    judging.add_argument(
        "--test-fraction",
        type=float,
        default=defaults.test_fraction,
        metavar="SHARE",
        help="share to hold out for evaluation: of the demonstrations, or of the rows if there "
        "is only one (default: %(default)s)",
    )
    judging.add_argument(
        "--refit",
        action=argparse.BooleanOptionalAction,
        help="learn again from all rows after evaluation (default: yes; with --paper: no)",
    )


def _recalls(report: LearningReport) -> Iterator[str]:
    """The recall of each action as a table, and what to hold it against."""
    rows = [("  action", "shown", "recall")]
    for action in report.actions:
        recall = "-" if action.recall is None else f"{action.recall:.1%}"
        rows.append((f"  {action.label}", str(action.rows), recall))
    yield from aligned(rows)
    if report.mean_recall is not None and report.agreement is not None:
        yield (
            f"  mean recall {report.mean_recall:.1%}; agreement {report.agreement:.1%} in "
            f"cross-validation, where always taking the most frequent action would reach "
            f"{report.most_frequent:.1%}"
        )
        yield f"  (agreement in cross-validation is the forecast of success, though {FORECAST})"


def _smaller(channel: str, policy: ChosenPolicy, judged: JudgedLevels) -> Iterator[str]:
    """Smaller trees that are on offer, as a table with what each costs."""
    alphas, leaves = policy.fitted.path.alphas, policy.fitted.path.leaf_counts()
    chosen = int(np.searchsorted(alphas, policy.ccp_alpha, side="right")) - 1
    smaller = range(chosen + 1, len(alphas) - 1)
    if not smaller:
        return
    offered = sorted({smaller[int(place)] for place in np.linspace(0, len(smaller) - 1, _OFFERED)})
    rows = [(f"  {channel}smaller trees", "leaves", "mean recall", "agreement")]
    for level in (chosen, *offered):
        name = f"  --level {level}" + (" (chosen)" if level == chosen else "")
        place = judged.at(float(alphas[level]))
        figures = (f"{judged.mean_recalls[place]:.1%}", f"{judged.means[place]:.1%}")
        rows.append((name, str(leaves[level]), *figures))
    yield from aligned(rows)


def _values(kind: type[Enum]) -> str:
    return "|".join(str(member.value) for member in kind)


def _depth(text: str) -> int | Literal["auto"]:
    if text in ("auto", "none"):
        return "auto"
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a whole number nor auto") from None


def _amount(text: str) -> float | Literal["auto"]:
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number nor auto") from None


def _unit(text: str) -> tuple[str, str]:
    feature, sign, unit = text.rpartition("=")
    if not (feature and sign and unit):
        raise argparse.ArgumentTypeError(f"{text!r} is not FEATURE=UNIT, such as left=m")
    return feature, unit


def _history(text: str) -> History | Literal["auto"]:
    return "auto" if text == "auto" else word_of(History, "auto")(text)


def _options(parsed: argparse.Namespace) -> LearnOptions:
    """The defaults, or the paper's settings, with what was asked for."""
    asked: dict[str, Any] = {
        name: None if (value := getattr(parsed, name)) == "auto" else value
        for name in _ASKED
        if getattr(parsed, name) is not None
    }
    reductions = Reductions(
        **{field.name: getattr(parsed, field.name) for field in fields(Reductions)}
    )
    return replace(
        LearnOptions.paper() if parsed.paper else LearnOptions(reductions=reductions),
        **asked,
        test_fraction=parsed.test_fraction,
        attach=tuple(parsed.attach),
        psa_choice=parsed.psa_as,
        routines=parsed.routines and not parsed.paper,
        random_state=parsed.random_state,
        lags=parsed.lags,
        units=dict(parsed.unit),
        upsample=parsed.upsample,
    )


def _learn(parsed: argparse.Namespace) -> None:
    progress = ProgressBar()
    told: list[str] = []

    def tell(notes: tuple[str, ...]) -> None:
        # At once: they may be the reason why nothing can be learned.
        progress.clear()
        told.extend(notes)
        print_notes(notes)

    try:
        result = learning_from_files.learn(
            parsed.inputs,
            out=parsed.out,
            options=_options(parsed),
            reading=_reading(parsed, progress, tell),
            declared=_declared(parsed),
            levels=parsed.levels,
            most_levels=parsed.most_levels,
            rules=parsed.rules,
            repair=parsed.repair,
            progress=progress,
        )
    finally:
        progress.clear()
    print_notes(note for note in result.notes if note not in told)
    print()
    # The suggestions are listed below, and drawn in the files.
    print(render_text(replace(result.learned, suggestions=()), color=use_color()))
    print(summary_sentence(result.learned))
    print(_judgement(result))
    for learning in result.learnings:
        if len(result.learnings) > 1:
            print(f"Channel {learning.table.channel}:")
        if learning.report.sample is not None:
            print(learning.report.sample.sentence)
        print("\n".join(_recalls(learning.report)))
    for learning in result.learnings:
        channel = f"{learning.table.channel}: " if len(result.learnings) > 1 else ""
        for reason in learning.policy.reasons:
            print(f"  - {channel}{reason}")
        if learning.policy.levels is not None:
            print("\n".join(_smaller(channel, learning.policy, learning.policy.levels)))
    if result.rules:
        count = len(result.rules)
        print(f"{'Its rule is' if count == 1 else f'All {count} rules are'} proven.")
    if result.learned.suggestions:
        print("\n".join(_suggestions(result.learned)))
    files = "tree.json, summary.json and pictures of the tree and of its decision tree"
    print(f"Written to {parsed.out}: {files}{', levels/' if parsed.levels else ''}.")
    if parsed.export is not None:
        exported = write_export(parsed.out, result.learned, parsed.export)
        print(f"Exported to {exported}.")


def _reading(
    parsed: argparse.Namespace,
    progress: ProgressBar,
    tell_notes: Callable[[tuple[str, ...]], None],
) -> InputOptions:
    reading = input_options(parsed, progress, tell_notes)
    return (
        reading
        if parsed.weights is None
        else replace(reading, weights=read_weights(parsed.weights))
    )


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


def _suggestions(learned: LearnedTree) -> Iterator[str]:
    yield "Suggested subtrees (attach with --attach ID):"
    width = max(len(suggestion.id) for suggestion in learned.suggestions)
    for suggestion in learned.suggestions:
        shown = " → ".join(action.label for action in nodes.actions(suggestion.subtree))
        mark = ", attached" if suggestion.attached else ""
        yield f"  {suggestion.id:<{width}}  {shown}  (shown {how_often(suggestion)}{mark})"


def _judgement(result: OfflineLearning) -> str:
    provenance = result.learned.provenance
    figures = provenance.figures
    lines = [("may test what was done before", provenance.history.value)]
    if figures.fidelity_mismatches is not None:
        differ = f"{figures.fidelity_mismatches} rows"
        lines.insert(0, ("decision tree and behavior tree differ on", differ))
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
