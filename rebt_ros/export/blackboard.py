"""The blackboard of an exported tree: the variables that its conditions read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import DocumentError
from rebt_ros.export.identifiers import identifiers
from rebt_ros.logic.conditions import (
    HasCategory,
    LastActionIs,
    PreviousActionIs,
    features_of,
)

#: A port of a tree cannot have the name of an attribute of every node.
_RESERVED = ("ID", "name")


@dataclass(frozen=True, slots=True)
class Variable:
    """An entry of the blackboard that the robot's program sets before each tick."""

    feature: Feature
    name: str
    categories: dict[str, str]
    """The text that stands for each category that the tree tests; the same where that is possible.
    """

    @property
    def type(self) -> str:
        """The C++ type of its values."""
        return "std::string" if self.feature.categories else "double"

    @property
    def meaning(self) -> str:
        """What it holds, in one line."""
        feature = self.feature
        meaning = f"feature {feature.name!r}"
        if feature.topic is not None:
            meaning = f"{meaning}: value {feature.index} of {feature.topic}"
        if feature.lag:
            meaning = f"{meaning}, {feature.lag} tick{'s' if feature.lag > 1 else ''} before"
        if self.categories:
            texts = [
                repr(text) if text == category else f"{text!r} for {category!r}"
                for category, text in self.categories.items()
            ]
            return f"{meaning}; {', '.join(texts)} or other texts, empty where it is missing"
        values = "; 1 or 0, NaN" if feature.kind is FeatureKind.BINARY else "; NaN"
        return f"{meaning}{values} where it is missing"


def variables(learned: LearnedTree, tree: nodes.Node) -> dict[str, Variable]:
    """The variables that a tree reads, by the names of their features.

    Args:
        learned: Whose features they are.
        tree: The tree as it is exported.

    Raises:
        DocumentError: The tree compares a feature that has categories with a number.
    """
    tested = nodes.features(tree)
    read = [feature for feature in learned.features if feature.name in tested]
    names = identifiers((feature.name for feature in read), "feature", _RESERVED)
    compared: set[str] = set()
    categories: dict[str, list[str]] = {}
    for node in nodes.conditions(tree):
        match node.literal.condition:
            case HasCategory(feature=name, category=category):
                categories.setdefault(name, []).append(category)
            case PreviousActionIs() | LastActionIs():
                pass
            case condition:
                compared.update(features_of(condition))
    for feature in read:
        if feature.categories and feature.name in compared:
            raise DocumentError(
                f"the tree compares {feature.name!r} with a number although it has categories, and "
                "a variable cannot hold both: learn it as numeric or as categorical."
            )
    return {
        feature.name: Variable(
            feature,
            names[feature.name],
            _of(texts(feature.categories, "category"), categories.get(feature.name, ())),
        )
        for feature in read
    }


def _of(all_texts: dict[str, str], tested: Iterable[str]) -> dict[str, str]:
    return {category: all_texts[category] for category in dict.fromkeys(tested)}


def texts(words: Iterable[str], kind: str) -> dict[str, str]:
    """A text for each word that a script can name, all different and none empty.

    Scripts know no escapes and only ASCII, so that other words get an identifier.
    """
    words = tuple(dict.fromkeys(words))
    plain = {word: word for word in words if _can_be_written(word)}
    others = [word for word in words if word not in plain]
    return plain | identifiers(others, kind, plain)


def _can_be_written(word: str) -> bool:
    return word.isascii() and word.isprintable() and word != "" and not {"'", '"'} <= set(word)
