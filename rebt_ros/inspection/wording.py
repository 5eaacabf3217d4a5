"""An inspection in words: cells of a table, and what to look at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rebt_ros.behavior_tree.wording import name_text
from rebt_ros.inspection.inspection import (
    ActionCount,
    Inspected,
    Inspection,
    Outlier,
    OutlierKind,
    Stretches,
)

#: What the columns of the table are called; the last one is text.
HEADING: Final = (
    "demonstration",
    "rows",
    "seconds",
    "rate",
    "gaps",
    "idle",
    "constant",
    "contradicting",
    "actions",
)
#: Names that are listed.
_LISTED = 5
_NOTHING = "-"


def cells(inspected: Inspected, *, several: bool) -> tuple[str, ...]:
    """A demonstration as a line of the table.

    Args:
        inspected: The demonstration.
        several: Whether there are several channels.
    """
    timing = inspected.timing
    return (
        inspected.name,
        str(inspected.rows),
        _NOTHING if timing is None else f"{timing.seconds:.1f}",
        _NOTHING if timing is None else f"{timing.rate:.3g} Hz",
        _stretches(inspected.gaps),
        _stretches(inspected.idle),
        str(len(inspected.constant)),
        str(inspected.contradicting.rows),
        actions_text(inspected.actions, several=several),
    )


def _stretches(found: Stretches | None) -> str:
    if found is None:
        return _NOTHING
    if not found.count:
        return "0"
    length = f"{found.rows} rows" if found.seconds is None else f"{found.seconds:.1f} s"
    return f"{found.count} ({length})"


def action_name(action: ActionCount, *, several: bool) -> str:
    """What an action is called, with its channel where there are several."""
    return f"{f'{action.channel}: ' if several else ''}{name_text(action.action)}"


def actions_text(actions: Sequence[ActionCount], *, several: bool) -> str:
    """Actions with their rows, the most frequent ones by name."""
    named = [f"{action_name(one, several=several)} {one.rows}" for one in actions[:_LISTED]]
    more = len(actions) - _LISTED
    return ", ".join([*named, *([f"{more} more"] if more > 0 else [])])


def summary(inspection: Inspection) -> str:
    """All demonstrations in a sentence."""
    count = len(inspection.demonstrations)
    return (
        f"{count} demonstration{'s' * (count != 1)} with {inspection.rows} rows "
        f"({inspection.row_kind}s) of {len(inspection.features)} "
        f"feature{'s' * (len(inspection.features) != 1)}; "
        f"{_rows_contradict(inspection.contradicting)} others."
    )


def _rows_contradict(rows: int) -> str:
    return "1 row contradicts" if rows == 1 else f"{rows} rows contradict"


def findings(inspection: Inspection) -> Iterator[str]:
    """What is worth a look, most general first; no full stops."""
    if inspection.constant:
        varies = "varies" if len(inspection.constant) == 1 else "vary"
        yield f"never {varies} in any demonstration: {_named(inspection.constant)}"
    for one in inspection.demonstrations:
        for finding in findings_of(one, inspection):
            yield f"{one.name}: {finding}"


def findings_of(inspected: Inspected, inspection: Inspection) -> Iterator[str]:
    """What is worth a look in a demonstration; no full stops."""
    if not inspected.rows:
        yield "has no rows"
        return
    duplicate = inspected.near_duplicate
    if duplicate is not None:
        yield f"near-duplicate of {duplicate.of} ({duplicate.share:.1%} of the rows are alike)"
    for outlier in inspected.outliers:
        yield outlier_text(outlier)
    if inspected.timing is not None and inspected.timing.clock_set_back:
        yield f"the clock was set back {_times(inspected.timing.clock_set_back)}"
    if inspected.gaps is not None and inspected.gaps.count:
        longest = inspected.gaps.longest[0]
        yield f"gap of {longest.seconds:.3g} s at {longest.at:.1f} s" + _and_more(inspected.gaps)
    if inspected.idle is not None and inspected.idle.count:
        longest = inspected.idle.longest[0]
        span = f"{longest.rows} rows" if longest.seconds is None else f"{longest.seconds:.3g} s"
        where = f"row {longest.row}" if longest.at is None else f"{longest.at:.1f} s"
        yield f"nothing changes for {span} at {where}" + _and_more(inspected.idle)
    steady = [name for name in inspected.constant if name not in inspection.constant]
    if steady and len(inspection.demonstrations) > 1:
        varies, does = ("varies", "does") if len(steady) == 1 else ("vary", "do")
        yield f"never {varies} here, but {does} elsewhere: {_named(steady)}"
    if inspected.contradicting.examples:
        first = inspected.contradicting.examples[0]
        yield (
            f"{_rows_contradict(inspected.contradicting.rows)} others "
            f"({inspected.contradicting.outvoted} of them outvoted), such as row {first.row} "
            f"({name_text(first.action)}) and row {first.other_row} of {first.demonstration} "
            f"({name_text(first.other)})"
        )


def outlier_text(outlier: Outlier) -> str:
    """An outlier in words."""
    name = name_text(outlier.name)
    match outlier.kind:
        case OutlierKind.ROWS:
            return f"has {outlier.value:.0f} rows, where {outlier.usual:.0f} are usual"
        case OutlierKind.SECONDS:
            return f"takes {outlier.value:.3g} s, where {outlier.usual:.3g} s are usual"
        case OutlierKind.RATE:
            return f"has {outlier.value:.3g} rows a second, where {outlier.usual:.3g} are usual"
        case OutlierKind.ACTION_SHARE:
            return f"{name} in {outlier.value:.1%} of the rows, where {outlier.usual:.1%} is usual"
        case OutlierKind.ACTION_ONLY_HERE:
            return f"only here is {name} shown ({_times(round(outlier.value))})"
        case OutlierKind.FEATURE_MEDIAN:
            return (
                f"the median of {name} is {outlier.value:.4g}, where {outlier.usual:.4g} is usual"
            )
        case OutlierKind.FEATURE_RANGE:
            beyond = "above" if outlier.value > outlier.usual else "below"
            return (
                f"{name} is {outlier.value:.4g}, {beyond} the {outlier.usual:.4g} that it comes to "
                "in all others"
            )


def _and_more(found: Stretches) -> str:
    return f", and {found.count - 1} more" if found.count > 1 else ""


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _named(names: Sequence[str]) -> str:
    more = len(names) - _LISTED
    return ", ".join([*names[:_LISTED], *([f"{more} more"] if more > 0 else [])])
