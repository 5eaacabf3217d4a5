"""How a behavior tree is put into words, for every view that a person reads.

Two different conditions of one tree never read the same:

- Names that could be taken for something else (``a = b``, ``not docked``, an empty one) are quoted;
  what cannot be printed is escaped, so every text is a single line.
- A threshold, or end of an interval, is rounded, but never past the middle between it and the next
  one on the same quantity, so the numbers stay distinct and in order.
- The difference of two features reads ``left ≤ right`` where its threshold is 0, and
  ``left − right ≤ 0.3`` elsewhere.  A weighted sum reads ``angle + 0.4 × spin ≤ 0.02``, with every
  digit of its weights.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from enum import Enum
from fractions import Fraction
from itertools import pairwise

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Suggestion, SuggestionKind, Unit
from rebt_ros.logic.conditions import (
    KNOWN,
    Difference,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
    WeightedSum,
)

#: Significant digits of a rounded threshold, unless more are needed to tell it from another one.
_FEWEST_DIGITS = 3
#: Enough to tell any two double-precision numbers apart.
_MOST_DIGITS = 17
#: Decimal exponents of the numbers that are written without one.
_PLAIN_EXPONENTS = range(-4, 7)

_SIGNS = frozenset("=≠<>≤≥")
_QUOTES = frozenset("'\"`\u2018\u2019\u201c\u201d")


class Kind(Enum):
    """What a reader of a picture tells apart by color; the value is the legend's text."""

    CONTROL = "control node"
    CONDITION = "condition"
    INVERTER = "Inverter"
    ACTION = "action"
    PSA = "Parallel or Selector, yours to choose (PSA)"
    LAT_SEQUENCE = "LAT Sequence"
    REPEATER = "Repeater"


class Wording:
    """The words for the conditions and nodes of one learned tree, or of one subtree.

    Conditions that are not part of it are worded too, but then two of them can read the same.
    """

    def __init__(self, shown: LearnedTree | nodes.Node) -> None:
        suggestions: tuple[Suggestion, ...] = ()
        if isinstance(shown, LearnedTree):
            suggestions = shown.suggestions
            trees = (shown.tree, *(suggestion.subtree for suggestion in suggestions))
            actions = shown.actions
        else:
            trees = (shown,)
            actions = nodes.actions(shown)
        self._channels_differ = len({action.channel for action in actions}) > 1
        lat_sequences = [
            one.subtree for one in suggestions if one.kind is SuggestionKind.LAT_SEQUENCE
        ]
        self._lat_sequences = frozenset(map(_as_suggested, lat_sequences))
        self._lat_lengths = frozenset(len(nodes.children(sequence)) for sequence in lat_sequences)
        thresholds: dict[Quantity, list[float]] = {}
        deciding: dict[str, set[tuple[str, ...]]] = {}
        for tree in trees:
            for node in nodes.conditions(tree):
                match node.literal.condition:
                    case Threshold(quantity=quantity, value=value) if value != KNOWN:
                        thresholds.setdefault(quantity, []).append(value)
                    case Interval(quantity=quantity, above=above, at_most=at_most):
                        thresholds.setdefault(quantity, []).extend((above, at_most))
                    case LastActionIs(action=action, deciding=group):
                        deciding.setdefault(action, set()).add(group)
        self._numbers = {
            quantity: distinct_texts(values) for quantity, values in thresholds.items()
        }
        self._deciding_matters = {action for action, groups in deciding.items() if len(groups) > 1}

    def literal(self, literal: Literal) -> str:
        """A condition or its negation, as a person writes it.

        A missing value makes every negation true, which the text leaves out; `explanation` says it.
        """
        positive = literal.positive
        match literal.condition:
            case Threshold(quantity=quantity, value=value) if value == KNOWN:
                return f"{quantity_text(quantity)} is {'known' if positive else 'missing'}"
            case Threshold(quantity=Difference(minuend=one, subtrahend=other), value=0):
                return f"{feature_text(one)} {'≤' if positive else '>'} {feature_text(other)}"
            case Threshold(quantity=quantity, value=value):
                sign = "≤" if positive else ">"
                return f"{quantity_text(quantity)} {sign} {self._number(quantity, value)}"
            case Interval(quantity=quantity, above=above, at_most=at_most):
                low, high = self._number(quantity, above), self._number(quantity, at_most)
                between = f"{low} < {quantity_text(quantity)} ≤ {high}"
                return between if positive else f"not ({between})"
            case IsTrue(feature=name):
                return feature_text(name) if positive else f"not {feature_text(name)}"
            case HasCategory(feature=name, category=category):
                return f"{feature_text(name)} {'=' if positive else '≠'} {name_text(category)}"
            case PreviousActionIs(action=action):
                return f"{'' if positive else 'not '}doing {name_text(action)}"
            case LastActionIs() as last:
                sign = "=" if positive else "≠"
                return f"last action {sign} {name_text(last.action)}{self._before(last)}"

    def _number(self, quantity: Quantity, value: float) -> str:
        return self._numbers.get(quantity, {}).get(value, repr(value))

    def _before(self, last: LastActionIs) -> str:
        if last.action not in self._deciding_matters or not last.deciding:
            return ""
        return f" (before {' or '.join(_word(label) for label in last.deciding)})"

    def node(self, node: nodes.Node) -> str:
        """The node alone, without its children."""
        match node:
            case nodes.Condition(literal=literal):
                return self.literal(literal)
            case nodes.Action(label=label, channel=channel):
                return (
                    f"{name_text(label)} @{name_text(channel)}"
                    if self._channels_differ
                    else name_text(label)
                )
            case nodes.Inverter():
                return "not"
            case nodes.ParallelSelector():
                return "Parallel/Selector"
            case _:
                return type(node).__name__

    def explanation(self, node: nodes.Node) -> str:
        """What the node does, in one line and with every digit of a threshold."""
        match node:
            case nodes.Condition(literal=literal):
                return f"Condition: {_exactly(literal)}"
            case nodes.Action(label=label, channel=channel):
                return f"Action: sends {_quoted(label)} on {_quoted(channel)}"
            case nodes.Inverter():
                return "Inverter: succeeds where its child fails, and the other way round"
            case nodes.Sequence(memory=memory):
                return f"Sequence: runs its children in order until one fails{_resuming(memory)}"
            case nodes.Selector(memory=memory):
                return f"Selector: runs its children in order until one succeeds{_resuming(memory)}"
            case nodes.Parallel():
                return "Parallel: runs all its children at every tick"
            case nodes.ParallelSelector():
                return (
                    "Parallel Selector Actions (PSA): shown about equally often in the same states;"
                    " acts as a Selector until you make it a Parallel"
                )
            case nodes.Repeater():
                return "Repeater: runs its children in order, again and again until one fails"

    def kind(self, node: nodes.Node) -> Kind:
        """The kind by which the node is colored."""
        match node:
            case nodes.Condition():
                return Kind.CONDITION
            case nodes.Action():
                return Kind.ACTION
            case nodes.Inverter():
                return Kind.INVERTER
            case nodes.ParallelSelector():
                return Kind.PSA
            case nodes.Repeater():
                return Kind.REPEATER
            case nodes.Sequence() if self._is_lat_sequence(node):
                return Kind.LAT_SEQUENCE
            case _:
                return Kind.CONTROL

    def _is_lat_sequence(self, node: nodes.Sequence) -> bool:
        """Whether it is a suggested LAT Sequence, attached or not."""
        # Most Sequences need not be looked into.
        return len(node.children) in self._lat_lengths and (
            _as_suggested(node) in self._lat_sequences
        )


def _as_suggested(tree: nodes.Node) -> nodes.Node:
    """A subtree without what may change when it is attached.

    A Repeater in it may have got an Inverter, so that the Sequence around it goes on, and the user
    may have turned PSA nodes into a Selector or a Parallel.
    """
    children = tuple(map(_as_suggested, nodes.children(tree)))
    match tree:
        case nodes.Inverter(child=nodes.Repeater()):
            return children[0]
        case nodes.Inverter():
            return nodes.Inverter(*children)
        case nodes.Selector() | nodes.Parallel() if all(
            isinstance(child, nodes.Action) for child in children
        ):
            return nodes.ParallelSelector(children)
        case nodes.Condition() | nodes.Action():
            return tree
        case _:
            return replace(tree, children=children)


def offered(learned: LearnedTree) -> tuple[Suggestion, ...]:
    """The suggestions that are not attached, which pictures show beside the main tree."""
    return tuple(suggestion for suggestion in learned.suggestions if not suggestion.attached)


def heading(suggestion: Suggestion) -> str:
    """A line to stand over a suggested subtree."""
    kind = {
        SuggestionKind.PSA: "Parallel or Selector",
        SuggestionKind.LAT_SEQUENCE: "LAT Sequence",
        SuggestionKind.LAT_REPEATER: "LAT Repeater",
        SuggestionKind.SEQUENCE: "Sequence",
        SuggestionKind.REPEATER: "Repeater",
    }[suggestion.kind]
    return f"Suggestion {name_text(suggestion.id)}: {kind}, shown {how_often(suggestion)}"


def how_often(suggestion: Suggestion) -> str:
    """How much of the demonstrations shows a suggestion, such as "in 5 rows" or "3 times"."""
    unit = suggestion.kind.unit
    return f"{'in ' if unit is Unit.ROW else ''}{_count(suggestion.support, unit.value)}"


def summary(learned: LearnedTree) -> str:
    """A line about the tree: its size, what it was learned from and how well it does."""
    figures = learned.provenance.figures
    if figures.own_history_agreement is None:
        return size_and_origin(learned)
    return (
        f"{size_and_origin(learned)} · agrees on {figures.own_history_agreement:.1%}"
        f" of {_count(figures.held_out_rows, 'held-out row')}"
    )


def size_and_origin(learned: LearnedTree) -> str:
    """The same without how well it does, which says nothing of a tree that was changed since."""
    origin = learned.provenance
    return (
        f"{_count(nodes.size(learned.tree), 'node')} · learned from {_count(origin.rows, 'row')}"
        f" of {_count(origin.demonstrations, 'demonstration')}"
    )


def distinct_texts(values: Iterable[float]) -> dict[float, str]:
    """Short texts of finite numbers that stay distinct and in the numbers' order.

    Each text lies strictly between the middles of the gaps around its number, hence on the same
    side of every other number's text as the number itself.

    >>> distinct_texts([0.5, 0.30000001192092896, 0.83712, 0.83749])
    {0.30000001192092896: '0.3', 0.5: '0.5', 0.83712: '0.837', 0.83749: '0.8375'}
    """
    ordered = sorted(set(values))
    middles = [(Fraction(low) + Fraction(high)) / 2 for low, high in pairwise(ordered)]
    return {
        value: _shortest(value, above, below)
        for value, above, below in zip(ordered, [None, *middles], [*middles, None], strict=True)
    }


def _shortest(value: float, above: Fraction | None, below: Fraction | None) -> str:
    for digits in range(_FEWEST_DIGITS, _MOST_DIGITS):
        text = _rounded(value, digits)
        number = Fraction(text)
        if (
            (above is None or above < number)
            and (below is None or number < below)
            and math.isfinite(float(text))
        ):
            return text
    # Decimals of 17 digits lie closer together than doubles, so no check can fail here.
    return _rounded(value, _MOST_DIGITS)


def _rounded(value: float, digits: int) -> str:
    """At least so many significant digits, without zeros at the end; "3.2e-7" if very small."""
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    if int(exponent) in _PLAIN_EXPONENTS:
        return _without_zeros(f"{value:.{max(0, digits - 1 - int(exponent))}f}")
    return f"{_without_zeros(mantissa)}e{int(exponent)}"


def _without_zeros(decimal: str) -> str:
    text = decimal.rstrip("0").rstrip(".") if "." in decimal else decimal
    return "0" if text == "-0" else text


def name_text(name: str) -> str:
    """The name as it is where that cannot be misread, else quoted."""
    return name if _is_plain(name) else _quoted(name)


def feature_text(name: str) -> str:
    """The name of a feature, which stands beside numbers and so is none."""
    return _quoted(name) if _is_number(name) else name_text(name)


def quantity_text(quantity: Quantity) -> str:
    """What a threshold compares."""
    match quantity:
        case Difference(minuend=one, subtrahend=other):
            return f"{feature_text(one)} − {feature_text(other)}"
        case WeightedSum(terms=((first, weight), *others)):
            texts = [f"{'−' if weight < 0 else ''}{_term_text(first, weight)}"]
            for name, its in others:
                texts.append(f"{'−' if its < 0 else '+'} {_term_text(name, its)}")
            return " ".join(texts)
        case str():
            return feature_text(quantity)
    raise AssertionError(quantity)


def _term_text(name: str, weight: float) -> str:
    """A feature with the size of its weight, every digit of it, or alone where that is 1."""
    size = repr(abs(weight)).removesuffix(".0")
    return feature_text(name) if size == "1" else f"{size} × {feature_text(name)}"


def _word(name: str) -> str:
    """A name in a list of names."""
    return _quoted(name) if any(one.isspace() or one in "()" for one in name) else name_text(name)


def _is_plain(name: str) -> bool:
    lower = name.casefold()
    return (
        bool(name)
        and name.isprintable()
        and name == " ".join(name.split())
        and name[0] not in _QUOTES
        and _SIGNS.isdisjoint(name)
        and not (lower.startswith("not") and not _continues_word(lower[3:]))
        and not lower.startswith(("last action", "doing "))
        and not name.startswith("−")
        and not any(sign in name for sign in (" − ", " + ", " × "))
        and not lower.endswith((" is known", " is missing"))
        and " (before " not in lower
        and " @" not in name
    )


def _continues_word(rest: str) -> bool:
    return rest[:1].isalnum() or rest[:1] == "_"


def _is_number(name: str) -> bool:
    try:
        float(name)
    except ValueError:
        return False
    return True


def _quoted(name: str) -> str:
    return f"'{''.join(_escaped(character) for character in name)}'"


def _escaped(character: str) -> str:
    if character == "'":
        return "\\'"
    if character == "\\" or not character.isprintable():
        return character.encode("unicode_escape").decode("ascii")
    return character


def _exactly(literal: Literal) -> str:
    """The literal with every digit, and with what it says of missing values."""
    missing = "" if literal.positive else ", or missing"
    match literal.condition:
        case Threshold(quantity=quantity, value=value) if value == KNOWN:
            return f"{_quoted_quantity(quantity)} is {'known' if literal.positive else 'missing'}"
        case Threshold(quantity=quantity, value=value):
            sign = "<=" if literal.positive else ">"
            return f"{_quoted_quantity(quantity)} {sign} {value!r}{missing}"
        case Interval(quantity=quantity, above=above, at_most=at_most):
            between = f"{above!r} < {_quoted_quantity(quantity)} <= {at_most!r}"
            return between if literal.positive else f"not ({between}){missing}"
        case IsTrue(feature=name):
            return f"{_quoted(name)} is {1 if literal.positive else 0}{missing}"
        case HasCategory(feature=name, category=category):
            sign = "=" if literal.positive else "≠"
            return f"{_quoted(name)} {sign} {_quoted(category)}{missing}"
        case PreviousActionIs(action=action):
            answer = "is" if literal.positive else "is not"
            return f"the action before {answer} {_quoted(action)}"
        case LastActionIs(action=action, deciding=deciding):
            other = " or ".join(map(_quoted, deciding)) or "the action being decided"
            answer = "is" if literal.positive else "is not"
            return f"the most recent action other than {other} {answer} {_quoted(action)}"


def _quoted_quantity(quantity: Quantity) -> str:
    match quantity:
        case Difference(minuend=one, subtrahend=other):
            return f"{_quoted(one)} - {_quoted(other)}"
        case WeightedSum(terms=terms):
            return " + ".join(f"{weight!r} * {_quoted(name)}" for name, weight in terms)
        case str():
            return _quoted(quantity)
    raise AssertionError(quantity)


def _resuming(memory: bool) -> str:
    return ", and resumes where it was running" if memory else ""


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
