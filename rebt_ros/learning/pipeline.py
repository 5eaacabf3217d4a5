"""From demonstrations to a learned tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import (
    ChannelProvenance,
    Figures,
    LearnedTree,
    Provenance,
)
from rebt_ros.beyond_the_paper.reductions import MOST_LEAVES_IN_BEST_ORDER, MOST_LEAVES_MINIMIZED
from rebt_ros.beyond_the_paper.routines.finding import find_routines
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.demonstration import Demonstration, RowKind
from rebt_ros.demonstration.lags import evenly_spaced, with_lags
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.errors import InputError, OptionError
from rebt_ros.learning.choice import choose
from rebt_ros.learning.chosen_policy import ChosenPolicy
from rebt_ros.learning.late_actions import shifted
from rebt_ros.learning.learning import Learning, learned_as_asked
from rebt_ros.learning.levels import Evidence
from rebt_ros.learning.mistakes import intended_actions, without_mistakes
from rebt_ros.learning.options import ALL, DEFAULTS, LearnOptions
from rebt_ros.learning.progress import Progress
from rebt_ros.learning.reaction_time import ReactionTime, estimate, given
from rebt_ros.learning.suggesting import suggest

_UNEVEN = (
    "the rows of channel {!r} are not evenly spaced, so one row back is no fixed time "
    "back: record with a sample rate to use lags"
)
_LARGE = (
    "the decision tree of channel {!r} has {} leaves, too many to search for the best order of "
    "the rules: they are ordered by their number of leaves; prune more for a smaller tree"
)
_VERY_LARGE = (
    "the decision tree of channel {!r} has {} leaves, too many to minimize its rules and "
    "search for their best order: they keep its conditions; prune more for a smaller tree"
)

#: Up to this many rows, a tree that is learned from all rows is also chosen from all rows.
_CHOSEN_FROM_ALL = 5_000

#: Shares of the work at which choosing and judging begin.
_CHOOSING, _JUDGING = 0.1, 0.8


def learn(
    demonstrations: Sequence[Demonstration],
    options: LearnOptions = DEFAULTS,
    declared: Mapping[str, FeatureKind] | None = None,
) -> LearnedTree:
    """Learns a behavior tree from all demonstrations.

    Args:
        demonstrations: What was shown, oldest first.
        options: How to learn.
        declared: Kinds of features by name, for those that should not be detected.

    Raises:
        InputError: There are too few rows or actions, or features differ.
        OptionError: A declared kind does not fit its feature.
    """
    return side_by_side(learn_channels(tabulate(demonstrations, declared), options))


def learn_channels(
    tables: Sequence[DemonstrationTable],
    options: LearnOptions = DEFAULTS,
    progress: Progress = lambda stage, share: None,
) -> tuple[Learning, ...]:
    """Learns one policy for each channel; see `learn`."""
    for one in options.attach if len(tables) > 1 else ():
        if one != ALL and not any(one.startswith(f"{table.channel}/") for table in tables):
            raise OptionError(
                f"there is no suggestion {one!r} to attach: with several channels, an id begins "
                f"with its channel, such as {tables[0].channel}/psa-1."
            )

    def of_channel(place: int) -> Progress:
        return lambda stage, share: progress(stage, (place + share) / len(tables))

    return tuple(
        learn_from(table, _of_channel(table.channel, options, len(tables)), of_channel(place))
        for place, table in enumerate(tables)
    )


def _of_channel(channel: str, options: LearnOptions, channels: int) -> LearnOptions:
    """The options with the ids of this channel's suggestions, without its name in front."""
    if channels == 1:
        return options
    led = f"{channel}/"
    mine = (one.removeprefix(led) for one in options.attach if one == ALL or one.startswith(led))
    return replace(options, attach=tuple(mine))


def side_by_side(learnings: Sequence[Learning]) -> LearnedTree:
    """One tree from the policies of several channels, which act at the same time."""
    trees = [learning.learned for learning in learnings]
    first = trees[0]
    if len(trees) == 1:
        return first
    channels = tuple(
        ChannelProvenance(
            learning.table.channel,
            tree.provenance.rows,
            tree.provenance.ccp_alpha,
            tree.provenance.history,
            tree.provenance.figures,
        )
        for learning, tree in zip(learnings, trees, strict=True)
    )
    return LearnedTree(
        first.features,
        tuple(action for tree in trees for action in tree.actions),
        nodes.Parallel(tuple(tree.tree for tree in trees)),
        replace(
            first.provenance,
            demonstrations=max(tree.provenance.demonstrations for tree in trees),
            rows=sum(one.rows for one in channels),
            ccp_alpha=max(one.ccp_alpha for one in channels),
            history=next(
                (one.history for one in channels if one.history is not History.NONE), History.NONE
            ),
            figures=_pooled([one.figures for one in channels]),
            channels=channels,
            late_rows=max(tree.provenance.late_rows for tree in trees),
            late_seconds=max(
                (late for tree in trees if (late := tree.provenance.late_seconds) is not None),
                default=None,
            ),
        ),
        tuple(
            replace(suggestion, id=f"{channel.channel}/{suggestion.id}")
            for channel, tree in zip(channels, trees, strict=True)
            for suggestion in tree.suggestions
        ),
        tuple(channel for tree in trees for channel in tree.shown),
        row_kind=first.row_kind,
        robot=first.robot,
    )


def _pooled(figures: Sequence[Figures]) -> Figures:
    """Figures over the rows of all channels."""
    rows = sum(figure.held_out_rows for figure in figures)

    def share(agreements: Sequence[float | None]) -> float | None:
        agreeing = 0.0
        for agreement, figure in zip(agreements, figures, strict=True):
            if agreement is not None:
                agreeing += agreement * figure.held_out_rows
            elif figure.held_out_rows:
                # It was changed since.
                return None
        return agreeing / rows if rows else None

    differing = [figure.fidelity_mismatches for figure in figures]
    return Figures(
        None if None in differing else sum(filter(None, differing)),
        share([figure.teacher_forced_agreement for figure in figures]),
        share([figure.own_history_agreement for figure in figures]),
        rows,
        share([figure.mean_recall for figure in figures]),
    )


def learn_from(
    table: DemonstrationTable,
    options: LearnOptions = DEFAULTS,
    progress: Progress = lambda stage, share: None,
) -> Learning:
    """Learns the policy of one channel; see `learn`.

    Args:
        table: Its rows, without lagged features; those that the options ask for are added.
        options: How to learn.
        progress: Called with what is being done, and the share of the work that is done.
    """
    if table.weights is not None and options.upsample is not Upsampling.NONE:
        raise OptionError(
            "upsampling makes up rows, which have no weights, but the demonstrations have some: "
            "leave out the upsampling or the weights."
        )
    names = [feature.name for feature in table.features]
    if unknown := sorted(set(options.units) - set(names)):
        raise OptionError(
            f"there is no feature {unknown[0]!r}, which is given a unit: the features are "
            f"{', '.join(names)}."
        )
    late = reaction_time_of(table, options)
    table = shifted(table, late.rows)
    if len(np.unique(table.chosen)) < 2:
        shown = table.actions[table.chosen[0]]
        rows = f"{len(table)} rows" if len(table) > 1 else "only row"
        show = "show" if len(table) > 1 else "shows"
        raise InputError(
            f"the {rows} of channel {table.channel!r} {show} one action only ({shown!r}): "
            "demonstrate at least two, as there is nothing to decide between."
        )
    # Before any rows are held out: each row must still see those before it.
    table = with_lags(table, options.lags)
    held_out = table.held_out(options.test_fraction)
    intended = _intended(table, held_out, options)
    judged, policy = _chosen(table, held_out, intended, options, progress)
    evidence = Evidence(
        table, held_out, intended[-1], policy.fitted, judged.fitted, policy.psa, options
    )
    ccp_alpha = judged.ccp_alpha if options.level is None else policy.ccp_alpha
    plain = evidence.tree_at(policy.ccp_alpha, judged_at=ccp_alpha)
    progress("suggesting", 0.9)
    learned_from, trained = evidence.learned_from, plain.decision_tree
    routines = find_routines(learned_from) if options.routines else ()
    suggestions, notes = suggest(learned_from, trained, policy.ccp_alpha, options, routines)
    learned = replace(
        plain.learned, suggestions=suggestions, provenance=_late(plain.learned.provenance, late)
    )
    learning = learned_as_asked(
        learned,
        trained,
        policy,
        evidence,
        late=(late.sentence,) if late.rows else (),
        further=(
            *_mistakes(table, evidence.intended),
            *trained.notes,
            *notes,
            *_cautions(table, trained, options),
        ),
    )
    progress("done", 1.0)
    return learning


def _intended(
    table: DemonstrationTable, held_out: BoolArray, options: LearnOptions
) -> tuple[IntArray, IntArray]:
    """The action meant in each row, by the rows that are not held out, and by all rows.

    Without `refit`, nothing needs the latter: both are the former.
    """
    if not options.leave_out_mistakes:
        return table.chosen, table.chosen
    known = table.chosen.copy()
    # With few rows, each one counts: all of them take part, or none.
    if len(table) <= _CHOSEN_FROM_ALL:
        known[~held_out] = intended_actions(table.where(~held_out))
    return known, (intended_actions(table) if options.refit else known)


def _chosen(
    table: DemonstrationTable,
    held_out: BoolArray,
    intended: tuple[IntArray, IntArray],
    options: LearnOptions,
    progress: Progress,
) -> tuple[ChosenPolicy, ChosenPolicy]:
    """The policy to judge, which does not know the held-out rows, and the one to publish."""
    progress("choosing", _CHOOSING)
    # With few rows, each one counts for choosing too: the choice is repeated with all rows.  So it
    # is where a level is asked for, which is one of the tree that is published.
    again = options.refit and (len(table) <= _CHOSEN_FROM_ALL or options.level is not None)

    def advance(share: float) -> None:
        progress("choosing", _CHOOSING + (_JUDGING - _CHOOSING) * share)

    if options.refit and not again:
        judged = choose(table, options, advance, held_out)
    else:
        kept = replace(options, level=None) if again else options
        known = without_mistakes(table.where(~held_out), intended[0][~held_out])
        judged = choose(known, kept, advance)
    progress("judging", _JUDGING)
    if not options.refit:
        return judged, judged
    progress("learning from all rows", _JUDGING)
    if not again:
        return judged, _of_all(judged, options)
    return judged, choose(without_mistakes(table, intended[1]), options)


def reaction_time_of(table: DemonstrationTable, options: LearnOptions) -> ReactionTime:
    """How late the demonstrator acted, by the options or by the rows.

    Raises:
        OptionError: It is given in seconds, but stamps are not times.
    """
    if options.reaction_time is not None:
        return given(table, options.reaction_time)
    if table.row_kind is RowKind.EVENT:
        return given(table, 0.0)
    # Reaction time is estimated from what was done, whatever its weight.
    return estimate(replace(table, weights=None))


def _late(provenance: Provenance, late: ReactionTime) -> Provenance:
    seconds = late.seconds if late.rows else None
    return replace(provenance, late_rows=late.rows, late_seconds=seconds)


def _of_all(policy: ChosenPolicy, options: LearnOptions) -> ChosenPolicy:
    """A policy of all rows, as chosen by those that were not held out."""
    assert policy.of_all is not None
    ccp_alpha = policy.ccp_alpha
    if options.ccp_alpha is None:
        # The levels of another fit are elsewhere: the choice stands for the range up to the next.
        ccp_alpha = policy.fitted.path.middle(ccp_alpha)
    return replace(policy, fitted=policy.of_all, ccp_alpha=ccp_alpha)


def _mistakes(table: DemonstrationTable, intended: IntArray) -> Iterator[str]:
    """Which rows are left out as mistakes."""
    mistaken = table.chosen[intended != table.chosen]
    counts = np.bincount(mistaken, minlength=len(table.actions)).tolist()
    each = (f"{table.actions[code]!r} {count} times" for code, count in enumerate(counts) if count)
    if len(mistaken):
        yield (
            f"{len(mistaken)} of {len(table)} rows look like mistakes and are left out: "
            f"{', '.join(each)}"
        )


def _cautions(
    table: DemonstrationTable, trained: TrainedTree, options: LearnOptions
) -> Iterator[str]:
    """What a user should know about the table and the decision tree."""
    if options.lags and not evenly_spaced(table):
        yield _UNEVEN.format(table.channel)
    leaves = trained.tree.leaves
    if options.reductions is None or leaves <= MOST_LEAVES_IN_BEST_ORDER:
        return
    if leaves <= MOST_LEAVES_MINIMIZED:
        yield _LARGE.format(table.channel, leaves)
    else:
        yield _VERY_LARGE.format(table.channel, leaves)


def summary_sentence(learned: LearnedTree) -> str:
    """What was learned, in one sentence."""
    provenance = learned.provenance
    figures = provenance.figures
    shown = provenance.demonstrations
    judged = "it is not judged, as no rows were held out"
    if figures.held_out_rows:
        judged = "it is not judged, as what was attached or edited changes what it does"
    if figures.own_history_agreement is not None:
        # The rows that it was judged on may have been learned from afterwards.
        judged = (
            f"learned without them, it agrees with {figures.own_history_agreement:.1%} of "
            f"{figures.held_out_rows} held-out rows"
        )
    guards = ""
    if provenance.mended is not None:
        guards = (
            f" Guards make it keep its rules: {provenance.mended}; other figures are of the tree "
            "without them."
        )
    return (
        f"Learned a behavior tree with {nodes.size(learned.tree)} nodes and "
        f"{len(nodes.actions(learned.tree))} actions from {provenance.rows} rows of "
        f"{shown} demonstration{'s' if shown != 1 else ''}; {judged}.{guards}"
    )
