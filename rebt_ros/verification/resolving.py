"""Rules as they concern a tree: names become its features, categories and actions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final, NoReturn

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.schema import TRUTH, Feature, FeatureKind, number_of
from rebt_ros.logic.conditions import (
    KNOWN,
    Difference,
    HasCategory,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
)
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.expressions import (
    And,
    Comparison,
    Doing,
    Expression,
    LastAction,
    Not,
    Number,
    Or,
    Presence,
    Side,
    Sign,
    Subtraction,
    Truth,
    Word,
)
from rebt_ros.verification.formulas import AllOf, AnyOf, Formula, negated
from rebt_ros.verification.rules import EVERYWHERE, Demand, Rule, RuleSet

#: How many names a message lists.
_LISTED: Final = 8

_MIRRORED: Final = {
    Sign.BELOW: Sign.ABOVE,
    Sign.AT_MOST: Sign.AT_LEAST,
    Sign.ABOVE: Sign.BELOW,
    Sign.AT_LEAST: Sign.AT_MOST,
    Sign.EQUAL: Sign.EQUAL,
    Sign.DIFFERENT: Sign.DIFFERENT,
}


def demands(rules: RuleSet, learned: LearnedTree) -> tuple[Demand, ...]:
    """What the rules demand of a tree, in their order.

    Raises:
        RuleError: A rule names a feature, category or action that the tree does not know.
    """
    return tuple(_Resolver(rule, learned).demand() for rule in rules.rules)


@dataclass(frozen=True, slots=True)
class _Resolver:
    rule: Rule
    learned: LearnedTree

    def demand(self) -> Demand:
        action = self._action()
        when = self.rule.when
        return Demand(self.rule, action, EVERYWHERE if when is None else self._formula(when))

    def _action(self) -> nodes.Action:
        label, channel = self.rule.action, self.rule.channel
        found = [action for action in self.learned.actions if action.label == label]
        if not found:
            labels = [*dict.fromkeys(action.label for action in self.learned.actions)]
            self._refuse_rule(
                f"there is no action {_unknown(label, labels)}: there are {_listed(labels)}"
            )
        on_channel = [one for one in found if channel in (None, one.channel)]
        if not on_channel:
            self._refuse_rule(f"the action {label!r} is not on a channel {channel!r}")
        if len(on_channel) > 1:
            names = ", ".join(one.channel for one in on_channel)
            self._refuse_rule(
                f"the action {label!r} is on several channels: add 'channel:' with one of {names}"
            )
        return on_channel[0]

    def _formula(self, expression: Expression) -> Formula:
        match expression:
            case And(parts=parts):
                return AllOf(tuple(map(self._formula, parts)))
            case Or(parts=parts):
                return AnyOf(tuple(map(self._formula, parts)))
            case Not(inner=inner):
                return negated(self._formula(inner))
            case Doing(action=action):
                return Literal(PreviousActionIs(self._label(action)))
            case LastAction(action=action, equal=equal):
                deciding = (self.rule.action,)
                return Literal(LastActionIs(self._label(action), deciding), equal)
            case Truth(feature=name, value=value):
                return self._truth(self._feature(name), name, value)
            case Presence(measured=measured, known=known):
                there = self._known(measured)
                return there if known else negated(there)
            case Comparison():
                return self._comparison(expression)

    def _truth(self, feature: Feature, name: Word, value: bool) -> Formula:
        if feature.kind is FeatureKind.CATEGORICAL and feature.categories == tuple(TRUTH):
            return Literal(HasCategory(feature.name, str(value)))
        if feature.kind is not FeatureKind.BINARY:
            self._refuse(
                f"{feature.name!r} is {feature.kind.value}, not true or false: compare it", name.at
            )
        true = Literal(IsTrue(feature.name))
        return true if value else AllOf((_known(feature.name), ~true))

    def _known(self, measured: Word | Subtraction) -> Formula:
        if isinstance(measured, Subtraction):
            return _known(self._difference(measured.minuend, measured.subtrahend))
        feature = self._feature(measured)
        if feature.kind is FeatureKind.CATEGORICAL:
            return _among(feature, feature.categories)
        return _known(feature.name)

    def _comparison(self, compared: Comparison) -> Formula:
        left, sign, right = compared.left, compared.sign, compared.right
        if self._is_measured(right) and not self._is_measured(left):
            left, sign, right = right, _MIRRORED[sign], left
        if not self._is_measured(left):
            if isinstance(left, Word):
                self._feature(left)
            self._refuse("two numbers are compared: name a feature", left.at)
        if isinstance(left, Word):
            feature = self._feature(left)
            if feature.kind is FeatureKind.CATEGORICAL:
                return self._category(feature, sign, right)
        if isinstance(right, Number):
            return _compared(self._quantity(left), sign, right.value)
        if isinstance(left, Word) and isinstance(right, Word):
            if not self._is_measured(right):
                self._refuse(
                    f"{right.text!r} is neither a number nor a feature, and {left.text!r} has no "
                    "categories",
                    right.at,
                )
            return _compared(self._difference(left, right), sign, 0.0)
        self._refuse("a difference is compared with a number", right.at)

    def _category(self, feature: Feature, sign: Sign, right: Side) -> Formula:
        if sign not in (Sign.EQUAL, Sign.DIFFERENT):
            self._refuse(
                f"{feature.name!r} has categories, {feature.examples}: compare it with = or !=",
                right.at,
            )
        if isinstance(right, Subtraction):
            self._refuse(f"{feature.name!r} has categories, {feature.examples}", right.at)
        wanted = right.text
        if wanted not in feature.categories and isinstance(right, Number):
            wanted = next(
                (category for category in feature.categories if number_of(category) == right.value),
                wanted,
            )
        if wanted not in feature.categories:
            listed = _listed(feature.categories)
            self._refuse(
                f"{feature.name!r} has no category {_unknown(right.text, feature.categories)}: "
                f"it has {listed}",
                right.at,
            )
        if sign is Sign.EQUAL:
            return _among(feature, (wanted,))
        return _among(feature, [category for category in feature.categories if category != wanted])

    def _is_measured(self, side: Side) -> bool:
        if isinstance(side, Word):
            return any(feature.name == side.text for feature in self.learned.features)
        return isinstance(side, Subtraction)

    def _quantity(self, side: Side) -> Quantity:
        match side:
            case Word():
                return self._feature(side).name
            case Subtraction(minuend=minuend, subtrahend=subtrahend):
                return self._difference(minuend, subtrahend)
            case Number():
                raise AssertionError(side)

    def _difference(self, minuend: Word, subtrahend: Word) -> Difference:
        for word in (minuend, subtrahend):
            feature = self._feature(word)
            if feature.kind is FeatureKind.CATEGORICAL:
                self._refuse(
                    f"{feature.name!r} has categories, {feature.examples}, which cannot be "
                    "subtracted",
                    word.at,
                )
        if minuend.text == subtrahend.text:
            self._refuse(f"{minuend.text!r} is compared with itself", subtrahend.at)
        return Difference(minuend.text, subtrahend.text)

    def _feature(self, word: Word) -> Feature:
        for feature in self.learned.features:
            if feature.name == word.text:
                return feature
        names = [one.name for one in self.learned.features]
        unknown = _unknown(word.text, names)
        self._refuse(f"there is no feature {unknown}: there are {_listed(names)}", word.at)

    def _label(self, word: Word) -> str:
        labels = tuple(dict.fromkeys(action.label for action in self.learned.actions))
        if word.text not in labels:
            unknown = _unknown(word.text, labels)
            self._refuse(f"there is no action {unknown}: there are {_listed(labels)}", word.at)
        return word.text

    def _refuse(self, why: str, at: int) -> NoReturn:
        raise RuleError(f"{self.rule.place_at(at)}: {why}.")

    def _refuse_rule(self, why: str) -> NoReturn:
        raise RuleError(f"{self.rule.place}: {why}.")


def _known(quantity: Quantity) -> Formula:
    return Literal(Threshold(quantity, KNOWN))


def _among(feature: Feature, categories: Sequence[str]) -> Formula:
    """Has one of these categories; a missing value has none."""
    parts = tuple(Literal(HasCategory(feature.name, category)) for category in categories)
    return parts[0] if len(parts) == 1 else AnyOf(parts)


def _compared(quantity: Quantity, sign: Sign, value: float) -> Formula:
    """A comparison with a number, which a missing value never meets."""
    at_most, below = _at_most(quantity, value), _at_most(quantity, _before(value))
    match sign:
        case Sign.AT_MOST:
            return at_most
        case Sign.BELOW:
            return below
        case Sign.ABOVE:
            return AllOf((_known(quantity), negated(at_most)))
        case Sign.AT_LEAST:
            return AllOf((_known(quantity), negated(below)))
        case Sign.EQUAL:
            return AllOf((at_most, negated(below)))
        case Sign.DIFFERENT:
            return AnyOf((below, AllOf((_known(quantity), negated(at_most)))))


def _at_most(quantity: Quantity, value: float) -> Formula:
    return Literal(Threshold(quantity, value)) if math.isfinite(value) else AnyOf()


def _before(value: float) -> float:
    """The next smaller number in double precision."""
    return math.nextafter(value, -math.inf)


def _unknown(name: str, known: Sequence[str]) -> str:
    """A name that is not known, with the one that may be meant."""
    close = get_close_matches(name, known, n=1)
    return f"{name!r} ({close[0]!r} is like it)" if close else repr(name)


def _listed(names: Sequence[str]) -> str:
    more = ", …" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more
