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
from rebt_ros.errors import listing
from rebt_ros.logic.conditions import (
    KNOWN,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
    WeightedSum,
    combination,
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
    Sum,
    Term,
    Truth,
    Word,
)
from rebt_ros.verification.formulas import AllOf, AnyOf, Formula, negated
from rebt_ros.verification.rules import EVERYWHERE, Demand, Rule, RuleSet

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
                f"there is no action {_unknown(label, labels)}: there are {listing(labels)}"
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

    def _known(self, measured: Word | Sum) -> Formula:
        if isinstance(measured, Sum):
            return _known(self._combination(measured.terms))
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
        assert not isinstance(left, Number)
        if isinstance(right, Number):
            quantity = self._combination(left.terms) if isinstance(left, Sum) else left.text
            return _compared(quantity, sign, right.value)
        if isinstance(right, Word) and not self._is_measured(right):
            self._refuse(
                f"{right.text!r} is neither a number nor a feature, and {left.text!r} has no "
                "categories"
                if isinstance(left, Word)
                else "a sum is compared with a number or with features",
                right.at,
            )
        # What stands on the right is taken to the left.
        across = tuple(Term(-one.weight, one.feature) for one in _terms(right))
        return _compared(self._combination(_terms(left) + across), sign, 0.0)

    def _category(self, feature: Feature, sign: Sign, right: Side) -> Formula:
        if sign not in (Sign.EQUAL, Sign.DIFFERENT):
            self._refuse(
                f"{feature.name!r} has categories, {feature.examples}: compare it with = or !=",
                right.at,
            )
        if isinstance(right, Sum):
            self._refuse(f"{feature.name!r} has categories, {feature.examples}", right.at)
        wanted = right.text
        if wanted not in feature.categories and isinstance(right, Number):
            wanted = next(
                (category for category in feature.categories if number_of(category) == right.value),
                wanted,
            )
        if wanted not in feature.categories:
            listed = listing(feature.categories)
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
        return isinstance(side, Sum)

    def _combination(self, written: tuple[Term, ...]) -> Quantity:
        """What is computed from several features."""
        for term in written:
            feature = self._feature(term.feature)
            if feature.kind is FeatureKind.CATEGORICAL:
                self._refuse(
                    f"{feature.name!r} has categories, {feature.examples}, which cannot be "
                    "computed with",
                    term.at,
                )
            if not term.weight or not math.isfinite(term.weight):
                self._refuse(f"{feature.name!r} is multiplied by {term.weight:g}", term.at)
        weights: dict[str, float] = {}
        for term in written:
            if term.feature.text in weights:
                self._refuse(
                    f"{term.feature.text!r} is compared with itself"
                    if len(written) == 2
                    else f"{term.feature.text!r} is named twice: name it once, with one number",
                    term.at,
                )
            weights[term.feature.text] = term.weight
        if len(weights) == 1:
            [(name, weight)] = weights.items()
            self._refuse(
                f"{name!r} alone is multiplied: compare {name!r} itself, and divide the other side "
                f"by {weight:g}",
                written[0].at,
            )
        if tuple(weights.values()) == (-1.0, 1.0):
            weights = dict(reversed(weights.items()))
        return combination(self._in_order(weights))

    def _in_order(self, weights: dict[str, float]) -> tuple[tuple[str, float], ...]:
        """The terms in the order of the same sum of the tree, so that both are rounded alike."""
        opposite = {name: -weight for name, weight in weights.items()}
        for node in nodes.conditions(self.learned.tree):
            match node.literal.condition:
                case (
                    Threshold(quantity=WeightedSum(terms=terms))
                    | Interval(quantity=WeightedSum(terms=terms))
                ) if dict(terms) in (weights, opposite):
                    return tuple((name, weights[name]) for name, _ in terms)
        return tuple(weights.items())

    def _feature(self, word: Word) -> Feature:
        for feature in self.learned.features:
            if feature.name == word.text:
                return feature
        names = [one.name for one in self.learned.features]
        unknown = _unknown(word.text, names)
        self._refuse(f"there is no feature {unknown}: there are {listing(names)}", word.at)

    def _label(self, word: Word) -> str:
        labels = tuple(dict.fromkeys(action.label for action in self.learned.actions))
        if word.text not in labels:
            unknown = _unknown(word.text, labels)
            self._refuse(f"there is no action {unknown}: there are {listing(labels)}", word.at)
        return word.text

    def _refuse(self, why: str, at: int) -> NoReturn:
        raise RuleError(f"{self.rule.place_at(at)}: {why}.")

    def _refuse_rule(self, why: str) -> NoReturn:
        raise RuleError(f"{self.rule.place}: {why}.")


def _terms(side: Word | Sum) -> tuple[Term, ...]:
    return side.terms if isinstance(side, Sum) else (Term(1.0, side),)


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
