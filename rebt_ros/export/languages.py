"""The languages that learned trees are exported to."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.export.btcpp import to_btcpp
from rebt_ros.export.py_trees_xml import to_py_trees_xml

#: What writes a tree, by the name that options have for the language.
LANGUAGES: Mapping[str, Callable[[LearnedTree], str]] = {
    "btcpp": to_btcpp,
    "py_trees": to_py_trees_xml,
}
